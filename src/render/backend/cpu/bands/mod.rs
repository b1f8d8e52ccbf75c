//! The drawing of one band, through the stages from visibility to resolve. A band is a range of pixel rows, most
//! often so few that its buffers fit a core's cache. It depends on no other band, so threads draw several at a time.
//! Occlusion alone looks at the whole picture: it is found between two runs over all bands.
//!
//! [`bins`] sorts triangles and edges into bands, [`scratch`] holds a band's buffers.

mod bin;
pub(crate) mod bins;
mod keep;
pub(crate) mod lists;
pub(crate) mod scratch;
pub(crate) mod triangle_bins;

use std::ops::ControlFlow;

use half::f16;

use self::bins::{Bins, EdgeBin};
use self::lists::BandLists;
use self::scratch::BandScratch;
use self::triangle_bins::TriangleBin;
use super::context::RasterContext;
use super::isa::{LANES, dispatch};
use super::resolve;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::batch::Batch;
use crate::backend::cpu::geometry::nearest::Nearest;
use crate::backend::cpu::geometry::samples::{SampleBand, for_samples};
use crate::backend::cpu::geometry::tiles::Tiles;
use crate::backend::cpu::geometry::visibility;
use crate::backend::cpu::geometry::visibility::Setup;
use crate::backend::cpu::lines::coverage::{BandStrokes, Covered, LineCompositor, composite};
use crate::backend::cpu::lines::edge::{Drawn, LineDrawer, LineTarget};
use crate::backend::cpu::lines::farthest::Farthest;
use crate::backend::cpu::lines::fringes::{add_fringes, add_fringes_plainly};
use crate::backend::cpu::lines::holes::dig::add_holes;
use crate::backend::cpu::lines::holes::free_points::{add_points, add_points_plainly};
use crate::backend::cpu::lines::holes::{self, Holes};
use crate::backend::cpu::lines::line_light;
use crate::backend::cpu::lines::plain::add_holes_plainly;
use crate::backend::cpu::mixed::draw::draw_mixed;
use crate::backend::cpu::occlusion::grid::{Shape, write_band};
use crate::backend::cpu::peeling;
use crate::backend::cpu::peeling::state::PeelBand;
use crate::backend::cpu::resolve::Resolver;
use crate::backend::cpu::surface::flat::{draw_flat, shade_flat};
use crate::backend::cpu::surface::light::Light;
use crate::backend::cpu::surface::together::shade_band;
use crate::backend::{DrawStage, linear};
use crate::plan::{LinePass, OcclusionPass, Shown};

/// Edges between two polls of the deadline. Wide lines count their pixels too.
const EDGES_PER_POLL: usize = 256;

/// Draws band number `band` into its rows of the picture.
pub fn draw(context: &RasterContext<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize, rgba: &mut [u8]) {
    let (plan, isa) = (context.plan, context.isa);
    let mut lap = context.watch.begin();
    fill_samples(context, scratch, bins, band);
    lap.end(DrawStage::Visibility);
    if let (true, Some(flat)) = (plan.lines.is_empty(), context.flat) {
        draw_flat(isa, context, flat, &scratch.samples, rgba);
        lap.end(DrawStage::Shade);
        if plan.is_adaptive {
            let (width, first) = (plan.width_px as usize, scratch.samples.shown[0]);
            let (pixels, _) = rgba.as_chunks_mut::<4>();
            draw_mixed(
                context,
                (&bins.triangles, band),
                (&scratch.samples, None),
                &mut scratch.mixed,
                |x, y, color| {
                    let resolver = Resolver::new(plan.background_at(y), context.srgb);
                    pixels[(y - first) as usize * width + x as usize] = resolver.pixel(color);
                },
            );
            lap.end(DrawStage::Mixed);
        }
        return;
    }
    draw_colors(context, scratch, bins, band, rgba.len() / 4);
    let mut lap = context.watch.begin();
    resolve::resolve(isa, plan, context.srgb, scratch.samples.shown[0], &scratch.colors, rgba);
    lap.end(DrawStage::Resolve);
}

/// Draws band number `band` into its rows of the picture in linear light.
pub fn draw_linear(
    context: &RasterContext<'_>,
    scratch: &mut BandScratch,
    bins: &Bins,
    band: usize,
    rgba: &mut [[f16; 4]],
) {
    let mut lap = context.watch.begin();
    fill_samples(context, scratch, bins, band);
    lap.end(DrawStage::Visibility);
    draw_colors(context, scratch, bins, band, rgba.len());
    let mut lap = context.watch.begin();
    let width = context.plan.width_px as usize;
    let rows = scratch.colors.chunks(width).zip(rgba.chunks_mut(width));
    for (row, (colors, out)) in (scratch.samples.shown[0]..).zip(rows) {
        linear::write_row(context.plan, row, colors.iter().copied(), out);
    }
    lap.end(DrawStage::Resolve);
}

/// Fills the colours of a band's pixels: all stages between visibility and resolve.
fn draw_colors(context: &RasterContext<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize, pixels: usize) {
    let (plan, isa) = (context.plan, context.isa);
    let mut lap = context.watch.begin();
    scratch.colors.clear();
    scratch.colors.resize(pixels, [0.0; 4]);
    if let Some(pass) = plan.peeling() {
        let peel = scratch.peel.get_or_insert_with(|| PeelBand::new(&scratch.samples, scratch.rows));
        peeling::composite::draw(context, pass, (&bins.peel, band), &scratch.samples, peel, &mut scratch.colors);
    } else if let Some(flat) = context.flat {
        shade_flat(isa, context, flat, &scratch.samples, &mut scratch.colors);
    } else if plan.is_shaded() {
        shade_band(isa, context, &scratch.samples, &mut scratch.colors);
    }
    if plan.peeling().is_some() || plan.is_shaded() {
        lap.end(DrawStage::Shade);
    }
    if plan.has_mixed() {
        let (width, first) = (plan.width_px as usize, scratch.samples.shown[0]);
        // The scratch may still hold what belongs to another plan.
        let layers = scratch.peel.as_ref().filter(|_| plan.peeling().is_some());
        let (samples, colors) = ((&scratch.samples, layers), &mut scratch.colors);
        draw_mixed(context, (&bins.triangles, band), samples, &mut scratch.mixed, |x, y, color| {
            colors[(y - first) as usize * width + x as usize] = color;
        });
        lap.end(DrawStage::Mixed);
    }
    if !plan.lines.is_empty() {
        draw_lines(context, scratch, bins, band);
        lap.end(DrawStage::Lines);
    }
}

/// Draws band number `band` of the visibility buffer, and writes the places of its pixels for the
/// occlusion stage.
pub fn write_places(
    context: &RasterContext<'_>,
    pass: &OcclusionPass,
    (scratch, bins, band): (&mut BandScratch, &Bins, usize),
    shape: Shape,
    out: &mut [f32],
) {
    fill_samples(context, scratch, bins, band);
    write_band(context.isa, pass, shape, &scratch.samples, context.plan.triangles.len() as u32, out);
}

/// Draws band number `band` of the visibility buffer alone, as
/// [`Renderer::draw_visibility`](super::Renderer) says.
pub fn draw_visibility(
    context: &RasterContext<'_>,
    scratch: &mut BandScratch,
    bins: &Bins,
    band: usize,
    words: &mut [u64],
) {
    fill_samples(context, scratch, bins, band);
    let samples = &scratch.samples;
    for_each_sample(samples, words, |at| samples.word(at));
}

/// Draws band number `band` of peeled layer number `layer` alone, in the words of
/// [`draw_visibility`].
pub fn draw_layer(
    context: &RasterContext<'_>,
    scratch: &mut BandScratch,
    bins: &Bins,
    band: usize,
    layer: u32,
    words: &mut [u64],
) {
    fill_samples(context, scratch, bins, band);
    if let Some(pass) = context.plan.peeling() {
        let peel = scratch.peel.get_or_insert_with(|| PeelBand::new(&scratch.samples, scratch.rows));
        let found = peeling::composite::find_layer(context, pass, (&bins.peel, band), &scratch.samples, peel, layer);
        for_each_sample(&peel.found, words, |at| found[at]);
    }
}

/// Composites the lines of each pass over the colours, one pass after the other, so that memory
/// does not grow with their number.
fn draw_lines(context: &RasterContext<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize) {
    let plan = context.plan;
    let pixels = scratch.colors.len();
    if plan.hides_lines() {
        scratch.farthest.clear(&scratch.samples);
    }
    let compositor = LineCompositor::new(plan, &scratch.samples, scratch.peel.as_ref(), &scratch.mixed.border);
    for (pass, edges) in plan.lines.iter().zip(&bins.edges) {
        let has_faces = || plan.has_holes_under(pass) && bins.triangles.iter().any(|chunk| !chunk.is_empty_in(band));
        if edges.iter().all(|chunk| chunk.is_empty_in(band)) && !has_faces() {
            continue;
        }
        let lit_pixels = if pass.lit && plan.lights_lines() { pixels } else { 0 };
        scratch.strokes.reset(pixels);
        scratch.owners.clear();
        scratch.owners.resize(lit_pixels, 0);
        scratch.line_depths.clear();
        scratch.line_depths.resize(if plan.tints(pass) { pixels } else { 0 }, 0.0);
        scratch.whole.clear();
        scratch.holes.clear();
        if plan.fades_hidden(pass) {
            let target = &mut LineTarget {
                strokes: &mut scratch.strokes,
                owners: &mut scratch.owners,
                depths: &mut [],
                holes: &mut scratch.holes,
            };
            let seen = (&scratch.samples, &mut scratch.farthest);
            draw_edges(context.isa, context, (pass, Drawn::Whole), edges, band, seen, target);
            if plan.has_fringes_under(pass) {
                let triangles = (&bins.triangles[..], band);
                if context.is_plain() {
                    add_fringes_plainly(context, pass, triangles, &scratch.samples, &mut scratch.strokes);
                } else {
                    add_fringes(context.isa, context, pass, triangles, &scratch.samples, &mut scratch.strokes);
                }
            }
            scratch.strokes.take_shares(pass.peak(), &mut scratch.whole);
            // The light on both is that of the samples; where there are none, that of the face with the highest id whose
            // edge is drawn there, hidden or not. Fringes name none.
            for (owner, _) in scratch.owners.iter_mut().zip(&scratch.whole).filter(|(_, share)| **share > 0.0) {
                *owner = (*owner).max(1);
            }
        }
        find_holes(context, pass, (&bins.triangles, band), &scratch.samples, &mut scratch.holes);
        let target = &mut LineTarget {
            strokes: &mut scratch.strokes,
            owners: &mut scratch.owners,
            depths: &mut scratch.line_depths,
            holes: &mut scratch.holes,
        };
        let parts = if pass.shown == Shown::All { Drawn::Whole } else { Drawn::Visible };
        draw_edges(context.isa, context, (pass, parts), edges, band, (&scratch.samples, &mut scratch.farthest), target);
        find_points(context, pass, &scratch.samples, &scratch.holes, (&mut scratch.strokes, &mut scratch.owners));
        if lit_pixels > 0 {
            scratch.holes.own(&mut scratch.owners);
        }
        scratch.light.clear();
        scratch.light.resize(lit_pixels, Light::NONE);
        line_light::light_lines(context, &scratch.samples, &scratch.owners, &mut scratch.light);
        let covered = &Covered { strokes: &scratch.strokes, holes: &scratch.holes, whole: &scratch.whole };
        let seen = (&scratch.light[..], &scratch.line_depths[..]);
        composite(context.isa, &compositor, pass, covered, seen, &mut scratch.colors);
    }
}

/// Finds the holes of a pass in a band, without the marks of rims.
fn find_holes(
    context: &RasterContext<'_>,
    pass: &LinePass,
    triangles: (&[TriangleBin], usize),
    samples: &SampleBand,
    holes: &mut Holes,
) {
    if !context.plan.has_holes_under(pass) {
        holes.clear();
        return;
    }
    holes.reset(samples);
    holes::mark_odd_samples(context.isa, context, samples, holes);
    if context.is_plain() {
        add_holes_plainly(context, pass, triangles, samples, holes);
    } else {
        add_holes(context.isa, context, pass, triangles, samples, holes);
    }
}

/// Adds the points that lines cover where holes do not tell.
fn find_points(
    context: &RasterContext<'_>,
    pass: &LinePass,
    samples: &SampleBand,
    holes: &Holes,
    target: (&mut BandStrokes, &mut [u32]),
) {
    if holes.is_empty() {
        return;
    }
    if context.is_plain() {
        add_points_plainly(context, pass, samples, holes, target);
    } else {
        add_points(context.isa, context, pass, samples, holes, target);
    }
}

/// Fills the words of a band's samples, given where each is.
fn for_each_sample(band: &SampleBand, words: &mut [u64], word: impl Fn(usize) -> u64) {
    for (i, out) in words.iter_mut().enumerate() {
        let (pixel, s) = (i as u32 / band.samples, i as u32 % band.samples);
        let (x, y) = (pixel % band.size_px[0], band.shown[0] + pixel / band.size_px[0]);
        *out = word(band.index(x as i32, y as i32, s));
    }
}

/// Moves the scratch to the band and fills its samples, unless that is done, or nothing in the plan reads
/// them.
fn fill_samples(context: &RasterContext<'_>, scratch: &mut BandScratch, bins: &Bins, band: usize) {
    if scratch.is_filled {
        return;
    }
    let plan = context.plan;
    let first = band as u32 * scratch.rows;
    let end = (first + scratch.rows).min(plan.height_px);
    let samples = &mut scratch.samples;
    samples.shown = [first, end];
    let [top, bottom] = plan.seen_range(plan.height_px);
    samples.first_row = (first as i32 - scratch.margin as i32).max(top);
    samples.rows = ((end + scratch.margin) as i32).min(bottom).abs_diff(samples.first_row);
    if plan.surface.is_some() || plan.hull.is_some() {
        scratch.samples.clear();
        draw_triangles(context.isa, context, bins, band, &mut scratch.samples);
    }
}

dispatch! {
    /// The visibility stage of a band.
    pub fn draw_triangles(context: &RasterContext<'_>, bins: &Bins, band: usize, samples: &mut SampleBand) = triangles_kernel
}

dispatch! {
    /// The line stage of a band.
    pub fn draw_edges(
        context: &RasterContext<'_>,
        pass: (&LinePass, Drawn),
        bins: &[EdgeBin],
        band: usize,
        seen: (&SampleBand, &mut Farthest),
        target: &mut LineTarget<'_>,
    ) = edges_kernel
}

#[inline(always)]
fn triangles_kernel(context: &RasterContext<'_>, bins: &Bins, band: usize, samples: &mut SampleBand) {
    for_samples!(samples.samples, triangles_sampled(context, bins, band, samples));
}

/// Clipped pieces and faces towards the viewer first. Most of those that face away lie behind them,
/// which is quickly seen.
#[inline(always)]
fn triangles_sampled<const S: usize>(context: &RasterContext<'_>, bins: &Bins, band: usize, samples: &mut SampleBand) {
    let mut poll = DeadlinePoll::new(context.deadline);
    for (id, piece) in bins.triangles.iter().flat_map(|chunk| chunk.pieces_in(band)) {
        // Not in a closure, which would be compiled for the baseline.
        let tested = match Setup::new(piece) {
            Some(setup) => visibility::draw::<S>(&setup, id, &mut Nearest(samples)),
            None => 0,
        };
        if poll.is_expired(tested) {
            return;
        }
    }
    if context.is_plain() {
        draw_plainly::<S>(context, bins, band, samples, &mut poll);
        return;
    }
    let lists_of: [fn(&TriangleBin) -> &BandLists; 2] = [|chunk| &chunk.fronts, |chunk| &chunk.backs];
    for (i, list_of) in lists_of.into_iter().enumerate() {
        let lists = || bins.triangles.iter().map(list_of);
        if lists().all(|list| list.is_empty_in(band)) {
            continue;
        }
        // Not in a closure, which would be compiled for the baseline.
        let tiles = if i == 1 { Some(Tiles::new(samples)) } else { None };
        if draw_batches::<S>(context, (lists(), band), samples, tiles.as_ref(), &mut poll).is_break() {
            return;
        }
    }
}

/// Draws a band's triangles one by one.
fn draw_plainly<const S: usize>(
    context: &RasterContext<'_>,
    bins: &Bins,
    band: usize,
    samples: &mut SampleBand,
    poll: &mut DeadlinePoll<'_>,
) {
    for id in bins.triangles.iter().flat_map(|chunk| chunk.whole_in(band)) {
        let setup = Setup::new(&context.screen_triangle(id));
        let tested = setup.map_or(0, |setup| visibility::draw::<S>(&setup, id, &mut Nearest(samples)));
        if poll.is_expired(tested) {
            return;
        }
    }
}

/// Draws a band's triangles of several lists; breaks off when the deadline has passed.
#[inline(always)]
fn draw_batches<'a, const S: usize>(
    context: &RasterContext<'_>,
    (lists, band): (impl Iterator<Item = &'a BandLists>, usize),
    samples: &mut SampleBand,
    tiles: Option<&Tiles>,
    poll: &mut DeadlinePoll<'_>,
) -> ControlFlow<()> {
    let mut batch = Batch::new();
    let mut draw = |batch: &mut Batch, samples: &mut SampleBand| {
        let triangles = batch.len() as u64;
        let tested = batch.draw::<S>(context, samples);
        if poll.is_expired_after(triangles, tested) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    for list in lists {
        if let Some(tiles) = tiles {
            let (listed, tall) = list.boxed_in(band);
            for faces in listed.chunks(LANES).chain(tall.chunks(LANES)) {
                batch.push_seen(context.isa, samples, tiles, faces);
                if batch.is_full() {
                    draw(&mut batch, samples)?;
                }
            }
            continue;
        }
        let (listed, tall) = list.items_in(band);
        for mut ids in [listed, &tall] {
            while !ids.is_empty() {
                ids = batch.fill(ids);
                if batch.is_full() {
                    draw(&mut batch, samples)?;
                }
            }
        }
    }
    draw(&mut batch, samples)
}

#[inline(always)]
fn edges_kernel(
    context: &RasterContext<'_>,
    (pass, parts): (&LinePass, Drawn),
    bins: &[EdgeBin],
    band: usize,
    seen: (&SampleBand, &mut Farthest),
    target: &mut LineTarget<'_>,
) {
    let mut drawer = LineDrawer::new(context, (pass, parts), seen);
    let mut polls = 0;
    // An edge of a wide line is as much work as hundreds of others.
    let mut is_late = |drawer: &mut LineDrawer<'_>| {
        polls += 1;
        (polls % EDGES_PER_POLL == 1 || drawer.is_poll_due()) && context.deadline.check().is_err()
    };
    let is_whole = parts == Drawn::Whole;
    drawer.marks = !is_whole;
    // One loop for both lists, because what it calls is copied into it.
    let lists = bins.iter().flat_map(|chunk| [Some(&chunk.rims), Some(&chunk.unfringed).filter(|_| is_whole)]);
    for edge in lists.flatten().flat_map(|list| list.items_in(band)) {
        if is_late(&mut drawer) {
            return;
        }
        drawer.draw(&pass.edges[edge as usize], target);
    }
    drawer.marks = false;
    if is_whole && context.plan.has_fringes_under(pass) {
        return;
    }
    // Most bands with holes need no other edges.
    if !target.holes.collect_stroked() {
        return;
    }
    for chunk in bins {
        let others = chunk.others(context, pass);
        for edge in others.bin.items_in(band) {
            if is_late(&mut drawer) {
                return;
            }
            // Most edges are far from all pixels with strokes.
            if drawer.may_draw_in(others.pixel_box(edge), target) {
                drawer.draw(&pass.edges[edge as usize], target);
            }
        }
    }
}
