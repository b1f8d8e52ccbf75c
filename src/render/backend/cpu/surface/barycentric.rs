//! Barycentric coordinates of shaded points: where each point lies in its triangle, in perspective, and how that
//! changes from pixel to pixel (stage shade). They are computed for `N` points side by side. Twin of
//! `shaders/surface/barycentric.wgsl`.

use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous, recip};
use crate::backend::cpu::vector::part;
use crate::plan::DrawPlan;

/// Corners of `N` triangles, each relative to its shaded point: homogeneous (x, y, w), and the factor
/// that a corner's barycentric takes besides. All are `[corner][lane]`.
pub struct Corners<const N: usize> {
    x: [[f32; N]; 3],
    y: [[f32; N]; 3],
    w: [[f32; N]; 3],
    weight: [[f32; N]; 3],
}

impl<const N: usize> Corners<N> {
    /// The corners of triangles, each seen from its point of `at` (columns, then rows). Snapped
    /// corners; of a triangle with one behind the eye the homogeneous ones, which are valid there too.
    #[inline(always)]
    pub fn new(context: &RasterContext<'_>, ids: &[u32; N], at: &[[f32; N]; 2]) -> Self {
        let mut c = Self { x: [[0.0; N]; 3], y: [[0.0; N]; 3], w: [[1.0; N]; 3], weight: [[0.0; N]; 3] };
        let mut is_any_outside = false;
        for l in 0..N {
            let vertices = context.screen_triangle(ids[l]);
            for k in 0..3 {
                (c.x[k][l], c.y[k][l]) = (vertices[k].x as f32, vertices[k].y as f32);
                c.weight[k][l] = vertices[k].inv_w;
                is_any_outside |= vertices[k].is_outside();
            }
        }
        for k in 0..3 {
            for l in 0..N {
                c.x[k][l] -= at[0][l];
                c.y[k][l] -= at[1][l];
            }
        }
        if is_any_outside {
            c.replace_outside(context, ids, at);
        }
        c
    }

    /// Those of `M` triangles, from `first` on, a multiple of it.
    #[inline(always)]
    pub fn part<const M: usize>(&self, first: usize) -> Corners<M> {
        let of = |all: &[[f32; N]; 3]| [part(&all[0], first), part(&all[1], first), part(&all[2], first)];
        Corners { x: of(&self.x), y: of(&self.y), w: of(&self.w), weight: of(&self.weight) }
    }

    #[cold]
    #[inline(never)]
    fn replace_outside(&mut self, context: &RasterContext<'_>, ids: &[u32; N], at: &[[f32; N]; 2]) {
        for l in 0..N {
            if !context.screen_triangle(ids[l]).iter().any(ScreenVertex::is_outside) {
                continue;
            }
            for (k, (position, _)) in context.positions_of(ids[l]).into_iter().enumerate() {
                let [x, y, _, w] = homogeneous(&context.plan.projection, position);
                (self.x[k][l], self.y[k][l]) = (x - at[0][l] * w, y - at[1][l] * w);
                (self.w[k][l], self.weight[k][l]) = (w, 1.0);
            }
        }
    }
}

/// Linear in the point: the areas opposite the corners, weighted, and how they change.
struct Areas<const N: usize> {
    u: [[f32; N]; 3],
    dx: [[f32; N]; 3],
    dy: [[f32; N]; 3],
}

impl<const N: usize> Areas<N> {
    /// `u_i = weight_i * (corner_j x corner_k)`.
    #[inline(always)]
    fn new(c: &Corners<N>) -> Self {
        let mut areas = Self { u: [[0.0; N]; 3], dx: [[0.0; N]; 3], dy: [[0.0; N]; 3] };
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            for l in 0..N {
                areas.u[i][l] = c.weight[i][l] * (c.x[j][l] * c.y[k][l] - c.x[k][l] * c.y[j][l]);
                areas.dx[i][l] = c.weight[i][l] * (c.w[k][l] * c.y[j][l] - c.w[j][l] * c.y[k][l]);
                areas.dy[i][l] = c.weight[i][l] * (c.w[j][l] * c.x[k][l] - c.w[k][l] * c.x[j][l]);
            }
        }
        areas
    }
}

/// Perspective-correct barycentrics at `N` points, `[corner][lane]`.
pub struct Barycentrics<const N: usize> {
    /// They add up to 1: two are computed, the third is the rest.
    pub value: [[f32; N]; 3],
    /// Change to the right, in 1/256 px.
    dx: [[f32; N]; 3],
    /// Change downwards, in 1/256 px.
    dy: [[f32; N]; 3],
    /// True if the triangle faces the viewer.
    pub front: [bool; N],
}

impl<const N: usize> Barycentrics<N> {
    /// `b_i` is proportional to the area opposite the corner, so that the derivatives are exact
    /// too.
    #[inline(always)]
    pub fn new(c: &Corners<N>) -> Self {
        Self::divided(&Areas::new(c), |total| 1.0 / total)
    }

    /// As [`Barycentrics::new`], with the same bits on both back-ends: for decisions such as
    /// thresholds.
    #[inline(always)]
    pub fn exact(c: &Corners<N>) -> Self {
        Self::divided(&Areas::new(c), |total| {
            let size = total.abs();
            let inverse = recip(size);
            let inverse = if (size > 1e-30) & (size < 1e30) { inverse } else { 0.0 };
            if total < 0.0 { -inverse } else { inverse }
        })
    }

    #[inline(always)]
    fn divided(areas: &Areas<N>, inverse_of: impl Fn(f32) -> f32) -> Self {
        let mut b = Self { value: [[0.0; N]; 3], dx: [[0.0; N]; 3], dy: [[0.0; N]; 3], front: [false; N] };
        for l in 0..N {
            let sum = |v: &[[f32; N]; 3]| (v[0][l] + v[1][l]) + v[2][l];
            let total = sum(&areas.u);
            let inverse = inverse_of(total);
            let (total_x, total_y) = (sum(&areas.dx), sum(&areas.dy));
            let (b0, b1) = (areas.u[0][l] * inverse, areas.u[1][l] * inverse);
            for (i, value) in [b0, b1, (1.0 - b0) - b1].into_iter().enumerate() {
                b.value[i][l] = value;
                b.dx[i][l] = (areas.dx[i][l] - value * total_x) * inverse;
                b.dy[i][l] = (areas.dy[i][l] - value * total_y) * inverse;
            }
            b.front[l] = total < 0.0;
        }
        b
    }

    /// `|db/dx| + |db/dy|` per pixel.
    #[inline(always)]
    pub fn fwidth(&self, i: usize) -> [f32; N] {
        let mut out = [0.0; N];
        for l in 0..N {
            out[l] = 256.0 * (self.dx[i][l].abs() + self.dy[i][l].abs());
        }
        out
    }

    /// Change to the right and downwards, per pixel.
    #[inline(always)]
    pub fn derivatives(&self) -> [[[f32; N]; 3]; 2] {
        [self.dx, self.dy].map(|d| d.map(|lanes| lanes.map(|v| 256.0 * v)))
    }
}

/// Distance in pixels from the point to the line on screen that carries the edge opposite corner
/// `i`, for each.
pub fn edge_distances_px(c: &Corners<1>) -> [f32; 3] {
    let areas = Areas::new(c);
    std::array::from_fn(|i| {
        let [[u], [dx], [dy]] = [areas.u[i], areas.dx[i], areas.dy[i]];
        u.abs() / (256.0 * (dx * dx + dy * dy).sqrt()).max(1e-30)
    })
}

/// Centres of the pixels that points lie in and of their neighbours across and down in the same
/// blocks of 2 x 2 pixels.
pub struct Quad<const N: usize> {
    /// Own, across, down: columns, then rows, in 1/256 px from the picture's centre.
    points: [[[f32; N]; 2]; 3],
    /// 1 where the neighbour is right of the pixel (below it), -1 where it is left of it (above
    /// it).
    pub sign: [[f32; N]; 2],
}

impl<const N: usize> Quad<N> {
    /// The blocks of the pixels that hold `at`.
    #[inline(always)]
    pub fn around(plan: &DrawPlan<'_>, at: &[[f32; N]; 2]) -> Self {
        let half = [plan.width_px, plan.height_px].map(|size| size as i32 * 128);
        let (mut center, mut sign) = ([[0.0; N]; 2], [[0.0; N]; 2]);
        for k in 0..2 {
            for l in 0..N {
                let pixel = (at[k][l] + half[k] as f32) as i32 >> 8;
                center[k][l] = (pixel * 256 - half[k] + 128) as f32;
                sign[k][l] = if pixel & 1 == 0 { 1.0 } else { -1.0 };
            }
        }
        let (mut across, mut down) = (center, center);
        for l in 0..N {
            across[0][l] += 256.0 * sign[0][l];
            down[1][l] += 256.0 * sign[1][l];
        }
        Self { points: [center, across, down], sign }
    }

    /// The triangles' exact barycentrics at the three points, continued beyond their edges.
    #[inline(always)]
    pub fn barycentrics(&self, context: &RasterContext<'_>, ids: &[u32; N]) -> [[[f32; N]; 3]; 3] {
        let mut values = [[[0.0; N]; 3]; 3];
        for (value, at) in values.iter_mut().zip(&self.points) {
            *value = Barycentrics::exact(&Corners::new(context, ids, at)).value;
        }
        values
    }
}

impl RasterContext<'_> {
    /// Unit-box corners of a triangle of the surface, and their vertex indices.
    #[inline(always)]
    pub(crate) fn positions_of(&self, id: u32) -> [([f32; 3], u32); 3] {
        self.triangle(id).map(|v| (self.plan.positions[v as usize], v))
    }
}
