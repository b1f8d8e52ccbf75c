//! Where a point lies in its triangle. Twin of `shaders/barycentric.wgsl`.

use super::Stages;
use super::transform::{ScreenVertex, homogeneous, hull_position};

/// A corner relative to the shaded point: homogeneous (x, y, w), and the factor that its barycentric takes besides.
#[derive(Clone, Copy)]
pub struct Corner {
    x: f32,
    y: f32,
    w: f32,
    weight: f32,
}

/// The corners of a triangle seen from point `at`. Snapped corners where there are some; where one is behind the eye,
/// the homogeneous ones, which stay right there.
pub fn corners(stages: &Stages<'_>, id: u32, at: [f32; 2]) -> [Corner; 3] {
    let vertices = stages.screen_triangle(id);
    if vertices.iter().any(ScreenVertex::is_outside) {
        return stages.positions_of(id).map(|(position, _)| {
            let [x, y, _, w] = homogeneous(&stages.plan.projection, position);
            Corner { x: x - at[0] * w, y: y - at[1] * w, w, weight: 1.0 }
        });
    }
    vertices.map(|v| Corner { x: v.x as f32 - at[0], y: v.y as f32 - at[1], w: 1.0, weight: v.inv_w })
}

/// Perspective-correct barycentrics at a point and how fast they change on screen.
pub struct Barycentrics {
    /// They add up to 1.
    pub value: [f32; 3],
    /// `|db/dx| + |db/dy|` a pixel.
    pub fwidth: [f32; 3],
    /// Whether the triangle faces the viewer.
    pub front: bool,
}

impl Barycentrics {
    /// `b_i` is proportional to `u_i = weight_i * (corner_j x corner_k)`, the area opposite the corner; linear in the
    /// point, so that its derivatives are exact.
    pub fn new(c: &[Corner; 3]) -> Self {
        let (mut u, mut ux, mut uy) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for i in 0..3 {
            let (j, k) = (&c[(i + 1) % 3], &c[(i + 2) % 3]);
            u[i] = c[i].weight * (j.x * k.y - k.x * j.y);
            ux[i] = c[i].weight * (k.w * j.y - j.w * k.y);
            uy[i] = c[i].weight * (j.w * k.x - k.w * j.x);
        }
        let sum = |v: &[f32; 3]| (v[0] + v[1]) + v[2];
        let total = sum(&u);
        let inverse = 1.0 / total;
        let (total_x, total_y) = (sum(&ux), sum(&uy));
        let value = u.map(|v| v * inverse);
        let fwidth = std::array::from_fn(|i| {
            let dx = (ux[i] - value[i] * total_x) * inverse;
            let dy = (uy[i] - value[i] * total_y) * inverse;
            256.0 * (dx.abs() + dy.abs())
        });
        Self { value, fwidth, front: total < 0.0 }
    }
}

impl Stages<'_> {
    /// Unit-box corners of a triangle of the surface or the hull, and their vertex indices.
    pub(super) fn positions_of(&self, id: u32) -> [([f32; 3], u32); 3] {
        let (triangle, is_hull) = self.triangle(id);
        triangle.map(|v| {
            let position = self.plan.positions[v as usize];
            match &self.plan.hull {
                Some(hull) if is_hull => (hull_position(hull, position, v as usize), v),
                _ => (position, v),
            }
        })
    }
}
