//! A reader that gives `tobj` cleaned lines.
//!
//! Only `v`, `vt`, `vn`, `f`, `l`, `p` and material lines pass, in canonical form, checked and paid
//! for. Harmless content that `tobj` would refuse (bytes that are not UTF-8, empty faces, partial
//! colours) is dropped or completed.

mod numbers;

use super::face::{Corner, Counts, parse_corner, write_face};
use super::lines::{Lines, uncommented};
use super::skipped::Skipped;
use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::text::before_comment;
use crate::mesh::LineOrPoint;
use crate::mesh::primitives::{POINT_TRIANGLES, SEGMENT_TRIANGLES};
use rapidhash::RapidHashMap;
use std::io::{BufRead, Read};
use tobj::LoadError;

/// Summary of a cleaned file.
pub struct Summary {
    /// `v` lines.
    pub vertices: u64,
    /// `usemtl` names, in order of first use.
    pub materials: Vec<Vec<u8>>,
    /// Arguments of `mtllib` lines.
    pub libraries: Vec<Vec<u8>>,
    /// Counts of skipped lines.
    pub skipped: Skipped,
}

/// Implements [`BufRead`] for `tobj`.
pub struct Cleaner<'a, 'b> {
    lines: Lines<'a>,
    cx: &'a mut Context<'b>,
    unpaid_bytes: u64,
    out: Vec<u8>,
    read: usize,
    fault: Option<MeshError>,
    counts: Counts,
    triangles: u64,
    /// Attributes of faces in the current model: texture coordinates, normals.
    form: Option<(bool, bool)>,
    /// True if the first vertex had a colour. Then all get one.
    colored: Option<bool>,
    /// The largest index of each kind and its line: tobj does not say which one was out of range.
    largest: [(u64, u64); 3],
    materials: Vec<Vec<u8>>,
    material_numbers: RapidHashMap<Vec<u8>, usize>,
    libraries: Vec<Vec<u8>>,
    corners: Vec<Corner>,
    skipped: Skipped,
}

impl<'a, 'b> Cleaner<'a, 'b> {
    /// Reads `bytes`.
    pub fn new(bytes: &'a [u8], cx: &'a mut Context<'b>) -> Self {
        Self {
            lines: Lines::new(bytes),
            cx,
            unpaid_bytes: 0,
            out: Vec::new(),
            read: 0,
            fault: None,
            counts: Counts::default(),
            triangles: 0,
            form: None,
            colored: None,
            largest: [(0, 0); 3],
            materials: Vec::new(),
            material_numbers: RapidHashMap::default(),
            libraries: Vec::new(),
            corners: Vec::new(),
            skipped: Skipped::default(),
        }
    }

    /// Turns a failure, here or in `tobj`, into an error that names the line.
    pub fn finish(self, error: Option<LoadError>) -> Result<Summary, MeshError> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let out_of_range = |kind: usize, what: &str, count: u64| {
            let (index, line) = self.largest[kind];
            format!("line {line} of the OBJ file: the {what} index {} is out of range: there are {count}", index + 1)
        };
        let here = |what: &str| format!("line {} of the OBJ file: {what}", self.lines.number);
        let detail = match error {
            None => {
                let Self { counts, materials, libraries, skipped, .. } = self;
                return Ok(Summary { vertices: counts.v, materials, libraries, skipped });
            }
            Some(LoadError::PositionParseError) => here("a vertex needs three numbers"),
            Some(LoadError::NormalParseError) => here("a normal needs three numbers"),
            Some(LoadError::TexcoordParseError) => here("a texture coordinate needs two numbers"),
            Some(LoadError::FaceVertexOutOfBounds) => out_of_range(0, "vertex", self.counts.v),
            Some(LoadError::FaceTexCoordOutOfBounds) => out_of_range(1, "texture coordinate", self.counts.vt),
            Some(LoadError::FaceNormalOutOfBounds) => out_of_range(2, "normal", self.counts.vn),
            Some(other) => here(&other.to_string()),
        };
        Err(MeshError::broken(detail))
    }

    /// Cleans lines until one gives output or the file ends.
    fn refill(&mut self) -> Result<(), MeshError> {
        self.out.clear();
        self.read = 0;
        while self.out.is_empty() {
            let Some(line) = self.lines.next() else { break };
            self.clean(&line)?;
            if self.unpaid_bytes > 1 << 20 || self.lines.number.is_multiple_of(65536) {
                self.cx.deadline.check()?;
                self.cx.check_triangles(self.triangles)?;
                self.cx.budget.spend("the OBJ file", self.unpaid_bytes, 1)?;
                self.unpaid_bytes = 0;
            }
        }
        Ok(())
    }

    fn clean(&mut self, line: &[u8]) -> Result<(), MeshError> {
        let words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        // A comment may begin within a word, which then is the last.
        let mut is_over = false;
        let mut words = words.map_while(move |word| {
            let kept = before_comment(word);
            let is_word = !is_over && !kept.is_empty();
            is_over |= kept.len() < word.len();
            is_word.then_some(kept)
        });
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => {
                self.counts.v += 1;
                self.unpaid_bytes += 48 + 24 + 100;
                self.vertex(words)?;
            }
            b"vt" => {
                self.counts.vt += 1;
                self.unpaid_bytes += 32;
                self.numbers(b"vt", words, 2)?;
            }
            b"vn" => {
                self.counts.vn += 1;
                self.unpaid_bytes += 48;
                self.numbers(b"vn", words, 3)?;
            }
            b"f" | b"fo" => self.face(words)?,
            b"l" => self.lines_and_points(words, true)?,
            b"p" => self.lines_and_points(words, false)?,
            b"curv" | b"curv2" | b"surf" => self.skipped.curves += 1,
            b"mtllib" => self.library(name(line)),
            b"usemtl" => self.material(name(line)),
            _ => {}
        }
        Ok(())
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), MeshError> {
        self.corners.clear();
        for word in words {
            let corner = self.corner(word)?;
            self.corners.push(corner);
            // One line may be the whole file.
            if self.corners.len().is_multiple_of(65536) {
                self.cx.budget.spend("the corners of an OBJ face", 65536, 300)?;
            }
        }
        let n = self.corners.len() as u64;
        if n < 3 {
            self.skipped.short_faces += 1;
            return Ok(());
        }
        self.triangles += n - 2;
        // An attribute that only some corners of a face have is dropped.
        let form = (self.corners.iter().all(|c| c.vt.is_some()), self.corners.iter().all(|c| c.vn.is_some()));
        self.begin_form(form);
        // tobj's face in a list that doubles; per corner an index and, with attributes, a vertex
        // and a hash entry; then our own copy.
        let per_corner = if form == (false, false) { 40 } else { 200 };
        self.unpaid_bytes += 208 + n * (per_corner + if n > 4 { 48 } else { 0 });
        write_face(&mut self.out, &self.corners, form);
        Ok(())
    }

    /// Writes the segments of a polyline, or points, as faces with too few corners: the only form
    /// in which tobj reads them.
    fn lines_and_points<'w>(
        &mut self,
        words: impl Iterator<Item = &'w [u8]>,
        are_joined: bool,
    ) -> Result<(), MeshError> {
        let mut before: Option<Corner> = None;
        for (number, word) in (1_u64..).zip(words) {
            let corner = self.corner(word)?;
            let corner = Corner { v: corner.v, ..Corner::default() };
            let ends = [before.unwrap_or(corner), corner];
            before = Some(corner);
            // One line may be the whole file.
            if number.is_multiple_of(65536) {
                self.cx.deadline.check()?;
                self.cx.budget.spend("the corners of an OBJ polyline", 65536, 300)?;
            }
            if are_joined && (number == 1 || ends[0].v == ends[1].v) {
                continue;
            }
            self.begin_form((false, false));
            self.triangles += if are_joined { SEGMENT_TRIANGLES } else { POINT_TRIANGLES };
            self.unpaid_bytes += 208 + 2 * 40 + size_of::<LineOrPoint>() as u64 * 2;
            write_face(&mut self.out, if are_joined { &ends } else { &ends[1..] }, (false, false));
        }
        Ok(())
    }

    /// Begins a new model where the attributes of faces change.
    fn begin_form(&mut self, form: (bool, bool)) {
        if self.form.is_some_and(|old| old != form) {
            self.out.extend_from_slice(b"o\n");
            self.unpaid_bytes += 1024;
        }
        self.form = Some(form);
    }

    fn corner(&mut self, word: &[u8]) -> Result<Corner, MeshError> {
        let corner = parse_corner(word, self.counts).map_err(|why| self.broken(&why))?;
        for (largest, index) in self.largest.iter_mut().zip([Some(corner.v), corner.vt, corner.vn]) {
            if index.is_some_and(|i| i > largest.0) {
                *largest = (index.unwrap_or(0), self.lines.number);
            }
        }
        Ok(corner)
    }

    fn material(&mut self, name: &[u8]) {
        if name.is_empty() {
            return;
        }
        let number = match self.material_numbers.get(name) {
            Some(&number) => number,
            None => {
                let number = self.materials.len();
                self.material_numbers.insert(name.to_vec(), number);
                self.materials.push(name.to_vec());
                self.unpaid_bytes += 1024 + 4 * name.len() as u64;
                self.out.extend_from_slice(format!("mtllib {number}\n").as_bytes());
                number
            }
        };
        self.unpaid_bytes += 1024;
        self.out.extend_from_slice(format!("usemtl {number}\n").as_bytes());
    }

    fn library(&mut self, name: &[u8]) {
        self.unpaid_bytes += 128 + 2 * name.len() as u64;
        self.libraries.push(name.to_vec());
    }

    fn broken(&self, what: &str) -> MeshError {
        MeshError::broken(format!("line {} of the OBJ file: {what}", self.lines.number))
    }
}

impl BufRead for Cleaner<'_, '_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.read == self.out.len() && self.fault.is_none() {
            self.fault = self.refill().err();
        }
        if self.fault.is_some() {
            return Err(std::io::Error::other("refused"));
        }
        Ok(&self.out[self.read..])
    }

    fn consume(&mut self, amount: usize) {
        self.read += amount;
    }
}

impl Read for Cleaner<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let available = self.fill_buf()?;
        let n = available.len().min(buffer.len());
        buffer[..n].copy_from_slice(&available[..n]);
        self.consume(n);
        Ok(n)
    }
}

/// The name after a keyword of six letters, including its spaces.
fn name(line: &[u8]) -> &[u8] {
    uncommented(line.trim_ascii_start().get(6..).unwrap_or_default().trim_ascii())
}
