//! Sorting of triangles and edges into bands of rows, before the stage visibility.

use std::ops::Range;

use rayon::prelude::*;

use super::bin::Bin;
use super::keep::TrianglePass;
use super::triangle_bins::TriangleBin;
use crate::backend::cpu::lines::contour;
use crate::backend::cpu::lines::segment::{PixelBox, Segment};
use crate::backend::cpu::{CHUNK, RasterContext};
use crate::limits::Stopped;
use crate::plan::{DrawPlan, Faces, HullPass, LinePass, pass_mask};

/// Edges that touch this many bands are listed once for all of them.
const TALL_EDGE_BANDS: usize = 4;

/// Items per band, chunk by chunk in ascending order.
pub struct Bins {
    /// For the visibility buffer.
    pub triangles: Vec<TriangleBin>,
    /// For depth peeling.
    pub peel: Vec<TriangleBin>,
    /// By line pass.
    pub edges: Vec<Vec<EdgeBin>>,
}

/// A chunk's edges by band.
#[derive(Default)]
pub struct EdgeBin {
    /// Those that are rims; empty where the pass has no holes.
    pub rims: Bin,
    /// The others.
    pub others: Bin,
    /// The pixels around each edge of the chunk, from the first on; empty where the pass has no holes.
    boxes: Vec<PixelBox>,
    /// The chunk's first edge.
    first: u32,
}

impl EdgeBin {
    /// True if the band has no edge.
    pub fn is_empty_in(&self, band: usize) -> bool {
        self.rims.items_in(band).chain(self.others.items_in(band)).next().is_none()
    }

    /// The pixels around an edge of the chunk, where the pass has holes.
    #[inline(always)]
    pub fn pixel_box(&self, edge: u32) -> Option<&PixelBox> {
        self.boxes.get(edge.wrapping_sub(self.first) as usize)
    }
}

/// Sorts the plan's triangles and edges into bands of `rows`; triangles of the visibility buffer
/// also into those to which they are as close as `margin` rows.
pub fn bin(
    context: &RasterContext<'_>,
    pool: Option<&rayon::ThreadPool>,
    [rows, margin]: [u32; 2],
) -> Result<Bins, Stopped> {
    let plan = context.plan;
    let (base, peel) = passes(plan);
    let bin_all = |passes: Vec<TrianglePass>, margin: u32| {
        let jobs = passes.into_iter().flat_map(chunks_of).collect();
        map(pool, jobs, |pass| match context.deadline.check() {
            Ok(()) => TriangleBin::new(context, [rows, margin], &pass),
            Err(Stopped) => TriangleBin::default(),
        })
    };
    let (triangles, peel) = (bin_all(base, margin), bin_all(peel, 0));
    let bin_pass = |pass: &LinePass| {
        map(pool, chunks(0..pass.edges.len()).collect(), |range| match context.deadline.check() {
            Ok(()) => bin_edges(context, pass, rows, range),
            Err(Stopped) => EdgeBin::default(),
        })
    };
    let edges = plan.lines.iter().map(bin_pass).collect();
    context.deadline.check()?;
    Ok(Bins { triangles, peel, edges })
}

/// A pass in parts.
fn chunks_of(pass: TrianglePass) -> impl Iterator<Item = TrianglePass> {
    chunks(pass.ids.clone()).map(move |ids| TrianglePass { ids, ..pass })
}

/// The passes of the visibility buffer, and those of depth peeling.
fn passes(plan: &DrawPlan<'_>) -> (Vec<TrianglePass>, Vec<TrianglePass>) {
    let count = plan.triangles.len();
    let surface = |pass_bit| plan.surface.as_ref().map(|s| TrianglePass { ids: 0..count, pass_bit, faces: s.faces });
    let around = |hull: &HullPass<'_>| TrianglePass {
        ids: count..count + hull.triangles.len(),
        pass_bit: 0,
        faces: Faces::Both,
    };
    let hull = plan.hull.as_ref().map(around);
    // Without pass masks nothing is peeled.
    let layer = surface(pass_mask::LAYER).filter(|_| plan.peeling().is_some() && !plan.pass_masks.is_empty());
    let (base_hull, peeled_hull) = if plan.has_peeled_hull() { (None, hull) } else { (hull, None) };
    let collect = |passes: [Option<TrianglePass>; 2]| passes.into_iter().flatten().collect();
    (collect([surface(pass_mask::SURFACE), base_hull]), collect([layer, peeled_hull]))
}

fn chunks(range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let end = range.end;
    range.step_by(CHUNK).map(move |first| first..end.min(first + CHUNK))
}

fn band_count(plan: &DrawPlan<'_>, rows: u32) -> usize {
    plan.height_px.div_ceil(rows) as usize
}

fn bin_edges(context: &RasterContext<'_>, pass: &LinePass, rows: u32, range: Range<usize>) -> EdgeBin {
    let empty = || Bin::new(band_count(context.plan, rows), TALL_EDGE_BANDS);
    let (reach, has_holes) = (pass.reach_px(), context.plan.has_holes_under(pass));
    let boxes = vec![PixelBox::default(); if has_holes { range.len() } else { 0 }];
    let mut bin = EdgeBin { rims: empty(), others: empty(), boxes, first: range.start as u32 };
    for i in range {
        let edge = &pass.edges[i];
        if !contour::is_drawn(context, pass, edge) {
            continue;
        }
        if let Some(segment) = Segment::new(context, edge) {
            let [first, last] = segment.rows(reach, context.plan.height_px);
            if first <= last {
                let bands = [first, last].map(|row| row as usize / rows as usize);
                let first = bin.first as usize;
                if let Some(place) = bin.boxes.get_mut(i - first) {
                    *place = segment.pixel_box(reach);
                }
                let is_rim = has_holes && context.is_silhouette(edge);
                let bin = if is_rim { &mut bin.rims } else { &mut bin.others };
                bin.push(i as u32, bands);
            }
        }
    }
    bin
}

fn map<T: Send, U: Send>(
    pool: Option<&rayon::ThreadPool>,
    items: Vec<T>,
    each: impl Fn(T) -> U + Sync + Send,
) -> Vec<U> {
    match pool {
        Some(pool) => pool.install(|| items.into_par_iter().map(each).collect()),
        None => items.into_iter().map(each).collect(),
    }
}
