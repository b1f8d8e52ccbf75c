//! Stage shade: steps of `flat` in AVX2 instructions, lane for lane the same. Compilers make
//! branches and single lanes of the loops there.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use crate::backend::cpu::geometry::batch_avx2::transposed;
use crate::backend::cpu::isa::LANES;

/// Samples per pixel, of [`means`].
const SAMPLES: usize = 4;

/// Pixels in a vector of ids.
const PIXELS: usize = LANES / SAMPLES;

/// As `mean` of each pixel, given the ids of its samples. True if no colour is unknown.
#[target_feature(enable = "avx2")]
pub fn means(colors: &[[f32; 4]], ids: &[[u32; SAMPLES]; LANES], out: &mut [[f32; 4]; LANES]) -> bool {
    let Some(last) = colors.len().checked_sub(1).and_then(|last| u32::try_from(last).ok()) else { return false };
    let mut unknown = _mm256_setzero_ps();
    for (ids, out) in ids.as_chunks::<PIXELS>().0.iter().zip(out.as_chunks_mut::<PIXELS>().0) {
        // SAFETY: the array has the size of a vector, and the load needs no alignment.
        let ids = unsafe { _mm256_loadu_si256(ids.as_ptr().cast()) };
        let weights = weights(ids);
        let mut places = [[0_u32; SAMPLES]; PIXELS];
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_si256(places.as_mut_ptr().cast(), _mm256_min_epu32(ids, _mm256_set1_epi32(last as i32)))
        };
        // SAFETY: no place is beyond `last`, which is an index of `colors`. A colour has the size of
        // a vector.
        let color = |place: u32| unsafe { _mm_loadu_ps(colors.as_ptr().add(place as usize).cast()) };
        let part =
            |s: usize, weight: __m256| _mm256_mul_ps(weight, _mm256_set_m128(color(places[1][s]), color(places[0][s])));
        let sum = _mm256_add_ps(_mm256_setzero_ps(), part(0, _mm256_permute_ps::<0x00>(weights)));
        let sum = _mm256_add_ps(sum, part(1, _mm256_permute_ps::<0x55>(weights)));
        let sum = _mm256_add_ps(sum, part(2, _mm256_permute_ps::<0xAA>(weights)));
        let sum = _mm256_add_ps(sum, part(3, _mm256_permute_ps::<0xFF>(weights)));
        unknown = _mm256_or_ps(unknown, _mm256_cmp_ps::<_CMP_UNORD_Q>(sum, sum));
        // SAFETY: the array has the size of a vector, and the store needs no alignment.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr().cast(), sum) };
    }
    _mm256_testz_ps(unknown, unknown) != 0
}

/// As `mean` of each pixel, given the ids of its samples: a multiple of [`LANES`], at most 32. True if no colour is
/// unknown.
#[inline]
#[target_feature(enable = "avx2")]
pub fn means_of_many<const S: usize>(colors: &[[f32; 4]], pixels: &[[u32; S]], out: &mut [[f32; 4]]) -> bool {
    const { assert!(S <= u32::BITS as usize) };
    debug_assert!(S.is_multiple_of(LANES));
    let Some(last) = colors.len().checked_sub(1) else { return false };
    let mut unknown = _mm_setzero_ps();
    for (ids, out) in pixels.iter().zip(out) {
        let (mut sum, mut left) = (_mm_setzero_ps(), u32::MAX >> (u32::BITS - S as u32));
        while left != 0 {
            let id = ids[left.trailing_zeros() as usize % S];
            let same = same_as(id, ids);
            left &= (left - 1) & !same;
            let weight = _mm_set1_ps(same.count_ones() as f32 * (1.0 / S as f32));
            // SAFETY: a colour has the size of a vector, and the load needs no alignment.
            let color = unsafe { _mm_loadu_ps(colors[(id as usize).min(last)].as_ptr()) };
            sum = _mm_add_ps(sum, _mm_mul_ps(weight, color));
        }
        unknown = _mm_or_ps(unknown, _mm_cmpunord_ps(sum, sum));
        // SAFETY: as above, for a store.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), sum) };
    }
    _mm_movemask_ps(unknown) == 0
}

/// A bit for each sample that has this id.
#[inline]
#[target_feature(enable = "avx2")]
fn same_as<const S: usize>(id: u32, ids: &[u32; S]) -> u32 {
    let own = _mm256_set1_epi32(id as i32);
    let mut same = 0;
    for (i, ids) in ids.as_chunks::<LANES>().0.iter().enumerate() {
        // SAFETY: the array has the size of a vector, and the load needs no alignment.
        let is_same = _mm256_cmpeq_epi32(own, unsafe { _mm256_loadu_si256(ids.as_ptr().cast()) });
        same |= (_mm256_movemask_ps(_mm256_castsi256_ps(is_same)) as u32) << (LANES * i);
    }
    same
}

/// Normals of triangles, turned to the viewer; None if some id is not below the last normal's.
#[inline]
#[target_feature(enable = "avx2")]
pub fn normals(normals: &[[f32; 3]], ids: &[u32; LANES], is_front: bool) -> Option<[[f32; LANES]; 3]> {
    let last = normals.len().checked_sub(2).and_then(|last| i32::try_from(last).ok())?;
    // SAFETY: the array has the size of a vector, and the load needs no alignment.
    if !are_all_up_to(unsafe { _mm256_loadu_si256(ids.as_ptr().cast()) }, last) {
        return None;
    }
    // SAFETY: as above, no id is beyond `last`. Four numbers are a normal and a part of the next, which
    // there is.
    let normal = |l: usize| unsafe { _mm_loadu_ps(normals.as_ptr().add(ids[l] as usize).cast()) };
    let pair = |l: usize| _mm256_set_m128(normal(l + 4), normal(l));
    let [x, y, z, _] = transposed([pair(0), pair(1), pair(2), pair(3)]);
    let sign = _mm256_set1_ps(if is_front { 0.0 } else { -0.0 });
    let mut out = [[0.0; LANES]; 3];
    for (out, v) in out.iter_mut().zip([x, y, z]) {
        // SAFETY: as above, for a store.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), _mm256_xor_ps(v, sign)) };
    }
    Some(out)
}

/// Writes colours of triangles, whose first is number `first`, if all are finite.
#[inline]
#[target_feature(enable = "avx2")]
pub fn write(colors: &[[f32; LANES]; 4], ids: &[u32; LANES], first: u32, out: &mut [[f32; 4]]) -> bool {
    let Some(last) = out.len().checked_sub(1).and_then(|last| i32::try_from(last).ok()) else { return false };
    // SAFETY: arrays have the size of a vector, and loads need no alignment.
    let places = unsafe { _mm256_loadu_si256(ids.as_ptr().cast()) };
    let places = _mm256_sub_epi32(places, _mm256_set1_epi32(first as i32));
    // SAFETY: as above.
    let of = |k: usize| unsafe { _mm256_loadu_ps(colors[k].as_ptr()) };
    let [r, g, b, a] = [of(0), of(1), of(2), of(3)];
    // What is not finite is not a number after it is multiplied by 0.
    let no = |v: __m256| _mm256_mul_ps(v, _mm256_setzero_ps());
    let sum = _mm256_add_ps(_mm256_add_ps(no(r), no(g)), _mm256_add_ps(no(b), no(a)));
    let is_odd = _mm256_cmp_ps::<_CMP_UNORD_Q>(sum, sum);
    if _mm256_testz_ps(is_odd, is_odd) == 0 || !are_all_up_to(places, last) {
        return false;
    }
    let mut at = [0_u32; LANES];
    // SAFETY: as above, for a store.
    unsafe { _mm256_storeu_si256(at.as_mut_ptr().cast(), places) };
    let colors = transposed([r, g, b, a]);
    for (l, color) in colors.into_iter().enumerate() {
        // SAFETY: no place is beyond `last`, which is an index of `out`. A colour has the size of
        // half a vector.
        unsafe {
            _mm_storeu_ps(out.as_mut_ptr().add(at[l] as usize).cast(), _mm256_castps256_ps128(color));
            _mm_storeu_ps(out.as_mut_ptr().add(at[l + 4] as usize).cast(), _mm256_extractf128_ps::<1>(color));
        }
    }
    true
}

/// True if no lane is beyond `last`.
#[inline]
#[target_feature(enable = "avx2")]
fn are_all_up_to(v: __m256i, last: i32) -> bool {
    let kept = _mm256_min_epu32(v, _mm256_set1_epi32(last));
    _mm256_movemask_epi8(_mm256_cmpeq_epi32(kept, v)) == -1
}

/// As `weights`, of two pixels.
#[inline]
#[target_feature(enable = "avx2")]
fn weights(ids: __m256i) -> __m256 {
    // Equal to the sample that is so many further on, round and round.
    let same = [
        _mm256_cmpeq_epi32(ids, _mm256_shuffle_epi32::<0b00_11_10_01>(ids)),
        _mm256_cmpeq_epi32(ids, _mm256_shuffle_epi32::<0b01_00_11_10>(ids)),
        _mm256_cmpeq_epi32(ids, _mm256_shuffle_epi32::<0b10_01_00_11>(ids)),
    ];
    let more = _mm256_add_epi32(_mm256_add_epi32(same[0], same[1]), same[2]);
    let counts = _mm256_sub_epi32(_mm256_set1_epi32(1), more);
    // Samples for which the other one comes first.
    let lanes = |a: i32, b: i32, c: i32, d: i32| _mm256_setr_epi32(a, b, c, d, a, b, c, d);
    let before = [lanes(0, 0, 0, -1), lanes(0, 0, -1, -1), lanes(0, -1, -1, -1)];
    let is_later = _mm256_or_si256(
        _mm256_or_si256(_mm256_and_si256(same[0], before[0]), _mm256_and_si256(same[1], before[1])),
        _mm256_and_si256(same[2], before[2]),
    );
    _mm256_mul_ps(_mm256_cvtepi32_ps(_mm256_andnot_si256(is_later, counts)), _mm256_set1_ps(1.0 / SAMPLES as f32))
}
