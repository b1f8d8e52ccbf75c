//! The colour of a mixed pixel, which is drawn a second time, from 64 or 256 points (stage mixed). It follows from
//! the triangles that are visible at the points.
//!
//! Each visible triangle is shaded once, at the mean position of its points, unless its colour is known already. Its
//! colour weighs as much as its share of the points. A triangle with vertex normals, of a metal that mirrors sharply,
//! is shaded once in each quarter of the pixel in which it has points.

use std::ops::ControlFlow;

use super::band_triangles::{BandTriangles, ScreenTriangle};
use super::crowd::Crowd;
use super::faces::PixelFaces;
use super::find::MixedPixels;
use super::lists::{Listed, ListsEnd, PIXELS_MAX, PixelLists};
use super::points::{ALL_WORDS, Lattice, PointSet};
use super::recent::Recent;
use super::shares::{Share, Shares};
use super::triangle::PointTriangle;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::surface::shade::Shader;
use crate::backend::cpu::surface::waiting::{Point, Waiting};

/// The colours of some mixed pixels, and the points of those at the border of all faces.
#[derive(Default)]
pub struct MixedColors {
    /// By pixel: premultiplied linear RGBA, nothing behind it.
    pub colors: Vec<[f32; 4]>,
    /// Under lines: the pixels, by number, of which some points see nothing, and the points that see something.
    pub borders: Vec<(u32, PointSet<ALL_WORDS>)>,
}

impl MixedColors {
    /// Allocated memory, at most, bytes.
    pub const BYTES_MAX: usize = PIXELS_MAX * (size_of::<[f32; 4]>() + size_of::<(u32, PointSet<ALL_WORDS>)>());

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.colors.capacity() * size_of::<[f32; 4]>()
            + self.borders.capacity() * size_of::<(u32, PointSet<ALL_WORDS>)>()
    }
}

dispatch! {
    /// Finds the colours of the mixed pixels that have lists, or of the one whose list has no room.
    pub fn color(
        context: &RasterContext<'_>,
        triangles: (&BandTriangles<'_>, &PixelLists, &mut Recent),
        pixels: &MixedPixels,
        samples: &SampleBand,
        found: &mut MixedColors,
    ) = color_kernel
}

#[inline(always)]
fn color_kernel(
    context: &RasterContext<'_>,
    (triangles, lists, recent): (&BandTriangles<'_>, &PixelLists, &mut Recent),
    pixels: &MixedPixels,
    samples: &SampleBand,
    found: &mut MixedColors,
) {
    let plan = context.plan;
    let surface =
        plan.surface.as_ref().filter(|surface| surface.is_shaded && !context.is_plain() && context.flat.is_none());
    let waiting = surface.map(|surface| Waiting::new(context, surface));
    let mut painter = Painter { context, shader: Shader::new(context), waiting };
    let mut few = Points::<1>::new();
    let mut all = Points::<ALL_WORDS>::new();
    let MixedColors { colors, borders } = found;
    let has_lines = !plan.lines.is_empty();
    borders.clear();
    borders.reserve_exact(if has_lines { PIXELS_MAX } else { 0 });
    colors.clear();
    colors.reserve_exact(PIXELS_MAX);
    colors.resize(lists.pixels.len(), [0.0; 4]);
    let mut row = pixels.row_of(lists.pixels.start, samples);
    let mut poll = DeadlinePoll::new(context.deadline);
    for (i, pixel) in lists.pixels.clone().enumerate() {
        let place = pixels.place(pixel, samples, &mut row);
        let listed = (lists.end == ListsEnd::Whole).then(|| lists.of(i));
        let own_z = samples.depth[samples.index(place[0] as i32, place[1] as i32, 0)];
        let of_pixel = (i, place, own_z);
        if pixels.needs_few[pixel] {
            few.see(context, (triangles, recent), listed, place);
            painter.paint(&few.shares, of_pixel, colors);
        } else {
            all.see(context, (triangles, recent), listed, place);
            painter.paint(&all.shares, of_pixel, colors);
            let seen = all.shares.points();
            if has_lines && seen != PointSet::ALL && seen != PointSet::NONE {
                borders.push((i as u32, seen));
            }
        }
        if poll.is_expired_after(listed.map_or(1, <[Listed]>::len) as u64, 0) {
            return;
        }
    }
    if let Some(waiting) = &mut painter.waiting {
        waiting.shade(colors);
    }
}

/// The faces that the points of a pixel see. Sets of these points have `W` words.
struct Points<const W: usize> {
    faces: PixelFaces<W>,
    shares: Shares<W>,
}

impl<const W: usize> Points<W> {
    fn new() -> Self {
        Self { faces: PixelFaces::EMPTY, shares: Shares::new() }
    }

    /// Finds the shares of the triangles of a pixel; of all of the band where it has no list of them.
    #[inline(always)]
    fn see(
        &mut self,
        context: &RasterContext<'_>,
        (triangles, recent): (&BandTriangles<'_>, &mut Recent),
        listed: Option<&[Listed]>,
        [x, y]: [u32; 2],
    ) {
        let [width, height] = [context.plan.width_px, context.plan.height_px].map(|size| size as i32);
        let corner = [256 * x as i32 - 128 * width, 256 * y as i32 - 128 * height];
        if let (Some(listed), false) = (listed, context.is_plain()) {
            self.faces.clear();
            let mut has_place = true;
            for triangle in listed {
                if self.faces.are_nearer_than(triangle.nearest) {
                    continue;
                }
                if let Some(triangle) = recent.get(triangles, triangle.item)
                    && !self.faces.offer(context.isa, triangle, corner)
                {
                    has_place = false;
                    break;
                }
            }
            if has_place {
                return self.faces.shares(&mut self.shares);
            }
        }
        self.see_many(context, triangles, listed, corner);
    }

    /// The same, for pixels of many faces.
    #[inline(never)]
    fn see_many(
        &mut self,
        context: &RasterContext<'_>,
        triangles: &BandTriangles<'_>,
        listed: Option<&[Listed]>,
        corner: [i32; 2],
    ) {
        let mut crowd = Crowd::EMPTY;
        let mut poll = DeadlinePoll::new(context.deadline);
        let mut offer = |ScreenTriangle { id, corners }: ScreenTriangle| {
            if let Some(mut triangle) = PointTriangle::new(id, &corners) {
                crowd.offer(context.isa, &mut triangle, corner);
            }
            let is_expired = poll.is_expired(Lattice::<W>::POINTS as u64);
            if is_expired { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        // A picture whose deadline has passed is thrown away.
        let _ = match listed {
            Some(listed) => listed.iter().try_for_each(|triangle| offer(triangles.get(triangle.item))),
            None => triangles.for_each(offer),
        };
        crowd.shares(&mut self.shares);
    }
}

struct Painter<'a> {
    context: &'a RasterContext<'a>,
    shader: Shader<'a>,
    /// None where colours are known, or points are shaded one by one.
    waiting: Option<Waiting<'a>>,
}

impl Painter<'_> {
    /// Adds to the colour of pixel number `i`, whose first sample has the depth `own_z`, what it shows.
    #[inline(always)]
    fn paint<const W: usize>(
        &mut self,
        shares: &Shares<W>,
        (i, pixel, own_z): (usize, [u32; 2], f32),
        colors: &mut [[f32; 4]],
    ) {
        let mut is_of_surface = true;
        for share in shares.all() {
            is_of_surface &= !self.context.is_hull(share.id);
        }
        for share in shares.all() {
            if !self.shader.is_quartered(share.id) {
                self.paint_share(share, is_of_surface, (i, pixel, own_z), colors);
                continue;
            }
            for points in share.points.quarters() {
                if !points.is_empty() {
                    let quarter = Share { points, ..*share };
                    self.paint_share(&quarter, is_of_surface, (i, pixel, own_z), colors);
                }
            }
        }
    }

    /// Adds what a triangle adds, or waits with that if all triangles of the pixel are of the surface.
    #[inline(always)]
    fn paint_share<const W: usize>(
        &mut self,
        Share { id, points, depth }: &Share<W>,
        is_of_surface: bool,
        (i, pixel, own_z): (usize, [u32; 2], f32),
        colors: &mut [[f32; 4]],
    ) {
        let plan = self.context.plan;
        let size = [plan.width_px, plan.height_px];
        let count = points.count();
        let weight = count as f32 / Lattice::<W>::POINTS as f32;
        if let Some(color) = self.context.flat.and_then(|flat| flat.known(*id)) {
            add(&mut colors[i], weight, color);
            return;
        }
        let (place_sum, scale) = (points.place_sum(), recip((2 * count) as f32));
        let mut at = [0.0; 2];
        for k in 0..2 {
            at[k] = (pixel[k] as i32 * 256 - size[k] as i32 * 128) as f32 + place_sum[k] as f32 * scale;
        }
        match &mut self.waiting {
            Some(waiting) if is_of_surface => {
                let open = self.shader.open_share(pixel, *depth, own_z);
                waiting.push(Point { id: *id, at, weight, pixel: i as u32, open }, colors);
            }
            _ => add(&mut colors[i], weight, self.shader.at_point(*id, at, pixel, [*depth, own_z])),
        }
    }
}

#[inline(always)]
fn add(to: &mut [f32; 4], weight: f32, color: [f32; 4]) {
    for k in 0..4 {
        to[k] += weight * color[k];
    }
}
