//! Faces in their plainest form: all corners alike, short indices without a sign, or relative ones.

use super::{CORNERS_PER_POLL, Fault, Parser};
use crate::import::obj::face::MISSING;

/// Digits of an index that cannot overflow.
const DIGITS_MAX: usize = 9;

/// Index after a face's line; then two flags, true if its corners have texture coordinates, and
/// normals.
type FaceEnd = (usize, (bool, bool));

impl Parser<'_, '_> {
    /// A face of three or more corners, all `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    pub(super) fn plain_face(&mut self, at: usize) -> Result<Option<usize>, Fault> {
        let before = self.part.corners.v.len();
        let largest = self.part.largest;
        let parsed = self.plain_corners(at, before)?;
        match parsed {
            Some((end, form)) => {
                let arity = self.part.corners.v.len() - before;
                self.part.triangles += arity as u64 - 2;
                self.count_face(arity, form);
                Ok(Some(end))
            }
            None => {
                self.part.corners.truncate(before);
                self.part.largest = largest;
                Ok(None)
            }
        }
    }

    #[inline]
    fn plain_corners(&mut self, mut at: usize, before: usize) -> Result<Option<FaceEnd>, Fault> {
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
            self.see(corner, 1);
            self.part.corners.push(corner);
            if self.part.corners.v.len().is_multiple_of(CORNERS_PER_POLL) {
                self.rules.deadline.check()?;
            }
        }
        let is_face = self.part.corners.v.len() - before >= 3;
        Ok(form.filter(|_| is_face).map(|form| (at, form)))
    }

    /// A corner, and where it ends.
    #[inline]
    fn plain_corner(&self, at: usize) -> Option<([u32; 3], usize)> {
        let counts = [self.part.positions.len(), self.part.uvs.len(), self.part.normals.len()];
        let (v, mut at) = self.index(at, 0, counts)?;
        let (mut vt, mut vn) = (MISSING, MISSING);
        if self.bytes.get(at) == Some(&b'/') {
            at += 1;
            if self.bytes.get(at) != Some(&b'/') {
                (vt, at) = self.index(at, 1, counts)?;
            }
            if self.bytes.get(at) == Some(&b'/') {
                (vn, at) = self.index(at + 1, 2, counts)?;
            }
        }
        let ends = self.bytes.get(at).is_none_or(u8::is_ascii_whitespace);
        ends.then_some(([v, vt, vn], at))
    }

    /// A zero-based index from a one-based or relative one, and where it ends.
    #[inline]
    fn index(&self, begin: usize, kind: usize, counts: [usize; 3]) -> Option<(u32, usize)> {
        let is_relative = self.bytes.get(begin) == Some(&b'-');
        let digits_begin = begin + usize::from(is_relative);
        let (mut at, mut index) = (digits_begin, 0_u32);
        while let Some(digit) = self.bytes.get(at).map(|b| b.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            index = index.wrapping_mul(10).wrapping_add(u32::from(digit));
            at += 1;
        }
        if at - digits_begin > DIGITS_MAX || index == 0 {
            return None;
        }
        if !is_relative {
            return Some((index - 1, at));
        }
        let before = self.rules.before?;
        let count = [before.v, before.vt, before.vn][kind] + counts[kind] as u64;
        Some((u32::try_from(count.checked_sub(u64::from(index))?).ok()?, at))
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
