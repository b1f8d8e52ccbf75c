//! The transform of vertices from the mesh's unit box to screen coordinates and depth (stage transform). Screen
//! coordinates are rounded to whole 1/256 px. Twin of `shaders/geometry/transform.wgsl`.
//!
//! The results have the same bits on every machine and on both back-ends: only `+ - *` are used, each rounded by
//! itself (docs/rasterizer.md, "Rounded operations"). Reciprocals and roots of this kind are here too; other stages
//! use them.

use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::Projection;
pub use crate::plan::ScreenVertex;

/// Farthest a snapped coordinate may lie from the picture's centre, in 1/256 px: 4096 px.
pub const GUARD: f32 = 1_048_576.0;

/// `x` of a vertex that is behind the near plane or beyond the guard band.
pub const OUTSIDE: i32 = i32::MIN;

impl ScreenVertex {
    /// True if the vertex cannot be drawn without clipping.
    #[inline(always)]
    pub fn is_outside(&self) -> bool {
        self.x == OUTSIDE
    }
}

/// `1 / w` for positive normal `w`, the same bits everywhere: Newton's iteration from an integer
/// guess.
#[inline(always)]
pub fn recip(w: f32) -> f32 {
    let mut r = f32::from_bits(0x7EF3_11C7_u32.wrapping_sub(w.to_bits()));
    for _ in 0..4 {
        // The residual is exact close to the end, so that recip(1) is 1 and not the number below
        // it.
        r += r * (1.0 - w * r);
    }
    r
}

/// `1 / w` for positive normal `w`, the same bits everywhere, for colours: an iteration less.
#[inline(always)]
pub fn quick_recip(w: f32) -> f32 {
    let r = f32::from_bits(0x7EF3_11C7_u32.wrapping_sub(w.to_bits()));
    let r = r * (2.0 - w * r);
    let r = r * (2.0 - w * r);
    r * (2.0 - w * r)
}

/// `1 / sqrt(v)` for positive normal `v`, the same bits everywhere.
#[inline(always)]
pub fn rsqrt(v: f32) -> f32 {
    let mut r = f32::from_bits(0x5F37_59DF_u32.wrapping_sub(v.to_bits() >> 1));
    for _ in 0..4 {
        r *= 1.5 - (0.5 * v) * r * r;
    }
    r
}

/// `1 / sqrt(v)` for positive normal `v` within 5e-6 of it, the same bits everywhere.
#[inline(always)]
pub fn quick_rsqrt(v: f32) -> f32 {
    let r = f32::from_bits(0x5F37_59DF_u32.wrapping_sub(v.to_bits() >> 1));
    let half = 0.5 * v;
    let r = r * (1.5 - (half * r) * r);
    r * (1.5 - (half * r) * r)
}

/// To the nearest integer, ties to even, for |v| < 2^22: adding 1.5 * 2^23 leaves the integer in
/// the low bits.
#[inline(always)]
pub fn round_to_i32(v: f32) -> i32 {
    ((v + 12_582_912.0).to_bits() as i32).wrapping_sub(0x4B40_0000)
}

/// `row . (p, 1)`.
#[inline(always)]
pub fn row_dot(row: &[f32; 4], p: [f32; 3]) -> f32 {
    ((row[0] * p[0] + row[1] * p[1]) + row[2] * p[2]) + row[3]
}

/// Homogeneous screen position: X, Y, Z, W.
#[inline(always)]
pub fn homogeneous(projection: &Projection, p: [f32; 3]) -> [f32; 4] {
    [row_dot(&projection.x, p), row_dot(&projection.y, p), row_dot(&projection.z, p), row_dot(&projection.w, p)]
}

dispatch! {
    /// Transforms `positions` into `out`, of the same length.
    pub fn transform(projection: &Projection, positions: &[[f32; 3]], out: &mut [ScreenVertex]) = transform_lanes
}

#[inline(always)]
fn transform_lanes(projection: &Projection, positions: &[[f32; 3]], out: &mut [ScreenVertex]) {
    let mut groups = positions.chunks_exact(LANES);
    let mut outs = out.chunks_exact_mut(LANES);
    for (group, slots) in (&mut groups).zip(&mut outs) {
        // Vertex by vertex inside a fixed-size loop: the compiler turns this into one vector a
        // component.
        let mut records = [ScreenVertex::default(); LANES];
        for lane in 0..LANES {
            records[lane] = transform_one(projection, group[lane]);
        }
        slots.copy_from_slice(&records);
    }
    for (position, slot) in groups.remainder().iter().zip(outs.into_remainder()) {
        *slot = transform_one(projection, *position);
    }
}

#[inline(always)]
fn transform_one(projection: &Projection, p: [f32; 3]) -> ScreenVertex {
    let [x, y, z, w] = homogeneous(projection, p);
    let r = recip(w);
    let (sx, sy) = (x * r, y * r);
    // One test with non-short-circuiting ands; NaN compares false and lands outside.
    let inside = (w >= projection.near_w) & (sx.abs() <= GUARD) & (sy.abs() <= GUARD);
    if inside {
        ScreenVertex { x: round_to_i32(sx), y: round_to_i32(sy), z: z * r, inv_w: r }
    } else {
        ScreenVertex { x: OUTSIDE, y: 0, z: 0.0, inv_w: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recip_and_rsqrt_are_within_two_ulp() {
        let mut cases = 0;
        for i in 0..100_000_u32 {
            let v = f32::from_bits(0x2000_0000 + i * 10_007 % 0x3F00_0000);
            let (r, s) = (f64::from(recip(v)), f64::from(rsqrt(v)));
            assert!((r * f64::from(v) - 1.0).abs() < 1.2e-7, "recip({v})");
            let quick = f64::from(quick_recip(v));
            assert!((quick * f64::from(v) - 1.0).abs() < 2e-7, "quick_recip({v})");
            assert!((s * s * f64::from(v) - 1.0).abs() < 6e-7, "rsqrt({v})");
            cases += 1;
        }
        assert_eq!(cases, 100_000);
        assert_eq!(recip(1.0), 1.0);
    }

    #[test]
    fn rounds_to_nearest_even() {
        for (v, want) in [(0.0, 0), (0.5, 0), (1.5, 2), (-0.5, 0), (-1.5, -2), (-2.6, -3), (1_048_575.5, 1_048_576)] {
            assert_eq!(round_to_i32(v), want, "{v}");
        }
    }
}
