//! The parts of silhouette edges that no face hides, beside which an outline is drawn. For each part it
//! is also found whether the background is beside it or the edge leaves the picture, and how much of
//! the width is visible if the outline is a hull (a border around the surface). Where there is too much
//! to compare, all edges count as visible.
//!
//! The depth test of the back-ends alone does not hide an outline. An outline is wider than the
//! edge that it belongs to, and a face in front of the edge may recede faster than the outline
//! does. There the outline would show in front of that face.

mod cells;
mod grid;
mod hidden;

use std::ops::Range;

use rayon::prelude::*;

use self::cells::{Cells, Marks};
use self::grid::FaceGrid;
use self::hidden::{depth_at, hidden_range};
use crate::limits::{Deadline, Stopped};
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::outline::outer_side::OuterSide;
use crate::plan::outline::screen_edges::{OutlineView, ScreenEdge};
use crate::plan::outline::silhouette_edges::SilhouetteEdge;
use crate::plan::{PX, PlanError};
use crate::spec::OutlineMethod;

/// Parts of an edge that are told apart. What follows the last of them counts as visible.
const PARTS_MAX: usize = 16;

/// Edges that a thread takes at a time, and such shares that are worked on between two payments.
const CHUNK: usize = 256;
const WAVE: usize = 64;

/// Pairs of an edge and a face that are compared. Where there are more, everything counts as
/// visible.
const PAIRS_MAX: usize = 1 << 26;

/// Hidden parts up to this length between visible ones are drawn, 1/256 px: they are what rounding
/// leaves, and would be cuts across the whole outline.
const GAP: f64 = PX;

/// Visible parts up to this length beside hidden ones are not drawn, 1/256 px.
const SLIVER: f64 = PX / 16.0;

/// Distance between two places where it is looked at what an outline covers, 1/256 px, and the most
/// such places of an edge.
const SAMPLED: f64 = 4.0 * PX;
const SAMPLES_MAX: f64 = 64.0;

/// Places beside an edge that are looked at: a pixel away, in 1/256 px, for the background, and at
/// shares of a hull's width for faces that hide it.
const BESIDE: f64 = PX;
const ACROSS: [f64; 2] = [0.3, 0.8];

/// Depths within so many units of the box are equal.
const EQUAL: f64 = 2e-6;

/// A visible part of a silhouette edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePart {
    /// The number of the edge.
    pub edge: u32,
    /// Its begin and its end, as shares of the edge on screen.
    pub range: [f64; 2],
    /// The share of the outline's width that is visible, 0 to 1, on average.
    pub shown: f64,
    /// True if nothing lies behind the outline, or if the edge leaves the picture.
    pub is_border: bool,
}

/// The visible parts of all edges, in their order. `hides` says which materials hide.
pub fn visible_parts(
    view: &OutlineView<'_>,
    edges: &[SilhouetteEdge],
    places: &[ScreenEdge],
    hides: &[bool],
    method: OutlineMethod,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<VisiblePart>, PlanError> {
    let cells = Cells::new(view.half, view.view.mesh.triangles.len());
    cx.budget.spend("faces near an outline", Marks::bytes(&cells), 1)?;
    let mut marks = Marks::new(cells);
    let mut search = Search { view, edges, places, method, deadline: cx.deadline, grid: None };
    for (i, place) in places.iter().enumerate() {
        if i % (CHECK_EVERY >> 6) == 0 {
            cx.deadline.check()?;
        }
        if place.may_show && !edges[i].is_hidden {
            marks.line(&place.ends.map(|[x, y, ..]| [x, y]));
            (0..samples(place)).for_each(|k| search.beside(i, k).into_iter().for_each(|at| marks.point(at)));
        }
    }
    let grid = FaceGrid::of(view, &marks, hides, cx)?;
    search.grid = grid.filter(|grid| pairs(grid, places) <= PAIRS_MAX);
    let mut all = Vec::new();
    for wave in (0..edges.len()).step_by(CHUNK * WAVE) {
        let last = edges.len().min(wave + CHUNK * WAVE);
        let chunk = |first: usize| search.parts(first..last.min(first + CHUNK));
        let starts: Vec<usize> = (wave..last).step_by(CHUNK).collect();
        let found: Vec<Vec<VisiblePart>> = if starts.len() == 1 {
            starts.into_iter().map(chunk).collect::<Result<_, Stopped>>()?
        } else {
            starts.into_par_iter().map(chunk).collect::<Result<_, Stopped>>()?
        };
        let count = found.iter().map(Vec::len).sum::<usize>();
        cx.budget.spend("an outline's edges", count as u64, 2 * size_of::<VisiblePart>() as u64)?;
        all.extend(found.into_iter().flatten());
    }
    Ok(all)
}

/// The number of pairs that the search will compare.
fn pairs(grid: &FaceGrid, places: &[ScreenEdge]) -> usize {
    let mut pairs = 0;
    for place in places.iter().filter(|place| place.may_show) {
        grid.cells.each(&place.ends.map(|[x, y, ..]| [x, y]), |cell| pairs += grid.count(cell));
        if pairs > PAIRS_MAX {
            break;
        }
    }
    pairs
}

/// The number of places beside an edge where it is looked at what its outline covers.
fn samples(place: &ScreenEdge) -> usize {
    (place.way().length / SAMPLED).ceil().clamp(1.0, SAMPLES_MAX) as usize
}

/// The edges of one search.
struct Search<'a> {
    view: &'a OutlineView<'a>,
    edges: &'a [SilhouetteEdge],
    places: &'a [ScreenEdge],
    method: OutlineMethod,
    deadline: &'a Deadline,
    /// None where there are too many faces to be looked at.
    grid: Option<FaceGrid>,
}

impl Search<'_> {
    /// The visible parts of a range of edges.
    fn parts(&self, range: Range<usize>) -> Result<Vec<VisiblePart>, Stopped> {
        self.deadline.check()?;
        let mut found = Vec::with_capacity(range.len());
        let mut hidden = Vec::new();
        for i in range.filter(|&i| self.places[i].may_show && !self.edges[i].is_hidden) {
            let Some(grid) = &self.grid else {
                found.push(VisiblePart { edge: i as u32, range: [0.0, 1.0], shown: 1.0, is_border: true });
                continue;
            };
            hidden.clear();
            if self.hidden(grid, i, &mut hidden) {
                continue;
            }
            let length = self.places[i].way().length;
            each_gap(&mut hidden, length, |range| found.push(self.part(grid, i, range)));
        }
        Ok(found)
    }

    /// Finds the hidden ranges of an edge. True if it is hidden wholly.
    fn hidden(&self, grid: &FaceGrid, i: usize, hidden: &mut Vec<[f64; 2]>) -> bool {
        let (place, vertices) = (&self.places[i], self.edges[i].vertices);
        let tiny = place.ends.map(|end| end[2] - self.view.behind(end[2], end[3], EQUAL));
        let tiny = tiny[0].max(tiny[1]);
        // The hidden parts that reach from the first end up to here, and from here to the second end. Where
        // they meet, nothing is left to be seen, whatever else hides the edge.
        let [mut from_first, mut from_second] = [0.0, 1.0];
        grid.cells.each(&place.ends.map(|[x, y, ..]| [x, y]), |cell| {
            for face in grid.faces(cell) {
                if from_first >= from_second {
                    return;
                }
                if let Some([from, to]) = hidden_range(face, place, vertices, tiny) {
                    from_first = if from <= from_first && to > from_first { to } else { from_first };
                    from_second = if to >= from_second && from < from_second { from } else { from_second };
                    hidden.push([from, to]);
                }
            }
        });
        from_first >= from_second
    }

    /// The part of an edge, with what its outline covers.
    fn part(&self, grid: &FaceGrid, i: usize, range: [f64; 2]) -> VisiblePart {
        let count = samples(&self.places[i]);
        let first = ((range[0] * count as f64).floor() as usize).min(count - 1);
        let last = ((range[1] * count as f64).ceil() as usize).clamp(first + 1, count);
        // A chain goes on where its edge is cut at the border of the picture.
        let is_cut = |end: usize| range[end] == [0.0, 1.0][end] && !self.places[i].is_whole[end];
        let is_hull = self.method == OutlineMethod::Hull;
        let side = is_hull.then(|| OuterSide::of(self.view, &self.edges[i], &self.places[i])).flatten();
        let (mut shown, mut is_border) = (0, is_cut(0) || is_cut(1));
        for k in first..last {
            let [beside, across @ ..] = self.beside(i, k);
            if grid.faces(grid.cells.at(beside)).all(|face| depth_at(face, beside).is_none()) {
                is_border = true;
            } else if is_hull {
                let along = (k as f64 + 0.5) / count as f64;
                let (inner, outer) = (self.places[i].at(along)[2], side.as_ref().map_or(0.0, |side| side.at(along)[2]));
                for (at, share) in across.into_iter().zip(ACROSS) {
                    let depth = inner + share * (outer - inner);
                    let is_before = |face| depth_at(face, at).is_some_and(|other| other >= depth);
                    shown += usize::from(!grid.faces(grid.cells.at(at)).any(is_before));
                }
                continue;
            }
            shown += ACROSS.len();
        }
        VisiblePart { edge: i as u32, range, shown: shown as f64 / (2 * (last - first)) as f64, is_border }
    }

    /// The places beside an edge, on its free side, at the k-th of its [`samples`]: for the
    /// background, and across a hull.
    fn beside(&self, i: usize, k: usize) -> [[f64; 2]; 3] {
        let (edge, place) = (&self.edges[i], &self.places[i]);
        let at = place.at((k as f64 + 0.5) / samples(place) as f64);
        let [right, down] = place.way().along;
        let out = f64::from(edge.free);
        let reach = self.view.reach(edge.material, at[3]);
        let [near, far] = match self.method {
            OutlineMethod::Hull => ACROSS.map(|share| share * reach),
            OutlineMethod::Contour => [BESIDE; 2],
        };
        let steps = [BESIDE.min(near), near, far];
        steps.map(|step| [at[0] - out * down * step, at[1] + out * right * step])
    }
}

/// Calls `each` with the visible ranges between hidden ones, of an edge with this length.
fn each_gap(hidden: &mut [[f64; 2]], length: f64, mut each: impl FnMut([f64; 2])) {
    hidden.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let (gap, sliver) = (GAP / length.max(1e-9), SLIVER / length.max(1e-9));
    let mut visible: Option<[f64; 2]> = None;
    let mut count = 0;
    let mut add = |range: [f64; 2], is_last: bool| {
        let is_bridged = |last: &[f64; 2]| range[0] - last[1] < gap;
        visible = match visible {
            Some(last) if is_bridged(&last) => Some([last[0], range[1]]),
            Some(last) => {
                each(last);
                Some(range)
            }
            None => Some(range),
        };
        if is_last && let Some(last) = visible {
            each(last);
        }
    };
    let mut from = 0.0;
    let mut ranges = [[0.0; 2]; PARTS_MAX];
    for range in hidden.iter() {
        if range[0] - from > sliver {
            if count + 1 == PARTS_MAX {
                break;
            }
            ranges[count] = [from, range[0]];
            count += 1;
        }
        from = from.max(range[1]);
    }
    if hidden.is_empty() || 1.0 - from > sliver {
        ranges[count] = [from, 1.0];
        count += 1;
    }
    // A short hidden end is drawn if more than that is visible.
    if count > 0 {
        let long = |range: [f64; 2]| range[1] - range[0] > gap;
        if ranges[0][0] < gap && long(ranges[0]) {
            ranges[0][0] = 0.0;
        }
        if 1.0 - ranges[count - 1][1] < gap && long(ranges[count - 1]) {
            ranges[count - 1][1] = 1.0;
        }
    }
    for (i, range) in ranges[..count].iter().enumerate() {
        add(*range, i + 1 == count);
    }
}

#[cfg(test)]
mod tests;
