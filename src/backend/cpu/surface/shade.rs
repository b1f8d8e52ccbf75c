//! Stage shade, per pixel: the colour of each visible triangle. Twin of
//! `shaders/surface/shade.wgsl`.
//!
//! Samples of a pixel that see the same triangle are shaded once, at their mean position
//! ([`point`](super::point)), and weigh their share.

use super::point::{PointShader, Show};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand, for_samples};
use crate::backend::cpu::geometry::transform::recip;
use crate::plan::sample_offsets;

/// Shades every pixel of the band into `colors` (premultiplied linear RGBA, row by row, nothing
/// behind it).
#[inline(always)]
pub fn shade(context: &RasterContext<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) {
    for_samples!(band.samples, shade_sampled(context, band, colors));
}

#[inline(always)]
fn shade_sampled<const S: usize>(context: &RasterContext<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) {
    let width = band.size_px[0];
    let mut shader = Shader::new(context);
    for y in band.shown[0]..band.shown[1] {
        let line = &mut colors[((y - band.shown[0]) * width) as usize..][..width as usize];
        for (x, color) in (0_u32..).zip(line) {
            *color = shader.pixel::<S>(band, x, y);
        }
    }
}

/// Shades pixels of a band.
pub struct Shader<'a> {
    /// Input of the stage.
    context: &'a RasterContext<'a>,
    /// Shades their points.
    points: PointShader<'a>,
}

impl<'a> Shader<'a> {
    /// One for a band.
    pub fn new(context: &'a RasterContext<'a>) -> Self {
        Self { context, points: PointShader::new(context) }
    }

    /// The colour of a pixel of the picture.
    #[inline(always)]
    pub fn pixel<const S: usize>(&mut self, band: &SampleBand, x: u32, y: u32) -> [f32; 4] {
        let at = band.index(x as i32, y as i32, 0);
        let mut ids = [band.ids[at]; S];
        let mut is_mixed = false;
        for s in 1..S {
            ids[s] = band.ids[at + s];
            is_mixed |= ids[s] != ids[0];
        }
        if !is_mixed {
            return self.group(ids[0], x, y, [128 * S as i32; 2], S as i32);
        }
        self.mixed_pixel(ids, x, y)
    }

    fn mixed_pixel<const S: usize>(&mut self, ids: [u32; S], x: u32, y: u32) -> [f32; 4] {
        let mut sum = [0.0; 4];
        self.groups(
            ids,
            [x, y],
            |_| Show::ALL,
            |same, color| {
                let weight = same.iter().filter(|same| **same).count() as f32 / S as f32;
                for k in 0..4 {
                    sum[k] += weight * color[k];
                }
            },
        );
        sum
    }

    /// Shades each triangle among a pixel's samples once, at the mean position of its samples, and
    /// calls `each` with which samples these are, and its colour.
    #[inline(always)]
    pub fn groups<const S: usize>(
        &mut self,
        ids: [u32; S],
        [x, y]: [u32; 2],
        show: impl Fn(u32) -> Show,
        mut each: impl FnMut([bool; S], [f32; 4]),
    ) {
        let offsets = sample_offsets(S as u32);
        for s in 0..S {
            // Each triangle is shaded once, at the first of its samples.
            if ids[s] == NOTHING || ids[..s].contains(&ids[s]) {
                continue;
            }
            let (mut offset, mut count) = ([0, 0], 0);
            for (id, at) in ids.iter().zip(offsets) {
                if *id == ids[s] {
                    offset = [offset[0] + at[0], offset[1] + at[1]];
                    count += 1;
                }
            }
            self.points.show = show(ids[s]);
            let color = self.group(ids[s], x, y, offset, count);
            each(ids.map(|id| id == ids[s]), color);
        }
    }

    /// The colour of triangle `id` at the mean of `count` samples whose offsets in 1/256 px add up
    /// to `offset_sum`.
    #[inline(always)]
    fn group(&mut self, id: u32, x: u32, y: u32, offset_sum: [i32; 2], count: i32) -> [f32; 4] {
        if id == NOTHING {
            return [0.0; 4];
        }
        if let Some(color) = self.points.flat(id) {
            return color;
        }
        let plan = self.context.plan;
        let scale = recip(count as f32);
        let corner = [x as i32 * 256 - plan.width_px as i32 * 128, y as i32 * 256 - plan.height_px as i32 * 128];
        let at = [corner[0] as f32 + offset_sum[0] as f32 * scale, corner[1] as f32 + offset_sum[1] as f32 * scale];
        match (self.context.is_hull(id), &plan.surface, &plan.hull) {
            (false, Some(surface), _) if surface.is_shaded => self.points.color(surface, id, at),
            (true, _, Some(hull)) => hull.color(id as usize),
            _ => [0.0; 4],
        }
    }
}
