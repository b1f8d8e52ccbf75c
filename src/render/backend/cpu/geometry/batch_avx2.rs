//! Stage visibility: the steps of `batch` and `setups` in AVX2 instructions, lane for lane the
//! same. Compilers make worse of the loops there: parts of vectors, and masked stores, which take
//! several times as long on some processors.

#![allow(unsafe_code)]

use std::arch::asm;
use std::arch::x86_64::*;

use super::samples::{SampleBand, SampleGrid};
use super::setups::{Boxes, EXTENT_MAX, SHORT_MAX, SIZES, Setups, class, lane_offsets};
use super::transform::ScreenVertex;
use super::visibility::Parts;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// Corners of eight triangles.
pub struct Corners {
    pub x: [__m256i; 3],
    pub y: [__m256i; 3],
    pub z: [__m256; 3],
}

/// As `Corners::load`.
#[inline]
#[target_feature(enable = "avx2")]
pub fn load_corners(context: &RasterContext<'_>, ids: &[u32; LANES]) -> Corners {
    load(context.vertices, &context.indices_of(ids))
}

/// Corners of triangles by the indices of their vertices.
#[inline]
#[target_feature(enable = "avx2")]
pub fn load(vertices: &[ScreenVertex], triangles: &[[u32; 3]; LANES]) -> Corners {
    let (mut x, mut y, mut z) = ([_mm256_setzero_si256(); 3], [_mm256_setzero_si256(); 3], [_mm256_setzero_ps(); 3]);
    for k in 0..3 {
        let vertex = |l: usize| from_vertex(&vertices[triangles[l][k] as usize]);
        let pair = |l: usize| _mm256_set_m128i(vertex(l + 4), vertex(l));
        let (a, b, c, d) = (pair(0), pair(1), pair(2), pair(3));
        let (ab, cd) = (_mm256_unpacklo_epi32(a, b), _mm256_unpacklo_epi32(c, d));
        x[k] = _mm256_unpacklo_epi64(ab, cd);
        y[k] = _mm256_unpackhi_epi64(ab, cd);
        let (ab, cd) = (_mm256_unpackhi_epi32(a, b), _mm256_unpackhi_epi32(c, d));
        z[k] = _mm256_castsi256_ps(_mm256_unpacklo_epi64(ab, cd));
    }
    Corners { x, y, z }
}

/// As `Boxes::new`.
#[target_feature(enable = "avx2")]
pub fn boxes<const S: usize>(context: &RasterContext<'_>, ids: &[u32; LANES], band: &SampleBand) -> Boxes {
    let Corners { x, y, z } = load_corners(context, ids);
    let [columns, rows] = band.range();
    let half = [band.size_px[0] as i32 * 128, band.size_px[1] as i32 * 128];
    let (left, right, _) = bounds::<S>(&x, half[0], columns);
    let (top, bottom, _) = bounds::<S>(&y, half[1], rows);
    Boxes {
        bounds: [[to_ints(left), to_ints(right)], [to_ints(top), to_ints(bottom)]],
        depth_max: to_floats(_mm256_max_ps(_mm256_max_ps(z[0], z[1]), z[2])),
    }
}

/// As `Setups::new`.
#[target_feature(enable = "avx2")]
pub fn set_up<const S: usize>(context: &RasterContext<'_>, ids: &[u32; LANES], band: &SampleBand, s: &mut Setups) {
    let Corners { x, y, z } = load_corners(context, ids);
    let [columns, rows] = band.range();
    let half = [band.size_px[0] as i32 * 128, band.size_px[1] as i32 * 128];
    let (left, right, is_narrow) = bounds::<S>(&x, half[0], columns);
    let (top, bottom, is_low) = bounds::<S>(&y, half[1], rows);
    let depth_min = _mm256_min_ps(_mm256_min_ps(z[0], z[1]), z[2]);
    let depth_max = _mm256_max_ps(_mm256_max_ps(z[0], z[1]), z[2]);
    let is_deep = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_GT_OQ>(depth_min, _mm256_setzero_ps()));
    let is_short = _mm256_and_si256(_mm256_and_si256(is_narrow, is_low), is_deep);
    s.classes = to_ints(classes::<S>([left, right], [top, bottom], is_short));
    s.parts.bounds = [[to_ints(left), to_ints(right)], [to_ints(top), to_ints(bottom)]];
    s.parts.depth_range = [to_floats(depth_min), to_floats(depth_max)];
    let shift = sample_offsets(S as u32)[0][0] & 15;
    let corner =
        |first: __m256i, half: i32| _mm256_add_epi32(_mm256_slli_epi32::<8>(first), _mm256_set1_epi32(shift - half));
    planes(&mut s.parts, x, y, z, [corner(left, half[0]), corner(top, half[1])]);
}

#[inline]
#[target_feature(enable = "avx2")]
fn classes<const S: usize>(columns: [__m256i; 2], rows: [__m256i; 2], is_short: __m256i) -> __m256i {
    let is_empty = _mm256_or_si256(_mm256_cmpgt_epi32(columns[0], columns[1]), _mm256_cmpgt_epi32(rows[0], rows[1]));
    let pixels = ((LANES / S).max(1) as i32).trailing_zeros() as i32;
    let vectors = _mm256_sra_epi32(_mm256_sub_epi32(columns[1], columns[0]), _mm_cvtsi32_si128(pixels));
    let rows = _mm256_sub_epi32(rows[1], rows[0]);
    let sizes = _mm256_set1_epi32(SIZES);
    let is_small = _mm256_and_si256(_mm256_cmpgt_epi32(sizes, rows), _mm256_cmpgt_epi32(sizes, vectors));
    let small = _mm256_add_epi32(_mm256_mullo_epi32(rows, sizes), vectors);
    let short = _mm256_blendv_epi8(_mm256_set1_epi32(class::SHORT), small, is_small);
    let any = _mm256_blendv_epi8(_mm256_set1_epi32(class::LONG), short, is_short);
    _mm256_blendv_epi8(any, _mm256_set1_epi32(class::EMPTY), is_empty)
}

/// First and last pixel along an axis, and which lanes are short along it.
#[inline]
#[target_feature(enable = "avx2")]
fn bounds<const S: usize>(v: &[__m256i; 3], half: i32, [from, to]: [i32; 2]) -> (__m256i, __m256i, __m256i) {
    let grid = SampleGrid::new(S as u32);
    let low = _mm256_min_epi32(_mm256_min_epi32(v[0], v[1]), v[2]);
    let high = _mm256_max_epi32(_mm256_max_epi32(v[0], v[1]), v[2]);
    let [first, last] = pixels([low, high], half, grid, [from, to]);
    let is_small = _mm256_cmpgt_epi32(_mm256_set1_epi32(EXTENT_MAX + 1), _mm256_sub_epi32(high, low));
    let is_short = _mm256_cmpgt_epi32(_mm256_set1_epi32(SHORT_MAX), _mm256_sub_epi32(last, first));
    (first, last, _mm256_and_si256(is_small, is_short))
}

/// As `pixels` of the grid, of coordinates from the picture's centre, which is `half` from its
/// corner.
#[inline]
#[target_feature(enable = "avx2")]
pub fn pixels([low, high]: [__m256i; 2], half: i32, grid: SampleGrid, [from, to]: [i32; 2]) -> [__m256i; 2] {
    let (cells, pixels) = (_mm_cvtsi32_si128(8 - grid.shift), _mm_cvtsi32_si128(grid.shift));
    let first = _mm256_sra_epi32(_mm256_add_epi32(low, _mm256_set1_epi32(half + grid.border - 1)), cells);
    let last = _mm256_sra_epi32(_mm256_add_epi32(high, _mm256_set1_epi32(half - grid.border)), cells);
    let is_empty = _mm256_cmpgt_epi32(first, last);
    let last = _mm256_blendv_epi8(_mm256_sra_epi32(last, pixels), _mm256_set1_epi32(i32::MIN), is_empty);
    let first = _mm256_max_epi32(_mm256_sra_epi32(first, pixels), _mm256_set1_epi32(from));
    [first, _mm256_min_epi32(last, _mm256_set1_epi32(to - 1))]
}

/// Edges and depth.
#[inline]
#[target_feature(enable = "avx2")]
fn planes(s: &mut Parts<LANES>, x: [__m256i; 3], y: [__m256i; 3], z: [__m256; 3], corner: [__m256i; 2]) {
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

/// Columns of four rows, in each half.
#[inline]
#[target_feature(enable = "avx2")]
pub fn transposed([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    let double = |v: __m256| _mm256_castps_pd(v);
    let single = |v: __m256d| _mm256_castpd_ps(v);
    let (ab, cd) = (double(_mm256_unpacklo_ps(a, b)), double(_mm256_unpacklo_ps(c, d)));
    let (ab_high, cd_high) = (double(_mm256_unpackhi_ps(a, b)), double(_mm256_unpackhi_ps(c, d)));
    [
        single(_mm256_unpacklo_pd(ab, cd)),
        single(_mm256_unpackhi_pd(ab, cd)),
        single(_mm256_unpacklo_pd(ab_high, cd_high)),
        single(_mm256_unpackhi_pd(ab_high, cd_high)),
    ]
}

/// As [`recip`](super::transform::recip).
#[inline]
#[target_feature(enable = "avx2")]
pub fn recip(w: __m256) -> __m256 {
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
pub fn draw_lane<const S: usize, const N: usize>(t: &Parts<N>, l: usize, id: u32, band: &mut SampleBand) {
    let [[left, right], [top, bottom]] = t.bounds_of(l);
    let pixels = (LANES / S).max(1);
    let (rows, vectors) = ((bottom - top) as u32 as usize, (right - left) as u32 as usize / pixels);
    // From the first sample to the end of the last vector.
    let (first, stride) = (band.index(left, top, 0), band.stride);
    let width = vectors * (pixels * S) + LANES * S.div_ceil(LANES);
    let end = rows.saturating_mul(stride).saturating_add(width).saturating_add(first);
    let Some(depths) = band.depth.get_mut(first..end) else { return };
    let Some(ids) = band.ids.get_mut(first..end) else { return };
    let id = _mm256_set1_epi32(id as i32);
    let range = [_mm256_set1_ps(t.depth_range[0][l]), _mm256_set1_ps(t.depth_range[1][l])];
    let (depth, across) = (_mm256_set1_ps(t.depth[0][l]), _mm256_set1_ps(t.depth[1][l]));
    for part in 0..S.div_ceil(LANES) {
        let offsets = lane_offsets::<S>(part);
        let [offset_x, offset_y] = [from_ints(&offsets[0]), from_ints(&offsets[1])];
        let edge = |k: usize| {
            let down = _mm256_mullo_epi32(_mm256_set1_epi32(t.dx[k][l]), offset_y);
            let right = _mm256_mullo_epi32(_mm256_set1_epi32(t.dy[k][l]), offset_x);
            _mm256_add_epi32(_mm256_set1_epi32(t.edges[k][l]), _mm256_sub_epi32(down, right))
        };
        let mut edges = [edge(0), edge(1), edge(2)];
        let down = |k: usize| _mm256_set1_epi32(16 * t.dx[k][l]);
        let right = |k: usize| _mm256_set1_epi32(16 * pixels as i32 * t.dy[k][l]);
        let (downs, rights) = ([down(0), down(1), down(2)], [right(0), right(1), right(2)]);
        let first_x = _mm256_add_epi32(_mm256_set1_epi32(t.from[0][l]), _mm256_slli_epi32::<4>(offset_x));
        let mut y = _mm256_add_epi32(_mm256_set1_epi32(t.from[1][l]), _mm256_slli_epi32::<4>(offset_y));
        for row in 0..=rows {
            let depth_y = _mm256_mul_ps(_mm256_set1_ps(t.depth[2][l]), _mm256_cvtepi32_ps(y));
            let [mut e0, mut e1, mut e2] = edges;
            let mut x = first_x;
            for vector in 0..=vectors {
                let outside = _mm256_or_si256(_mm256_or_si256(e0, e1), e2);
                let plane = _mm256_add_ps(depth, _mm256_mul_ps(across, _mm256_cvtepi32_ps(x)));
                let z = _mm256_min_ps(_mm256_max_ps(_mm256_add_ps(plane, depth_y), range[0]), range[1]);
                let at = row * stride + vector * (pixels * S) + LANES * part;
                // SAFETY: `at + LANES` is at most `rows * stride + width`, the length of both slices:
                // `row` is at most `rows`, `vector` at most `vectors`.
                unsafe { update(outside, z, id, depths.as_mut_ptr().add(at), ids.as_mut_ptr().add(at)) };
                (e0, e1, e2) =
                    (_mm256_sub_epi32(e0, rights[0]), _mm256_sub_epi32(e1, rights[1]), _mm256_sub_epi32(e2, rights[2]));
                x = _mm256_add_epi32(x, _mm256_set1_epi32(256 * pixels as i32));
            }
            for k in 0..3 {
                edges[k] = _mm256_add_epi32(edges[k], downs[k]);
            }
            y = _mm256_add_epi32(y, _mm256_set1_epi32(256));
        }
    }
}

/// As [`update`](super::nearest::update), for depths above 0.
///
/// # Safety
///
/// From both pointers on, [`LANES`] values may be read and written.
#[inline]
#[target_feature(enable = "avx2")]
unsafe fn update(outside: __m256i, z: __m256, id: __m256i, depths: *mut f32, ids: *mut u32) {
    // SAFETY: the caller vouches for the pointers, and loads and stores need no alignment. The empty
    // assembly changes nothing. It only keeps the compiler from seeing that a store keeps some of what
    // was there.
    unsafe {
        let old_depths = _mm256_loadu_ps(depths);
        let old_ids = _mm256_loadu_si256(ids.cast());
        let nearer = _mm256_cmp_ps::<_CMP_GT_OQ>(z, old_depths);
        let is_lower = _mm256_cmpeq_epi32(_mm256_min_epu32(id, old_ids), id);
        let tied = _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(z, old_depths), _mm256_castsi256_ps(is_lower));
        let change = _mm256_andnot_ps(_mm256_castsi256_ps(outside), _mm256_or_ps(nearer, tied));
        let mut new_depths = _mm256_blendv_ps(old_depths, z, change);
        let mut new_ids = _mm256_blendv_ps(_mm256_castsi256_ps(old_ids), _mm256_castsi256_ps(id), change);
        asm!("/* {0} {1} */", inout(ymm_reg) new_depths, inout(ymm_reg) new_ids, options(pure, nomem, nostack, preserves_flags));
        _mm256_storeu_ps(depths, new_depths);
        _mm256_storeu_ps(ids.cast(), new_ids);
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn from_vertex(v: &ScreenVertex) -> __m128i {
    const { assert!(size_of::<ScreenVertex>() == size_of::<__m128i>()) };
    // SAFETY: the vertex has the size of a vector and no padding, and the load needs no alignment.
    unsafe { _mm_loadu_si128(std::ptr::from_ref(v).cast()) }
}

#[inline]
#[target_feature(enable = "avx2")]
fn from_ints(v: &[i32; LANES]) -> __m256i {
    // SAFETY: the array has the size of a vector, and the load needs no alignment.
    unsafe { _mm256_loadu_si256(v.as_ptr().cast()) }
}

/// A bit for each lane, its highest.
#[inline]
#[target_feature(enable = "avx2")]
pub fn bits(v: __m256i) -> u32 {
    _mm256_movemask_ps(_mm256_castsi256_ps(v)) as u32
}

/// The lanes of a vector.
#[inline]
#[target_feature(enable = "avx2")]
pub fn to_ints(v: __m256i) -> [i32; LANES] {
    let mut out = [0; LANES];
    // SAFETY: the array has the size of a vector, and the store needs no alignment.
    unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), v) };
    out
}

/// The same, of numbers without a sign.
#[inline]
#[target_feature(enable = "avx2")]
pub fn to_words(v: __m256i) -> [u32; LANES] {
    to_ints(v).map(|lane| lane as u32)
}

/// A vector of such lanes.
#[inline]
#[target_feature(enable = "avx2")]
pub fn from_words(v: &[u32; LANES]) -> __m256i {
    // SAFETY: the array has the size of a vector, and the load needs no alignment.
    unsafe { _mm256_loadu_si256(v.as_ptr().cast()) }
}

/// A vector of such lanes.
#[inline]
#[target_feature(enable = "avx2")]
pub fn from_floats(v: &[f32; LANES]) -> __m256 {
    // SAFETY: the array has the size of a vector, and the load needs no alignment.
    unsafe { _mm256_loadu_ps(v.as_ptr()) }
}

/// The lanes of a vector.
#[inline]
#[target_feature(enable = "avx2")]
pub fn to_floats(v: __m256) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    // SAFETY: as above.
    unsafe { _mm256_storeu_ps(out.as_mut_ptr(), v) };
    out
}
