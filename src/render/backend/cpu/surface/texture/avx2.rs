//! Texture lookups in AVX2 and F16C instructions (stage shade). One vector holds the texture coordinates of a place
//! in two mip levels, or of two places in the part of a texture that a pixel covers. Another holds the four
//! components of a texel.
//!
//! The results have the same bits as those of [`trilinear_plainly`](super::trilinear_plainly) and
//! [`mean_plainly`](super::mean_plainly), from which compilers make slower code, with branches and one component at
//! a time.

use std::arch::x86_64::*;

use bytemuck::must_cast;

use super::{Level, Places};
use crate::backend::cpu::geometry::transform::quick_recip;
use crate::plan::samplers;

/// As [`trilinear_plainly`](super::trilinear_plainly).
#[inline]
#[target_feature(enable = "avx2,f16c")]
pub fn trilinear(
    texels: &[[u16; 4]],
    (level, next): (Level, Option<(Level, f32)>),
    [u, v]: [f32; 2],
    sampler: u32,
) -> [f32; 4] {
    let (second, share) = next.unwrap_or((level, 0.0));
    let sizes = _mm_setr_epi32(level.size[0], level.size[1], second.size[0], second.size[1]);
    let pair = Pair::of(_mm_setr_ps(u, v, u, v), sizes, modes(sampler));
    let color = pair.color(texels, 0, &level);
    if next.is_none() {
        return must_cast(color);
    }
    must_cast(mix(color, pair.color(texels, 1, &second), _mm_set1_ps(share)))
}

/// As [`mean_plainly`](super::mean_plainly) of [`bilinear`](super::bilinear).
#[inline]
#[target_feature(enable = "avx2,f16c")]
pub fn mean(texels: &[[u16; 4]], places: &Places, sampler: u32) -> [f32; 4] {
    let modes = modes(sampler);
    let sizes = places.levels.map(|level| _mm_setr_epi32(level.size[0], level.size[1], 0, 0));
    let mut sum = _mm_setzero_ps();
    let mut places_left = places.iter();
    while let Some(([u, v], first)) = places_left.next() {
        let next = places_left.next();
        let ([next_u, next_v], second) = next.unwrap_or(([u, v], first));
        let sizes = _mm_unpacklo_epi64(sizes[first], sizes[second]);
        let pair = Pair::of(_mm_setr_ps(u, v, next_u, next_v), sizes, modes);
        sum = _mm_add_ps(sum, pair.color(texels, 0, &places.levels[first]));
        if next.is_some() {
            sum = _mm_add_ps(sum, pair.color(texels, 1, &places.levels[second]));
        }
    }
    must_cast(_mm_mul_ps(sum, _mm_set1_ps(quick_recip(places.taps as f32))))
}

/// Two places, each in a level, and the texels around them.
struct Pair {
    /// Columns and rows of the texels before the places and after them.
    before: [i32; 4],
    after: [i32; 4],
    /// Shares of the latter.
    shares: [f32; 4],
}

impl Pair {
    /// Places with columns and rows of their levels, and the wrap modes: across and down, twice.
    #[inline]
    #[target_feature(enable = "avx2,f16c")]
    fn of(at: __m128, sizes: __m128i, modes: __m128i) -> Self {
        let repeats = _mm_cmpeq_epi32(modes, _mm_set1_epi32(samplers::REPEAT as i32));
        let at = _mm_mul_ps(wrapped(at, modes), _mm_cvtepi32_ps(sizes));
        let at = _mm_sub_ps(at, _mm_set1_ps(0.5));
        let floor = _mm_floor_ps(at);
        let before = _mm_cvttps_epi32(floor);
        let after = _mm_add_epi32(before, _mm_set1_epi32(1));
        Self {
            before: must_cast(within(before, sizes, repeats)),
            after: must_cast(within(after, sizes, repeats)),
            shares: must_cast(_mm_sub_ps(at, floor)),
        }
    }

    /// The colour at one of the places, bilinear in its level.
    #[inline]
    #[target_feature(enable = "avx2,f16c")]
    fn color(&self, texels: &[[u16; 4]], i: usize, &Level { first, size }: &Level) -> __m128 {
        let (left, right) = (self.before[2 * i] as u32, self.after[2 * i] as u32);
        let upper = first.wrapping_add(self.before[2 * i + 1].wrapping_mul(size[0]) as u32);
        let lower = first.wrapping_add(self.after[2 * i + 1].wrapping_mul(size[0]) as u32);
        let across = _mm_set1_ps(self.shares[2 * i]);
        let above = mix(texel(texels, upper.wrapping_add(left)), texel(texels, upper.wrapping_add(right)), across);
        let below = mix(texel(texels, lower.wrapping_add(left)), texel(texels, lower.wrapping_add(right)), across);
        mix(above, below, _mm_set1_ps(self.shares[2 * i + 1]))
    }
}

/// The wrap modes across and down, twice.
#[inline]
#[target_feature(enable = "avx2,f16c")]
fn modes(sampler: u32) -> __m128i {
    let [across, down] = [sampler, sampler >> samplers::DOWN_SHIFT].map(|v| (v & samplers::WRAP_BITS) as i32);
    _mm_setr_epi32(across, down, across, down)
}

/// Coordinates in 0 to 1.
#[inline]
#[target_feature(enable = "avx2,f16c")]
fn wrapped(u: __m128, modes: __m128i) -> __m128 {
    let (one, sign) = (_mm_set1_ps(1.0), _mm_set1_ps(-0.0));
    let repeated = _mm_sub_ps(u, _mm_floor_ps(u));
    let turns = _mm_floor_ps(_mm_mul_ps(_mm_set1_ps(0.5), u));
    let in_turn = _mm_sub_ps(u, _mm_mul_ps(_mm_set1_ps(2.0), turns));
    let mirrored = _mm_sub_ps(one, _mm_andnot_ps(sign, _mm_sub_ps(in_turn, one)));
    let clamped = _mm_min_ps(_mm_max_ps(u, _mm_setzero_ps()), one);
    let is = |mode: u32| _mm_castsi128_ps(_mm_cmpeq_epi32(modes, _mm_set1_epi32(mode as i32)));
    let wrapped = _mm_blendv_ps(clamped, mirrored, is(samplers::MIRROR));
    _mm_blendv_ps(wrapped, repeated, is(samplers::REPEAT))
}

/// Columns or rows of texels that may lie one beyond the edge.
#[inline]
#[target_feature(enable = "avx2,f16c")]
fn within(i: __m128i, sizes: __m128i, repeats: __m128i) -> __m128i {
    let zero = _mm_setzero_si128();
    let last = _mm_sub_epi32(sizes, _mm_set1_epi32(1));
    let clamped = _mm_max_epi32(_mm_min_epi32(i, last), zero);
    let added = _mm_and_si128(_mm_cmpgt_epi32(zero, i), sizes);
    let taken = _mm_and_si128(_mm_cmpgt_epi32(i, last), sizes);
    _mm_blendv_epi8(clamped, _mm_sub_epi32(_mm_add_epi32(i, added), taken), repeats)
}

/// A texel; white beyond the last. As `half_to_f32` for finite halves, and no texel is anything else.
#[inline]
#[target_feature(enable = "avx2,f16c")]
fn texel(texels: &[[u16; 4]], index: u32) -> __m128 {
    let Some(texel) = texels.get(index as usize) else { return _mm_set1_ps(1.0) };
    _mm_cvtph_ps(_mm_cvtsi64_si128(must_cast(*texel)))
}

#[inline]
#[target_feature(enable = "avx2,f16c")]
fn mix(a: __m128, b: __m128, share: __m128) -> __m128 {
    _mm_add_ps(a, _mm_mul_ps(_mm_sub_ps(b, a), share))
}
