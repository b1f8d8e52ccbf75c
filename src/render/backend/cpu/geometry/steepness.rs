//! Numbers for comparisons of depths: the tolerance for rounding, and the steepness of a triangle, which is the
//! change of its depth per 1/256 px to the right plus that per 1/256 px down. Twin of
//! `shaders/geometry/steepness.wgsl`.

use super::transform::{ScreenVertex, homogeneous, recip};
use crate::backend::cpu::context::RasterContext;

/// Smallest ratio of the depth of what lies in front of a line to the line's: covers the rounding of f32.
pub const NEARER_RATIO: f32 = 1.0 + 1.0 / 524_288.0;

/// A corner on screen, times its W: X, Y, Z, W.
pub type Corner = [f32; 4];

/// Corners behind the eye may lie anywhere: 2^31.
const FAR: f32 = 2_147_483_648.0;

/// True if a triangle reaches so far that sums of its coordinates might overflow, and f32 is coarser there than the
/// snapping of corners.
#[inline(always)]
pub fn is_far(corners: &[Corner; 3]) -> bool {
    corners.iter().flatten().any(|v| v.abs() >= FAR)
}

/// Change of a triangle's depth per 1/256 px to the right plus that per 1/256 px down, both positive; None without area.
/// Depth is `z = gx x + gy y + c` for all corners, times W: Cramer's rule. Not for triangles that reach
/// [far](is_far).
#[inline(always)]
pub fn steepness([p, q, r]: &[Corner; 3]) -> Option<f32> {
    let cofactors = |i: usize, j: usize| {
        let cofactor = |a: &Corner, b: &Corner| a[i] * b[j] - a[j] * b[i];
        [cofactor(q, r), cofactor(r, p), cofactor(p, q)]
    };
    let (x, y) = (cofactors(1, 3), cofactors(3, 0));
    let sum = |c: [f32; 3], k: usize| (c[0] * p[k] + c[1] * q[k]) + c[2] * r[k];
    let volume = sum(x, 0).abs();
    (volume > f32::MIN_POSITIVE).then(|| (sum(x, 2).abs() + sum(y, 2).abs()) * recip(volume))
}

/// The steepness of a triangle of the plan; None also where it reaches far.
#[inline(always)]
pub fn steepness_of(context: &RasterContext<'_>, id: u32) -> Option<f32> {
    let on_screen = context.screen_triangle(id);
    let mut corners = on_screen.map(|v| corner(&v));
    if on_screen.iter().any(ScreenVertex::is_outside) {
        if context.is_hull(id) || !context.plan.projection.clip {
            return None;
        }
        let vertices = context.triangle(id);
        corners = vertices.map(|v| homogeneous(&context.plan.projection, context.plan.positions[v as usize]));
    }
    if is_far(&corners) { None } else { steepness(&corners) }
}

/// A vertex that is not outside, as a corner.
#[inline(always)]
pub fn corner(v: &ScreenVertex) -> Corner {
    [v.x as f32, v.y as f32, v.z, 1.0]
}

/// Per side of a triangle, twice the area that it spans with a point; positive inside. Valid for
/// corners behind the eye too.
#[inline(always)]
pub fn sides(corners: &[Corner; 3], [x, y]: [f32; 2], is_clockwise: bool) -> [f32; 3] {
    let from = |k: usize| [corners[k][0] - x * corners[k][3], corners[k][1] - y * corners[k][3]];
    let (a, b, c) = (from(0), from(1), from(2));
    let side = |a: [f32; 2], b: [f32; 2]| {
        let side = a[0] * b[1] - a[1] * b[0];
        if is_clockwise { side } else { -side }
    };
    [side(b, c), side(c, a), side(a, b)]
}
