//! Stage visibility, eight triangles at a time: set-up in lanes, and a short way for small ones.
//!
//! Values are those of [`visibility`](super::visibility). Edge functions of triangles up to
//! [`EXTENT_MAX`] fit 32 bits, so no blocks are needed. Larger triangles take that file's way.

use super::nearest::{Nearest, update};
use super::samples::{SampleBand, SampleGrid};
use super::tiles::Tiles;
use super::transform::recip;
use super::visibility;
use super::visibility::Setup;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// Largest width and height of a triangle that is set up in lanes, 1/256 px. Twice its square, and
/// some, is below 2^31.
const EXTENT_MAX: i32 = 64 * 256;

/// Largest width and height of what is drawn without looking which blocks are empty, pixels.
const SHORT_MAX: i32 = 16;

/// Up to eight triangles that need no clipping.
#[derive(Default)]
pub struct Batch {
    ids: [u32; LANES],
    len: usize,
}

impl Batch {
    /// Adds a triangle. True if the batch is full, and to be drawn now.
    #[inline(always)]
    pub fn push(&mut self, id: u32) -> bool {
        self.ids[self.len % LANES] = id;
        self.len += 1;
        self.len == LANES
    }

    /// Draws the triangles, except those that `tiles` hides, and empties the batch. Returns the
    /// number of samples tested.
    #[inline(always)]
    pub fn draw<const S: usize>(
        &mut self,
        context: &RasterContext<'_>,
        band: &mut SampleBand,
        tiles: Option<&Tiles>,
    ) -> u64 {
        let setups = Setups::new::<S>(&Corners::load(context, &self.ids, self.len), band);
        let mut tested = 0;
        for l in 0..self.len {
            let [[left, right], [top, bottom]] = setups.bounds_of(l);
            if left > right || top > bottom {
                continue;
            }
            let depth_max = setups.depth_range[1][l];
            if tiles.is_some_and(|tiles| tiles.hide([left, right], [top, bottom], depth_max)) {
                continue;
            }
            let id = self.ids[l];
            if setups.is_short[l] {
                setups.draw::<S>(l, id, band);
                tested += ((right - left + 1) * (bottom - top + 1)) as u64 * S as u64;
            } else if let Some(setup) = Setup::new(&context.screen_triangle(id)) {
                tested += visibility::draw(&setup, id, &mut Nearest(band));
            }
        }
        self.len = 0;
        tested
    }
}

/// Corners of eight triangles.
struct Corners {
    x: [[i32; LANES]; 3],
    y: [[i32; LANES]; 3],
    z: [[f32; LANES]; 3],
}

impl Corners {
    #[inline(always)]
    fn load(context: &RasterContext<'_>, ids: &[u32; LANES], len: usize) -> Self {
        let mut corners = Self { x: [[0; LANES]; 3], y: [[0; LANES]; 3], z: [[0.0; LANES]; 3] };
        for l in 0..LANES.min(len) {
            let v = context.screen_triangle(ids[l]);
            for k in 0..3 {
                (corners.x[k][l], corners.y[k][l], corners.z[k][l]) = (v[k].x, v[k].y, v[k].z);
            }
        }
        corners
    }
}

/// Eight triangles, ready to be drawn. Lanes that are not short have their bounds and their depth
/// range alone.
struct Setups {
    /// First and last column, and row; the first beyond the last where there are no samples.
    bounds: [[[i32; LANES]; 2]; 2],
    is_short: [bool; LANES],
    /// Change of the edge functions.
    dx: [[i32; LANES]; 3],
    dy: [[i32; LANES]; 3],
    /// Edge functions in sixteenths at the first pixel's corner.
    edges: [[i32; LANES]; 3],
    /// That corner from the triangle's first, 1/256 px.
    from: [[i32; LANES]; 2],
    /// Depth at the triangle's first corner, and its change per 1/256 px.
    depth: [[f32; LANES]; 3],
    depth_range: [[f32; LANES]; 2],
}

impl Setups {
    #[inline(always)]
    fn new<const S: usize>(corners: &Corners, band: &SampleBand) -> Self {
        let mut s = Self {
            bounds: [[[0; LANES]; 2]; 2],
            is_short: [false; LANES],
            dx: [[0; LANES]; 3],
            dy: [[0; LANES]; 3],
            edges: [[0; LANES]; 3],
            from: [[0; LANES]; 2],
            depth: [[0.0; LANES]; 3],
            depth_range: [[0.0; LANES]; 2],
        };
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
                & (rows[1].wrapping_sub(rows[0]) < SHORT_MAX);
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
    fn bounds_of(&self, l: usize) -> [[i32; 2]; 2] {
        let [[left, right], [top, bottom]] = &self.bounds;
        [[left[l], right[l]], [top[l], bottom[l]]]
    }

    /// Draws the short triangle of lane `l`.
    #[inline(always)]
    fn draw<const S: usize>(&self, l: usize, id: u32, band: &mut SampleBand) {
        let [[left, right], [top, bottom]] = self.bounds_of(l);
        let (dx, dy, edges) = (lane(&self.dx, l), lane(&self.dy, l), lane(&self.edges, l));
        let (depth, range) = (lane(&self.depth, l), [self.depth_range[0][l], self.depth_range[1][l]]);
        let pixels = (LANES / S).max(1);
        for part in 0..S.div_ceil(LANES) {
            let [offset_x, offset_y] = lane_offsets::<S>(part);
            let (mut steps, mut x) = ([[0; LANES]; 3], [0; LANES]);
            for i in 0..LANES {
                for k in 0..3 {
                    steps[k][i] = edges[k] + (dx[k] * offset_y[i] - dy[k] * offset_x[i]);
                }
                x[i] = self.from[0][l] + 16 * offset_x[i];
            }
            for row in 0..=bottom - top {
                let mut depth_y = [0.0; LANES];
                for i in 0..LANES {
                    depth_y[i] = depth[2] * (self.from[1][l] + 256 * row + 16 * offset_y[i]) as f32;
                }
                let mut at = band.index(left, top + row, 0) + LANES * part;
                for column in (0..=right - left).step_by(pixels) {
                    let (mut outside, mut z) = ([0; LANES], [0.0; LANES]);
                    for k in 0..3 {
                        let base = 16 * (dx[k] * row - dy[k] * column);
                        for i in 0..LANES {
                            outside[i] |= base + steps[k][i];
                        }
                    }
                    for i in 0..LANES {
                        let across = depth[0] + depth[1] * (x[i] + 256 * column) as f32;
                        z[i] = visibility::clamp(across + depth_y[i], range);
                    }
                    let depths = band.depth.get_mut(at..).and_then(|d| d.first_chunk_mut::<LANES>());
                    let ids = band.ids.get_mut(at..).and_then(|d| d.first_chunk_mut::<LANES>());
                    if let (Some(depths), Some(ids)) = (depths, ids) {
                        update(&outside, &z, id, depths, ids);
                    }
                    at += pixels * S;
                }
            }
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
fn lane_offsets<const S: usize>(part: usize) -> [[i32; LANES]; 2] {
    let offsets = sample_offsets(S as u32);
    let (mut x, mut y) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        let at = offsets[(LANES * part + i) % S];
        x[i] = 16 * (i / S) as i32 + (at[0] >> 4);
        y[i] = at[1] >> 4;
    }
    [x, y]
}
