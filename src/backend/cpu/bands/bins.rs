//! Sorting of triangles and edges into bands of rows, before the stage visibility.

use std::ops::Range;

use rayon::prelude::*;

use crate::backend::cpu::geometry::clip::clip_triangle;
use crate::backend::cpu::geometry::transform::{ScreenVertex, homogeneous};
use crate::backend::cpu::geometry::visibility::{area, axis_bounds, passes_culling};
use crate::backend::cpu::lines::contour;
use crate::backend::cpu::lines::segment::Segment;
use crate::backend::cpu::{CHUNK, RasterContext};
use crate::limits::Stopped;
use crate::plan::{DrawPlan, Faces, HullPass, LinePass, pass_mask};

/// Triangles that touch this many bands are listed once for all of them. Otherwise large ones on a
/// tall picture would take gigabytes of lists.
const TALL_BANDS: usize = 8;

/// The same for edges, whose lists are a line pass's own.
const TALL_EDGE_BANDS: usize = 4;

/// Items per band, chunk by chunk in ascending order.
pub struct Bins {
    /// For the visibility buffer.
    pub triangles: Vec<TriangleBin>,
    /// For depth peeling.
    pub peel: Vec<TriangleBin>,
    /// By line pass.
    pub edges: Vec<Vec<Bin>>,
}

/// A chunk's triangles by band.
#[derive(Default)]
pub struct TriangleBin {
    /// Ids of triangles that need no clipping.
    pub whole: Bin,
    /// Id and pieces of clipped triangles.
    pieces: Vec<(u32, [ScreenVertex; 3])>,
    /// Indices into `pieces`.
    piece_bands: Bin,
}

/// A chunk's items by band.
#[derive(Default)]
pub struct Bin {
    by_band: Vec<Vec<u32>>,
    /// Items that touch many bands, with the first and last.
    tall: Vec<(u32, [u32; 2])>,
    /// Number of bands from which an item is tall.
    tall_bands: usize,
}

impl Bin {
    fn new(bands: usize, tall_bands: usize) -> Self {
        Self { by_band: vec![Vec::new(); bands], tall: Vec::new(), tall_bands }
    }

    fn push(&mut self, item: u32, [first, last]: [usize; 2]) {
        if last - first >= self.tall_bands {
            self.tall.push((item, [first as u32, last as u32]));
            return;
        }
        for band in &mut self.by_band[first..=last] {
            band.push(item);
        }
    }

    /// True if every band's items come in ascending order.
    pub fn is_ordered(&self) -> bool {
        self.tall.is_empty()
    }

    /// The band's items.
    pub fn items_in(&self, band: usize) -> impl Iterator<Item = u32> {
        let is_here = move |[first, last]: [u32; 2]| (first as usize..=last as usize).contains(&band);
        let tall = self.tall.iter().filter(move |(_, bands)| is_here(*bands)).map(|&(item, _)| item);
        self.by_band.get(band).into_iter().flatten().copied().chain(tall)
    }
}

impl TriangleBin {
    fn push_piece(&mut self, id: u32, piece: [ScreenVertex; 3], bands: [usize; 2]) {
        self.piece_bands.push(self.pieces.len() as u32, bands);
        self.pieces.push((id, piece));
    }

    /// The band's clipped pieces with their ids.
    pub fn pieces_in(&self, band: usize) -> impl Iterator<Item = (u32, &[ScreenVertex; 3])> {
        self.piece_bands.items_in(band).map(|i| &self.pieces[i as usize]).map(|(id, piece)| (*id, piece))
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
    let bin_all = |passes: Vec<Pass>, margin: u32| {
        let jobs = passes.into_iter().flat_map(Pass::chunks).collect();
        map(pool, jobs, |pass| match context.deadline.check() {
            Ok(()) => bin_triangles(context, [rows, margin], &pass),
            Err(Stopped) => TriangleBin::default(),
        })
    };
    let (triangles, peel) = (bin_all(base, margin), bin_all(peel, 0));
    let bin_pass = |pass: &LinePass| {
        map(pool, chunks(0..pass.edges.len()).collect(), |range| match context.deadline.check() {
            Ok(()) => bin_edges(context, pass, rows, range),
            Err(Stopped) => Bin::default(),
        })
    };
    let edges = plan.lines.iter().map(bin_pass).collect();
    context.deadline.check()?;
    Ok(Bins { triangles, peel, edges })
}

/// Triangles of one pass.
struct Pass {
    ids: Range<usize>,
    /// Bit that a triangle's pass mask must have; 0 for the outline mesh, which has no masks.
    pass_bit: u8,
    faces: Faces,
}

impl Pass {
    fn chunks(self) -> impl Iterator<Item = Self> {
        chunks(self.ids.clone()).map(move |ids| Self { ids, ..self })
    }

    /// Drawn faces of a triangle; None if the pass does not draw it.
    #[inline(always)]
    fn faces_of(&self, plan: &DrawPlan<'_>, id: usize) -> Option<Faces> {
        if self.pass_bit == 0 {
            return Some(self.faces);
        }
        match plan.pass_masks.get(id) {
            None => Some(self.faces),
            Some(mask) if mask & self.pass_bit == 0 => None,
            Some(mask) if mask & pass_mask::FRONT_ONLY != 0 => Some(Faces::Front),
            Some(mask) if mask & pass_mask::BACK_ONLY != 0 => Some(Faces::Back),
            _ => Some(self.faces),
        }
    }
}

/// The passes of the visibility buffer, and those of depth peeling.
fn passes(plan: &DrawPlan<'_>) -> (Vec<Pass>, Vec<Pass>) {
    let count = plan.triangles.len();
    let surface = |pass_bit| plan.surface.as_ref().map(|s| Pass { ids: 0..count, pass_bit, faces: s.faces });
    let around =
        |hull: &HullPass<'_>| Pass { ids: count..count + hull.triangles.len(), pass_bit: 0, faces: Faces::Both };
    let hull = plan.hull.as_ref().map(around);
    // Without pass masks nothing is peeled.
    let layer = surface(pass_mask::LAYER).filter(|_| plan.peeling().is_some() && !plan.pass_masks.is_empty());
    let (base_hull, peeled_hull) = if plan.has_peeled_hull() { (None, hull) } else { (hull, None) };
    let collect = |passes: [Option<Pass>; 2]| passes.into_iter().flatten().collect();
    (collect([surface(pass_mask::SURFACE), base_hull]), collect([layer, peeled_hull]))
}

fn chunks(range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let end = range.end;
    range.step_by(CHUNK).map(move |first| first..end.min(first + CHUNK))
}

fn band_count(plan: &DrawPlan<'_>, rows: u32) -> usize {
    plan.height_px.div_ceil(rows) as usize
}

fn bin_triangles(context: &RasterContext<'_>, rows: [u32; 2], pass: &Pass) -> TriangleBin {
    let plan = context.plan;
    let bands = band_count(plan, rows[0]);
    let mut bin = TriangleBin {
        whole: Bin::new(bands, TALL_BANDS),
        pieces: Vec::new(),
        piece_bands: Bin::new(bands, TALL_BANDS),
    };
    for id in pass.ids.clone() {
        let Some(faces) = pass.faces_of(plan, id) else { continue };
        let vertices = context.screen_triangle(id as u32);
        if vertices.iter().any(ScreenVertex::is_outside) {
            bin_clipped(context, rows, id as u32, faces, &mut bin);
        } else if passes_culling(faces, area(&vertices))
            && let Some(bands) = bands_of(plan, rows, &vertices)
        {
            bin.whole.push(id as u32, bands);
        }
    }
    bin
}

fn bin_clipped(context: &RasterContext<'_>, rows: [u32; 2], id: u32, faces: Faces, bin: &mut TriangleBin) {
    let plan = context.plan;
    if !plan.projection.clip || context.is_hull(id) {
        return;
    }
    let corners = context.positions_of(id).map(|(position, _)| homogeneous(&plan.projection, position));
    clip_triangle(&plan.projection, corners, |piece| {
        if passes_culling(faces, area(&piece))
            && let Some(bands) = bands_of(plan, rows, &piece)
        {
            bin.push_piece(id, piece, bands);
        }
    });
}

/// First and last band that a triangle on screen touches, or comes as close to as `margin` rows;
/// None if it lies beside, above or below all that has samples.
#[inline(always)]
fn bands_of(plan: &DrawPlan<'_>, [rows, margin]: [u32; 2], v: &[ScreenVertex; 3]) -> Option<[usize; 2]> {
    axis_bounds(&v.map(|v| v.x), plan.width_px, plan.seen_range(plan.width_px))?;
    let [first, last] = axis_bounds(&v.map(|v| v.y), plan.height_px, plan.seen_range(plan.height_px))?;
    let (first, last) = ((first - margin as i32).max(0), (last + margin as i32).min(plan.height_px as i32 - 1));
    (first <= last).then(|| [first, last].map(|row| row as usize / rows as usize))
}

fn bin_edges(context: &RasterContext<'_>, pass: &LinePass, rows: u32, range: Range<usize>) -> Bin {
    let mut bin = Bin::new(band_count(context.plan, rows), TALL_EDGE_BANDS);
    let reach = pass.reach_px();
    for i in range {
        let edge = &pass.edges[i];
        if !contour::is_drawn(context, pass, edge) {
            continue;
        }
        if let Some(segment) = Segment::new(context, edge) {
            let [first, last] = segment.rows(reach, context.plan.height_px);
            if first <= last {
                bin.push(i as u32, [first, last].map(|row| row as usize / rows as usize));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_band_lists_the_pieces_that_touch_it() {
        let new = || Bin::new(20, TALL_BANDS);
        let mut bin = TriangleBin { whole: new(), pieces: Vec::new(), piece_bands: new() };
        let spans = [[0, 0], [2, 4], [0, 19], [3, 3], [5, 15]];
        for (id, span) in (100..).zip(spans) {
            bin.push_piece(id, [ScreenVertex::default(); 3], span);
        }
        for band in 0..20 {
            let mut found: Vec<u32> = bin.pieces_in(band).map(|(id, _)| id).collect();
            found.sort_unstable();
            let want = (100..).zip(spans).filter(|(_, [first, last])| (*first..=*last).contains(&band));
            assert_eq!(found, want.map(|(id, _)| id).collect::<Vec<u32>>(), "band {band}");
        }
        // Pieces that touch few bands are not visited in the others.
        assert_eq!(bin.piece_bands.tall.len(), 2);
    }
}
