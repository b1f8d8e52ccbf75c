//! The search for the points to be shaded in eight pixels of a row at a time (stage shade). For
//! each triangle that a pixel's samples show, there is one point at their mean position, or one in
//! each quarter of the pixel (see `shade`), weighted by its share of the samples. Points
//! [wait](super::waiting) until many are shaded together.
//!
//! In each pixel the colours of its triangles are summed up in the order of its samples.
//! [`Shader::pixel`], which shades pixels that show an outline, sums them up in the same order, so
//! both ways give the same bits.

use super::shade::{Shader, for_each_quarter, for_each_triangle};
use super::waiting::{Point, Waiting};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand, for_samples};
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::{SurfacePass, sample_offsets};

dispatch! {
    /// Shades every pixel of the band into `colors` (premultiplied linear RGBA, row by row, nothing behind it), which are
    /// zero.
    pub fn shade_band(context: &RasterContext<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) = shade
}

#[inline(always)]
fn shade(context: &RasterContext<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) {
    for_samples!(band.samples, shade_sampled(context, band, colors));
}

#[inline(always)]
fn shade_sampled<const S: usize>(context: &RasterContext<'_>, band: &SampleBand, colors: &mut [[f32; 4]]) {
    let width = band.size_px[0] as usize;
    let surface = context.plan.surface.as_ref().filter(|surface| surface.is_shaded && !context.is_plain());
    if let Some(surface) = surface {
        shade_together::<S>((context, surface), band, colors);
        return;
    }
    let mut shader = Shader::new(context);
    for (y, row) in (band.shown[0]..band.shown[1]).zip(colors.chunks_exact_mut(width)) {
        for (x, color) in (0_u32..).zip(row) {
            *color = shader.pixel::<S>(band, x, y);
        }
    }
}

/// As [`shade_band`] where the surface is shaded, many points at a time.
#[inline(always)]
fn shade_together<const S: usize>(
    (context, surface): (&RasterContext<'_>, &SurfacePass<'_>),
    band: &SampleBand,
    colors: &mut [[f32; 4]],
) {
    let width = band.size_px[0] as usize;
    let mut finder = Finder {
        context,
        shader: Shader::new(context),
        band,
        triangles: context.plan.triangles.len() as u32,
        waiting: Waiting::new(context, surface),
    };
    for (row, y) in (band.shown[0]..band.shown[1]).enumerate() {
        let first = band.index(0, y as i32, 0);
        let (pixels, _) = band.ids[first..first + width * S].as_chunks::<S>();
        let (groups, rest) = pixels.as_chunks::<LANES>();
        for (group, ids) in groups.iter().enumerate() {
            let x = (group * LANES) as u32;
            finder.find_in_eight(ids, [x, y], row * width, colors);
        }
        for (i, ids) in rest.iter().enumerate() {
            let x = (groups.len() * LANES + i) as u32;
            finder.find_in_pixel(ids, [x, y], row * width, colors);
        }
    }
    finder.waiting.shade(colors);
}

/// Finds the points of a band.
struct Finder<'a> {
    context: &'a RasterContext<'a>,
    shader: Shader<'a>,
    band: &'a SampleBand,
    /// Triangles of the surface; those from this number on are a hull's.
    triangles: u32,
    waiting: Waiting<'a>,
}

impl Finder<'_> {
    /// Adds the points of eight neighbours, the first of which lies at `[x, y]`. Its row of colours begins at `row`.
    #[inline(always)]
    fn find_in_eight<const S: usize>(
        &mut self,
        ids: &[[u32; S]; LANES],
        [x, y]: [u32; 2],
        row: usize,
        colors: &mut [[f32; 4]],
    ) {
        let (mut not_empty, mut is_hull) = (0, false);
        for id in ids.as_flattened() {
            not_empty |= id ^ NOTHING;
            is_hull |= (*id >= self.triangles) & (*id != NOTHING);
        }
        if not_empty == 0 {
            return;
        }
        if is_hull {
            for (x, ids) in (x..).zip(ids) {
                self.find_in_pixel(ids, [x, y], row, colors);
            }
            return;
        }
        let mut seen = [[0; LANES]; S];
        for l in 0..LANES {
            for s in 0..S {
                seen[s][l] = ids[l][s];
            }
        }
        for s in 0..S {
            let mut is_new = [false; LANES];
            for l in 0..LANES {
                is_new[l] = seen[s][l] != NOTHING;
            }
            let is_divided = self.are_quartered(&seen[s]);
            for (before, in_quarter) in seen[..s].iter().zip(quarter_of(s as u32, S as u32)) {
                for l in 0..LANES {
                    is_new[l] &= (before[l] != seen[s][l]) | (is_divided[l] & !in_quarter);
                }
            }
            let mut new = 0;
            for l in 0..LANES {
                new |= u32::from(is_new[l]) << l;
            }
            if new != 0 {
                self.push(&seen, (s, new, is_divided), [x, y], (row, colors));
            }
        }
    }

    /// True for triangles that are shaded in each quarter of a pixel.
    #[inline(always)]
    fn are_quartered(&self, ids: &[u32; LANES]) -> [bool; LANES] {
        let mut are = [false; LANES];
        if self.shader.has_quarters() {
            for l in 0..LANES {
                are[l] = self.shader.is_quartered(ids[l]);
            }
        }
        are
    }

    /// Adds what the pixels whose bits are in `new` see with sample `s` for the first time: in its quarter of the pixel
    /// alone where `is_divided`.
    #[inline(always)]
    fn push<const S: usize>(
        &mut self,
        seen: &[[u32; LANES]; S],
        (s, mut new, is_divided): (usize, u32, [bool; LANES]),
        pixel: [u32; 2],
        (row, colors): (usize, &mut [[f32; 4]]),
    ) {
        let (mut count, mut offset) = ([0; LANES], [[0; LANES]; 2]);
        let samples = seen.iter().zip(sample_offsets(S as u32)).zip(quarter_of(s as u32, S as u32));
        for ((own, at), in_quarter) in samples.skip(s) {
            for l in 0..LANES {
                let is_own = i32::from((own[l] == seen[s][l]) & (!is_divided[l] | in_quarter));
                count[l] += is_own;
                offset[0][l] += is_own * at[0];
                offset[1][l] += is_own * at[1];
            }
        }
        let corner = self.context.corner_of(pixel);
        let (mut at, mut weights) = ([[0.0; LANES]; 2], [0.0; LANES]);
        for l in 0..LANES {
            // A triangle that covers all samples covers the pixel.
            let is_all = count[l] == S as i32;
            let scale = recip(count[l].max(1) as f32);
            for k in 0..2 {
                let sum = if is_all { 128 * S as i32 } else { offset[k][l] };
                let left = if k == 0 { corner[0] + 256 * l as i32 } else { corner[1] };
                at[k][l] = left as f32 + sum as f32 * scale;
            }
            weights[l] = count[l] as f32 / S as f32;
        }
        let open = self.open_shares::<S>((s, new), pixel);
        while new != 0 {
            let l = new.trailing_zeros() as usize % LANES;
            new &= new - 1;
            let (at, x) = ([at[0][l], at[1][l]], pixel[0] + l as u32);
            let pixel = (row + x as usize) as u32;
            self.waiting.push(Point { id: seen[s][l], at, weight: weights[l], pixel, open: open[l] }, colors);
        }
    }

    /// The shares of light that reach sample `s` of the pixels whose bits are in `of`.
    #[inline(always)]
    fn open_shares<const S: usize>(&self, (s, of): (usize, u32), [x, y]: [u32; 2]) -> [f32; LANES] {
        let mut open = [1.0; LANES];
        let Some((pass, occlusion)) = self.context.occlusion else { return open };
        let first = self.band.index(x as i32, y as i32, 0);
        let depths = &self.band.depth[first..first + S * LANES];
        let (mut z, mut own_z) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            (z[l], own_z[l]) = (depths[S * l + s], depths[S * l]);
        }
        let mut far = occlusion.open_shares(pass, [x, y], (&z, &own_z), &mut open) & of;
        while far != 0 {
            let l = far.trailing_zeros() as usize % LANES;
            far &= far - 1;
            open[l] = occlusion.open_share(pass, [x + l as u32, y], z[l], own_z[l]);
        }
        open
    }

    /// Adds the points of a pixel. Its colour is found at once if it shows a hull.
    #[inline(always)]
    fn find_in_pixel<const S: usize>(&mut self, ids: &[u32; S], [x, y]: [u32; 2], row: usize, colors: &mut [[f32; 4]]) {
        let pixel = row + x as usize;
        if ids.iter().any(|&id| id >= self.triangles && id != NOTHING) {
            colors[pixel] = self.shader.pixel::<S>(self.band, x, y);
            return;
        }
        let first = self.band.index(x as i32, y as i32, 0);
        if self.shader.has_quarters() {
            for_each_quarter(
                ids,
                |id| self.shader.is_quartered(id),
                |id, s, offset, count, _| {
                    let depths = &self.band.depth[first..first + S];
                    let open = self.shader.open_share([x, y], depths[s], depths[0]);
                    let at = self.shader.mean_place([x, y], offset, count);
                    let weight = count as f32 / S as f32;
                    self.waiting.push(Point { id, at, weight, pixel: pixel as u32, open }, colors);
                },
            );
            return;
        }
        for_each_triangle(ids, |id, s, offset, count| {
            let offset = if count == S as i32 { [128 * count; 2] } else { offset };
            let depths = &self.band.depth[first..first + S];
            let open = self.shader.open_share([x, y], depths[s], depths[0]);
            let at = self.shader.mean_place([x, y], offset, count);
            let weight = count as f32 / S as f32;
            self.waiting.push(Point { id, at, weight, pixel: pixel as u32, open }, colors);
        });
    }
}

/// Per sample of so many, true if it lies in the same quarter of a pixel as sample `s`.
#[inline(always)]
fn quarter_of(s: u32, samples: u32) -> impl Iterator<Item = bool> {
    let offsets = sample_offsets(samples);
    let quarter = |at: &[i32; 2]| [at[0] >= 128, at[1] >= 128];
    let own = quarter(&offsets[s as usize]);
    offsets.iter().map(move |at| quarter(at) == own)
}

impl RasterContext<'_> {
    /// The upper left corner of a pixel, in 1/256 px from the picture's centre.
    #[inline(always)]
    pub(super) fn corner_of(&self, [x, y]: [u32; 2]) -> [i32; 2] {
        let plan = self.plan;
        [x as i32 * 256 - plan.width_px as i32 * 128, y as i32 * 256 - plan.height_px as i32 * 128]
    }
}
