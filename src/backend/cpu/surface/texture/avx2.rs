//! Stage shade, per place of a texture: texture lookups in AVX2 instructions. A vector holds the coordinates in both levels,
//! another the four components of a texel.
//!
//! The same bits as [`trilinear_plainly`](super::trilinear_plainly), of which compilers
//! make branches and single components.

#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::Level;
use crate::backend::cpu::geometry::transform::quick_recip;
use crate::plan::samplers;

/// As [`trilinear_plainly`](super::trilinear_plainly).
#[inline]
#[target_feature(enable = "avx2")]
pub fn trilinear(texels: &[[u16; 4]], levels: (Level, Option<(Level, f32)>), at: [f32; 2], sampler: u32) -> [f32; 4] {
    to_floats(Levels::of(levels, sampler).color(texels, at))
}

/// As [`mean_plainly`](super::mean_plainly).
#[inline]
#[target_feature(enable = "avx2")]
pub fn mean(
    texels: &[[u16; 4]],
    levels: (Level, Option<(Level, f32)>),
    (at, axis): ([f32; 2], [f32; 2]),
    taps: u32,
    sampler: u32,
) -> [f32; 4] {
    let levels = Levels::of(levels, sampler);
    let share = quick_recip(taps as f32);
    let mut sum = _mm_setzero_ps();
    for tap in 0..taps {
        let along = (tap as f32 + 0.5) * share - 0.5;
        sum = _mm_add_ps(sum, levels.color(texels, [at[0] + axis[0] * along, at[1] + axis[1] * along]));
    }
    to_floats(_mm_mul_ps(sum, _mm_set1_ps(share)))
}

/// One level or two, as places in them are found.
struct Levels {
    levels: [Level; 2],
    count: usize,
    /// Of the second level.
    share: f32,
    /// Wrap modes across and down, twice.
    modes: __m128i,
    /// Columns and rows of both levels.
    sizes: __m128i,
}

impl Levels {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn of((level, next): (Level, Option<(Level, f32)>), sampler: u32) -> Self {
        let (second, share) = next.unwrap_or((level, 0.0));
        let [across, down] = [sampler, sampler >> samplers::DOWN_SHIFT].map(|v| (v & samplers::WRAP_BITS) as i32);
        Self {
            levels: [level, second],
            count: 1 + usize::from(next.is_some()),
            share,
            modes: _mm_setr_epi32(across, down, across, down),
            sizes: _mm_setr_epi32(level.size[0], level.size[1], second.size[0], second.size[1]),
        }
    }

    /// The colour at a place.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn color(&self, texels: &[[u16; 4]], [u, v]: [f32; 2]) -> __m128 {
        let repeats = _mm_cmpeq_epi32(self.modes, _mm_set1_epi32(samplers::REPEAT as i32));
        // Columns and rows of the texels before the place and after it, and the shares of the latter.
        let at = _mm_mul_ps(wrapped(_mm_setr_ps(u, v, u, v), self.modes), _mm_cvtepi32_ps(self.sizes));
        let at = _mm_sub_ps(at, _mm_set1_ps(0.5));
        let before = _mm_floor_ps(at);
        let shares = to_floats(_mm_sub_ps(at, before));
        let before = _mm_cvttps_epi32(before);
        let after = _mm_add_epi32(before, _mm_set1_epi32(1));
        let (before, after) =
            (to_ints(within(before, self.sizes, repeats)), to_ints(within(after, self.sizes, repeats)));
        let mut colors = [_mm_setzero_ps(); 2];
        for (i, color) in colors.iter_mut().enumerate().take(self.count) {
            let Level { first, size } = self.levels[i];
            let (left, right) = (before[2 * i] as u32, after[2 * i] as u32);
            let upper = first.wrapping_add(before[2 * i + 1].wrapping_mul(size[0]) as u32);
            let lower = first.wrapping_add(after[2 * i + 1].wrapping_mul(size[0]) as u32);
            let across = _mm_set1_ps(shares[2 * i]);
            let above = mix(texel(texels, upper.wrapping_add(left)), texel(texels, upper.wrapping_add(right)), across);
            let below = mix(texel(texels, lower.wrapping_add(left)), texel(texels, lower.wrapping_add(right)), across);
            *color = mix(above, below, _mm_set1_ps(shares[2 * i + 1]));
        }
        if self.count > 1 { mix(colors[0], colors[1], _mm_set1_ps(self.share)) } else { colors[0] }
    }
}

/// Coordinates in 0 to 1.
#[inline]
#[target_feature(enable = "avx2")]
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
#[target_feature(enable = "avx2")]
fn within(i: __m128i, sizes: __m128i, repeats: __m128i) -> __m128i {
    let zero = _mm_setzero_si128();
    let last = _mm_sub_epi32(sizes, _mm_set1_epi32(1));
    let clamped = _mm_max_epi32(_mm_min_epi32(i, last), zero);
    let added = _mm_and_si128(_mm_cmpgt_epi32(zero, i), sizes);
    let taken = _mm_and_si128(_mm_cmpgt_epi32(i, last), sizes);
    _mm_blendv_epi8(clamped, _mm_sub_epi32(_mm_add_epi32(i, added), taken), repeats)
}

/// A texel; white beyond the last.
#[inline]
#[target_feature(enable = "avx2")]
fn texel(texels: &[[u16; 4]], index: u32) -> __m128 {
    let Some(texel) = texels.get(index as usize) else { return _mm_set1_ps(1.0) };
    // SAFETY: the array has the 64 bits that are loaded, and the load needs no alignment.
    let halves = _mm_cvtepu16_epi32(unsafe { _mm_loadl_epi64(texel.as_ptr().cast()) });
    let size = _mm_slli_epi32::<13>(_mm_and_si128(halves, _mm_set1_epi32(0x7FFF)));
    let exponents = _mm_castsi128_ps(_mm_set1_epi32((112 + 127) << 23));
    let sign = _mm_slli_epi32::<16>(_mm_and_si128(halves, _mm_set1_epi32(0x8000)));
    _mm_or_ps(_mm_mul_ps(_mm_castsi128_ps(size), exponents), _mm_castsi128_ps(sign))
}

#[inline]
#[target_feature(enable = "avx2")]
fn mix(a: __m128, b: __m128, share: __m128) -> __m128 {
    _mm_add_ps(a, _mm_mul_ps(_mm_sub_ps(b, a), share))
}

#[inline]
#[target_feature(enable = "avx2")]
fn to_floats(v: __m128) -> [f32; 4] {
    let mut out = [0.0; 4];
    // SAFETY: the array has the size of a vector, and the store needs no alignment.
    unsafe { _mm_storeu_ps(out.as_mut_ptr(), v) };
    out
}

#[inline]
#[target_feature(enable = "avx2")]
fn to_ints(v: __m128i) -> [i32; 4] {
    let mut out = [0; 4];
    // SAFETY: the array has the size of a vector, and the store needs no alignment.
    unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), v) };
    out
}
