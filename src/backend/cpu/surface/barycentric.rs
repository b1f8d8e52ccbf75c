//! Stage shade, per point: its position in its triangle. Twin of
//! `shaders/surface/barycentric.wgsl`.

use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous, recip};
use crate::plan::DrawPlan;

/// A corner relative to the shaded point: homogeneous (x, y, w), and the factor that its
/// barycentric takes besides.
#[derive(Clone, Copy)]
pub struct Corner {
    x: f32,
    y: f32,
    w: f32,
    weight: f32,
}

/// The corners of a triangle seen from point `at`. Snapped corners; if one is behind the eye, the
/// homogeneous ones, which are valid there too.
#[inline]
pub fn corners(context: &RasterContext<'_>, id: u32, at: [f32; 2]) -> [Corner; 3] {
    let vertices = context.screen_triangle(id);
    if vertices.iter().any(ScreenVertex::is_outside) {
        return context.positions_of(id).map(|(position, _)| {
            let [x, y, _, w] = homogeneous(&context.plan.projection, position);
            Corner { x: x - at[0] * w, y: y - at[1] * w, w, weight: 1.0 }
        });
    }
    vertices.map(|v| Corner { x: v.x as f32 - at[0], y: v.y as f32 - at[1], w: 1.0, weight: v.inv_w })
}

/// Linear in the point: the areas opposite the corners, weighted, and how they change.
struct Areas {
    u: [f32; 3],
    dx: [f32; 3],
    dy: [f32; 3],
}

impl Areas {
    /// `u_i = weight_i * (corner_j x corner_k)`.
    #[inline(always)]
    fn new(c: &[Corner; 3]) -> Self {
        let mut areas = Self { u: [0.0; 3], dx: [0.0; 3], dy: [0.0; 3] };
        for i in 0..3 {
            let (j, k) = (&c[(i + 1) % 3], &c[(i + 2) % 3]);
            areas.u[i] = c[i].weight * (j.x * k.y - k.x * j.y);
            areas.dx[i] = c[i].weight * (k.w * j.y - j.w * k.y);
            areas.dy[i] = c[i].weight * (j.w * k.x - k.w * j.x);
        }
        areas
    }
}

/// Perspective-correct barycentrics at a point.
pub struct Barycentrics {
    /// They add up to 1: two are computed, the third is the rest.
    pub value: [f32; 3],
    /// Change to the right, in 1/256 px.
    dx: [f32; 3],
    /// Change downwards, in 1/256 px.
    dy: [f32; 3],
    /// True if the triangle faces the viewer.
    pub front: bool,
}

impl Barycentrics {
    /// `b_i` is proportional to the area opposite the corner, so that the derivatives are exact
    /// too.
    #[inline(always)]
    pub fn new(c: &[Corner; 3]) -> Self {
        Self::divided(&Areas::new(c), |total| 1.0 / total)
    }

    /// As [`Barycentrics::new`], with the same bits on both back-ends: for decisions such as
    /// thresholds.
    #[inline(always)]
    pub fn exact(c: &[Corner; 3]) -> Self {
        Self::divided(&Areas::new(c), |total| {
            let size = total.abs();
            let inverse = if size > 1e-30 && size < 1e30 { recip(size) } else { 0.0 };
            if total < 0.0 { -inverse } else { inverse }
        })
    }

    #[inline(always)]
    fn divided(areas: &Areas, inverse: impl Fn(f32) -> f32) -> Self {
        let sum = |v: &[f32; 3]| (v[0] + v[1]) + v[2];
        let total = sum(&areas.u);
        let inverse = inverse(total);
        let (total_x, total_y) = (sum(&areas.dx), sum(&areas.dy));
        let (b0, b1) = (areas.u[0] * inverse, areas.u[1] * inverse);
        let value = [b0, b1, (1.0 - b0) - b1];
        let dx = std::array::from_fn(|i| (areas.dx[i] - value[i] * total_x) * inverse);
        let dy = std::array::from_fn(|i| (areas.dy[i] - value[i] * total_y) * inverse);
        Self { value, dx, dy, front: total < 0.0 }
    }

    /// `|db/dx| + |db/dy|` per pixel.
    #[inline(always)]
    pub fn fwidth(&self, i: usize) -> f32 {
        256.0 * (self.dx[i].abs() + self.dy[i].abs())
    }

    /// Change to the right and downwards, per pixel.
    pub fn derivatives(&self) -> [[f32; 3]; 2] {
        [self.dx, self.dy].map(|d| d.map(|v| 256.0 * v))
    }
}

/// Distance in pixels from the point to the line on screen that carries the edge opposite corner
/// `i`, for each.
pub fn edge_distances_px(c: &[Corner; 3]) -> [f32; 3] {
    let areas = Areas::new(c);
    std::array::from_fn(|i| {
        let slope = areas.dx[i] * areas.dx[i] + areas.dy[i] * areas.dy[i];
        areas.u[i].abs() / (256.0 * slope.sqrt()).max(1e-30)
    })
}

/// Centres of the pixel that a point lies in and of its neighbours across and down in the same
/// block of 2 x 2 pixels.
pub struct Quad {
    /// In 1/256 px from the picture's centre: own, across, down.
    pub points: [[f32; 2]; 3],
    /// 1 where the neighbour is right of the pixel (below it), -1 where it is left of it (above
    /// it).
    pub sign: [f32; 2],
}

impl Quad {
    /// The block of the pixel that holds `at`.
    pub fn around(plan: &DrawPlan<'_>, at: [f32; 2]) -> Self {
        let half = [plan.width_px, plan.height_px].map(|size| size as i32 * 128);
        let pixel = [0, 1].map(|k| (at[k] + half[k] as f32) as i32 >> 8);
        let center = [0, 1].map(|k| (pixel[k] * 256 - half[k] + 128) as f32);
        let sign = pixel.map(|p| if p & 1 == 0 { 1.0 } else { -1.0 });
        let across = [center[0] + 256.0 * sign[0], center[1]];
        let down = [center[0], center[1] + 256.0 * sign[1]];
        Self { points: [center, across, down], sign }
    }

    /// A triangle's exact barycentrics at the three points, continued beyond its edges.
    pub fn barycentrics(&self, context: &RasterContext<'_>, id: u32) -> [[f32; 3]; 3] {
        self.points.map(|at| Barycentrics::exact(&corners(context, id, at)).value)
    }
}

impl RasterContext<'_> {
    /// Unit-box corners of a triangle of the surface, and their vertex indices.
    pub(crate) fn positions_of(&self, id: u32) -> [([f32; 3], u32); 3] {
        self.triangle(id).map(|v| (self.plan.positions[v as usize], v))
    }
}
