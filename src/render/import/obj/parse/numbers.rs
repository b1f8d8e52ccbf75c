//! The fast parsing of `v`, `vn` and `vt` lines of OBJ in their most frequent form: three decimals
//! (for `vt` also two, for `v` six in a file with colours) with white space between them. Any other
//! line is left to `statement`.

use super::Parser;
use super::decimal;

impl Parser<'_, '_, '_> {
    /// A position without a weight, with a colour if the file has colours.
    #[inline]
    pub(super) fn plain_vertex(&mut self, at: usize) -> Option<usize> {
        let (position, at) = self.decimals::<3>(at)?;
        if !self.rules.is_colored {
            let end = self.end_of_line(at)?;
            self.lists.positions.push(position);
            return Some(end);
        }
        let (color, at) = self.decimals::<3>(at)?;
        let end = self.end_of_line(at)?;
        if !color.iter().all(|c| c.is_finite()) {
            return None;
        }
        self.lists.positions.push(position);
        self.lists.colors.push(opaque(color));
        Some(end)
    }

    /// A normal, from after `vn`.
    #[inline]
    pub(super) fn plain_normal(&mut self, at: usize) -> Option<usize> {
        let (normal, at) = self.after_space::<3>(at)?;
        let end = self.end_of_line(at)?;
        self.lists.normals.push(normal.map(|c| c as f32));
        Some(end)
    }

    /// A texture coordinate, from after `vt`. A third number is passed over.
    #[inline]
    pub(super) fn plain_uv(&mut self, at: usize) -> Option<usize> {
        let (uv, at) = self.after_space::<2>(at)?;
        let end = match self.end_of_line(at) {
            Some(end) => end,
            None => self.end_of_line(self.decimals::<1>(at)?.1)?,
        };
        self.lists.uvs.push(upright(uv));
        Some(end)
    }

    #[inline]
    fn after_space<const N: usize>(&self, at: usize) -> Option<([f64; N], usize)> {
        if self.bytes.get(at) == Some(&b' ') { self.decimals(at + 1) } else { None }
    }

    /// Some numbers on one line, and where the last one ends.
    #[inline]
    fn decimals<const N: usize>(&self, mut at: usize) -> Option<([f64; N], usize)> {
        let mut values = [0.0; N];
        for value in &mut values {
            while let Some(b' ' | b'\t') = self.bytes.get(at) {
                at += 1;
            }
            (*value, at) = decimal::leading(self.bytes, at)?;
        }
        Some((values, at))
    }
}

/// A colour as in the file, with full opacity.
pub fn opaque([r, g, b]: [f64; 3]) -> [f32; 4] {
    [r as f32, g as f32, b as f32, 1.0]
}

/// In OBJ v runs up from the image's lower edge, in a raw mesh down from the upper one.
pub fn upright([u, v]: [f64; 2]) -> [f32; 2] {
    [u as f32, (1.0 - v) as f32]
}
