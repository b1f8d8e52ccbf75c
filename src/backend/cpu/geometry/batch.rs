//! Stage visibility, eight triangles at a time: set-up in lanes, and a short way for small ones.
//!
//! Larger triangles are drawn in the blocks of [`visibility`](super::visibility).

use super::nearest::{Nearest, update};
use super::samples::SampleBand;
use super::setups::{Corners, Setups, lane_offsets};
use super::tiles::Tiles;
use super::visibility;
use super::visibility::{Part, Setup};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::isa::{Isa, LANES};

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
        let next = load_corners(context, self);
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
                tested += draw_long::<S>(context, &setup, id, band);
            }
        }
        tested
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
fn draw_long<const S: usize>(context: &RasterContext<'_>, setup: &Setup, id: u32, band: &mut SampleBand) -> u64 {
    if context.is_plain || !context.isa.has_own_batch() || setup.depth_range[0] <= 0.0 {
        return visibility::draw::<S>(setup, id, &mut Nearest(band));
    }
    let mut parts = 0;
    let (size_px, range) = (band.size_px, band.range());
    visibility::for_each_part::<S>(setup, size_px, range, |part| {
        draw_short::<S>(context.isa, part, id, band);
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

#[inline(always)]
fn load_corners(context: &RasterContext<'_>, batch: &Batch) -> Corners {
    let mut corners = Corners { ids: batch.ids, len: batch.len.min(LANES), ..Corners::default() };
    for l in 0..corners.len {
        for k in 0..3 {
            let v = &context.vertices[batch.vertices[l][k] as usize];
            (corners.x[k][l], corners.y[k][l], corners.z[k][l]) = (v.x, v.y, v.z);
        }
    }
    corners
}
