//! Helpers in AVX2 instructions for eight numbers at a time: they load corners of triangles, compute reciprocals, and
//! collect signs as bits. The modules `inset` and `dig`, which find the areas of faces that lines leave free, use
//! them.

use std::arch::x86_64::*;

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;

/// Columns, and rows, of the corners of triangles.
#[inline]
#[target_feature(enable = "avx2")]
pub fn load_corners(context: &RasterContext<'_>, ids: &[u32; LANES]) -> [[__m256i; 3]; 2] {
    let triangles = context.indices_of(ids);
    let mut corners = [[_mm256_setzero_si256(); 3]; 2];
    for k in 0..3 {
        let vertex = |l: usize| bytemuck::must_cast(context.vertices[triangles[l][k] as usize]);
        let pair = |l: usize| _mm256_set_m128i(vertex(l + 4), vertex(l));
        let (ab, cd) = (_mm256_unpacklo_epi32(pair(0), pair(1)), _mm256_unpacklo_epi32(pair(2), pair(3)));
        corners[0][k] = _mm256_unpacklo_epi64(ab, cd);
        corners[1][k] = _mm256_unpackhi_epi64(ab, cd);
    }
    corners
}

/// As [`recip`](crate::backend::cpu::geometry::transform::recip).
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

/// A bit for each lane, its highest.
#[inline]
#[target_feature(enable = "avx2")]
pub fn bits(v: __m256i) -> u32 {
    _mm256_movemask_ps(_mm256_castsi256_ps(v)) as u32
}
