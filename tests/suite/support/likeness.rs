//! The difference of two pictures, and named tolerances for it.

use std::fmt;

use meshsnap_render::image::Image;

/// A bound on what two back-ends may differ by.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Largest difference in any channel, /255.
    pub max: u8,
    /// Largest share of pixels that differ at all.
    pub share: f64,
}

impl Tolerance {
    /// Goal: the same samples, and colours that round the same but for the last place.
    pub const TWINS: Self = Self { max: 1, share: 0.001 };
}

/// The difference between two pictures.
#[derive(Clone, Copy, Debug, Default)]
pub struct Likeness {
    pixels: usize,
    differing: usize,
    max: u8,
}

impl Likeness {
    /// Compares two pictures of the same size. Colours count as much as they show: of a pixel that
    /// is all but transparent, the stored colour is that of nothing, or of its last step of alpha.
    pub fn of(a: &Image, b: &Image) -> Self {
        assert_eq!((a.width_px, a.height_px), (b.width_px, b.height_px));
        let mut like = Self { pixels: a.rgba.len() / 4, ..Self::default() };
        for (p, q) in a.rgba.chunks(4).zip(b.rgba.chunks(4)) {
            let [p, q] = [p, q].map(shown);
            let difference = p.iter().zip(q).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0);
            like.differing += usize::from(difference > 0);
            like.max = like.max.max(difference);
        }
        like
    }

    /// True if the tolerance holds.
    pub fn is_within(&self, tolerance: Tolerance) -> bool {
        self.max <= tolerance.max && self.differing as f64 / self.pixels as f64 <= tolerance.share
    }

    /// Pixels that differ at all.
    pub fn differing(&self) -> usize {
        self.differing
    }

    /// Panics where the tolerance is broken.
    pub fn assert(&self, tolerance: Tolerance, what: &str) {
        println!("{what:32} {self}");
        assert!(self.is_within(tolerance), "{what}: {self}; allowed is {tolerance:?}");
    }
}

/// Alpha, and the colours times it.
fn shown(pixel: &[u8]) -> [u8; 4] {
    let alpha = u32::from(pixel[3]);
    let times = |v: u8| ((u32::from(v) * alpha + 127) / 255) as u8;
    [times(pixel[0]), times(pixel[1]), times(pixel[2]), pixel[3]]
}

impl fmt::Display for Likeness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} pixels differ, at most by {}", self.differing, self.pixels, self.max)
    }
}
