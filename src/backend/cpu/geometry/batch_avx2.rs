//! Stage visibility: the steps of `batch` and `setups` in AVX2 instructions, lane for lane the
//! same. Compilers make worse of the loops there: parts of vectors, and masked stores, which take
//! several times as long on some processors.

#![allow(unsafe_code)]

use std::arch::asm;
use std::arch::x86_64::*;

use super::samples::{SampleBand, SampleGrid};
use super::setups::{Corners, EXTENT_MAX, SHORT_MAX, Setups, lane_offsets};
use super::visibility::Part;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// As `Setups::new`.
#[target_feature(enable = "avx2")]
pub fn set_up<const S: usize>(corners: &Corners, band: &SampleBand) -> Setups {
    let mut s = Setups::default();
    let (x, y) = (load3(&corners.x), load3(&corners.y));
    let z = [from_floats(&corners.z[0]), from_floats(&corners.z[1]), from_floats(&corners.z[2])];
    let [columns, rows] = band.range();
    let half = [band.size_px[0] as i32 * 128, band.size_px[1] as i32 * 128];
    let (left, right, is_narrow) = bounds::<S>(&x, half[0], columns);
    let (top, bottom, is_low) = bounds::<S>(&y, half[1], rows);
    let depth_min = _mm256_min_ps(_mm256_min_ps(z[0], z[1]), z[2]);
    let depth_max = _mm256_max_ps(_mm256_max_ps(z[0], z[1]), z[2]);
    let is_deep = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(depth_min, _mm256_setzero_ps()));
    let is_short = _mm256_and_si256(_mm256_and_si256(is_narrow, is_low), is_deep);
    let is_short = _mm256_movemask_ps(_mm256_castsi256_ps(is_short));
    for l in 0..LANES {
        s.is_short[l] = is_short >> l & 1 != 0;
    }
    s.bounds = [[to_ints(left), to_ints(right)], [to_ints(top), to_ints(bottom)]];
    s.depth_range = [to_floats(depth_min), to_floats(depth_max)];
    let shift = sample_offsets(S as u32)[0][0] & 15;
    let corner =
        |first: __m256i, half: i32| _mm256_add_epi32(_mm256_slli_epi32::<8>(first), _mm256_set1_epi32(shift - half));
    planes(&mut s, x, y, z, [corner(left, half[0]), corner(top, half[1])]);
    s
}

/// First and last pixel along an axis, and which lanes are short along it.
#[inline]
#[target_feature(enable = "avx2")]
fn bounds<const S: usize>(v: &[__m256i; 3], half: i32, [from, to]: [i32; 2]) -> (__m256i, __m256i, __m256i) {
    let grid = SampleGrid::new(S as u32);
    let low = _mm256_min_epi32(_mm256_min_epi32(v[0], v[1]), v[2]);
    let high = _mm256_max_epi32(_mm256_max_epi32(v[0], v[1]), v[2]);
    let (cells, pixels) = (_mm_cvtsi32_si128(8 - grid.shift), _mm_cvtsi32_si128(grid.shift));
    let first = _mm256_sra_epi32(_mm256_add_epi32(low, _mm256_set1_epi32(half + grid.border - 1)), cells);
    let last = _mm256_sra_epi32(_mm256_add_epi32(high, _mm256_set1_epi32(half - grid.border)), cells);
    let is_empty = _mm256_cmpgt_epi32(first, last);
    let last = _mm256_blendv_epi8(_mm256_sra_epi32(last, pixels), _mm256_set1_epi32(i32::MIN), is_empty);
    let first = _mm256_max_epi32(_mm256_sra_epi32(first, pixels), _mm256_set1_epi32(from));
    let last = _mm256_min_epi32(last, _mm256_set1_epi32(to - 1));
    let is_small = _mm256_cmpgt_epi32(_mm256_set1_epi32(EXTENT_MAX + 1), _mm256_sub_epi32(high, low));
    let is_short = _mm256_cmpgt_epi32(_mm256_set1_epi32(SHORT_MAX), _mm256_sub_epi32(last, first));
    (first, last, _mm256_and_si256(is_small, is_short))
}

/// Edges and depth.
#[inline]
#[target_feature(enable = "avx2")]
fn planes(s: &mut Setups, x: [__m256i; 3], y: [__m256i; 3], z: [__m256; 3], corner: [__m256i; 2]) {
    let sub = |a, b| _mm256_sub_epi32(a, b);
    let cross = |ax, ay, bx, by| sub(_mm256_mullo_epi32(ax, by), _mm256_mullo_epi32(bx, ay));
    let area = cross(sub(x[1], x[0]), sub(y[1], y[0]), sub(x[2], x[0]), sub(y[2], y[0]));
    // The sign of the area chooses.
    let flip = _mm256_castsi256_ps(area);
    let choose = |a: __m256i, b: __m256i| {
        _mm256_castps_si256(_mm256_blendv_ps(_mm256_castsi256_ps(a), _mm256_castsi256_ps(b), flip))
    };
    let x = [x[0], choose(x[1], x[2]), choose(x[2], x[1])];
    let y = [y[0], choose(y[1], y[2]), choose(y[2], y[1])];
    let z = [z[0], _mm256_blendv_ps(z[1], z[2], flip), _mm256_blendv_ps(z[2], z[1], flip)];
    let change = |v: &[__m256i; 3], k: usize| _mm256_cvtepi32_ps(sub(v[k], v[0]));
    let (dx1, dy1, dx2, dy2) = (change(&x, 1), change(&y, 1), change(&x, 2), change(&y, 2));
    let (dz1, dz2) = (_mm256_sub_ps(z[1], z[0]), _mm256_sub_ps(z[2], z[0]));
    let inverse = recip(_mm256_cvtepi32_ps(_mm256_abs_epi32(area)));
    let slope = |a, b, c, d| _mm256_mul_ps(_mm256_sub_ps(_mm256_mul_ps(a, b), _mm256_mul_ps(c, d)), inverse);
    s.depth = [to_floats(z[0]), to_floats(slope(dz1, dy2, dz2, dy1)), to_floats(slope(dz2, dx1, dz1, dx2))];
    let (zero, one) = (_mm256_setzero_si256(), _mm256_set1_epi32(-1));
    for k in 0..3 {
        let (dx, dy) = (sub(x[(k + 1) % 3], x[k]), sub(y[(k + 1) % 3], y[k]));
        let is_left = _mm256_cmpgt_epi32(zero, dy);
        let is_top = _mm256_and_si256(_mm256_cmpeq_epi32(dy, zero), _mm256_cmpgt_epi32(dx, zero));
        let bias = _mm256_andnot_si256(_mm256_or_si256(is_left, is_top), one);
        let at = cross(dx, dy, sub(corner[0], x[k]), sub(corner[1], y[k]));
        s.edges[k] = to_ints(_mm256_srai_epi32::<4>(_mm256_add_epi32(at, bias)));
        s.dx[k] = to_ints(dx);
        s.dy[k] = to_ints(dy);
    }
    s.from = [to_ints(sub(corner[0], x[0])), to_ints(sub(corner[1], y[0]))];
}

/// As [`recip`](super::transform::recip).
#[inline]
#[target_feature(enable = "avx2")]
fn recip(w: __m256) -> __m256 {
    let guess = _mm256_sub_epi32(_mm256_set1_epi32(0x7EF3_11C7), _mm256_castps_si256(w));
    let mut r = _mm256_castsi256_ps(guess);
    for _ in 0..4 {
        let rest = _mm256_sub_ps(_mm256_set1_ps(1.0), _mm256_mul_ps(w, r));
        r = _mm256_add_ps(r, _mm256_mul_ps(r, rest));
    }
    r
}

/// As `draw_part`.
#[target_feature(enable = "avx2")]
pub fn draw_short<const S: usize>(t: &Part, id: u32, band: &mut SampleBand) {
    let [[left, right], [top, bottom]] = t.bounds;
    let pixels = (LANES / S).max(1);
    let id = _mm256_set1_epi32(id as i32);
    let range = [_mm256_set1_ps(t.depth_range[0]), _mm256_set1_ps(t.depth_range[1])];
    let (depth, across) = (_mm256_set1_ps(t.depth[0]), _mm256_set1_ps(t.depth[1]));
    for part in 0..S.div_ceil(LANES) {
        let offsets = lane_offsets::<S>(part);
        let [offset_x, offset_y] = [from_ints(&offsets[0]), from_ints(&offsets[1])];
        let edge = |k: usize| {
            let down = _mm256_mullo_epi32(_mm256_set1_epi32(t.dx[k]), offset_y);
            let right = _mm256_mullo_epi32(_mm256_set1_epi32(t.dy[k]), offset_x);
            _mm256_add_epi32(_mm256_set1_epi32(t.edges[k]), _mm256_sub_epi32(down, right))
        };
        let edges = [edge(0), edge(1), edge(2)];
        let first_x = _mm256_add_epi32(_mm256_set1_epi32(t.from[0]), _mm256_slli_epi32::<4>(offset_x));
        let first_y = _mm256_add_epi32(_mm256_set1_epi32(t.from[1]), _mm256_slli_epi32::<4>(offset_y));
        for row in 0..=bottom - top {
            let y = _mm256_cvtepi32_ps(_mm256_add_epi32(first_y, _mm256_set1_epi32(256 * row)));
            let depth_y = _mm256_mul_ps(_mm256_set1_ps(t.depth[2]), y);
            let in_row = |k: usize| _mm256_add_epi32(edges[k], _mm256_set1_epi32(16 * t.dx[k] * row));
            let (mut e0, mut e1, mut e2) = (in_row(0), in_row(1), in_row(2));
            let mut x = first_x;
            let mut at = band.index(left, top + row, 0) + LANES * part;
            for _ in (0..=right - left).step_by(pixels) {
                let outside = _mm256_or_si256(_mm256_or_si256(e0, e1), e2);
                let plane = _mm256_add_ps(depth, _mm256_mul_ps(across, _mm256_cvtepi32_ps(x)));
                let z = _mm256_min_ps(_mm256_max_ps(_mm256_add_ps(plane, depth_y), range[0]), range[1]);
                if let Some((depths, ids)) = band.lanes_mut(at) {
                    update(outside, z, id, depths, ids);
                }
                let step = |e: __m256i, k: usize| _mm256_sub_epi32(e, _mm256_set1_epi32(16 * pixels as i32 * t.dy[k]));
                (e0, e1, e2) = (step(e0, 0), step(e1, 1), step(e2, 2));
                x = _mm256_add_epi32(x, _mm256_set1_epi32(256 * pixels as i32));
                at += pixels * S;
            }
        }
    }
}

/// As [`update`](super::nearest::update), for depths above 0.
#[inline]
#[target_feature(enable = "avx2")]
fn update(outside: __m256i, z: __m256, id: __m256i, depths: &mut [f32; LANES], ids: &mut [u32; LANES]) {
    // SAFETY: the arrays have the size of a vector, and loads and stores need no alignment. The empty
    // assembly changes nothing. It only keeps the compiler from seeing that a store keeps some of what
    // was there.
    unsafe {
        let old_depths = _mm256_loadu_ps(depths.as_ptr());
        let old_ids = _mm256_loadu_si256(ids.as_ptr().cast());
        let nearer = _mm256_cmp_ps::<_CMP_GT_OQ>(z, old_depths);
        let is_lower = _mm256_cmpeq_epi32(_mm256_min_epu32(id, old_ids), id);
        let tied = _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(z, old_depths), _mm256_castsi256_ps(is_lower));
        let change = _mm256_andnot_ps(_mm256_castsi256_ps(outside), _mm256_or_ps(nearer, tied));
        let mut new_depths = _mm256_blendv_ps(old_depths, z, change);
        let mut new_ids = _mm256_blendv_ps(_mm256_castsi256_ps(old_ids), _mm256_castsi256_ps(id), change);
        asm!("/* {0} {1} */", inout(ymm_reg) new_depths, inout(ymm_reg) new_ids, options(pure, nomem, nostack, preserves_flags));
        _mm256_storeu_ps(depths.as_mut_ptr(), new_depths);
        _mm256_storeu_ps(ids.as_mut_ptr().cast(), new_ids);
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn load3(v: &[[i32; LANES]; 3]) -> [__m256i; 3] {
    [from_ints(&v[0]), from_ints(&v[1]), from_ints(&v[2])]
}

#[inline]
#[target_feature(enable = "avx2")]
fn from_ints(v: &[i32; LANES]) -> __m256i {
    // SAFETY: the array has the size of a vector, and the load needs no alignment.
    unsafe { _mm256_loadu_si256(v.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn from_floats(v: &[f32; LANES]) -> __m256 {
    // SAFETY: as above.
    unsafe { _mm256_loadu_ps(v.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn to_ints(v: __m256i) -> [i32; LANES] {
    let mut out = [0; LANES];
    // SAFETY: the array has the size of a vector, and the store needs no alignment.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

#[inline]
#[target_feature(enable = "avx2")]
fn to_floats(v: __m256) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    // SAFETY: as above.
    unsafe { _mm256_storeu_ps(out.as_mut_ptr(), v) };
    out
}
