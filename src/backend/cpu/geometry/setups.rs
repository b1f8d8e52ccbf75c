//! Stage visibility: eight triangles, set up in lanes.
//!
//! Values are those of [`visibility`](super::visibility). Edge functions of triangles up to
//! [`EXTENT_MAX`] fit 32 bits, so no blocks are needed.

use super::samples::{SampleBand, SampleGrid};
use super::transform::recip;
use super::visibility::Part;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// Largest width and height of a triangle that is set up in lanes, 1/256 px. Twice its square, and
/// some, is below 2^31.
pub const EXTENT_MAX: i32 = 64 * 256;

/// Largest width and height of what is drawn without looking which blocks are empty, pixels.
pub const SHORT_MAX: i32 = 16;

/// Corners of up to eight triangles.
#[derive(Default)]
pub struct Corners {
    pub ids: [u32; LANES],
    pub len: usize,
    pub x: [[i32; LANES]; 3],
    pub y: [[i32; LANES]; 3],
    pub z: [[f32; LANES]; 3],
}

/// Eight triangles, ready to be drawn. Lanes that are not short have their bounds and their depth
/// range alone.
#[derive(Default)]
pub struct Setups {
    /// First and last column, and row; the first beyond the last where there are no samples.
    pub bounds: [[[i32; LANES]; 2]; 2],
    pub is_short: [bool; LANES],
    /// Change of the edge functions.
    pub dx: [[i32; LANES]; 3],
    pub dy: [[i32; LANES]; 3],
    /// Edge functions in sixteenths at the first pixel's corner.
    pub edges: [[i32; LANES]; 3],
    /// That corner from the triangle's first, 1/256 px.
    pub from: [[i32; LANES]; 2],
    /// Depth at the triangle's first corner, and its change per 1/256 px.
    pub depth: [[f32; LANES]; 3],
    pub depth_range: [[f32; LANES]; 2],
}

impl Setups {
    #[inline(always)]
    pub fn new<const S: usize>(corners: &Corners, band: &SampleBand) -> Self {
        let mut s = Self::default();
        let grid = SampleGrid::new(S as u32);
        let half = band.size_px.map(|size| size as i32 * 128);
        let ranges = band.range();
        let shift = sample_offsets(S as u32)[0][0] & 15;
        for l in 0..LANES {
            let (x, y, z) = (lane(&corners.x, l), lane(&corners.y, l), lane(&corners.z, l));
            let low = [x[0].min(x[1]).min(x[2]), y[0].min(y[1]).min(y[2])];
            let high = [x[0].max(x[1]).max(x[2]), y[0].max(y[1]).max(y[2])];
            let columns = grid.pixels([low[0] + half[0], high[0] + half[0]], ranges[0]);
            let rows = grid.pixels([low[1] + half[1], high[1] + half[1]], ranges[1]);
            s.bounds[0][0][l] = columns[0];
            s.bounds[0][1][l] = columns[1];
            s.bounds[1][0][l] = rows[0];
            s.bounds[1][1][l] = rows[1];
            s.is_short[l] = (high[0] - low[0] <= EXTENT_MAX)
                & (high[1] - low[1] <= EXTENT_MAX)
                & (columns[1].wrapping_sub(columns[0]) < SHORT_MAX)
                & (rows[1].wrapping_sub(rows[0]) < SHORT_MAX)
                & (z[0].min(z[1]).min(z[2]) > 0.0);
            s.depth_range[0][l] = z[0].min(z[1]).min(z[2]);
            s.depth_range[1][l] = z[0].max(z[1]).max(z[2]);
            // What follows means nothing where it wraps: those lanes are not short.
            let corner = [
                columns[0].wrapping_mul(256).wrapping_sub(half[0]).wrapping_add(shift),
                rows[0].wrapping_mul(256).wrapping_sub(half[1]).wrapping_add(shift),
            ];
            s.set_lane(l, x, y, z, corner);
        }
        s
    }

    /// Edges and depth, as `Setup`, `Edges::new` and `Edges::at` of [`visibility`] have them.
    #[inline(always)]
    fn set_lane(&mut self, l: usize, x: [i32; 3], y: [i32; 3], z: [f32; 3], corner: [i32; 2]) {
        let cross = |ax: i32, ay: i32, bx: i32, by: i32| ax.wrapping_mul(by).wrapping_sub(bx.wrapping_mul(ay));
        let area = cross(x[1] - x[0], y[1] - y[0], x[2] - x[0], y[2] - y[0]);
        let flip = area < 0;
        let swap = |v: [i32; 3]| if flip { [v[0], v[2], v[1]] } else { v };
        let (x, y) = (swap(x), swap(y));
        let z = if flip { [z[0], z[2], z[1]] } else { z };
        let (dx1, dy1) = ((x[1] - x[0]) as f32, (y[1] - y[0]) as f32);
        let (dx2, dy2) = ((x[2] - x[0]) as f32, (y[2] - y[0]) as f32);
        let (dz1, dz2) = (z[1] - z[0], z[2] - z[0]);
        let inverse = recip(area.wrapping_abs() as f32);
        self.depth[0][l] = z[0];
        self.depth[1][l] = (dz1 * dy2 - dz2 * dy1) * inverse;
        self.depth[2][l] = (dz2 * dx1 - dz1 * dx2) * inverse;
        for k in 0..3 {
            let (dx, dy) = (x[(k + 1) % 3] - x[k], y[(k + 1) % 3] - y[k]);
            let bias = if (dy < 0) | ((dy == 0) & (dx > 0)) { 0 } else { -1 };
            let at = cross(dx, dy, corner[0].wrapping_sub(x[k]), corner[1].wrapping_sub(y[k]));
            self.edges[k][l] = at.wrapping_add(bias) >> 4;
            self.dx[k][l] = dx;
            self.dy[k][l] = dy;
        }
        self.from[0][l] = corner[0].wrapping_sub(x[0]);
        self.from[1][l] = corner[1].wrapping_sub(y[0]);
    }

    #[inline(always)]
    pub fn bounds_of(&self, l: usize) -> [[i32; 2]; 2] {
        let [[left, right], [top, bottom]] = &self.bounds;
        [[left[l], right[l]], [top[l], bottom[l]]]
    }

    /// The short triangle of lane `l`.
    #[inline(always)]
    pub fn short(&self, l: usize) -> Part {
        Part {
            bounds: self.bounds_of(l),
            dx: lane(&self.dx, l),
            dy: lane(&self.dy, l),
            edges: lane(&self.edges, l),
            from: [self.from[0][l], self.from[1][l]],
            depth: lane(&self.depth, l),
            depth_range: [self.depth_range[0][l], self.depth_range[1][l]],
        }
    }
}

/// A lane of three vectors. Not `map`, which may stay a call.
#[inline(always)]
fn lane<T: Copy>(v: &[[T; LANES]; 3], l: usize) -> [T; 3] {
    [v[0][l], v[1][l], v[2][l]]
}

/// Each lane's sample from the pixel's corner (moved by what the samples leave modulo 16), in 1/16
/// px: across, down.
#[inline(always)]
pub fn lane_offsets<const S: usize>(part: usize) -> [[i32; LANES]; 2] {
    let offsets = sample_offsets(S as u32);
    let (mut x, mut y) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        let at = offsets[(LANES * part + i) % S];
        x[i] = 16 * (i / S) as i32 + (at[0] >> 4);
        y[i] = at[1] >> 4;
    }
    [x, y]
}
