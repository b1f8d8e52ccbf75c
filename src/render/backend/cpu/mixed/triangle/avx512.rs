//! The AVX-512 version of a function of the parent module (stage mixed): whether the points of a
//! mixed pixel lie outside an edge of a triangle. Sixteen points are tested at a time. Mixed pixels
//! are drawn a second time, from 64 or 256 points each.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::mixed::points::{Lattice, PointSet};
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Points in a vector.
const WIDE: usize = 2 * LANES;

/// Vectors of a word's points.
const VECTORS: usize = u64::BITS as usize / WIDE;

/// From a point to the one that is [`WIDE`] later.
struct Steps<const W: usize>;

impl<const W: usize> Steps<W> {
    /// Columns.
    const COLUMNS: i32 = (WIDE * Lattice::<W>::STEP * GENERATORS[0]) as i32;

    /// Rows, where the pixel does not end between them.
    const ROWS: i32 = (WIDE * Lattice::<W>::STEP * GENERATORS[1] % POINTS) as i32;

    /// A bit for each point of a vector, set if the pixel ends between its row and that of the later point.
    const WRAPS: [[u16; VECTORS]; W] = {
        let mut wraps = [[0; VECTORS]; W];
        let mut i = 0;
        while i < Lattice::<W>::POINTS {
            let (word, bit) = (i / u64::BITS as usize, i % u64::BITS as usize);
            let row = Lattice::<W>::PLACES[1][word][bit];
            wraps[word][bit / WIDE] |= ((row + Self::ROWS >= POINTS as i32) as u16) << (bit % WIDE);
            i += 1;
        }
        wraps
    };
}

/// As `outside` of the parent.
#[inline]
#[target_feature(enable = "avx512f")]
pub fn outside<const W: usize>([c, dx, dy]: [i32; 3]) -> PointSet<W> {
    // All sums are modulo 2^32.
    let along = |change: i32, places: &[[i32; 64]; W]| {
        // SAFETY: a row of places has 256 bytes, of which 64 are read, and any alignment will do.
        let places = unsafe { _mm512_loadu_si512(places[0].as_ptr().cast()) };
        _mm512_mullo_epi32(_mm512_set1_epi32(change), places)
    };
    let start = _mm512_sub_epi32(along(dx, &Lattice::<W>::PLACES[1]), along(dy, &Lattice::<W>::PLACES[0]));
    let mut value = _mm512_add_epi32(_mm512_set1_epi32(c), start);
    let step = dx.wrapping_mul(Steps::<W>::ROWS).wrapping_sub(dy.wrapping_mul(Steps::<W>::COLUMNS));
    let wrapped = _mm512_set1_epi32(step.wrapping_sub(dx.wrapping_mul(POINTS as i32)));
    let step = _mm512_set1_epi32(step);
    let mut set = PointSet::NONE;
    for (word, wraps) in set.0.iter_mut().zip(&Steps::<W>::WRAPS) {
        for (vector, wraps) in wraps.iter().enumerate() {
            let bits = _mm512_cmplt_epi32_mask(value, _mm512_setzero_si512());
            *word |= u64::from(bits) << (WIDE * vector);
            value = _mm512_add_epi32(value, _mm512_mask_mov_epi32(step, *wraps, wrapped));
        }
    }
    set
}
