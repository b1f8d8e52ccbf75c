//! Stage mixed: the points that lie outside an edge, in AVX2 instructions. Compilers make much longer code of
//! "a bit for each sign".

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::points::{Lattice, PointSet};
use crate::backend::cpu::isa::LANES;
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Vectors of a word's points.
const VECTORS: usize = u64::BITS as usize / LANES;

/// From a point to the one that is [`LANES`] later.
struct Steps<const W: usize>;

impl<const W: usize> Steps<W> {
    /// Columns.
    const COLUMNS: i32 = (LANES * Lattice::<W>::STEP * GENERATORS[0]) as i32;

    /// Rows, where the pixel does not end between them.
    const ROWS: i32 = (LANES * Lattice::<W>::STEP * GENERATORS[1] % POINTS) as i32;

    /// By point: all bits if the pixel ends between its row and that of the later point, else none.
    const WRAPS: [[[i32; LANES]; VECTORS]; W] = {
        let mut wraps = [[[0; LANES]; VECTORS]; W];
        let mut i = 0;
        while i < Lattice::<W>::POINTS {
            let (word, bit) = (i / u64::BITS as usize, i % u64::BITS as usize);
            let row = Lattice::<W>::PLACES[1][word][bit];
            wraps[word][bit / LANES][bit % LANES] = if row + Self::ROWS >= POINTS as i32 { -1 } else { 0 };
            i += 1;
        }
        wraps
    };
}

/// As `triangle::outside`.
#[inline]
#[target_feature(enable = "avx2")]
pub fn outside<const W: usize>([c, dx, dy]: [i32; 3]) -> PointSet<W> {
    // All sums are modulo 2^32.
    let along = |change: i32, places: &[[i32; 64]; W]| {
        _mm256_mullo_epi32(_mm256_set1_epi32(change), load(&places[0].as_chunks::<LANES>().0[0]))
    };
    let start = _mm256_sub_epi32(along(dx, &Lattice::<W>::PLACES[1]), along(dy, &Lattice::<W>::PLACES[0]));
    let mut value = _mm256_add_epi32(_mm256_set1_epi32(c), start);
    let step = dx.wrapping_mul(Steps::<W>::ROWS).wrapping_sub(dy.wrapping_mul(Steps::<W>::COLUMNS));
    let (step, pixel) = (_mm256_set1_epi32(step), _mm256_set1_epi32(dx.wrapping_mul(POINTS as i32)));
    let mut set = PointSet::NONE;
    for (word, wraps) in set.0.iter_mut().zip(&Steps::<W>::WRAPS) {
        let mut halves = [0_u32; 2];
        for (bits, wraps) in halves.iter_mut().zip(wraps.as_chunks::<4>().0) {
            let mut four = [value; 4];
            for (own, wraps) in four.iter_mut().zip(wraps) {
                *own = value;
                let wrap = _mm256_and_si256(pixel, load(wraps));
                value = _mm256_add_epi32(value, _mm256_sub_epi32(step, wrap));
            }
            // Narrowing keeps signs, and interleaves the halves of vectors.
            let [a, b, c, d] = four;
            let bytes = _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
            let in_order = _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
            *bits = _mm256_movemask_epi8(in_order) as u32;
        }
        *word = u64::from(halves[0]) | u64::from(halves[1]) << 32;
    }
    set
}

#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32; LANES]) -> __m256i {
    // SAFETY: the array has the 32 bytes that are read, and any alignment will do.
    unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
}
