//! The fast parsing of an OBJ face in its most frequent form: three or more corners and nothing
//! else, all written in the same one of the four ways `v`, `v/vt`, `v//vn` and `v/vt/vn`, with
//! indices of at most nine digits. Any other face is left to `statement`, as are relative indices
//! while the counts before the part are unknown.

use super::decimal::whole;
use super::{CORNERS_PER_POLL, Parser, PartError};
use crate::import::obj::face::MISSING;

/// Digits of an index that cannot overflow.
const DIGITS_MAX: usize = 9;

/// Index after a face's line; then two flags, true if its corners have texture coordinates, and
/// normals.
type FaceEnd = (usize, (bool, bool));

impl Parser<'_, '_, '_> {
    /// A face of three or more corners, all `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    pub(super) fn plain_face(&mut self, at: usize) -> Result<Option<usize>, PartError> {
        if let Some(end) = self.plain_triangle_or_quad(at) {
            return Ok(Some(end));
        }
        let Some((end, form)) = self.plain_corners(at)? else { return Ok(None) };
        let arity = self.line.len();
        let mut largest = [0; 3];
        for corner in &self.line {
            largest = std::array::from_fn(|kind| largest[kind].max(corner[kind]));
        }
        self.see([largest[0], if form.0 { largest[1] } else { MISSING }, if form.1 { largest[2] } else { MISSING }], 1);
        let line = std::mem::take(&mut self.line);
        self.add_corners(&line, form);
        self.line = line;
        self.part.triangles += arity as u64 - 2;
        self.count_face(arity, form);
        Ok(Some(end))
    }

    /// A triangle or quad of positive `v`, in a part that has had nothing else yet.
    #[inline]
    fn plain_triangle_or_quad(&mut self, at: usize) -> Option<usize> {
        if !(self.part.corner_uvs.is_empty() && self.part.corner_normals.is_empty()) {
            return None;
        }
        let mut face = [0; 4];
        let (mut arity, mut at) = (3, at);
        for index in &mut face[..3] {
            (*index, at) = self.plain_index(at)?;
        }
        // White space ends the line and each number before, so that corners are whole words.
        let end = match self.end_of_line(at) {
            Some(end) => end,
            None => {
                (face[3], at) = self.plain_index(at)?;
                arity = 4;
                self.end_of_line(at)?
            }
        };
        // Of known lengths, which take no call to be copied.
        match face {
            [a, b, c, _] if arity == 3 => self.lists.corners.extend(&[a, b, c]),
            quad => self.lists.corners.extend(&quad),
        }
        let largest = face.into_iter().fold(0, u32::max);
        self.see([largest, MISSING, MISSING], 1);
        self.part.triangles += arity as u64 - 2;
        self.count_face(arity, (false, false));
        Some(end)
    }

    /// A zero-based index from a positive one after any white space, and where it ends.
    #[inline(always)]
    fn plain_index(&self, mut at: usize) -> Option<(u32, usize)> {
        while let Some(b' ' | b'\t') = self.bytes.get(at) {
            at += 1;
        }
        let (index, end) = whole(self.bytes, at);
        (end - at <= DIGITS_MAX && index > 0).then(|| (index as u32 - 1, end))
    }

    /// The corners of the face at `at`, in `self.line`.
    #[inline]
    fn plain_corners(&mut self, mut at: usize) -> Result<Option<FaceEnd>, PartError> {
        self.line.clear();
        let mut form = None;
        loop {
            while let Some(b' ' | b'\t' | b'\r') = self.bytes.get(at) {
                at += 1;
            }
            match self.bytes.get(at) {
                None => break,
                Some(&b) if b == self.rules.newline => {
                    at += 1;
                    break;
                }
                Some(_) => {}
            }
            let Some((corner, end)) = self.plain_corner(at) else { return Ok(None) };
            let has = (corner[1] != MISSING, corner[2] != MISSING);
            if *form.get_or_insert(has) != has {
                return Ok(None);
            }
            at = end;
            self.line.push(corner);
            if self.line.len().is_multiple_of(CORNERS_PER_POLL) {
                self.rules.deadline.check()?;
            }
        }
        let is_face = self.line.len() >= 3;
        Ok(form.filter(|_| is_face).map(|form| (at, form)))
    }

    /// A corner, and where it ends.
    #[inline]
    fn plain_corner(&self, at: usize) -> Option<([u32; 3], usize)> {
        let (v, mut at) = self.index(at, 0)?;
        let (mut vt, mut vn) = (MISSING, MISSING);
        if self.bytes.get(at) == Some(&b'/') {
            at += 1;
            if self.bytes.get(at) != Some(&b'/') {
                (vt, at) = self.index(at, 1)?;
            }
            if self.bytes.get(at) == Some(&b'/') {
                (vn, at) = self.index(at + 1, 2)?;
            }
        }
        let ends = self.bytes.get(at).is_none_or(u8::is_ascii_whitespace);
        ends.then_some(([v, vt, vn], at))
    }

    /// A zero-based index from a one-based or relative one, and where it ends.
    #[inline]
    fn index(&self, begin: usize, kind: usize) -> Option<(u32, usize)> {
        let (index, at) = whole(self.bytes, begin);
        if at - begin > DIGITS_MAX {
            return None;
        }
        if index > 0 {
            return Some((index as u32 - 1, at));
        }
        self.relative_index(begin, kind)
    }

    fn relative_index(&self, begin: usize, kind: usize) -> Option<(u32, usize)> {
        if self.bytes.get(begin) != Some(&b'-') {
            return None;
        }
        let (index, at) = whole(self.bytes, begin + 1);
        if at - begin > 1 + DIGITS_MAX || index == 0 {
            return None;
        }
        let (before, own) = (self.rules.before?, self.counts());
        let count = [before.v + own.v, before.vt + own.vt, before.vn + own.vn][kind];
        Some((u32::try_from(count.checked_sub(index)?).ok()?, at))
    }

    /// Remembers the largest indices; `ahead` lines after those counted.
    #[inline]
    pub(super) fn see(&mut self, corner: [u32; 3], ahead: u64) {
        for (largest, index) in self.part.largest.iter_mut().zip(corner) {
            let index = u64::from(index) + 1;
            if index > largest.0 && index <= u64::from(MISSING) {
                *largest = (index, self.part.lines + ahead);
            }
        }
    }
}
