//! The sorting of triangles and edges into bands, before the stage visibility. A band is a range of pixel rows that
//! one thread draws at a time. For each band, only the triangles that touch it or its margin, and the edges whose lines
//! reach it, are looked at.
//!
//! Rims are the edges at which a surface ends on screen or turns away. If `lines/holes` draws most pixels of a pass
//! of lines from faces alone (`DrawPlan::has_holes_under`), the rims are listed apart from the other edges, because
//! few bands need the others. These are sorted when the first band needs them.

use std::ops::Range;
use std::sync::OnceLock;

use super::bin::Bin;
use super::keep::{Sides, TrianglePass};
use super::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::contour;
use crate::backend::cpu::lines::segment::{PixelBox, Segment};
use crate::backend::cpu::threads::{CHUNK, map};
use crate::limits::Stopped;
use crate::plan::{DrawPlan, Edge, Faces, HullPass, LinePass, pass_mask};

/// Edges that touch more than this many bands are listed once for all of them.
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
    /// The chunk.
    edges: Range<usize>,
    /// Rows of a band.
    rows: u32,
    /// Those that are rims; empty where the pass has no holes.
    pub rims: Bin,
    /// Those of faces without a fringe that are no rims; empty where the pass has no fringes at all.
    pub unfringed: Bin,
    /// By edge of the chunk, true for a silhouette, drawn or not; empty where the pass has no holes.
    are_silhouettes: Vec<bool>,
    /// The others. Where the pass has holes, few bands need them: they are sorted when one does.
    others: OnceLock<OtherEdges>,
}

/// Edges that are no rims.
pub struct OtherEdges {
    pub bin: Bin,
    /// The pixels around each edge of the chunk, from the first on; empty where the pass has no holes.
    boxes: Vec<PixelBox>,
    /// The chunk's first edge.
    first: u32,
}

impl EdgeBin {
    fn new(
        context: &RasterContext<'_>,
        pass: &LinePass,
        rows: u32,
        (edges, triangles): (Range<usize>, &[TriangleBin]),
    ) -> Self {
        let bands = band_count(context.plan, rows);
        let [rims, unfringed] = [(); 2].map(|()| Bin::new(bands, TALL_EDGE_BANDS));
        let mut bin = Self { edges, rows, rims, unfringed, are_silhouettes: Vec::new(), others: OnceLock::new() };
        if !context.plan.has_holes_under(pass) {
            bin.others(context, pass);
            return bin;
        }
        let edges = &pass.edges[bin.edges.clone()];
        let is_closed = pass.unseen_side.is_some();
        bin.are_silhouettes = edges.iter().map(|edge| is_silhouette(context, edge, is_closed, triangles)).collect();
        for ((i, edge), _) in (bin.edges.start as u32..).zip(edges).zip(&bin.are_silhouettes).filter(|(_, is)| **is) {
            if contour::is_drawn(context, pass, edge)
                && let Some((_, bands)) = placed(context, edge, pass.reach_px(), rows)
            {
                bin.rims.push(i, bands);
            }
        }
        if context.plan.has_fringes_under(pass) {
            bin.push_unfringed(context, pass, triangles);
        }
        bin
    }

    /// Lists the edges of faces without a fringe.
    fn push_unfringed(&mut self, context: &RasterContext<'_>, pass: &LinePass, triangles: &[TriangleBin]) {
        let is_unfringed = |face: u32| {
            let chunk = triangles.get(face as usize / CHUNK);
            let sides = chunk.and_then(|chunk| chunk.sides.get(face as usize % CHUNK / LANES));
            sides.is_none_or(|sides| sides.unfringed >> (face as usize % LANES) & 1 != 0)
        };
        for (n, i) in self.edges.clone().enumerate() {
            let edge = &pass.edges[i];
            if !self.are_silhouettes[n]
                && edge.faces.into_iter().any(is_unfringed)
                && let Some((_, bands)) = placed(context, edge, pass.reach_px(), self.rows)
            {
                self.unfringed.push(i as u32, bands);
            }
        }
    }

    /// True if the band has no rim, no edge of a face without a fringe and, where the pass has no holes, no other edge.
    pub fn is_empty_in(&self, band: usize) -> bool {
        let others = self.others.get().into_iter().flat_map(|others| others.bin.items_in(band));
        self.rims.items_in(band).chain(self.unfringed.items_in(band)).chain(others).next().is_none()
    }

    /// The edges that are no rims.
    pub fn others(&self, context: &RasterContext<'_>, pass: &LinePass) -> &OtherEdges {
        self.others.get_or_init(|| OtherEdges::new(context, pass, self.rows, self.edges.clone(), &self.are_silhouettes))
    }
}

impl OtherEdges {
    fn new(
        context: &RasterContext<'_>,
        pass: &LinePass,
        rows: u32,
        edges: Range<usize>,
        are_silhouettes: &[bool],
    ) -> Self {
        let bin = Bin::new(band_count(context.plan, rows), TALL_EDGE_BANDS);
        let has_holes = context.plan.has_holes_under(pass);
        let boxes = vec![PixelBox::default(); if has_holes { edges.len() } else { 0 }];
        let mut others = Self { bin, boxes, first: edges.start as u32 };
        for (n, i) in edges.enumerate() {
            let edge = &pass.edges[i];
            if are_silhouettes.get(n).is_some_and(|is| *is) || !contour::is_drawn(context, pass, edge) {
                continue;
            }
            if let Some((segment, bands)) = placed(context, edge, pass.reach_px(), rows) {
                if let Some(place) = others.boxes.get_mut(n) {
                    *place = segment.pixel_box(pass.reach_px());
                }
                others.bin.push(i as u32, bands);
            }
        }
        others
    }

    /// The pixels around an edge of the chunk, where the pass has holes.
    #[inline(always)]
    pub fn pixel_box(&self, edge: u32) -> Option<&PixelBox> {
        self.boxes.get(edge.wrapping_sub(self.first) as usize)
    }
}

/// True for a silhouette, found by the sides that its faces show where that tells. On a closed mesh the two
/// faces of every edge run along it in opposite directions.
#[inline(always)]
fn is_silhouette(context: &RasterContext<'_>, edge: &Edge, is_closed: bool, triangles: &[TriangleBin]) -> bool {
    let side = |face: u32| {
        let (chunk, face) = (triangles.get(face as usize / CHUNK)?, face as usize % CHUNK);
        let Sides { front, back, .. } = chunk.sides.get(face / LANES)?;
        Some([front, back].map(|bits| bits >> (face % LANES) & 1))
    };
    let runs_along = |face: u32| {
        let ([p, q, r], [a, b]) = (context.triangle(face), edge.vertices);
        ((p == a) & (q == b)) | ((q == a) & (r == b)) | ((r == a) & (p == b))
    };
    let [first, second] = edge.faces;
    match (side(first), side(second)) {
        // Two faces lie on one side of their edge if they show the same side and run along it the same way,
        // or if they do neither.
        (Some(a), Some(b)) if a != [0, 0] && b != [0, 0] => {
            (a == b) == (!is_closed && runs_along(first) == runs_along(second))
        }
        _ => context.is_silhouette(edge),
    }
}

/// An edge on screen, and the first and the last band that it reaches; None if it reaches none.
fn placed(context: &RasterContext<'_>, edge: &Edge, reach_px: f32, rows: u32) -> Option<(Segment, [usize; 2])> {
    let segment = Segment::new(context, edge)?;
    let [first, last] = segment.rows(reach_px, context.plan.height_px);
    (first <= last).then(|| (segment, [first, last].map(|row| row as usize / rows as usize)))
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
            Ok(()) => EdgeBin::new(context, pass, rows, (range, &triangles)),
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
    // Layers are drawn from samples alone.
    let surface = |pass_bit| {
        let has_mixed = plan.has_mixed() && pass_bit == pass_mask::SURFACE;
        let has_points = has_mixed || (plan.has_fringes() && pass_bit == pass_mask::SURFACE);
        plan.surface.as_ref().map(|s| TrianglePass { ids: 0..count, pass_bit, faces: s.faces, has_mixed, has_points })
    };
    let around = |hull: &HullPass<'_>| {
        let has_mixed = plan.has_mixed() && !plan.has_peeled_hull();
        let ids = count..count + hull.triangles.len();
        TrianglePass { ids, pass_bit: 0, faces: Faces::Both, has_mixed, has_points: has_mixed }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::CpuRenderer;
    use crate::backend::cpu::stopwatch::Stopwatch;
    use crate::limits::Deadline;
    use crate::plan::{Projection, SurfacePass};

    /// Pairs of faces with a common edge, wound alike or not, some of them edge-on, behind the eye, or
    /// without a second face.
    #[test]
    fn silhouettes_by_sides_are_those_by_corners() {
        let mut state = 1_u32;
        let mut chance = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let count = 3 * CHUNK as u32 / 2;
        let corner = |i: u32, chance: &mut dyn FnMut() -> f32| {
            let depth = if i.is_multiple_of(50) { 3.0 } else { 0.5 };
            // Few places in one dimension, so that some faces have no area.
            let across = if i.is_multiple_of(7) { 0.1 } else { chance() - 0.5 };
            [across, chance() - 0.5, depth * chance()]
        };
        let positions: Vec<[f32; 3]> = (0..4 * count).map(|i| corner(i / 4, &mut chance)).collect();
        let (mut triangles, mut edges) = (Vec::new(), Vec::new());
        for i in 0..count {
            let [a, b, c, d] = [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3];
            triangles.push([[a, b, c], [c, a, b], [b, a, c]][i as usize % 3]);
            triangles.push(if i % 5 < 3 { [b, a, d] } else { [d, a, b] });
            let second = if i.is_multiple_of(11) { Edge::NO_FACE } else { 2 * i + 1 };
            edges.push(Edge { vertices: [a, b], faces: [2 * i, second] });
        }
        let mut plan = DrawPlan::new([200, 150], &positions, &triangles, Projection::for_tests());
        plan.surface = Some(SurfacePass::new(Faces::Both, Vec::new()));
        let (deadline, watch) = (Deadline::default(), Stopwatch::default());
        let mut cpu = CpuRenderer::new(1);
        cpu.transform(&plan, None);
        let context = cpu.context(&plan, &deadline, &watch);
        let bins = bin(&context, None, [40, 3]).unwrap();
        let (mut silhouettes, mut opposite) = (0, 0);
        for edge in &edges {
            let want = context.is_silhouette(edge);
            assert_eq!(is_silhouette(&context, edge, false, &bins.triangles), want, "{edge:?}");
            silhouettes += usize::from(want);
            let runs_back = |face: u32, [a, b]: [u32; 2]| {
                let t = triangles.get(face as usize)?;
                Some((0..3).any(|k| [t[k], t[(k + 1) % 3]] == [b, a]))
            };
            // As on a closed mesh.
            if let [Some(is_back), Some(other)] = edge.faces.map(|face| runs_back(face, edge.vertices))
                && is_back != other
            {
                assert_eq!(is_silhouette(&context, edge, true, &bins.triangles), want, "{edge:?}");
                opposite += 1;
            }
        }
        assert!(silhouettes > 2000 && silhouettes < edges.len() - 2000, "{silhouettes} of {}", edges.len());
        assert!(opposite > 2000, "{opposite}");
    }
}
