//! The shading of triangles whose colour is the same all over, because their material has no
//! textures, smooth normals and the like (stage shade). Each colour is found once, eight triangles
//! at a time, and pixels look it up; colours of clipped triangles are found per pixel. This is used
//! for pictures in which all materials are like this, if they have neither transparent layers nor
//! darkened hollows (stage occlusion).

use super::flat_colors::{FlatColors, UNKNOWN};
use super::flat_lanes;
use super::point::{Show, flat_colors, is_flat};
use super::shade::Shader;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{SampleBand, for_samples};
use crate::backend::cpu::isa::{Isa, LANES, dispatch, with_simd};
use crate::backend::cpu::resolve::Resolver;
use crate::backend::cpu::threads::map;
use crate::backend::cpu::vector::turned_to_viewer;
use crate::plan::{DrawPlan, SurfacePass, flags};

impl FlatColors {
    /// True if all colours of a plan's visible samples are the same all over a triangle.
    pub fn suffice(plan: &DrawPlan<'_>) -> bool {
        let is_flat = |s: &SurfacePass<'_>| !s.is_shaded || s.materials.iter().all(|m| is_flat(s, m));
        plan.peeling().is_none()
            && plan.occlusion.is_none()
            && plan.is_shaded()
            && plan.surface.as_ref().is_none_or(is_flat)
    }

    /// Finds the colours of all triangles in the bins, which have each triangle once.
    pub fn find(&mut self, context: &RasterContext<'_>, pool: Option<&rayon::ThreadPool>, bins: &[TriangleBin]) {
        let triangles = context.plan.triangles.len() + context.plan.hull.as_ref().map_or(0, |h| h.triangles.len());
        if self.colors.len() != triangles + 1 {
            // Not filled: the system gives zeros, and pages that nothing touches cost nothing.
            self.colors = Vec::new();
            self.colors = vec![[0.0; 4]; triangles + 1];
        }
        self.colors[triangles] = [0.0; 4];
        let mut rest = &mut self.colors[..];
        let mut next = 0;
        let mut jobs = Vec::with_capacity(bins.len());
        for bin in bins {
            let (_, from_here) = rest.split_at_mut(bin.ids.start.saturating_sub(next).min(rest.len()));
            let (own, after) = from_here.split_at_mut(bin.ids.len().min(from_here.len()));
            (rest, next) = (after, bin.ids.end);
            jobs.push((bin, own));
        }
        let each = |(bin, own): (&TriangleBin, &mut [[f32; 4]])| {
            if context.deadline.check().is_ok() {
                find_colors(context.isa, context, bin, own);
            }
        };
        map(pool, jobs, each);
    }
}

dispatch! {
    /// Finds the colours of a chunk's triangles.
    pub fn find_colors(context: &RasterContext<'_>, bin: &TriangleBin, colors: &mut [[f32; 4]]) = find_kernel
}

#[inline(always)]
fn find_kernel(context: &RasterContext<'_>, bin: &TriangleBin, colors: &mut [[f32; 4]]) {
    for id in bin.clipped_ids() {
        colors[id as usize - bin.ids.start] = UNKNOWN;
    }
    for (list, is_front) in [(&bin.fronts, true), (&bin.backs, false)] {
        find_in_list(context, &list.all, is_front, (bin.ids.start, &mut *colors));
    }
}

#[inline(always)]
fn find_in_list(context: &RasterContext<'_>, ids: &[u32], is_front: bool, (first, colors): (usize, &mut [[f32; 4]])) {
    let surface = context.plan.surface.as_ref().filter(|surface| surface.is_shaded);
    let hull = context.plan.hull.as_ref().filter(|_| context.is_hull(first as u32));
    let (Some(surface), None) = (surface, hull) else {
        for &id in ids {
            colors[id as usize - first] = hull.map_or([0.0; 4], |hull| hull.color(id as usize));
        }
        return;
    };
    let mut group = Group { ids: [0; LANES], len: 0, material: 0 };
    if surface.materials.len() == 1 {
        for ids in ids.chunks(LANES) {
            group.ids = [ids[0]; LANES];
            group.ids[..ids.len()].copy_from_slice(ids);
            group.len = ids.len();
            group.color(context, surface, is_front, (first, &mut *colors));
        }
        return;
    }
    for &id in ids {
        let material = surface.triangle_materials.get(id as usize).map_or(0, |&m| m);
        if group.len == LANES || (group.material != material && group.len > 0) {
            group.color(context, surface, is_front, (first, &mut *colors));
            group.len = 0;
        }
        group.material = material;
        group.ids[group.len] = id;
        group.len += 1;
    }
    if group.len > 0 {
        group.color(context, surface, is_front, (first, colors));
    }
}

/// Up to eight triangles of a material.
struct Group {
    ids: [u32; LANES],
    len: usize,
    material: u32,
}

impl Group {
    #[inline(always)]
    fn color(
        &self,
        context: &RasterContext<'_>,
        surface: &SurfacePass<'_>,
        is_front: bool,
        (first, out): (usize, &mut [[f32; 4]]),
    ) {
        let material = surface.material(self.ids[0] as usize);
        let mut normals = [[0.0; LANES]; 3];
        if material.flags & flags::FACE_NORMALS != 0 {
            normals = self.normals(context.isa, surface, is_front);
        }
        let colors = flat_colors(surface, material, &context.plan.projection, Show::ALL, (&normals, &[1.0; LANES]));
        if self.are_written(context.isa, &colors, (first, &mut *out)) {
            return;
        }
        for l in 0..self.len {
            let color = [colors[0][l], colors[1][l], colors[2][l], colors[3][l]];
            out[self.ids[l] as usize - first] = if color.iter().all(|v| v.is_finite()) { color } else { UNKNOWN };
        }
    }

    /// Normals on the viewer's side.
    #[inline(always)]
    fn normals(&self, isa: Isa, surface: &SurfacePass<'_>, is_front: bool) -> [[f32; LANES]; 3] {
        if self.len == LANES {
            let all = &surface.face_normals;
            if let Some(normals) = with_simd!(isa, simd => flat_lanes::normals(simd, all, &self.ids, is_front)) {
                return normals;
            }
        }
        let mut normals = [[0.0; LANES]; 3];
        for l in 0..self.len {
            let normal = turned_to_viewer(surface.face_normals[self.ids[l] as usize], is_front);
            for k in 0..3 {
                normals[k][l] = normal[k];
            }
        }
        normals
    }

    /// Writes eight colours at once. True if there are as many, and all are finite.
    #[inline(always)]
    fn are_written(&self, isa: Isa, colors: &[[f32; LANES]; 4], (first, out): (usize, &mut [[f32; 4]])) -> bool {
        self.len == LANES && with_simd!(isa, simd => flat_lanes::write(simd, colors, &self.ids, first as u32, out))
    }
}

dispatch! {
    /// Shades every pixel of the band into `colors`, as [`shade_band`](super::together::shade_band) does.
    pub fn shade_flat(context: &RasterContext<'_>, flat: &FlatColors, band: &SampleBand, colors: &mut [[f32; 4]]) = shade
}

dispatch! {
    /// Shades every pixel of the band and resolves it into `rgba`: where nothing is drawn over the
    /// surface.
    pub fn draw_flat(context: &RasterContext<'_>, flat: &FlatColors, band: &SampleBand, rgba: &mut [u8]) = draw
}

#[inline(always)]
fn shade(context: &RasterContext<'_>, flat: &FlatColors, band: &SampleBand, colors: &mut [[f32; 4]]) {
    for_samples!(band.samples, shade_sampled(context, flat, band, colors));
}

#[inline(always)]
fn shade_sampled<const S: usize>(
    context: &RasterContext<'_>,
    flat: &FlatColors,
    band: &SampleBand,
    colors: &mut [[f32; 4]],
) {
    let shader = FlatShader::<S> { context, flat, band };
    let width = band.size_px[0] as usize;
    for (y, line) in (band.shown[0]..band.shown[1]).zip(colors.chunks_exact_mut(width)) {
        let groups = shader.row(y).chunks(LANES * S).zip(line.chunks_mut(LANES));
        for (x, (ids, out)) in (0..).step_by(LANES).zip(groups) {
            match shader.only_color(ids) {
                Some(color) => out.fill(color),
                None => shader.mixed(ids, [x, y], out),
            }
        }
    }
}

#[inline(always)]
fn draw(context: &RasterContext<'_>, flat: &FlatColors, band: &SampleBand, rgba: &mut [u8]) {
    for_samples!(band.samples, draw_sampled(context, flat, band, rgba));
}

#[inline(always)]
fn draw_sampled<const S: usize>(context: &RasterContext<'_>, flat: &FlatColors, band: &SampleBand, rgba: &mut [u8]) {
    let shader = FlatShader::<S> { context, flat, band };
    let mut resolver = Resolver::new(context.plan.background_at(band.shown[0]), context.srgb);
    let mut last = None;
    let (pixels, _) = rgba.as_chunks_mut::<4>();
    for (y, line) in (band.shown[0]..band.shown[1]).zip(pixels.chunks_exact_mut(band.size_px[0] as usize)) {
        if context.plan.has_gradient() {
            resolver = Resolver::new(context.plan.background_at(y), context.srgb);
            last = None;
        }
        let groups = shader.row(y).chunks(LANES * S).zip(line.chunks_mut(LANES));
        for (x, (ids, out)) in (0..).step_by(LANES).zip(groups) {
            // Neighbours often have the same id: large flat faces, the background.
            if let Some((_, pixel)) = last.filter(|(id, _)| is_all(ids, *id)) {
                out.fill(pixel);
                continue;
            }
            if let Some(color) = shader.only_color(ids) {
                let pixel = resolver.pixel(color);
                last = Some((ids[0], pixel));
                out.fill(pixel);
                continue;
            }
            let mut colors = [[0.0; 4]; LANES];
            shader.mixed(ids, [x, y], &mut colors[..out.len()]);
            resolver.mixed(&colors, out);
        }
    }
}

/// Shades groups of up to eight pixels in a row.
struct FlatShader<'a, const S: usize> {
    context: &'a RasterContext<'a>,
    flat: &'a FlatColors,
    band: &'a SampleBand,
}

impl<const S: usize> FlatShader<'_, S> {
    /// Ids of a row of the picture.
    #[inline(always)]
    fn row(&self, y: u32) -> &[u32] {
        let first = self.band.index(0, y as i32, 0);
        &self.band.ids[first..first + self.band.size_px[0] as usize * S]
    }

    /// The colour of all samples, if they have one id and its colour is known.
    #[inline(always)]
    fn only_color(&self, ids: &[u32]) -> Option<[f32; 4]> {
        Some(self.flat.of(ids[0])).filter(|color| is_all(ids, ids[0]) && !color[3].is_nan())
    }

    /// Shades pixels from column `x`, row `y` on.
    #[inline(always)]
    fn mixed(&self, ids: &[u32], [x, y]: [u32; 2], out: &mut [[f32; 4]]) {
        let (pixels, _) = ids.as_chunks::<S>();
        if are_means_known::<S>(self.context.isa, self.flat, pixels, out) {
            return;
        }
        for (x, (ids, out)) in (x..).zip(pixels.iter().zip(out)) {
            *out = mean(self.flat, ids);
            if out[3].is_nan() {
                *out = pixel_by_point::<S>(self.context, self.band, [x, y]);
            }
        }
    }
}

/// True if there are no other ids.
#[inline(always)]
fn is_all(ids: &[u32], id: u32) -> bool {
    // Without a way out in between, this is a few vector instructions.
    ids.iter().fold(0, |difference, other| difference | (other ^ id)) == 0
}

/// A pixel with a colour that is not known.
#[cold]
#[inline(never)]
fn pixel_by_point<const S: usize>(context: &RasterContext<'_>, band: &SampleBand, [x, y]: [u32; 2]) -> [f32; 4] {
    Shader::new(context).pixel::<S>(band, x, y)
}

/// Fills a group's pixels with the means of their samples at once, where they have several. True if it did, and knew all
/// colours.
#[inline(always)]
fn are_means_known<const S: usize>(isa: Isa, flat: &FlatColors, pixels: &[[u32; S]], out: &mut [[f32; 4]]) -> bool {
    if S == 4 {
        let (ids, _) = pixels.as_flattened().as_chunks();
        if let (Some(ids), Some(out)) = (ids.first_chunk(), out.first_chunk_mut()) {
            return with_simd!(isa, simd => flat_lanes::means(simd, &flat.colors, ids, out));
        }
    }
    if S.is_multiple_of(LANES) {
        return with_simd!(isa, simd => flat_lanes::means_of_many(simd, &flat.colors, pixels, out));
    }
    false
}

/// The mean of the samples' colours. Each triangle's share is added at once, at its first sample,
/// as [`Shader`] does.
#[inline(always)]
fn mean<const S: usize>(flat: &FlatColors, ids: &[u32; S]) -> [f32; 4] {
    let mut sum = [0.0; 4];
    let mut left = u32::MAX >> (u32::BITS - S as u32);
    while left != 0 {
        let id = ids[left.trailing_zeros() as usize % S];
        let mut same = 0;
        for s in 0..S {
            same |= u32::from(ids[s] == id) << s;
        }
        left &= !same;
        let (weight, color) = (same.count_ones() as f32 * (1.0 / S as f32), flat.of(id));
        for k in 0..4 {
            sum[k] += weight * color[k];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums share by share, in the order of first samples.
    fn plain_mean<const S: usize>(colors: &[[f32; 4]], ids: &[u32; S]) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for (s, id) in ids.iter().enumerate() {
            if ids[..s].contains(id) {
                continue;
            }
            let weight = ids.iter().filter(|other| *other == id).count() as f32 / S as f32;
            let color = colors[(*id as usize).min(colors.len() - 1)];
            for k in 0..4 {
                sum[k] += weight * color[k];
            }
        }
        sum
    }

    /// Compares the means of groups of pixels on an instruction set; how many were known at once.
    fn means_of<const S: usize>(isa: Isa) -> usize {
        let mut state = 5_u32;
        let mut below = |end: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % end
        };
        let colors = (0..20).map(|_| [0; 4].map(|_| below(1000) as f32 / 999.0 - 0.1)).collect();
        let mut flat = FlatColors { colors };
        flat.colors[7] = UNKNOWN;
        flat.colors[19] = [0.0; 4];
        let mut known = 0;
        for round in 0..400 {
            let faces = 1 + round % 7;
            let pixels: Vec<[u32; S]> =
                (0..LANES).map(|_| [0; S].map(|_| [4, 9, 12, 5, 6, u32::MAX, 7][below(faces) as usize])).collect();
            let want: Vec<_> = pixels.iter().map(|ids| plain_mean(&flat.colors, ids)).collect();
            let mut found = vec![[0.0; 4]; LANES];
            let are_known = are_means_known(isa, &flat, &pixels, &mut found);
            let has_unknown = pixels.as_flattened().contains(&7);
            assert!(!(are_known && has_unknown));
            assert!(S == 1 || are_known != has_unknown, "{S} samples");
            for (ids, (want, found)) in pixels.iter().zip(want.iter().zip(&found)) {
                let bits = |color: &[f32; 4]| color.map(f32::to_bits);
                assert_eq!(mean(&flat, ids)[3].is_nan(), ids.contains(&7));
                if !ids.contains(&7) {
                    assert_eq!(bits(&mean(&flat, ids)), bits(want), "{ids:?}");
                }
                assert!(!are_known || bits(found) == bits(want), "{ids:?}");
            }
            known += usize::from(are_known);
        }
        known
    }

    #[test]
    fn every_instruction_set_has_the_same_means() {
        for isa in Isa::available() {
            let known = [means_of::<1>(isa), means_of::<4>(isa), means_of::<8>(isa), means_of::<16>(isa)];
            assert!(known[1..].iter().all(|known| *known > 300), "{known:?}");
        }
    }
}
