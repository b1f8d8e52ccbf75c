//! Stage visibility: the inner loop of `batch` in AVX-512 instructions. It takes sixteen samples at
//! a time. Each has the same result as in `batch_avx2`, which takes eight.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::samples::{HANGOVER, SampleBand};
use super::setups::lane_offsets;
use super::visibility::Parts;
use crate::backend::cpu::isa::LANES;

/// Samples in a vector. With one sample per pixel it goes 8 columns beyond a block of large triangles, where
/// edge functions still fit 32 bits: 2^30, to which they are clamped, and at most 2^29 + 2^28 from there.
const WIDE: usize = 2 * LANES;

// A vector may begin at the last pixel of a row.
const _: () = assert!(WIDE <= HANGOVER);

/// As `draw_part`.
#[target_feature(enable = "avx512f")]
pub fn draw_lane<const S: usize, const N: usize>(t: &Parts<N>, l: usize, id: u32, band: &mut SampleBand) {
    let [[left, right], [top, bottom]] = t.bounds_of(l);
    let pixels = WIDE / S;
    let (rows, vectors) = ((bottom - top) as u32 as usize, (right - left) as u32 as usize / pixels);
    // From the first sample to the end of the last vector.
    let (first, stride) = (band.index(left, top, 0), band.stride);
    let width = (vectors + 1) * WIDE;
    let end = rows.saturating_mul(stride).saturating_add(width).saturating_add(first);
    let Some(depths) = band.depth.get_mut(first..end) else { return };
    let Some(ids) = band.ids.get_mut(first..end) else { return };
    let id = _mm512_set1_epi32(id as i32);
    let range = [_mm512_set1_ps(t.depth_range[0][l]), _mm512_set1_ps(t.depth_range[1][l])];
    let (depth, across) = (_mm512_set1_ps(t.depth[0][l]), _mm512_set1_ps(t.depth[1][l]));
    let [offset_x, offset_y] = offsets::<S>();
    let mut edges = [_mm512_setzero_si512(); 3];
    let (mut downs, mut rights) = (edges, edges);
    for k in 0..3 {
        let down = _mm512_mullo_epi32(_mm512_set1_epi32(t.dx[k][l]), offset_y);
        let right = _mm512_mullo_epi32(_mm512_set1_epi32(t.dy[k][l]), offset_x);
        edges[k] = _mm512_add_epi32(_mm512_set1_epi32(t.edges[k][l]), _mm512_sub_epi32(down, right));
        downs[k] = _mm512_set1_epi32(16 * t.dx[k][l]);
        rights[k] = _mm512_set1_epi32(16 * pixels as i32 * t.dy[k][l]);
    }
    let first_x = _mm512_add_epi32(_mm512_set1_epi32(t.from[0][l]), _mm512_slli_epi32::<4>(offset_x));
    let first_plane = _mm512_add_ps(depth, _mm512_mul_ps(across, _mm512_cvtepi32_ps(first_x)));
    let mut y = _mm512_add_epi32(_mm512_set1_epi32(t.from[1][l]), _mm512_slli_epi32::<4>(offset_y));
    for row in 0..=rows {
        let depth_y = _mm512_mul_ps(_mm512_set1_ps(t.depth[2][l]), _mm512_cvtepi32_ps(y));
        let [mut e0, mut e1, mut e2] = edges;
        let (mut x, mut plane) = (first_x, first_plane);
        for vector in 0..=vectors {
            let outside = _mm512_or_si512(_mm512_or_si512(e0, e1), e2);
            let z = _mm512_min_ps(_mm512_max_ps(_mm512_add_ps(plane, depth_y), range[0]), range[1]);
            let at = row * stride + vector * WIDE;
            // SAFETY: `at + WIDE` is at most `rows * stride + width`, the length of both slices: `row` is at
            // most `rows`, `vector` at most `vectors`.
            unsafe { update(outside, z, id, depths.as_mut_ptr().add(at), ids.as_mut_ptr().add(at)) };
            if vector < vectors {
                (e0, e1, e2) =
                    (_mm512_sub_epi32(e0, rights[0]), _mm512_sub_epi32(e1, rights[1]), _mm512_sub_epi32(e2, rights[2]));
                x = _mm512_add_epi32(x, _mm512_set1_epi32(256 * pixels as i32));
                plane = _mm512_add_ps(depth, _mm512_mul_ps(across, _mm512_cvtepi32_ps(x)));
            }
        }
        for k in 0..3 {
            edges[k] = _mm512_add_epi32(edges[k], downs[k]);
        }
        y = _mm512_add_epi32(y, _mm512_set1_epi32(256));
    }
}

/// As `lane_offsets`, of as many pixels as fill a vector.
#[inline]
#[target_feature(enable = "avx512f")]
fn offsets<const S: usize>() -> [__m512i; 2] {
    // With 16 samples a pixel has two parts. Otherwise the second half are the next pixels.
    let (lower, mut upper) = (lane_offsets::<S>(0), lane_offsets::<S>(usize::from(S > LANES)));
    if S <= LANES {
        for l in 0..LANES {
            upper[0][l] += 16 * (LANES / S) as i32;
        }
    }
    let mut all = [[0; WIDE]; 2];
    for axis in 0..2 {
        all[axis][..LANES].copy_from_slice(&lower[axis]);
        all[axis][LANES..].copy_from_slice(&upper[axis]);
    }
    // SAFETY: the arrays have the size of a vector, and loads need no alignment.
    unsafe { [_mm512_loadu_si512(all[0].as_ptr().cast()), _mm512_loadu_si512(all[1].as_ptr().cast())] }
}

/// As [`update`](super::nearest::update), for depths above 0. Stores whole vectors: a later load of what a
/// masked store has written waits longer.
///
/// # Safety
///
/// From both pointers on, [`WIDE`] values may be read and written.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn update(outside: __m512i, z: __m512, id: __m512i, depths: *mut f32, ids: *mut u32) {
    // SAFETY: the caller vouches for the pointers, and loads and stores need no alignment.
    unsafe {
        let old_depths = _mm512_loadu_ps(depths);
        let old_ids = _mm512_loadu_si512(ids.cast());
        let is_inside = _mm512_cmpge_epi32_mask(outside, _mm512_setzero_si512());
        let is_nearer = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(z, old_depths);
        let is_tied = _mm512_mask_cmp_ps_mask::<_CMP_EQ_OQ>(_mm512_cmplt_epu32_mask(id, old_ids), z, old_depths);
        let change = is_inside & (is_nearer | is_tied);
        _mm512_storeu_ps(depths, _mm512_mask_mov_ps(old_depths, change, z));
        _mm512_storeu_si512(ids.cast(), _mm512_mask_mov_epi32(old_ids, change, id));
    }
}
