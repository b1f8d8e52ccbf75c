//! Stage 4, a pixel: the union of the strokes that touch it. Twin of `shaders/ink.wgsl`.
//!
//! Of all strokes three things are kept, in integers, so that their order does not matter: the sum of their areas, the sum of
//! their counts of points, and which points any of them covers. Where they do not overlap the sum of the areas is the answer;
//! where they do, the share of the points that are left of the sum says how much of it is ([Ink::coverage]).

use super::stroke::{Mask, POINTS, WORDS, count};

/// Steps to the pixel of a sum of areas.
const AREA_UNIT: f32 = 65_536.0;

/// Sums stop before they could wrap. Only lit lines come close, in a pixel that 32,768 of them cover: others stop when all points
/// are covered.
const SUM_MAX: u32 = 1 << 31;

/// A pixel's strokes.
#[derive(Clone, Copy, Default)]
pub struct Ink {
    mask: Mask,
    area: u32,
    count: u32,
}

impl Ink {
    /// Whether all points are covered, so that nothing that comes can change anything but lines whose peak is less than 1. One
    /// stroke may cover them all and yet leave a corner of the pixel; more than one are taken to have covered it.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count > POINTS && self.mask == [u16::MAX; WORDS]
    }

    /// Adds a stroke.
    #[inline(always)]
    pub fn add(&mut self, area: f32, mask: &Mask) {
        for l in 0..WORDS {
            self.mask[l] |= mask[l];
        }
        if self.area < SUM_MAX && self.count < SUM_MAX {
            self.area += (area * AREA_UNIT + 0.5) as u32;
            self.count += count(mask);
        }
    }

    /// How much of the pixel is covered, 0 to the lines' `peak`: `area * points of the union / sum of the strokes' points`, a ratio estimate
    /// whose error is that of the overlap alone.
    #[inline(always)]
    pub fn coverage(&self, peak: f32) -> f32 {
        if self.area == 0 {
            return 0.0;
        }
        if self.is_full() {
            return peak;
        }
        let union = count(&self.mask);
        let area = self.area as f32 * (1.0 / AREA_UNIT);
        let share = if self.count > union { union as f32 / self.count as f32 } else { 1.0 };
        (area * share).min(peak)
    }
}
