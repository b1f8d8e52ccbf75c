//! Insets (the parts of faces that the lines along their sides leave free) and their areas, in AVX2 instructions.
//! Each of eight faces or pixels has the same result as without AVX2.
//!
//! Written by hand because the compiler does not vectorize two steps of the plain code: the conversion of f32 to
//! integers, and minima and maxima that treat NaN as Rust does.

use std::arch::x86_64::*;

use bytemuck::must_cast;

use super::{HOLE_UNIT, Inset, Insets, LEVEL_PX, NARROW_PX};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::holes::avx2::{load_corners, recip};

/// As [`Insets::new`], of faces by id.
#[target_feature(enable = "avx2")]
pub fn insets(context: &RasterContext<'_>, ids: &[u32; LANES], half: [i32; 2], half_width: f32) -> Insets {
    let corners = load_corners(context, ids);
    let zero = _mm256_setzero_ps();
    let one = _mm256_set1_ps(1.0);
    let (mut along, mut length, mut inverse) = ([[zero; 2]; 3], [zero; 3], [zero; 3]);
    for k in 0..3 {
        for axis in 0..2 {
            along[k][axis] = _mm256_cvtepi32_ps(_mm256_sub_epi32(corners[axis][(k + 1) % 3], corners[axis][k]));
        }
        let [x, y] = along[k];
        let squared = _mm256_max_ps(_mm256_add_ps(_mm256_mul_ps(x, x), _mm256_mul_ps(y, y)), one);
        inverse[k] = rsqrt(squared);
        length[k] = _mm256_mul_ps(squared, inverse[k]);
    }
    let area = _mm256_sub_ps(_mm256_mul_ps(along[0][0], along[1][1]), _mm256_mul_ps(along[0][1], along[1][0]));
    let around = recip(_mm256_add_ps(_mm256_add_ps(length[0], length[1]), length[2]));
    let radius = _mm256_mul_ps(abs(area), around);
    let half_width = _mm256_set1_ps(half_width);
    let is_clear = _mm256_cmp_ps::<_CMP_GT_OQ>(radius, half_width);
    let turn = _mm256_blendv_ps(one, _mm256_set1_ps(-1.0), _mm256_cmp_ps::<_CMP_LT_OQ>(area, zero));
    let share = _mm256_sub_ps(one, _mm256_mul_ps(half_width, recip(_mm256_blendv_ps(one, radius, is_clear))));
    let mut insets = [[zero; 2]; 3];
    for axis in 0..2 {
        let (to_second, to_third) = (along[0][axis], negated(along[2][axis]));
        let weighted = _mm256_add_ps(_mm256_mul_ps(length[2], to_second), _mm256_mul_ps(length[0], to_third));
        let centre = _mm256_mul_ps(weighted, around);
        let place = _mm256_add_epi32(corners[axis][0], _mm256_set1_epi32(half[axis]));
        let place = _mm256_cvtepi32_ps(_mm256_and_si256(place, _mm256_set1_epi32(255)));
        for (k, from_first) in [zero, to_second, to_third].into_iter().enumerate() {
            let at = _mm256_add_ps(centre, _mm256_mul_ps(_mm256_sub_ps(from_first, centre), share));
            insets[k][axis] = _mm256_mul_ps(_mm256_add_ps(at, place), _mm256_set1_ps(1.0 / 256.0));
        }
    }
    let mut out = Insets::EMPTY;
    for k in 0..3 {
        for axis in 0..2 {
            out.corners[k][axis] = must_cast(corners[axis][k]);
            out.units[k][axis] = must_cast(_mm256_mul_ps(along[k][axis], _mm256_mul_ps(inverse[k], turn)));
            out.insets[k][axis] = must_cast(insets[k][axis]);
        }
        out.slopes[k] = must_cast(slope(insets[k], insets[(k + 1) % 3]));
    }
    out.turn = must_cast(turn);
    out.is_open = must_cast(_mm256_srli_epi32::<31>(_mm256_castps_si256(is_clear)));
    out
}

/// Slope of an inset's side; 0 where its ends are less than [`NARROW_PX`] apart across.
#[inline]
#[target_feature(enable = "avx2")]
fn slope(from: [__m256; 2], to: [__m256; 2]) -> __m256 {
    let (right, down) = (_mm256_sub_ps(to[0], from[0]), _mm256_sub_ps(to[1], from[1]));
    let is_narrow = _mm256_cmp_ps::<_CMP_LT_OQ>(abs(right), _mm256_set1_ps(NARROW_PX));
    let inverse = recip(_mm256_blendv_ps(abs(right), _mm256_set1_ps(1.0), is_narrow));
    let is_leftward = _mm256_cmp_ps::<_CMP_LT_OQ>(right, _mm256_setzero_ps());
    let slope = _mm256_mul_ps(down, inverse);
    let turned = _mm256_xor_ps(slope, _mm256_and_ps(is_leftward, _mm256_set1_ps(-0.0)));
    _mm256_andnot_ps(is_narrow, turned)
}

/// As `areas_plainly` of an inset.
#[target_feature(enable = "avx2")]
pub fn areas(inset: &Inset, lefts: &[f32; LANES], tops: &[f32; LANES]) -> [u32; LANES] {
    let (left, top) = (must_cast::<_, __m256>(*lefts), must_cast::<_, __m256>(*tops));
    let mut areas = _mm256_setzero_ps();
    for side in &inset.sides {
        let [[x0, y0], [x1, _]] = side.ends;
        let y0 = _mm256_sub_ps(_mm256_set1_ps(y0), top);
        let start = _mm256_sub_ps(_mm256_set1_ps(x0), left);
        let (from, to) = (clamp(start), clamp(_mm256_sub_ps(_mm256_set1_ps(x1), left)));
        let slope = _mm256_set1_ps(side.slope);
        let high = _mm256_add_ps(y0, _mm256_mul_ps(_mm256_sub_ps(from, start), slope));
        let low = _mm256_add_ps(y0, _mm256_mul_ps(_mm256_sub_ps(to, start), slope));
        let width = _mm256_sub_ps(to, from);
        areas = _mm256_sub_ps(areas, _mm256_mul_ps(width, mean_clamped(high, low)));
    }
    let area = clamp(_mm256_mul_ps(areas, _mm256_set1_ps(inset.turn)));
    let units = _mm256_add_ps(_mm256_mul_ps(area, _mm256_set1_ps(HOLE_UNIT)), _mm256_set1_ps(0.5));
    must_cast(_mm256_cvttps_epi32(units))
}

/// As `mean_clamped` of insets. Where `a` and `b` are equal, the mean is NaN: the first minimum turns
/// it into an end, and the last line takes the middle instead.
#[inline]
#[target_feature(enable = "avx2")]
fn mean_clamped(a: __m256, b: __m256) -> __m256 {
    let (low, high) = (clamp(a), clamp(b));
    let rise = _mm256_sub_ps(b, a);
    let mean = _mm256_div_ps(_mm256_sub_ps(integral(b, high), integral(a, low)), rise);
    let middle = _mm256_mul_ps(_mm256_set1_ps(0.5), _mm256_add_ps(low, high));
    let mean = _mm256_min_ps(_mm256_max_ps(mean, _mm256_min_ps(low, high)), _mm256_max_ps(low, high));
    _mm256_blendv_ps(middle, mean, _mm256_cmp_ps::<_CMP_GT_OQ>(abs(rise), _mm256_set1_ps(LEVEL_PX)))
}

/// As the integral of the clamped function in `mean_clamped` of insets.
#[inline]
#[target_feature(enable = "avx2")]
fn integral(v: __m256, clamped: __m256) -> __m256 {
    let beyond = _mm256_max_ps(_mm256_sub_ps(v, _mm256_set1_ps(1.0)), _mm256_setzero_ps());
    _mm256_add_ps(_mm256_mul_ps(_mm256_mul_ps(_mm256_set1_ps(0.5), clamped), clamped), beyond)
}

#[inline]
#[target_feature(enable = "avx2")]
fn clamp(v: __m256) -> __m256 {
    _mm256_min_ps(_mm256_max_ps(v, _mm256_setzero_ps()), _mm256_set1_ps(1.0))
}

#[inline]
#[target_feature(enable = "avx2")]
fn abs(v: __m256) -> __m256 {
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), v)
}

#[inline]
#[target_feature(enable = "avx2")]
fn negated(v: __m256) -> __m256 {
    _mm256_xor_ps(_mm256_set1_ps(-0.0), v)
}

/// As [`rsqrt`](crate::backend::cpu::geometry::transform::rsqrt).
#[inline]
#[target_feature(enable = "avx2")]
fn rsqrt(v: __m256) -> __m256 {
    let guess = _mm256_sub_epi32(_mm256_set1_epi32(0x5F37_59DF), _mm256_srli_epi32::<1>(_mm256_castps_si256(v)));
    let mut r = _mm256_castsi256_ps(guess);
    let half = _mm256_mul_ps(_mm256_set1_ps(0.5), v);
    for _ in 0..4 {
        let square = _mm256_mul_ps(_mm256_mul_ps(half, r), r);
        r = _mm256_mul_ps(r, _mm256_sub_ps(_mm256_set1_ps(1.5), square));
    }
    r
}
