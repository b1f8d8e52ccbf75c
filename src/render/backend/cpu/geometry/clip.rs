//! Clipping of triangles (for the stage visibility) and of edges (for the stage lines) that reach
//! behind the near plane or far outside the picture: it cuts off what cannot be drawn. Twin of
//! `shaders/geometry/clip.wgsl`.

use super::transform::{ScreenVertex, recip, round_to_i32};
use crate::plan::Projection;

/// Bound of clipped coordinates, a little inside the guard band so that rounding cannot leave it.
pub const BOUND: f32 = 1_048_576.0 - 512.0;

/// A triangle cut by five planes has at most eight corners.
pub const CORNERS_MAX: usize = 8;

/// Clips the homogeneous triangle and calls `draw` for each triangle of the fan that is left.
pub fn clip_triangle(projection: &Projection, corners: [[f32; 4]; 3], mut draw: impl FnMut([ScreenVertex; 3])) {
    if !corners.iter().all(is_moderate) {
        return;
    }
    let mut polygon = Polygon { corners: [[0.0; 4]; CORNERS_MAX], len: 3 };
    polygon.corners[..3].copy_from_slice(&corners);
    for plane in 0..5 {
        polygon = polygon.cut(|p| distance(projection.near_w, plane, p));
    }
    let vertices: [ScreenVertex; CORNERS_MAX] = polygon.corners.map(|p| snap(projection.near_w, p));
    for i in 2..polygon.len {
        draw([vertices[0], vertices[i - 1], vertices[i]]);
    }
}

/// Clips a homogeneous segment; None if nothing is left.
pub fn clip_segment(projection: &Projection, ends: [[f32; 4]; 2]) -> Option<[ScreenVertex; 2]> {
    let [mut a, mut b] = ends;
    if !(is_moderate(&a) && is_moderate(&b)) {
        return None;
    }
    for plane in 0..5 {
        let (da, db) = (distance(projection.near_w, plane, &a), distance(projection.near_w, plane, &b));
        match (da >= 0.0, db >= 0.0) {
            (true, true) => {}
            (true, false) => b = intersect(&a, &b, da, db),
            (false, true) => a = intersect(&b, &a, db, da),
            (false, false) => return None,
        }
    }
    Some([a, b].map(|p| snap(projection.near_w, p)))
}

/// True if all coordinates are numbers below 2^64: then no step of clipping overflows. Other
/// triangles are not drawn.
pub fn is_moderate(p: &[f32; 4]) -> bool {
    const BOUND: f32 = 18_446_744_073_709_551_616.0;
    // Comparisons with what is not a number are false.
    p.iter().all(|v| v.abs() < BOUND)
}

struct Polygon {
    corners: [[f32; 4]; CORNERS_MAX],
    len: usize,
}

impl Polygon {
    fn cut(&self, distance: impl Fn(&[f32; 4]) -> f32) -> Self {
        let mut out = Self { corners: [[0.0; 4]; CORNERS_MAX], len: 0 };
        for i in 0..self.len {
            let (a, b) = (&self.corners[i], &self.corners[(i + 1) % self.len]);
            let (da, db) = (distance(a), distance(b));
            if da >= 0.0 {
                out.push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                // Always from the inside to the outside, whichever way this triangle runs round:
                // the neighbour across the edge then gets the same point, bit for bit.
                out.push(if da >= 0.0 { intersect(a, b, da, db) } else { intersect(b, a, db, da) });
            }
        }
        out
    }

    fn push(&mut self, corner: [f32; 4]) {
        if self.len < CORNERS_MAX {
            self.corners[self.len] = corner;
            self.len += 1;
        }
    }
}

fn distance(near_w: f32, plane: usize, p: &[f32; 4]) -> f32 {
    match plane {
        0 => p[3] - near_w,
        1 => BOUND * p[3] - p[0],
        2 => BOUND * p[3] + p[0],
        3 => BOUND * p[3] - p[1],
        _ => BOUND * p[3] + p[1],
    }
}

fn intersect(inside: &[f32; 4], outside: &[f32; 4], d_inside: f32, d_outside: f32) -> [f32; 4] {
    let t = d_inside * recip(d_inside - d_outside);
    std::array::from_fn(|k| inside[k] + t * (outside[k] - inside[k]))
}

fn snap(near_w: f32, p: [f32; 4]) -> ScreenVertex {
    // With a near plane below the precision of f32, rounding may move W behind it, or behind the
    // eye.
    let r = recip(p[3].max(near_w));
    // The clamp only ever takes away what rounding added.
    let bound = |v: f32| v.clamp(-BOUND, BOUND);
    ScreenVertex { x: round_to_i32(bound(p[0] * r)), y: round_to_i32(bound(p[1] * r)), z: p[2] * r, inv_w: r }
}
