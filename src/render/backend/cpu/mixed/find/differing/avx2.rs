//! The test of `differing` in AVX2 instructions, two pixels per vector: it finds the pixels of a row whose samples,
//! together with the closest samples of the pixels on the left and above, show different faces (stage mixed). Only
//! the samples of these pixels are compared by colour, to find the pixels that are drawn a second time from more
//! points.

use std::arch::x86_64::*;

use super::{Ids, OUTERMOST, WORD};

/// Pixels in a vector.
const PIXELS: usize = 2;

/// Vectors whose results make a vector of one number per pixel.
const VECTORS: usize = 4;

/// As `word`.
#[inline]
#[target_feature(enable = "avx2")]
pub fn word(own: &[Ids; WORD + 1], above: &[Ids; WORD]) -> u64 {
    // A shuffle per vector puts one sample of each pixel into all places.
    let first = |v: __m256i| _mm256_shuffle_epi32::<0>(v);
    let rightmost = |v: __m256i| _mm256_shuffle_epi32::<{ 0x55 * OUTERMOST.right as i32 }>(v);
    let lowest = |v: __m256i| _mm256_shuffle_epi32::<{ 0x55 * OUTERMOST.bottom as i32 }>(v);
    let mut word = 0;
    for group in 0..WORD / (PIXELS * VECTORS) {
        let mut are_same = [_mm256_setzero_si256(); VECTORS];
        for (v, is_same) in are_same.iter_mut().enumerate() {
            let x = PIXELS * (VECTORS * group + v);
            let ids = load(own, x + 1);
            let id = first(ids);
            let left = _mm256_xor_si256(id, rightmost(load(own, x)));
            let others = _mm256_or_si256(left, _mm256_xor_si256(id, lowest(load(above, x))));
            let difference = _mm256_or_si256(_mm256_xor_si256(id, ids), others);
            *is_same = _mm256_cmpeq_epi32(difference, _mm256_setzero_si256());
        }
        // Bytes of one pixel per number: 0, 2, 4, 6 and then 1, 3, 5, 7.
        let [a, b, c, d] = are_same;
        let bytes = _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
        let is_same = _mm256_cmpeq_epi32(bytes, _mm256_set1_epi32(-1));
        let in_order = _mm256_permutevar8x32_epi32(is_same, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
        let same = _mm256_movemask_ps(_mm256_castsi256_ps(in_order)) as u8;
        word |= u64::from(!same) << (PIXELS * VECTORS * group);
    }
    word
}

/// The ids of two pixels in succession.
#[inline]
#[target_feature(enable = "avx2")]
fn load<const N: usize>(pixels: &[Ids; N], first: usize) -> __m256i {
    bytemuck::must_cast(*pixels[first..].first_chunk::<PIXELS>().unwrap_or(&[[0; 4]; PIXELS]))
}
