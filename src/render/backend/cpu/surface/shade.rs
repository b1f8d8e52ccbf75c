//! The colour of a pixel, from the triangles that its samples show (stage shade). Twin of
//! `shaders/surface/shade.wgsl`.
//!
//! Samples of a pixel that show the same triangle are shaded once, at their mean position
//! ([`point`](super::point)). The colour is weighted by their share of the pixel's samples. With
//! adaptive samples, metals that may mirror sharply and have vertex normals are shaded once in
//! each quarter of a pixel, because what they mirror changes within a pixel.

use super::point::{PointShader, Show};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::transform::recip;
use crate::plan::{SurfacePass, sample_offsets};

/// Shades pixels of a band.
pub struct Shader<'a> {
    /// Input of the stage.
    context: &'a RasterContext<'a>,
    /// Shades their points.
    points: PointShader<'a>,
    /// The surface, if some faces are shaded in each quarter of a pixel.
    quartered: Option<&'a SurfacePass<'a>>,
}

impl<'a> Shader<'a> {
    /// One for a band.
    pub fn new(context: &'a RasterContext<'a>) -> Self {
        let quartered = context.plan.surface.as_ref().filter(|_| context.has_quarters);
        Self { context, points: PointShader::new(context), quartered }
    }

    /// True if some faces are shaded in each quarter of a pixel.
    #[inline(always)]
    pub fn has_quarters(&self) -> bool {
        self.quartered.is_some()
    }

    /// True if a triangle is shaded in each quarter of a pixel.
    #[inline(always)]
    pub fn is_quartered(&self, id: u32) -> bool {
        is_quartered(self.context, self.quartered, id)
    }

    /// The share of light that reaches a surface of depth `z` in a pixel whose first sample has the depth
    /// `own_z`.
    #[inline(always)]
    pub fn open_share(&self, pixel: [u32; 2], z: f32, own_z: f32) -> f32 {
        self.context.occlusion.map_or(1.0, |(pass, occlusion)| occlusion.open_share(pass, pixel, z, own_z))
    }

    /// The mean of `count` samples of a pixel, whose offsets in 1/256 px add up to `offset_sum`: in 1/256
    /// px from the picture's centre.
    #[inline(always)]
    pub(super) fn mean_place(&self, [x, y]: [u32; 2], offset_sum: [i32; 2], count: i32) -> [f32; 2] {
        let scale = recip(count as f32);
        let corner = self.context.corner_of([x, y]);
        [corner[0] as f32 + offset_sum[0] as f32 * scale, corner[1] as f32 + offset_sum[1] as f32 * scale]
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
        if !is_mixed && !self.is_quartered(ids[0]) {
            self.points.open = self.open_share([x, y], band.depth[at], band.depth[at]);
            return self.group(ids[0], x, y, [128 * S as i32; 2], S as i32);
        }
        self.mixed_pixel(ids, Some(&band.depth[at..at + S]), x, y)
    }

    fn mixed_pixel<const S: usize>(&mut self, ids: [u32; S], depths: Option<&[f32]>, x: u32, y: u32) -> [f32; 4] {
        let mut sum = [0.0; 4];
        self.groups(
            (ids, depths),
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

    /// Shades each triangle among a pixel's samples once, at the mean position of its samples, or once in each quarter of
    /// the pixel, and calls `each` with which samples these are, and its colour. The samples' depths tell the light that
    /// a surface goes without; without them, all of it is there.
    #[inline(always)]
    pub fn groups<const S: usize>(
        &mut self,
        (ids, depths): ([u32; S], Option<&[f32]>),
        [x, y]: [u32; 2],
        show: impl Fn(u32) -> Show,
        mut each: impl FnMut([bool; S], [f32; 4]),
    ) {
        let (context, quartered) = (self.context, self.quartered);
        let mut shade = |own: u32, s: usize, offset, count, same| {
            self.points.show = show(own);
            self.points.open = depths.map_or(1.0, |depths| self.open_share([x, y], depths[s], depths[0]));
            let color = self.group(own, x, y, offset, count);
            each(same, color);
        };
        if quartered.is_some() {
            for_each_quarter(&ids, |id| is_quartered(context, quartered, id), shade);
            return;
        }
        for_each_triangle(&ids, |own, s, offset, count| shade(own, s, offset, count, ids.map(|id| id == own)));
    }

    /// The colour of triangle `id` at a point, 1/256 px from the picture's centre, in a pixel whose first
    /// sample has the depth `own_z`. Its own depth there is `z`.
    pub fn at_point(&mut self, id: u32, at: [f32; 2], pixel: [u32; 2], [z, own_z]: [f32; 2]) -> [f32; 4] {
        self.points.show = Show::ALL;
        self.points.open = self.open_share(pixel, z, own_z);
        self.colored(id, at)
    }

    /// The colour of triangle `id` in pixel (`x`, `y`), at the mean of `count` samples whose offsets from the pixel's
    /// centre, 1/256 px, add up to `offset_sum`. Transparent where `id` is [`NOTHING`].
    #[inline(always)]
    fn group(&mut self, id: u32, x: u32, y: u32, offset_sum: [i32; 2], count: i32) -> [f32; 4] {
        if id == NOTHING {
            return [0.0; 4];
        }
        let at = self.mean_place([x, y], offset_sum, count);
        self.colored(id, at)
    }

    #[inline(always)]
    fn colored(&mut self, id: u32, at: [f32; 2]) -> [f32; 4] {
        if let Some(color) = self.points.flat(id) {
            return color;
        }
        let plan = self.context.plan;
        match (self.context.is_hull(id), &plan.surface, &plan.hull) {
            (false, Some(surface), _) if surface.is_shaded => self.points.color(surface, id, at),
            (true, _, Some(hull)) => hull.color(id as usize),
            _ => [0.0; 4],
        }
    }
}

#[inline(always)]
fn is_quartered(context: &RasterContext<'_>, surface: Option<&SurfacePass<'_>>, id: u32) -> bool {
    // The material is that of a surface's triangle, not of a hull's.
    surface.is_some_and(|surface| {
        (id as usize) < context.plan.triangles.len() && surface.material(id as usize).is_quartered()
    })
}

/// As [`for_each_triangle`], with which samples they are; triangles that are shaded in each quarter of the pixel come once
/// for each quarter in which they have samples.
#[inline(always)]
pub(super) fn for_each_quarter<const S: usize>(
    ids: &[u32; S],
    is_quartered: impl Fn(u32) -> bool,
    mut each: impl FnMut(u32, usize, [i32; 2], i32, [bool; S]),
) {
    let offsets = sample_offsets(S as u32);
    let quarter = |s: usize| offsets[s].map(|at| at >= 128);
    for s in 0..S {
        if ids[s] == NOTHING {
            continue;
        }
        let is_divided = is_quartered(ids[s]);
        let same: [bool; S] = std::array::from_fn(|t| ids[t] == ids[s] && (!is_divided || quarter(t) == quarter(s)));
        if same[..s].contains(&true) {
            continue;
        }
        let (mut offset, mut count) = ([0, 0], 0);
        for t in (0..S).filter(|&t| same[t]) {
            offset = [offset[0] + offsets[t][0], offset[1] + offsets[t][1]];
            count += 1;
        }
        each(ids[s], s, offset, count, same);
    }
}

/// Calls `each` with every triangle among a pixel's samples: its id, the number of its first sample, the
/// sum of its samples' offsets in 1/256 px, and how many they are.
#[inline(always)]
pub(super) fn for_each_triangle<const S: usize>(ids: &[u32; S], mut each: impl FnMut(u32, usize, [i32; 2], i32)) {
    let offsets = sample_offsets(S as u32);
    for s in 0..S {
        if ids[s] == NOTHING || ids[..s].contains(&ids[s]) {
            continue;
        }
        let (mut offset, mut count) = ([0, 0], 0);
        for (id, at) in ids.iter().zip(offsets) {
            let is_own = i32::from(*id == ids[s]);
            offset = [offset[0] + is_own * at[0], offset[1] + is_own * at[1]];
            count += is_own;
        }
        each(ids[s], s, offset, count);
    }
}
