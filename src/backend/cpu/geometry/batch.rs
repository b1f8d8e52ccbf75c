//! Stage visibility, eight triangles at a time: set-up in lanes, and a short way for small ones.
//!
//! Values are those of [`visibility`](super::visibility). Edge functions of triangles up to
//! [`EXTENT_MAX`] fit 32 bits, so no blocks are needed. Larger triangles take that file's way.

use super::nearest::{Nearest, update};
use super::samples::{SampleBand, SampleGrid};
use super::tiles::Tiles;
use super::transform::recip;
use super::visibility;
use super::visibility::{Part, Setup};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::isa::{Isa, LANES};
use crate::plan::sample_offsets;

/// Largest width and height of a triangle that is set up in lanes, 1/256 px. Twice its square, and
/// some, is below 2^31.
pub const EXTENT_MAX: i32 = 64 * 256;

/// Largest width and height of what is drawn without looking which blocks are empty, pixels.
pub const SHORT_MAX: i32 = 16;

/// Draws triangles that need no clipping. Eight are collected while the eight before them wait with
/// their corners loaded, so that the memory is read ahead of what needs it.
#[derive(Default)]
pub struct Batch {
    /// Triangles of which only the indices are known.
    ids: [u32; LANES],
    vertices: [[u32; 3]; LANES],
    len: usize,
    waiting: Corners,
}

impl Batch {
    /// Adds a triangle. True if the batch is full, and to be drawn now.
    #[inline(always)]
    pub fn push(&mut self, id: u32, vertices: [u32; 3]) -> bool {
        self.ids[self.len % LANES] = id;
        self.vertices[self.len % LANES] = vertices;
        self.len += 1;
        self.len == LANES
    }

    /// Loads the new triangles' corners and draws those that wait, except where `tiles` hides them.
    /// Returns the number of samples tested.
    #[inline(always)]
    pub fn draw<const S: usize>(
        &mut self,
        context: &RasterContext<'_>,
        band: &mut SampleBand,
        tiles: Option<&Tiles>,
    ) -> u64 {
        let next = Corners::load(context, self);
        let corners = std::mem::replace(&mut self.waiting, next);
        self.len = 0;
        let setups = set_up::<S>(context.isa, &corners, band);
        let mut tested = 0;
        for l in 0..corners.len {
            let [[left, right], [top, bottom]] = setups.bounds_of(l);
            if left > right || top > bottom {
                continue;
            }
            let depth_max = setups.depth_range[1][l];
            if tiles.is_some_and(|tiles| tiles.hide([left, right], [top, bottom], depth_max)) {
                continue;
            }
            let id = corners.ids[l];
            if setups.is_short[l] && !context.is_plain {
                draw_short::<S>(context.isa, &setups.short(l), id, band);
                tested += ((right - left + 1) * (bottom - top + 1)) as u64 * S as u64;
            } else if let Some(setup) = Setup::new(&context.screen_triangle(id)) {
                tested += match context.is_plain {
                    true => visibility::draw(&setup, id, &mut Nearest(band)),
                    false => draw_long::<S>(context.isa, &setup, id, band),
                };
            }
        }
        tested
    }
}

/// Corners of up to eight triangles.
#[derive(Default)]
pub struct Corners {
    ids: [u32; LANES],
    len: usize,
    pub x: [[i32; LANES]; 3],
    pub y: [[i32; LANES]; 3],
    pub z: [[f32; LANES]; 3],
}

impl Corners {
    #[inline(always)]
    fn load(context: &RasterContext<'_>, batch: &Batch) -> Self {
        let mut corners = Self { ids: batch.ids, len: batch.len.min(LANES), ..Self::default() };
        for l in 0..corners.len {
            for k in 0..3 {
                let v = &context.vertices[batch.vertices[l][k] as usize];
                (corners.x[k][l], corners.y[k][l], corners.z[k][l]) = (v.x, v.y, v.z);
            }
        }
        corners
    }
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
    fn new<const S: usize>(corners: &Corners, band: &SampleBand) -> Self {
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
    fn bounds_of(&self, l: usize) -> [[i32; 2]; 2] {
        let [[left, right], [top, bottom]] = &self.bounds;
        [[left[l], right[l]], [top[l], bottom[l]]]
    }

    /// The short triangle of lane `l`.
    #[inline(always)]
    fn short(&self, l: usize) -> Part {
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

#[inline(always)]
#[allow(unsafe_code)]
fn set_up<const S: usize>(isa: Isa, corners: &Corners, band: &SampleBand) -> Setups {
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx2() {
        // SAFETY: the processor has AVX2, as `isa` says.
        return unsafe { super::batch_avx2::set_up::<S>(corners, band) };
    }
    let _ = isa;
    Setups::new::<S>(corners, band)
}

/// Draws a triangle block by block. Returns the number of samples tested.
#[inline(always)]
fn draw_long<const S: usize>(isa: Isa, setup: &Setup, id: u32, band: &mut SampleBand) -> u64 {
    if !isa.has_own_batch() || setup.depth_range[0] <= 0.0 {
        return visibility::draw(setup, id, &mut Nearest(band));
    }
    let mut parts = 0;
    let (size_px, range) = (band.size_px, band.range());
    visibility::for_each_part::<S>(setup, size_px, range, |part| {
        draw_short::<S>(isa, part, id, band);
        parts += 1;
    });
    parts * (64 * S as u64)
}

/// Draws part of a triangle whose depths are above 0.
#[inline(always)]
#[allow(unsafe_code)]
fn draw_short<const S: usize>(isa: Isa, part: &Part, id: u32, band: &mut SampleBand) {
    #[cfg(target_arch = "x86_64")]
    if isa.has_avx2() {
        // SAFETY: the processor has AVX2, as `isa` says.
        return unsafe { super::batch_avx2::draw_short::<S>(part, id, band) };
    }
    let _ = isa;
    draw_part::<S>(part, id, band);
}

#[inline(always)]
fn draw_part<const S: usize>(part: &Part, id: u32, band: &mut SampleBand) {
    let Part { bounds: [[left, right], [top, bottom]], dx, dy, edges, from, depth, depth_range } = *part;
    let pixels = (LANES / S).max(1);
    for part in 0..S.div_ceil(LANES) {
        let [offset_x, offset_y] = lane_offsets::<S>(part);
        let (mut steps, mut x) = ([[0; LANES]; 3], [0; LANES]);
        for i in 0..LANES {
            for k in 0..3 {
                steps[k][i] = edges[k] + (dx[k] * offset_y[i] - dy[k] * offset_x[i]);
            }
            x[i] = from[0] + 16 * offset_x[i];
        }
        for row in 0..=bottom - top {
            let mut depth_y = [0.0; LANES];
            for i in 0..LANES {
                depth_y[i] = depth[2] * (from[1] + 256 * row + 16 * offset_y[i]) as f32;
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
                    z[i] = visibility::clamp(across + depth_y[i], depth_range);
                }
                if let Some((depths, ids)) = band.lanes_mut(at) {
                    update(&outside, &z, id, depths, ids);
                }
                at += pixels * S;
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
