//! The assembly of an OBJ mesh: several threads have parsed parts of the text, and here the
//! vertices, faces and material names of the parts become one mesh. Indices are checked first,
//! against the counts of the whole text.

mod faces;
mod names;
mod vertices;

pub use names::Names;

use rapidhash::RapidHashSet;
use std::mem::take;

use super::cut::Census;
use super::parse::{Part, Places, join};
use super::skipped::Skipped;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::raw::RawMesh;

/// Bytes of a library beside its name: in lists and sets that double as they grow.
const LIBRARY_BYTES: u64 = 160;

/// Names and counts of a text, beside its mesh.
#[derive(Debug, Default)]
pub struct Summary {
    /// `usemtl` names, in order of first use. A triangle's material is 1 more, or 0 without one.
    pub materials: Vec<Vec<u8>>,
    /// Arguments of `mtllib` lines, each once.
    pub libraries: Vec<Vec<u8>>,
    /// Counts of skipped lines.
    pub skipped: Skipped,
}

/// The lists of a text, whole; or room for them.
#[derive(Debug, Default)]
pub struct Room {
    positions: Vec<[f64; 3]>,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    corners: Vec<u32>,
    /// The estimated content of each part.
    census: Vec<Census>,
}

impl Room {
    /// Room for what parts seem to have, if all faces are triangles.
    pub fn new(census: Vec<Census>, is_colored: bool) -> Self {
        let sum = |count: fn(&Census) -> usize| census.iter().map(count).sum::<usize>();
        Self {
            positions: vec![[0.0; 3]; sum(|part| part.v)],
            colors: vec![[0.0; 4]; if is_colored { sum(|part| part.v) } else { 0 }],
            uvs: vec![[0.0; 2]; sum(|part| part.vt)],
            normals: vec![[0.0; 3]; sum(|part| part.vn)],
            corners: vec![0; sum(|part| 3 * part.f)],
            census,
        }
    }

    /// The places of the parts.
    pub fn places(&mut self) -> Vec<Places<'_>> {
        fn cut<'r, T>(list: &mut &'r mut [T], count: usize) -> &'r mut [T] {
            list.split_off_mut(..count).unwrap_or_default()
        }
        let Self { positions, colors, uvs, normals, corners, census } = self;
        let mut rest = Places { positions, colors, uvs, normals, corners };
        let next = |part: &Census| Places {
            positions: cut(&mut rest.positions, part.v),
            colors: cut(&mut rest.colors, part.v),
            uvs: cut(&mut rest.uvs, part.vt),
            normals: cut(&mut rest.normals, part.vn),
            corners: cut(&mut rest.corners, 3 * part.f),
        };
        census.iter().map(next).collect()
    }

    /// The lists, with what found no room in the parts.
    fn joined(self, parts: &mut [Part<'_>]) -> Self {
        let Self { positions, colors, uvs, normals, corners, census } = self;
        let is_colored = usize::from(!colors.is_empty());
        let mut parts: Vec<(&Census, &mut Part<'_>)> = census.iter().zip(parts).collect();
        Self {
            positions: join(positions, parts.iter_mut().map(|(of, part)| (of.v, take(&mut part.positions)))),
            colors: join(colors, parts.iter_mut().map(|(of, part)| (of.v * is_colored, take(&mut part.colors)))),
            uvs: join(uvs, parts.iter_mut().map(|(of, part)| (of.vt, take(&mut part.uvs)))),
            normals: join(normals, parts.iter_mut().map(|(of, part)| (of.vn, take(&mut part.normals)))),
            corners: join(corners, parts.iter_mut().map(|(of, part)| (3 * of.f, take(&mut part.corners)))),
            census: Vec::new(),
        }
    }
}

/// Fills in vertices and triangles. `room` has the places of the parts.
pub fn assemble(
    mut parts: Vec<Part<'_>>,
    room: Room,
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<Summary, MeshError> {
    check_indices(&parts)?;
    cx.check_triangles(parts.iter().map(|part| part.triangles).sum())?;
    let mut summary = Summary::default();
    parts.iter().for_each(|part| summary.skipped.add(&part.skipped));
    summary.libraries = libraries_of(&parts, cx)?;
    let names = Names::of(&parts, cx)?;
    let mut lists = room.joined(&mut parts);
    cx.deadline.check()?;
    raw.report.file_vertices = lists.positions.len() as u64;
    let mut corners = take(&mut lists.corners);
    vertices::fill(&mut parts, &mut corners, &names, lists, raw, cx)?;
    faces::fill(&parts, corners, &names, raw, cx)?;
    summary.materials = names.all;
    Ok(summary)
}

/// The distinct arguments of `mtllib` lines, in the text's order.
fn libraries_of(parts: &[Part<'_>], cx: &mut Context<'_>) -> Result<Vec<Vec<u8>>, MeshError> {
    let mut seen = RapidHashSet::default();
    let mut libraries = Vec::new();
    for part in parts {
        cx.deadline.check()?;
        for line in part.libraries.iter().map(AsRef::as_ref) {
            if !seen.contains(line) {
                cx.budget.spend("the OBJ file's libraries", 1, LIBRARY_BYTES + 2 * line.len() as u64)?;
                seen.insert(line);
                libraries.push(line.to_vec());
            }
        }
    }
    Ok(libraries)
}

/// Refuses indices beyond what the text has. Without any texture coordinates or normals, indices
/// of them mean nothing.
fn check_indices(parts: &[Part<'_>]) -> Result<(), MeshError> {
    let mut lines_before = 0;
    let mut largest = [(0, 0); 3];
    let mut counts = [0_u64; 3];
    for part in parts {
        for (all, own) in largest.iter_mut().zip(part.largest) {
            if own.0 > all.0 {
                *all = (own.0, lines_before + own.1);
            }
        }
        lines_before += part.lines;
        let own = [part.positions.len(), part.uvs.len(), part.normals.len()];
        counts = std::array::from_fn(|k| counts[k] + own[k] as u64);
    }
    if counts.iter().any(|count| *count >= u64::from(u32::MAX)) {
        return Err(MeshError::broken("the OBJ file has more than 4 billion vertices"));
    }
    for (k, what) in ["vertex", "texture coordinate", "normal"].into_iter().enumerate() {
        let ((index, line), count) = (largest[k], counts[k]);
        if index > count && (k == 0 || count > 0) {
            let detail =
                format!("line {line} of the OBJ file: the {what} index {index} is out of range: there are {count}");
            return Err(MeshError::broken(detail));
        }
    }
    Ok(())
}
