//! The drawing of lines without any shortcut, for tests that compare its pictures with those of the
//! fast code. Programs are built without it: see [`RasterContext::is_plain`].
//!
//! Hidden-line removal tests every triangle that is visible along an edge, one by one, unless all
//! of them lie in front of the edge. What a line covers is computed for every pixel around it. What
//! lines leave free of faces is looked for pixel by pixel.

use super::edge::{LineDrawer, LineTarget, Piece, Window};
use super::hidden_lines::{HiddenIntervals, hidden_by};
use super::holes::inset::Insets;
use super::holes::tips::TipRange;
use super::holes::{Holes, half_width, looked_at, marks_of_hidden};
use super::segment::Segment;
use super::stroke::{self, Mask};
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::geometry::setups::Corners;
use crate::backend::cpu::geometry::steepness::NEARER_RATIO;
use crate::backend::cpu::isa::{Isa, LANES};
use crate::plan::{Edge, LinePass};

impl HiddenIntervals {
    /// As [`HiddenIntervals::find`].
    pub fn find_plainly(
        &mut self,
        (context, band): (&RasterContext<'_>, &SampleBand),
        (edge, segment): (&Edge, &Segment),
        range: [f32; 2],
    ) {
        self.hidden.clear();
        if is_behind_all((context, band), segment, range) {
            self.hidden.push(range);
            return;
        }
        self.collect_plainly((context, band), (edge, segment), range, 0);
        if !self.hidden.is_empty() && !self.hidden.contains(&range) {
            self.collect_plainly((context, band), (edge, segment), range, 1);
        }
        if self.hidden.contains(&range) {
            self.hidden = vec![range];
        }
        self.hidden.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }

    fn collect_plainly(
        &mut self,
        (context, band): (&RasterContext<'_>, &SampleBand),
        (edge, segment): (&Edge, &Segment),
        range: [f32; 2],
        radius: i32,
    ) {
        let across = segment.across();
        let beyond = radius as f32 * segment.inverse_length;
        let mut ids = Vec::new();
        for [x, y] in segment.walk([range[0] - beyond, range[1] + beyond]) {
            for away in -radius..=radius {
                let [x, y] = [x + away * across[0], y + away * across[1]];
                if band.has(x, y) {
                    ids.extend(band.pixel(x, y).0.iter().filter(|&&id| id != NOTHING));
                }
            }
        }
        ids.sort_unstable();
        ids.dedup();
        for [start, end] in ids.into_iter().filter_map(|id| hidden_by(context, edge, segment, id)) {
            let (start, end) = (start.max(range[0]), end.min(range[1]));
            if start < end {
                self.hidden.push([start, end]);
            }
        }
    }
}

/// True if every triangle visible along the edge is nearer than all of it.
pub(super) fn is_behind_all(
    (context, band): (&RasterContext<'_>, &SampleBand),
    segment: &Segment,
    range: [f32; 2],
) -> bool {
    let nearest = segment.nearest() * NEARER_RATIO;
    let is_nearer = |id: u32| {
        id != NOTHING && context.screen_triangle(id).iter().all(|corner| !corner.is_outside() && corner.z > nearest)
    };
    let mut pixels = segment.walk(range).filter(|&[x, y]| band.has(x, y)).peekable();
    pixels.peek().is_some() && pixels.all(|[x, y]| band.pixel(x, y).0.iter().all(|&id| is_nearer(id)))
}

/// As [`add_holes`](super::holes::dig::add_holes): each pixel looks for the faces that are seen close by.
pub fn add_holes_plainly(
    context: &RasterContext<'_>,
    pass: &LinePass,
    (bins, number): (&[TriangleBin], usize),
    band: &SampleBand,
    holes: &mut Holes,
) {
    let plan = context.plan;
    let half = [plan.width_px as i32 * 128, plan.height_px as i32 * 128];
    let reach = pass.hidden_reach_px() as i32;
    let inset_of = |id: u32| {
        let insets = Insets::new(&Corners::load(context, &[id; LANES]), half, half_width(pass));
        (insets.is_open[0] != 0).then(|| insets.get(0, half))
    };
    let tips = TipRange::new(plan, pass, band);
    let surface = |id: &u32| (*id as usize) < plan.triangles.len();
    for id in bins.iter().flat_map(|chunk| chunk.whole_in(number)).filter(surface) {
        if inset_of(id).is_some() {
            tips.mark(context, band, id, holes);
        }
    }
    let [columns, rows] = looked_at(band, reach);
    for y in rows[0]..rows[1] {
        for x in columns[0]..columns[1] {
            let around = (-1..=1).flat_map(|down| (-1..=1).map(move |right| [x + right, y + down]));
            let seen = around.filter(|&[x, y]| band.has(x, y)).flat_map(|[x, y]| band.pixel(x, y).0);
            let mut ids: Vec<u32> = seen.copied().filter(|&id| (id as usize) < plan.triangles.len()).collect();
            ids.sort_unstable();
            ids.dedup();
            ids.retain(|&id| !context.screen_triangle(id).iter().any(|corner| corner.is_outside()));
            for id in ids {
                let Some(inset) = inset_of(id) else { continue };
                holes.mark_around([x, y], reach, marks_of_hidden(context, band, half, (&inset, id), [x, y]));
                if let Some(at) = holes.index([x, y]) {
                    holes.add(at, inset.areas(Isa::baseline(), x, y)[0]);
                }
            }
        }
    }
}

impl LineDrawer<'_> {
    /// As [`LineDrawer::draw_piece`].
    pub(super) fn draw_piece_plainly(
        &mut self,
        window: &Window<'_>,
        piece: &Piece,
        owner: u32,
        target: &mut LineTarget<'_>,
    ) {
        let [a, b] = piece.ends;
        let width_px = self.band.size_px[0];
        let reach = self.pen.reach + 1.0;
        let columns = [a[0].min(b[0]) - reach, a[0].max(b[0]) + reach];
        for y in self.rows[0]..self.rows[1] {
            for x in (columns[0] as i32).max(0)..(columns[1] as i32 + 1).min(width_px as i32) {
                let center = [x as f32 + 0.5, y as f32 + 0.5];
                let ends = [a, b].map(|p| [p[0] - center[0], p[1] - center[1]]);
                let place = self.direction.place(ends);
                let at = (y - self.rows[0]) as usize * width_px as usize + x as usize;
                if !place.is_within(self.pen.reach) || !window.owns(center) || !self.may_draw(at, target.holes) {
                    continue;
                }
                let mut mask = Mask::default();
                if let Some(amount) = stroke::cover(&self.pen, &self.direction, ends, &place, &mut mask) {
                    target.strokes.add(at, amount, &mask, self.pen.peak);
                    target.note(at, owner, piece.depth(window.segment, &place));
                }
            }
        }
    }
}
