//! Stage mixed, per triangle and mixed pixel: the points that a triangle covers, and its depth at each.
//!
//! Points lie in the middle of 1/256 px, so edge functions are taken in halves of it. The rest is as in
//! stage visibility: exact signs with the top-left rule, depth from offsets.

use crate::backend::cpu::geometry::nearest::update;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleGrid};
use crate::backend::cpu::geometry::visibility::{Setup, clamp};
use crate::backend::cpu::isa::LANES;
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Columns and rows of points in a pixel: some in each.
pub const POINT_GRID: SampleGrid = SampleGrid { shift: 8, border: 1 };

/// Column and row of each point in its pixel, 1/256 px, without the half.
pub const PLACES: [[i32; POINTS]; 2] = {
    let mut places = [[0; POINTS]; 2];
    let mut i = 0;
    while i < POINTS {
        places[0][i] = (i * GENERATORS[0] % POINTS) as i32;
        places[1][i] = (i * GENERATORS[1] % POINTS) as i32;
        i += 1;
    }
    places
};

/// Largest of [`PLACES`].
const PLACE_MAX: i64 = POINTS as i64 - 1;

/// The faces that the points of a pixel see, and their depths.
pub struct PixelPoints {
    /// Reversed depth of each; 0 where there is nothing.
    pub depth: [f32; POINTS],
    /// Triangle of each.
    pub ids: [u32; POINTS],
    /// No point is farther.
    farthest: f32,
}

/// A triangle, ready to be offered to pixels.
pub struct PointTriangle {
    setup: Setup,
    dx: [i32; 3],
    dy: [i32; 3],
    bias: [i64; 3],
}

impl PixelPoints {
    /// A pixel without triangles.
    pub const EMPTY: Self = Self { depth: [0.0; POINTS], ids: [NOTHING; POINTS], farthest: 0.0 };
}

impl PointTriangle {
    /// A triangle by its setup.
    #[inline(always)]
    pub fn new(setup: Setup) -> Self {
        let dx: [i32; 3] = std::array::from_fn(|k| setup.x[(k + 1) % 3] - setup.x[k]);
        let dy: [i32; 3] = std::array::from_fn(|k| setup.y[(k + 1) % 3] - setup.y[k]);
        let bias = std::array::from_fn(|k| if dy[k] < 0 || (dy[k] == 0 && dx[k] > 0) { 0 } else { -1 });
        Self { setup, dx, dy, bias }
    }

    /// Edge functions, halved, at the first point's place of the pixel with this corner; None where no
    /// point of the pixel is inside. An edge that has all of the pixel inside is left out.
    #[inline(always)]
    fn edges_at(&self, corner: [i32; 2]) -> Option<[[i32; 3]; 3]> {
        let mut edges = [[0; 3]; 3];
        for k in 0..3 {
            let (dx, dy) = (i64::from(self.dx[k]), i64::from(self.dy[k]));
            let (px, py) = (i64::from(corner[0] - self.setup.x[k]), i64::from(corner[1] - self.setup.y[k]));
            let c = (2 * (dx * py - dy * px) + (dx - dy) + self.bias[k]) >> 1;
            if c + (PLACE_MAX * dx).max(0) + (PLACE_MAX * -dy).max(0) < 0 {
                return None;
            }
            if c + (PLACE_MAX * dx).min(0) + (PLACE_MAX * -dy).min(0) < 0 {
                edges[k] = [c.clamp(-(1 << 30), 1 << 30) as i32, self.dx[k], self.dy[k]];
            }
        }
        Some(edges)
    }

    /// Offers the triangle to the points of the pixel with this upper left corner, 1/256 px from the
    /// picture's centre.
    #[inline(always)]
    pub fn offer(&self, id: u32, corner: [i32; 2], points: &mut PixelPoints) {
        let Setup { depth, depth_range, .. } = self.setup;
        // Of equal depths the lower id is kept.
        if depth_range[1] < points.farthest {
            return;
        }
        let Some(edges) = self.edges_at(corner) else { return };
        let from = [2 * (corner[0] - self.setup.x[0]) + 1, 2 * (corner[1] - self.setup.y[0]) + 1];
        let mut farthest = [f32::INFINITY; LANES];
        let (depths, _) = points.depth.as_chunks_mut::<LANES>();
        let (ids, _) = points.ids.as_chunks_mut::<LANES>();
        let (columns, rows) = (PLACES[0].as_chunks::<LANES>().0, PLACES[1].as_chunks::<LANES>().0);
        for i in 0..POINTS / LANES {
            let (mut outside, mut z) = ([0; LANES], [0.0; LANES]);
            for [c, dx, dy] in edges {
                for l in 0..LANES {
                    outside[l] |=
                        c.wrapping_add(dx.wrapping_mul(rows[i][l]).wrapping_sub(dy.wrapping_mul(columns[i][l])));
                }
            }
            for l in 0..LANES {
                let x = (from[0] + 2 * columns[i][l]) as f32 * 0.5;
                let y = (from[1] + 2 * rows[i][l]) as f32 * 0.5;
                z[l] = clamp((depth[0] + depth[1] * x) + depth[2] * y, depth_range);
            }
            update(&outside, &z, id, &mut depths[i], &mut ids[i]);
            for l in 0..LANES {
                farthest[l] = if depths[i][l] < farthest[l] { depths[i][l] } else { farthest[l] };
            }
        }
        points.farthest = farthest.into_iter().fold(f32::INFINITY, |least, z| if z < least { z } else { least });
    }
}

/// A triangle's share of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// Its id.
    pub id: u32,
    /// Number of the first point that sees it.
    pub first: usize,
    /// Number of points that see it.
    pub count: i32,
    /// Sum of the points' columns and rows, 1/512 px from the pixel's corner.
    pub place_sum: [i32; 2],
}

/// Calls `each` with the triangles that a pixel's points see, in the order of their first points.
#[inline(always)]
pub fn for_each_share(ids: &[u32; POINTS], mut each: impl FnMut(Share)) {
    let mut is_known = [0_u32; POINTS];
    for first in 0..POINTS {
        let id = ids[first];
        if is_known[first] != 0 || id == NOTHING {
            continue;
        }
        let (mut count, mut sums) = (0, [0; 2]);
        for i in 0..POINTS {
            let is_own = -i32::from(ids[i] == id);
            is_known[i] |= is_own as u32;
            count -= is_own;
            sums[0] += PLACES[0][i] & is_own;
            sums[1] += PLACES[1][i] & is_own;
        }
        each(Share { id, first, count, place_sum: sums.map(|sum| 2 * sum + count) });
    }
}
