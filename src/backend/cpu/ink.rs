//! Stage 4, a pixel: the union of the strokes that touch it. Twin of `shaders/ink.wgsl`.
//!
//! Of all strokes three things are kept, in integers, so that their order does not matter: the sum of their areas, the sum of
//! their counts of points, and which points any of them covers. Where they do not overlap the sum of the areas is the answer;
//! where they do, the share of the points that are left of the sum says how much of it is ([Ink::coverage]).

use super::stroke::{Mask, POINTS, WORDS, count};

/// Steps to the pixel of a sum of areas.
const AREA_UNIT: f32 = 65_536.0;

/// A pixel's strokes.
#[derive(Clone, Copy, Default)]
pub struct Ink {
    mask: Mask,
    /// Of all strokes: no number of them comes near the end of 64 bits.
    area: u64,
    count: u64,
}

impl Ink {
    /// Whether all points are covered, so that nothing that comes can change anything but lines whose peak is less than 1. One
    /// stroke may cover them all and yet leave a corner of the pixel; more than one are taken to have covered it.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count > u64::from(POINTS) && self.mask == [u16::MAX; WORDS]
    }

    /// Adds a stroke.
    #[inline(always)]
    pub fn add(&mut self, area: f32, mask: &Mask) {
        for l in 0..WORDS {
            self.mask[l] |= mask[l];
        }
        self.area += u64::from((area * AREA_UNIT + 0.5) as u32);
        self.count += u64::from(count(mask));
    }

    /// How much of the pixel is covered, 0 to the lines' `peak`: `area * points of the union / sum of the strokes' points`, a
    /// ratio estimate whose error is that of the overlap alone.
    #[inline(always)]
    pub fn coverage(&self, peak: f32) -> f32 {
        if self.area == 0 {
            return 0.0;
        }
        if self.is_full() {
            return peak;
        }
        let union = count(&self.mask);
        let area = to_f32(self.area) * (1.0 / AREA_UNIT);
        let share = if self.count > u64::from(union) { union as f32 / to_f32(self.count) } else { 1.0 };
        (area * share).min(peak)
    }
}

/// As the shaders round a number of two words.
#[inline(always)]
fn to_f32(v: u64) -> f32 {
    (v >> 32) as f32 * 4_294_967_296.0 + (v as u32) as f32
}
