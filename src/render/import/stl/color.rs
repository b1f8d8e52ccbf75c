//! The colours in binary STL: two attribute bytes for each triangle, with 5 bits per channel. Two
//! conventions are in use, that of VisCAM and SolidView and that of Materialise Magics. The header
//! and the bytes tell which one a file follows.

use crate::srgb::srgb_to_linear;

/// Keyword in the header of Materialise Magics. RGBA bytes follow: the colour of triangles without
/// their own.
const MAGICS: &[u8] = b"COLOR=";
/// Bit 15, which tells whether a triangle has a colour.
const FLAG: u16 = 0x8000;
/// The colour of elements without one, where others have one.
const WHITE: [f32; 4] = [1.0; 4];

/// The convention for colours in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Colors {
    /// VisCAM and SolidView: blue in the lowest bits; a triangle has a colour if bit 15 is set.
    VisCam,
    /// Materialise Magics: red in the lowest bits; a triangle has a colour if bit 15 is clear.
    Magics {
        /// Colour of the other triangles, linear RGBA.
        object: [f32; 4],
    },
}

impl Colors {
    /// Detects the convention from the header and the attribute bytes. None if no triangle has a
    /// colour. `any_is_flagged` is true if an attribute is [`is_flagged`].
    pub fn of(header: &[u8], any_is_flagged: impl FnOnce() -> bool) -> Option<Self> {
        let at = header.windows(MAGICS.len()).position(|word| word == MAGICS);
        if let Some(bytes) = at.and_then(|at| header.get(at + MAGICS.len()..at + MAGICS.len() + 3)) {
            let [r, g, b] = [bytes[0], bytes[1], bytes[2]].map(|byte| linear(f64::from(byte) / 255.0));
            return Some(Self::Magics { object: [r, g, b, 1.0] });
        }
        any_is_flagged().then_some(Self::VisCam)
    }

    /// Linear RGBA of a triangle. In the Magics convention 0 means no colour, because programs that
    /// copy the header but write no colours leave 0.
    pub fn color(self, attribute: u16) -> [f32; 4] {
        let channel = |shift: u16| linear(f64::from(attribute >> shift & 31) / 31.0);
        match self {
            Self::VisCam if attribute & FLAG != 0 => [channel(10), channel(5), channel(0), 1.0],
            Self::VisCam => WHITE,
            Self::Magics { .. } if attribute != 0 && attribute & FLAG == 0 => {
                [channel(0), channel(5), channel(10), 1.0]
            }
            Self::Magics { object } => object,
        }
    }
}

/// True if bit 15 is set.
#[inline(always)]
pub fn is_flagged(attribute: u16) -> bool {
    attribute & FLAG != 0
}

fn linear(v: f64) -> f32 {
    srgb_to_linear(v) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_are_told_apart() {
        let mut header = [b' '; 80];
        let of =
            |header: &[u8; 80], attributes: &[u16]| Colors::of(header, || attributes.iter().any(|a| is_flagged(*a)));
        assert_eq!(of(&header, &[0, 1, 0x7FFF]), None);
        let viscam = of(&header, &[0, FLAG]).unwrap();
        assert_eq!(viscam.color(FLAG | 31), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!((viscam.color(FLAG | 31 << 10), viscam.color(31)), ([1.0, 0.0, 0.0, 1.0], WHITE));
        header[40..50].copy_from_slice(b"COLOR=\xFF\x00\x00\xFF");
        let magics = of(&header, &[]).unwrap();
        assert_eq!(magics.color(31 << 10), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!([magics.color(0), magics.color(FLAG), magics.color(FLAG | 31)], [[1.0, 0.0, 0.0, 1.0]; 3]);
        // Cut off by the header's end.
        header[40..50].fill(b' ');
        header[74..].copy_from_slice(MAGICS);
        assert_eq!(of(&header, &[]), None);
    }
}
