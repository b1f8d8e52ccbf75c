//! Stage mixed: the points that lie outside an edge, in AVX2 instructions. Compilers make much longer code of
//! "a bit for each sign".

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::points::{PLACES, PointSet};
use crate::backend::cpu::isa::LANES;
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Rows from a point to the one that is [`LANES`] later, where the pixel does not end between them.
const ROWS: i32 = (LANES * GENERATORS[1] % POINTS) as i32;

/// By point: all bits if the pixel ends between its row and that of the point that is [`LANES`] later, else none.
const WRAPS: [[i32; LANES]; POINTS / LANES] = {
    let mut wraps = [[0; LANES]; POINTS / LANES];
    let mut i = 0;
    while i < POINTS {
        wraps[i / LANES][i % LANES] = if PLACES[1][i] + ROWS >= POINTS as i32 { -1 } else { 0 };
        i += 1;
    }
    wraps
};

/// Points whose bits are found together.
const TOGETHER: usize = 4 * LANES;

/// As `triangle::outside`.
#[inline]
#[target_feature(enable = "avx2")]
pub fn outside([c, dx, dy]: [i32; 3]) -> PointSet {
    let mut bits = [0_u32; POINTS / TOGETHER];
    // All sums are modulo 2^32.
    let along = |change: i32, places: &[i32; POINTS]| {
        _mm256_mullo_epi32(_mm256_set1_epi32(change), load(&places.as_chunks::<LANES>().0[0]))
    };
    let start = _mm256_sub_epi32(along(dx, &PLACES[1]), along(dy, &PLACES[0]));
    let mut value = _mm256_add_epi32(_mm256_set1_epi32(c), start);
    let step = _mm256_set1_epi32(dx.wrapping_mul(ROWS).wrapping_sub(dy.wrapping_mul(LANES as i32)));
    let pixel = _mm256_set1_epi32(dx.wrapping_mul(POINTS as i32));
    for (bits, wraps) in bits.iter_mut().zip(WRAPS.as_chunks::<4>().0) {
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
    PointSet(std::array::from_fn(|w| u64::from(bits[2 * w]) | u64::from(bits[2 * w + 1]) << 32))
}

#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32; LANES]) -> __m256i {
    // SAFETY: the array has the 32 bytes that are read, and any alignment will do.
    unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
}
