//! The depths that the stage occlusion (screen-space ambient occlusion) reads. For each pixel, the grid has the
//! distance from the far plane to the surface that the pixel's first sample shows, in pixels. Twin of
//! `shaders/occlusion/grid.wgsl`.
//!
//! In memory, every fourth pixel of a row lies side by side. These pixels look at neighbours in the same
//! directions, so the neighbours of eight of them are loaded as one vector. A border of empty pixels around the
//! picture saves the test whether a neighbour lies in the picture.

use std::ops::Range;

use crate::backend::cpu::geometry::samples::{SampleBand, for_samples};
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::OcclusionPass;

/// The place of nothing: so far behind all else that no surface takes light from it.
pub const NOWHERE: f32 = -1e15;

/// Distance between the columns that lie together.
pub const PHASES: usize = 4;

/// Places per pixel.
#[derive(Default)]
pub struct Grid {
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
    /// Columns and rows around it, a multiple of [`PHASES`].
    border: usize,
    /// Columns that lie together, with room for a vector to hang over.
    part: usize,
    /// Distance before the far plane, or [`NOWHERE`].
    depths: Vec<f32>,
}

impl Grid {
    /// Places for a picture.
    pub fn len(pass: &OcclusionPass, size_px: [u32; 2]) -> usize {
        let (border, part) = Self::layout(pass, size_px[0]);
        PHASES * part * (size_px[1] as usize + 2 * border)
    }

    fn layout(pass: &OcclusionPass, width_px: u32) -> (usize, usize) {
        let reach = pass.taps.as_flattened().iter().map(|v| v.unsigned_abs()).max().unwrap_or(0).max(2);
        let border = (reach as usize).next_multiple_of(PHASES);
        (border, (width_px as usize + 2 * border).div_ceil(PHASES) + LANES)
    }

    /// Empties the grid for a picture.
    pub fn reset(&mut self, pass: &OcclusionPass, [width_px, height_px]: [u32; 2]) {
        let (border, part) = Self::layout(pass, width_px);
        if (self.width_px, self.height_px, self.border) != (width_px, height_px, border) {
            self.depths.clear();
            self.depths.resize(Self::len(pass, [width_px, height_px]), NOWHERE);
        }
        (self.width_px, self.height_px, self.border, self.part) = (width_px, height_px, border, part);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.depths.capacity() * size_of::<f32>()
    }

    /// Items of a row.
    pub fn stride(&self) -> usize {
        PHASES * self.part
    }

    /// All places.
    pub fn depths(&self) -> &[f32] {
        &self.depths
    }

    /// The items of the picture's rows.
    pub fn picture(&self) -> Range<usize> {
        let first = self.border * self.stride();
        first..first + self.height_px as usize * self.stride()
    }

    /// The places in the picture's rows.
    pub fn picture_mut(&mut self) -> &mut [f32] {
        let picture = self.picture();
        &mut self.depths[picture]
    }

    /// Index of the place `across` and `down` from a pixel; those of pixels [`PHASES`] columns farther each
    /// follow.
    #[inline(always)]
    pub fn index(&self, [x, y]: [u32; 2], [across, down]: [i32; 2]) -> usize {
        let column = (x as i32 + self.border as i32 + across) as usize;
        let row = (y as i32 + self.border as i32 + down) as usize;
        row * self.stride() + (column % PHASES) * self.part + column / PHASES
    }

    /// Of the eight pixels around one, that whose place is nearest to that of depth `z`.
    #[inline(never)]
    pub fn nearest_neighbour(&self, pass: &OcclusionPass, pixel: [u32; 2], z: f32) -> Option<[u32; 2]> {
        let place = place_of(pass, z);
        let (mut nearest, mut best) = (f32::INFINITY, None);
        for down in -1..=1 {
            for across in -1..=1 {
                let depth = self.depths[self.index(pixel, [across, down])];
                let difference = (depth - place).abs();
                if depth > NOWHERE && difference < nearest {
                    nearest = difference;
                    best = Some([(pixel[0] as i32 + across) as u32, (pixel[1] as i32 + down) as u32]);
                }
            }
        }
        best
    }
}

/// Eight values from `at` on; zeros where there are not so many.
#[inline(always)]
pub fn lanes(all: &[f32], at: usize) -> &[f32; LANES] {
    all.get(at..).and_then(|values| values.first_chunk()).unwrap_or(&[0.0; LANES])
}

/// The place of a sample of depth `z`, pixels before the far plane.
#[inline(always)]
pub fn place_of(pass: &OcclusionPass, z: f32) -> f32 {
    let [a, b, c] = pass.depth;
    (a * z) * recip(b * z + c)
}

/// Border of a [`Grid`], and its columns that lie together.
pub type Shape = (usize, usize);

dispatch! {
    /// Writes the places of a band's pixels into their rows of the grid; outlines, from triangle `triangles`
    /// on, are nothing.
    pub fn write_band(pass: &OcclusionPass, shape: Shape, band: &SampleBand, triangles: u32, out: &mut [f32]) = write_kernel
}

#[inline(always)]
fn write_kernel(pass: &OcclusionPass, (border, part): Shape, band: &SampleBand, triangles: u32, out: &mut [f32]) {
    for_samples!(band.samples, write_sampled(pass, (border, part), band, triangles, out));
}

#[inline(always)]
fn write_sampled<const S: usize>(
    pass: &OcclusionPass,
    (border, part): Shape,
    band: &SampleBand,
    triangles: u32,
    out: &mut [f32],
) {
    let width = band.size_px[0] as usize;
    for (y, row) in (band.shown[0]..band.shown[1]).zip(out.chunks_exact_mut(PHASES * part)) {
        let first = band.index(0, y as i32, 0);
        let samples = first..first + S * width;
        let (ids, depths) = (&band.ids[samples.clone()], &band.depth[samples]);
        for (phase, out) in row.chunks_exact_mut(part).enumerate() {
            // The border is a multiple of the number of phases.
            let out = &mut out[border / PHASES..][..(width + PHASES - 1 - phase) / PHASES];
            let pixels = ids.chunks(PHASES * S).zip(depths.chunks(PHASES * S));
            for (place, (ids, depths)) in out.iter_mut().zip(pixels) {
                let (id, depth) = (ids[phase * S], depths[phase * S]);
                // `NOTHING` is larger than all ids.
                *place = if id < triangles { place_of(pass, depth) } else { NOWHERE };
            }
        }
    }
}

impl Grid {
    /// The layout, which [`write_band`] takes.
    pub fn shape(&self) -> Shape {
        (self.border, self.part)
    }
}
