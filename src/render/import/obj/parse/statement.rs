//! The general parsing of OBJ: any line, word by word. Lines in their most frequent form are parsed
//! faster elsewhere (`numbers`, `corners`).
//!
//! Harmless faults are no errors. Names that are not UTF-8 are kept as bytes. Faces of fewer than
//! three corners are counted and left out. If only some vertices have colours, the first vertex
//! decides: all get one (white where a vertex has none), or none does.

use super::numbers::{opaque, upright};
use super::{CORNERS_PER_POLL, Parser, PartError};
use crate::import::obj::face::{Counts, MISSING, parse_corner, show};
use crate::import::obj::lines::{Lines, uncommented};
use crate::import::text::{self, before_comment, is_c_nan};
use crate::mesh::primitives::{POINT_TRIANGLES, SEGMENT_TRIANGLES};
use std::borrow::Cow;

impl<'t> Parser<'t, '_, '_> {
    /// Parses the line at `at`, and gives the begin of the next.
    #[cold]
    pub(super) fn any_line(&mut self, at: usize) -> Result<usize, PartError> {
        let mut lines = Lines::of_part(&self.bytes[at..], self.rules.newline);
        let Some(line) = lines.next() else { return Ok(self.bytes.len()) };
        // A continued line has the number of its end.
        self.part.lines += lines.number;
        self.statement(&line)?;
        let name = |line| match line {
            Cow::Borrowed(line) => Cow::Borrowed(name(line)),
            Cow::Owned(line) => Cow::Owned(name(&line).to_vec()),
        };
        match keyword(&line) {
            Some(b"usemtl") => self.part.materials.extend(Some(name(line)).filter(|name| !name.is_empty())),
            Some(b"mtllib") => self.part.libraries.extend(Some(name(line)).filter(|name| !name.is_empty())),
            _ => {}
        }
        Ok(self.bytes.len() - lines.rest_bytes())
    }

    fn statement(&mut self, line: &[u8]) -> Result<(), PartError> {
        let mut words = words(line);
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(words),
            b"vt" => {
                let [u, v] = self.numbers(b"vt", "a texture coordinate needs two numbers", words)?;
                self.lists.uvs.push(upright([u, v]));
                Ok(())
            }
            b"vn" => {
                let normal: [f64; 3] = self.numbers(b"vn", "a normal needs three numbers", words)?;
                self.lists.normals.push(normal.map(|c| c as f32));
                Ok(())
            }
            b"f" | b"fo" => self.face(words),
            b"l" => self.lines_and_points(words, true),
            b"p" => self.lines_and_points(words, false),
            b"curv" | b"curv2" | b"surf" => {
                self.part.skipped.curves += 1;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// A position, with its colour or its weight.
    fn vertex<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), PartError> {
        let (all, count) = first_seven(words);
        let given = all[..count].iter().copied();
        let mut position: [f64; 3] = self.numbers(b"v", "a vertex needs three numbers", given)?;
        let color = color_of(&all, count);
        let is_colored = self.rules.is_colored;
        self.part.skipped.colors += u64::from(is_colored != color.is_some());
        if is_colored {
            self.lists.colors.push(opaque(color.unwrap_or([1.0; 3])));
        } else if count == 4
            && let Some(weight) = finite(all[3]).filter(|weight| *weight != 0.0)
        {
            position = position.map(|c| c / weight);
        }
        self.lists.positions.push(position);
        Ok(())
    }

    /// Exactly `N` numbers; more words are passed over.
    fn numbers<'w, const N: usize>(
        &self,
        keyword: &[u8],
        needed: &str,
        mut words: impl Iterator<Item = &'w [u8]>,
    ) -> Result<[f64; N], PartError> {
        let mut values = [0.0; N];
        let mut is_number = true;
        for (i, value) in values.iter_mut().enumerate() {
            *value = match words.next() {
                Some(word) if is_c_nan(word) => f64::NAN,
                Some(word) if word.is_ascii() => text::number(word).unwrap_or_else(|| {
                    is_number = false;
                    f64::NAN
                }),
                // A one-dimensional texture coordinate is legal.
                None if N == 2 && i == 1 => 0.0,
                other => {
                    let given = other.map_or(format!("it has {i}"), |w| format!("\"{}\" is none", show(w)));
                    return Err(self.broken(format!("\"{}\" needs {N} numbers, and {given}", show(keyword))));
                }
            };
        }
        if is_number { Ok(values) } else { Err(self.broken(needed.to_owned())) }
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w [u8]>) -> Result<(), PartError> {
        self.line.clear();
        for word in words {
            let corner = self.corner(word)?;
            self.line.push(corner);
            if self.line.len().is_multiple_of(CORNERS_PER_POLL) {
                self.rules.deadline.check()?;
            }
        }
        let arity = self.line.len();
        if arity < 3 {
            self.part.skipped.short_faces += 1;
            return Ok(());
        }
        // An attribute that only some corners of a face have is dropped.
        let has = |kind: usize| self.line.iter().all(|corner| corner[kind] != MISSING);
        let form = (has(1), has(2));
        for i in 0..arity {
            let [v, vt, vn] = self.line[i];
            let corner = [v, if form.0 { vt } else { MISSING }, if form.1 { vn } else { MISSING }];
            self.see(corner, 0);
            self.add_corners(&[corner], form);
        }
        self.part.triangles += arity as u64 - 2;
        self.count_face(arity, form);
        Ok(())
    }

    /// The segments of a polyline, or points.
    fn lines_and_points<'w>(
        &mut self,
        words: impl Iterator<Item = &'w [u8]>,
        are_joined: bool,
    ) -> Result<(), PartError> {
        let mut before: Option<u32> = None;
        for (number, word) in (1_usize..).zip(words) {
            let v = self.corner(word)?[0];
            let from = before.replace(v);
            if number.is_multiple_of(CORNERS_PER_POLL) {
                self.rules.deadline.check()?;
            }
            if are_joined {
                // The first corner has nothing to be joined to, and an equal one no length.
                let Some(from) = from.filter(|from| *from != v) else { continue };
                self.see([from, MISSING, MISSING], 0);
                self.add_corners(&[[from, MISSING, MISSING]], (false, false));
            }
            self.see([v, MISSING, MISSING], 0);
            self.add_corners(&[[v, MISSING, MISSING]], (false, false));
            self.part.triangles += if are_joined { SEGMENT_TRIANGLES } else { POINT_TRIANGLES };
            self.count_face(if are_joined { 2 } else { 1 }, (false, false));
        }
        Ok(())
    }

    fn corner(&self, word: &[u8]) -> Result<[u32; 3], PartError> {
        let counts = self.rules.before.unwrap_or_default() + self.counts();
        match parse_corner(word, counts) {
            _ if self.rules.before.is_none() && word.contains(&b'-') => Err(PartError::NeedsCounts),
            Ok(corner) => Ok(corner),
            Err(why) => Err(self.broken(why)),
        }
    }

    fn broken(&self, what: String) -> PartError {
        PartError::Line(self.part.lines, what)
    }
}

/// True if the first vertex of a text has a colour; None without a vertex.
pub fn has_colored_vertex(text: &[u8], newline: u8, mut poll: impl FnMut() -> bool) -> Option<bool> {
    for line in Lines::of_part(text, newline) {
        if !poll() {
            return None;
        }
        let mut words = words(&line);
        if words.next() == Some(b"v") {
            let (all, count) = first_seven(words);
            return Some(color_of(&all, count).is_some());
        }
    }
    None
}

/// The counts of one part.
pub fn count(bytes: &[u8], newline: u8, mut poll: impl FnMut() -> bool) -> Counts {
    let mut counts = Counts::default();
    for line in Lines::of_part(bytes, newline).take_while(|_| poll()) {
        match keyword(&line) {
            Some(b"v") => counts.v += 1,
            Some(b"vt") => counts.vt += 1,
            Some(b"vn") => counts.vn += 1,
            _ => {}
        }
    }
    counts
}

/// The words of a line. A comment may begin within a word, which then is the last.
fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut is_over = false;
    let words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
    words.map_while(move |word| {
        let kept = before_comment(word);
        let is_word = !is_over && !kept.is_empty();
        is_over |= kept.len() < word.len();
        is_word.then_some(kept)
    })
}

fn keyword(line: &[u8]) -> Option<&[u8]> {
    words(line).next()
}

fn first_seven<'w>(words: impl Iterator<Item = &'w [u8]>) -> ([&'w [u8]; 7], usize) {
    let mut all: [&[u8]; 7] = [b""; 7];
    let mut count = 0;
    for (place, word) in all.iter_mut().zip(words) {
        *place = word;
        count += 1;
    }
    (all, count)
}

/// The colour in the words of a vertex: six or seven numbers are a position and a colour, four are
/// x y z w.
fn color_of(all: &[&[u8]; 7], count: usize) -> Option<[f64; 3]> {
    if count < 6 {
        return None;
    }
    Some([finite(all[3])?, finite(all[4])?, finite(all[5])?])
}

fn finite(word: &[u8]) -> Option<f64> {
    text::number(word).filter(|v| v.is_finite())
}

/// The name after a keyword of six letters, including its spaces.
fn name(line: &[u8]) -> &[u8] {
    uncommented(line.trim_ascii_start().get(6..).unwrap_or_default().trim_ascii())
}
