//! Stage visibility: eight triangles, set up in lanes.
//!
//! Values are those of [`visibility`](super::visibility). Edge functions of triangles up to
//! [`EXTENT_MAX`] fit 32 bits, so no blocks are needed.

use super::samples::{SampleBand, SampleGrid};
use super::transform::recip;
use super::visibility::Parts;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::plan::sample_offsets;

/// Largest width and height of a triangle that is set up in lanes, 1/256 px. Twice its square, and
/// some, is below 2^31.
pub const EXTENT_MAX: i32 = 64 * 256;

/// Largest width and height of what is drawn without looking which blocks are empty, pixels.
pub const SHORT_MAX: i32 = 16;

/// Rows, and vectors in a row, up to which triangles are drawn together with others of the same size.
pub const SIZES: i32 = 4;

/// Classes of triangles by the way they are drawn: a number below `SIZES * SIZES` for each small
/// size, or one of these.
pub mod class {
    /// Other triangles drawn by lanes.
    pub const SHORT: i32 = super::SIZES * super::SIZES;
    /// Triangles drawn in blocks.
    pub const LONG: i32 = SHORT + 1;
    /// Triangles without samples.
    pub const EMPTY: i32 = LONG + 1;
    /// Number of classes.
    pub const COUNT: usize = EMPTY as usize + 1;
}

/// Corners of eight triangles.
pub struct Corners {
    pub x: [[i32; LANES]; 3],
    pub y: [[i32; LANES]; 3],
    pub z: [[f32; LANES]; 3],
}

/// Eight triangles, ready to be drawn. Long ones have their bounds and their depth range alone.
pub struct Setups {
    pub parts: Parts<LANES>,
    /// The class of each triangle, see [`class`].
    pub classes: [i32; LANES],
}

impl Corners {
    /// The corners of triangles by id.
    #[inline(always)]
    pub fn load(context: &RasterContext<'_>, ids: &[u32; LANES]) -> Self {
        let (mut x, mut y, mut z) = ([[0; LANES]; 3], [[0; LANES]; 3], [[0.0; LANES]; 3]);
        for l in 0..LANES {
            let corners = context.screen_triangle(ids[l]);
            for k in 0..3 {
                (x[k][l], y[k][l], z[k][l]) = (corners[k].x, corners[k].y, corners[k].z);
            }
        }
        Self { x, y, z }
    }
}

/// Pixels and nearest depth of eight triangles.
pub struct Boxes {
    /// First and last column, and row; the first beyond the last where there are no samples.
    pub bounds: [[[i32; LANES]; 2]; 2],
    pub depth_max: [f32; LANES],
}

impl Boxes {
    #[inline(always)]
    pub fn new<const S: usize>(corners: &Corners, band: &SampleBand) -> Self {
        let grid = SampleGrid::new(S as u32);
        let (half, ranges) = (band.size_px.map(|size| size as i32 * 128), band.range());
        let mut boxes = Self { bounds: [[[0; LANES]; 2]; 2], depth_max: [0.0; LANES] };
        for l in 0..LANES {
            for (k, v) in [lane(&corners.x, l), lane(&corners.y, l)].into_iter().enumerate() {
                let (low, high) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
                [boxes.bounds[k][0][l], boxes.bounds[k][1][l]] =
                    grid.pixels([low + half[k], high + half[k]], ranges[k]);
            }
            let z = lane(&corners.z, l);
            boxes.depth_max[l] = z[0].max(z[1]).max(z[2]);
        }
        boxes
    }
}

impl Setups {
    /// Eight triangles without samples.
    pub const EMPTY: Self = Self { parts: Parts::EMPTY, classes: [class::EMPTY; LANES] };

    #[inline(always)]
    pub fn new<const S: usize>(corners: &Corners, band: &SampleBand) -> Self {
        let mut s = Self::EMPTY;
        let Boxes { bounds, depth_max } = Boxes::new::<S>(corners, band);
        let half = band.size_px.map(|size| size as i32 * 128);
        let shift = sample_offsets(S as u32)[0][0] & 15;
        for l in 0..LANES {
            let (x, y, z) = (lane(&corners.x, l), lane(&corners.y, l), lane(&corners.z, l));
            let extent = |v: [i32; 3]| v[0].max(v[1]).max(v[2]) - v[0].min(v[1]).min(v[2]);
            let [[left, right], [top, bottom]] =
                [[bounds[0][0][l], bounds[0][1][l]], [bounds[1][0][l], bounds[1][1][l]]];
            let (columns, rows) = (right.wrapping_sub(left), bottom.wrapping_sub(top));
            let depth_min = z[0].min(z[1]).min(z[2]);
            let is_short = (extent(x) <= EXTENT_MAX)
                & (extent(y) <= EXTENT_MAX)
                & (columns < SHORT_MAX)
                & (rows < SHORT_MAX)
                & (depth_min > 0.0);
            let vectors = columns / (LANES / S).max(1) as i32;
            s.classes[l] = if (left > right) | (top > bottom) {
                class::EMPTY
            } else if !is_short {
                class::LONG
            } else if (rows < SIZES) & (vectors < SIZES) {
                rows * SIZES + vectors
            } else {
                class::SHORT
            };
            s.parts.depth_range[0][l] = depth_min;
            // These values may wrap around in lanes that are not short, where nothing reads them.
            let corner = [
                left.wrapping_mul(256).wrapping_sub(half[0]).wrapping_add(shift),
                top.wrapping_mul(256).wrapping_sub(half[1]).wrapping_add(shift),
            ];
            s.parts.set_lane(l, x, y, z, corner);
        }
        s.parts.bounds = bounds;
        s.parts.depth_range[1] = depth_max;
        s
    }
}

impl Parts<LANES> {
    /// Edges and depth, as `Setup`, `Edges::new` and `Edges::at` of `visibility` have them.
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
}

/// A lane of three vectors. Not `map`, which may stay a call.
#[inline(always)]
fn lane<T: Copy>(v: &[[T; LANES]; 3], l: usize) -> [T; 3] {
    [v[0][l], v[1][l], v[2][l]]
}

/// Offset of each lane's sample from the corner of the vector's first pixel, 1/16 px: across, down.
/// The remainder modulo 16 that all samples share is in the corner already.
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
