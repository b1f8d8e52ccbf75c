//! The parser of one part of an OBJ text. Lines in their most frequent form are parsed byte by
//! byte. All others go to [`statement`], which is slower: it splits a line into words.

mod corners;
mod decimal;
mod list;
mod numbers;
mod statement;

pub use list::{Filled, join};
pub use statement::{count, has_colored_vertex};

use self::list::List;
use super::face::{Counts, MISSING};
use super::skipped::Skipped;
use crate::import::MeshError;
use crate::limits::{Deadline, Stopped};
use std::borrow::Cow;

/// Corners between two deadline checks: one line may be the whole file.
const CORNERS_PER_POLL: usize = 65_536;

/// Facts about the whole file that the parser of a part needs.
#[derive(Clone, Copy, Debug)]
pub struct Rules<'a> {
    /// The byte that ends lines.
    pub newline: u8,
    /// True if the file's first vertex has a colour. Then all get one.
    pub is_colored: bool,
    /// The counts before the part; None if they are not known yet.
    pub before: Option<Counts>,
    /// False: every line goes word by word. Tests compare both ways.
    pub is_quick: bool,
    /// Polled inside long lines.
    pub deadline: &'a Deadline,
}

/// The content of one part.
#[derive(Debug, Default)]
pub struct Part<'t> {
    /// `v` lines.
    pub positions: Filled<[f64; 3]>,
    /// Colours of the vertices as in the file, if they have any.
    pub colors: Filled<[f32; 4]>,
    /// `vt` lines, v down.
    pub uvs: Filled<[f32; 2]>,
    /// `vn` lines.
    pub normals: Filled<[f32; 3]>,
    /// Faces, segments and points, run-length coded.
    pub groups: Vec<Group>,
    /// The positions of their corners, as zero-based indices.
    pub corners: Filled<u32>,
    /// Texture coordinates of the corners, [`MISSING`] where one has none. Empty if none has any.
    pub corner_uvs: Vec<u32>,
    /// Normals, in the same way.
    pub corner_normals: Vec<u32>,
    /// The name of each `usemtl` line.
    pub materials: Vec<Cow<'t, [u8]>>,
    /// Arguments of `mtllib` lines.
    pub libraries: Vec<Cow<'t, [u8]>>,
    /// Triangles that faces, segments and points become, at most.
    pub triangles: u64,
    /// Counts of skipped lines.
    pub skipped: Skipped,
    /// The largest index of each kind, from 1, and its line in the part.
    pub largest: [(u64, u64); 3],
    /// Lines.
    pub lines: u64,
}

/// Places for the lists of a part, of any length.
#[derive(Debug, Default)]
pub struct Places<'r> {
    /// Positions.
    pub positions: &'r mut [[f64; 3]],
    /// Colours.
    pub colors: &'r mut [[f32; 4]],
    /// Texture coordinates.
    pub uvs: &'r mut [[f32; 2]],
    /// Normals.
    pub normals: &'r mut [[f32; 3]],
    /// Corners.
    pub corners: &'r mut [u32],
}

/// The lists of a part.
struct Lists<'r> {
    positions: List<'r, [f64; 3]>,
    colors: List<'r, [f32; 4]>,
    uvs: List<'r, [f32; 2]>,
    normals: List<'r, [f32; 3]>,
    corners: List<'r, u32>,
}

/// Consecutive faces with the same number of corners, attributes and material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    /// Corners of each; 2 for a segment, 1 for a point.
    pub arity: u32,
    /// Number of faces.
    pub faces: u32,
    /// True if their corners have texture coordinates, normals.
    pub form: (bool, bool),
    /// Index into the part's `materials`. None: as before the part.
    pub material: Option<u32>,
}

/// The end of a part that cannot be parsed.
#[derive(Debug)]
pub enum PartError {
    /// A relative index, and the counts before the part are not known.
    NeedsCounts,
    /// Broken content: the line in the part, and what is wrong.
    Line(u64, String),
    /// The deadline.
    Stopped,
}

impl Part<'_> {
    /// The counts of the part.
    pub fn counts(&self) -> Counts {
        let [v, vt, vn] = [self.positions.len(), self.uvs.len(), self.normals.len()].map(|count| count as u64);
        Counts { v, vt, vn }
    }
}

impl From<Stopped> for PartError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

impl PartError {
    /// The error, if `lines` come before the part.
    pub fn error(self, lines: u64) -> MeshError {
        match self {
            Self::Stopped => Stopped.into(),
            Self::NeedsCounts => MeshError::broken("a relative index of the OBJ file has nothing before it"),
            Self::Line(line, what) => MeshError::broken(format!("line {} of the OBJ file: {what}", lines + line)),
        }
    }
}

/// Parses one part.
pub fn parse<'t>(bytes: &'t [u8], places: Places<'_>, rules: Rules<'_>) -> Result<Part<'t>, PartError> {
    rules.deadline.check()?;
    let lists = Lists {
        positions: List::new(places.positions),
        colors: List::new(places.colors),
        uvs: List::new(places.uvs),
        normals: List::new(places.normals),
        corners: List::new(places.corners),
    };
    let mut parser = Parser { bytes, rules, lists, part: Part::default(), line: Vec::new() };
    let mut at = 0;
    while at < bytes.len() {
        let plain = if rules.is_quick { parser.plain_line(at)? } else { None };
        at = match plain {
            Some(end) => {
                parser.part.lines += 1;
                end
            }
            None => parser.any_line(at)?,
        };
    }
    let Parser { lists, part, .. } = parser;
    Ok(Part {
        positions: lists.positions.finish(),
        colors: lists.colors.finish(),
        uvs: lists.uvs.finish(),
        normals: lists.normals.finish(),
        corners: lists.corners.finish(),
        ..part
    })
}

struct Parser<'t, 'a, 'r> {
    bytes: &'t [u8],
    rules: Rules<'a>,
    lists: Lists<'r>,
    part: Part<'t>,
    /// The corners of a face in its general form.
    line: Vec<[u32; 3]>,
}

impl Parser<'_, '_, '_> {
    /// Parses the line at `at` if it is in the plainest form, and gives the begin of the next.
    #[inline]
    fn plain_line(&mut self, at: usize) -> Result<Option<usize>, PartError> {
        let (first, second) = (self.bytes[at], self.bytes.get(at + 1).copied().unwrap_or(self.rules.newline));
        Ok(match (first, second) {
            (b'v', b' ') => self.plain_vertex(at + 2),
            (b'f', b' ') => self.plain_face(at + 2)?,
            (b'v', b'n') => self.plain_normal(at + 2),
            (b'v', b't') => self.plain_uv(at + 2),
            (newline, _) if newline == self.rules.newline => Some(at + 1),
            _ => None,
        })
    }

    /// The begin of the next line, if only white space is left on this one.
    #[inline]
    fn end_of_line(&self, mut at: usize) -> Option<usize> {
        loop {
            match self.bytes.get(at) {
                None => return Some(at),
                Some(&b) if b == self.rules.newline => return Some(at + 1),
                Some(b' ' | b'\t' | b'\r') => at += 1,
                Some(_) => return None,
            }
        }
    }

    /// The counts so far.
    fn counts(&self) -> Counts {
        let Lists { positions, uvs, normals, .. } = &self.lists;
        Counts { v: positions.len() as u64, vt: uvs.len() as u64, vn: normals.len() as u64 }
    }

    /// Adds the corners of a face; `form` says what they have.
    #[inline]
    fn add_corners(&mut self, corners: &[[u32; 3]], form: (bool, bool)) {
        let Part { corner_uvs, corner_normals, .. } = &mut self.part;
        let before = self.lists.corners.len();
        for (kind, has, list) in [(1, form.0, corner_uvs), (2, form.1, corner_normals)] {
            if has || !list.is_empty() {
                list.resize(before, MISSING);
                list.extend(corners.iter().map(|corner| corner[kind]));
            }
        }
        corners.iter().for_each(|corner| self.lists.corners.push(corner[0]));
    }

    /// Counts a face whose corners were added.
    #[inline]
    fn count_face(&mut self, arity: usize, form: (bool, bool)) {
        let part = &mut self.part;
        let material = part.materials.len().checked_sub(1).map(|last| last as u32);
        let arity = arity as u32;
        match part.groups.last_mut() {
            Some(Group { faces, .. }) if *faces == u32::MAX => {}
            Some(last) if (last.arity, last.form, last.material) == (arity, form, material) => {
                last.faces += 1;
                return;
            }
            _ => {}
        }
        part.groups.push(Group { arity, faces: 1, form, material });
    }
}
