//! Stage visibility: the test of tiles in AVX2 instructions, eight faces at a time.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::{TILE_SHIFT, Tiles};
use crate::backend::cpu::bands::lists::BoxedFace;
use crate::backend::cpu::geometry::batch_avx2::{bits, transposed};
use crate::backend::cpu::isa::LANES;

/// Bits of the faces that tiles do not hide, in these rows of samples; None if there are not eight, or
/// one of them touches more than two tiles along an axis.
#[target_feature(enable = "avx2")]
pub fn seen(tiles: &Tiles, faces: &[BoxedFace], [from, to]: [i32; 2]) -> Option<u32> {
    let last = i32::try_from(tiles.depth_min.len().checked_sub(1)?).ok()?;
    let faces: &[BoxedFace; LANES] = faces.first_chunk()?;
    const { assert!(size_of::<BoxedFace>() == size_of::<__m128>()) };
    // SAFETY: a face is four numbers and has the size of half a vector. The load needs no alignment.
    let face = |l: usize| unsafe { _mm_loadu_ps(std::ptr::from_ref(&faces[l]).cast()) };
    let pair = |l: usize| _mm256_set_m128(face(l + 4), face(l));
    let [_, columns, rows, depth_max] = transposed([pair(0), pair(1), pair(2), pair(3)]);
    let (columns, rows) = (_mm256_castps_si256(columns), _mm256_castps_si256(rows));
    let low = |pair: __m256i| _mm256_srai_epi32::<16>(_mm256_slli_epi32::<16>(pair));
    let high = |pair: __m256i| _mm256_srai_epi32::<16>(pair);
    let top = _mm256_max_epi32(low(rows), _mm256_set1_epi32(from));
    let bottom = _mm256_min_epi32(high(rows), _mm256_set1_epi32(to - 1));
    let is_empty = _mm256_cmpgt_epi32(top, bottom);
    let tile =
        |v: __m256i, k: usize| _mm256_srli_epi32::<TILE_SHIFT>(_mm256_sub_epi32(v, _mm256_set1_epi32(tiles.first[k])));
    let (left, right) = (tile(low(columns), 0), tile(high(columns), 0));
    let (top, bottom) = (tile(top, 1), tile(bottom, 1));
    let is_wide = |first, last| _mm256_cmpgt_epi32(_mm256_sub_epi32(last, first), _mm256_set1_epi32(1));
    let is_large = _mm256_or_si256(is_wide(left, right), is_wide(top, bottom));
    if bits(_mm256_andnot_si256(is_empty, is_large)) != 0 {
        return None;
    }
    let of_row = |row| _mm256_mullo_epi32(row, _mm256_set1_epi32(tiles.columns as i32));
    let depth_min = |row, column| {
        let at = _mm256_min_epu32(_mm256_add_epi32(row, column), _mm256_set1_epi32(last));
        // SAFETY: no index is beyond `last`, the last of `depth_min`'s.
        unsafe { _mm256_i32gather_ps::<4>(tiles.depth_min.as_ptr(), at) }
    };
    let (top, bottom) = (of_row(top), of_row(bottom));
    let upper = _mm256_min_ps(depth_min(top, left), depth_min(top, right));
    let lower = _mm256_min_ps(depth_min(bottom, left), depth_min(bottom, right));
    let is_hidden = _mm256_cmp_ps::<_CMP_LT_OQ>(depth_max, _mm256_min_ps(upper, lower));
    Some(!bits(_mm256_or_si256(is_empty, _mm256_castps_si256(is_hidden))) & 255)
}
