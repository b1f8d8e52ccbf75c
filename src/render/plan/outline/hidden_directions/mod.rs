//! Hidden directions: the directions around a vertex that its own faces cover on screen, and the
//! silhouette edges there that these faces hide. Outlines need them at their corners.
//!
//! A round join fills the corner of an outline at a vertex where two silhouette edges meet. If both edges are
//! visible, no face of the vertex lies in front of the join. But an outline can end inside the shape, at a cusp,
//! where the surface folds. There the surface hides the second edge of the vertex, and the join is left out where
//! the vertex's own faces cover it.

use std::f64::consts::TAU;

use crate::plan::PlanError;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::edges::face_runs::FaceRuns;
use crate::plan::edges::select::{map, map_indices, select_by};
use crate::plan::outline::EdgeEnd;
use crate::plan::outline::silhouette_edges::ScreenMesh;
use crate::plan::outline::sort::sort;

/// Limit of ends times faces at a vertex. Around a vertex with more, all ends count as visible.
const PAIRS_MAX: usize = 1 << 12;

/// Runs of faces that a thread takes at a time.
const RUNS: usize = 128;

/// Relative difference up to which two angles or two slopes count as equal.
const EQUAL: f64 = 1e-9;

/// The directions that vertices' own faces cover: arcs that do not touch, by vertex and angle.
#[derive(Debug, Default)]
pub struct HiddenDirections {
    arcs: Vec<Arc>,
}

/// From one angle to a larger one, both from 0 to a whole turn.
#[derive(Clone, Copy, Debug, Default, bytemuck::Zeroable)]
struct Arc {
    vertex: u32,
    from: f64,
    to: f64,
    /// Change of depth across the face, per 1/256 px right and down.
    slope: [f64; 2],
}

impl HiddenDirections {
    /// The directions around the vertices of `ends`, which are sorted by vertex. Sets
    /// [`EdgeEnd::is_hidden`] of each end at a vertex with a quad.
    pub fn around(ends: &mut [EdgeEnd], view: &ScreenMesh<'_>, cx: &mut PlanContext<'_>) -> Result<Self, PlanError> {
        if ends.is_empty() {
            return Ok(Self::default());
        }
        let mut arcs = arcs(ends, view, cx)?;
        sort(&mut arcs, &|a, b| a.vertex.cmp(&b.vertex).then(a.from.total_cmp(&b.from)), cx.deadline)?;
        let mut rest = &arcs[..];
        for (i, group) in ends.chunk_by_mut(|a, b| a.vertex == b.vertex).enumerate() {
            if i % CHECK_EVERY == 0 {
                cx.deadline.check()?;
            }
            let skipped = rest.partition_point(|arc| arc.vertex < group[0].vertex);
            let count = rest[skipped..].partition_point(|arc| arc.vertex == group[0].vertex);
            let (own, after) = rest[skipped..].split_at(count);
            rest = after;
            if group.len() * own.len() <= PAIRS_MAX {
                group.iter_mut().for_each(|end| end.is_hidden = own.iter().any(|arc| arc.hides(end)));
            }
        }
        arcs.dedup_by(|next, last| {
            let is_one = next.vertex == last.vertex && next.from <= last.to;
            if is_one {
                last.to = last.to.max(next.to);
            }
            is_one
        });
        Ok(Self { arcs })
    }

    /// The directions that one face hides, for tests.
    #[cfg(test)]
    pub fn of_one(vertex: u32, [from, to]: [f64; 2]) -> Self {
        Self { arcs: vec![Arc { vertex, from, to, slope: [0.0; 2] }] }
    }

    /// Calls `each` with the parts of a range of angles around a vertex that no face covers. The
    /// range begins between 0 and a whole turn, and is at most a whole turn long.
    pub fn gaps(&self, vertex: u32, [from, to]: [f64; 2], mut each: impl FnMut([f64; 2])) {
        let first = self.arcs.partition_point(|arc| arc.vertex < vertex);
        let mut free_from = from;
        for turn in [0.0, TAU] {
            let skipped = self.arcs[first..].partition_point(|arc| arc.vertex == vertex && arc.to + turn <= from);
            let met = self.arcs[first + skipped..].iter();
            for arc in met.take_while(|arc| arc.vertex == vertex && arc.from + turn < to) {
                if arc.from + turn > free_from {
                    each([free_from, arc.from + turn]);
                }
                free_from = free_from.max(arc.to + turn);
            }
        }
        if free_from < to {
            each([free_from, to]);
        }
    }
}

impl Arc {
    /// True if the face hides an edge that leaves its corner: it covers the edge's direction, and
    /// is nearer there.
    fn hides(&self, end: &EdgeEnd) -> bool {
        let angle = wrapped(end.angle);
        let slope = self.slope[0] * libm::cos(angle) + self.slope[1] * libm::sin(angle);
        let rounded = EQUAL * (self.slope[0].abs() + self.slope[1].abs() + end.slope.abs());
        // An arc past a whole turn is stored as two, and the direction to the right is at both ends
        // of the turn.
        let is_within = |angle: f64| angle >= self.from - EQUAL && angle <= self.to + EQUAL;
        [angle, angle + TAU, angle - TAU].into_iter().any(is_within) && slope > end.slope + rounded
    }
}

/// The arcs of all faces around the vertices of ends. Around a vertex without a quad nothing is drawn, so
/// no arc is needed there.
fn arcs(ends: &[EdgeEnd], view: &ScreenMesh<'_>, cx: &mut PlanContext<'_>) -> Result<Vec<Arc>, PlanError> {
    let words = view.mesh.positions.len().div_ceil(64);
    cx.budget.spend("an outline's corners", words as u64, 8)?;
    cx.budget.spend("an outline's corners", view.runs.runs.len() as u64, 1 + 4)?;
    let mut has_end = vec![0_u64; words];
    let mut near_ends = Neighbourhood::default();
    for end in ends.iter().filter(|end| end.outer.is_some()) {
        has_end[end.vertex as usize / 64] |= 1 << (end.vertex % 64);
        near_ends.add(view.mesh.positions[end.vertex as usize]);
    }
    let is_listed = |v: u32| has_end[v as usize / 64] >> (v % 64) & 1 == 1;
    let is_near = map(&view.runs.runs, cx.deadline, |run| u8::from(near_ends.meets(&run.bounds)))?;
    let mut runs = Vec::with_capacity(is_near.len());
    runs.extend(is_near.iter().zip(0_u32..).filter(|(is_near, _)| **is_near == 1).map(|(_, r)| r));
    let corners = select_by("an outline's corners", runs.len(), RUNS, cx, |range, found| {
        for face in runs[range].iter().flat_map(|&r| FaceRuns::faces(r as usize, view.mesh.triangles.len())) {
            let triangle = view.mesh.triangles[face];
            (0..3_u32).filter(|&k| is_listed(triangle[k as usize])).for_each(|k| found([face as u32, k]));
        }
    })?;
    cx.budget.spend("an outline's corners", corners.len() as u64, 4 * size_of::<Arc>() as u64)?;
    let found = map_indices(corners.len(), cx.deadline, |i| {
        let [face, k] = corners[i];
        let triangle = view.mesh.triangles[face as usize];
        face_arcs(view, face, [0, 1, 2].map(|j| triangle[(k as usize + j) % 3])).map(Option::unwrap_or_default)
    })?;
    // Arcs are not empty.
    let mut arcs = Vec::with_capacity(2 * found.len());
    arcs.extend(found.into_iter().flatten().filter(|arc| arc.from < arc.to));
    Ok(arcs)
}

/// Cells of the unit box, for each axis.
const CELLS: usize = 64;

/// The cells of the unit box in which some points lie: a row of them in a word.
struct Neighbourhood(Vec<u64>);

impl Default for Neighbourhood {
    fn default() -> Self {
        Self(vec![0; CELLS * CELLS])
    }
}

impl Neighbourhood {
    fn cell(v: f32) -> usize {
        (((v + 0.5) * CELLS as f32) as usize).min(CELLS - 1)
    }

    fn add(&mut self, point: [f32; 3]) {
        let [x, y, z] = point.map(Self::cell);
        self.0[z * CELLS + y] |= 1 << x;
    }

    /// True if a cell that a box meets has a point.
    fn meets(&self, bounds: &[[f32; 3]; 2]) -> bool {
        let [low, high] = bounds.map(|corner| corner.map(Self::cell));
        let mask = (u64::MAX << low[0]) & (u64::MAX >> (CELLS - 1 - high[0]));
        let row = |z: usize| &self.0[z * CELLS + low[1]..=z * CELLS + high[1]];
        (low[2]..=high[2]).any(|z| row(z).iter().any(|word| word & mask != 0))
    }
}

/// The arc that a face covers around its first corner, in two where it goes past a whole turn. None
/// of a face that is not drawn or seen edge on.
fn face_arcs(view: &ScreenMesh<'_>, face: u32, [at, next, last]: [u32; 3]) -> [Option<Arc>; 2] {
    let shown = view.shown(face).unwrap_or(0);
    // The direction in which a side leaves: the derivative of its place on screen, which is right
    // even where the other end lies behind the eye.
    let here = view.place(at);
    let angle = |there: u32| {
        let there = view.place(there);
        let [x, y] = [0, 1].map(|axis| there[axis] * here[2] - here[axis] * there[2]);
        libm::atan2(y, x)
    };
    // Y points down, so angles grow from the first to the last corner of a face that shows its
    // back.
    let (from, to) = match shown {
        0 => return [None; 2],
        1 => (angle(next), angle(last)),
        _ => (angle(last), angle(next)),
    };
    let width = wrapped(to - from);
    // More than half a turn is a rounding error of a face that is seen edge on.
    if here[2] <= 0.0 || width.is_nan() || width > 0.5 * TAU {
        return [None; 2];
    }
    let from = wrapped(from);
    let slope = slope(view, [at, next, last]);
    let arc = |from: f64, to: f64| (from < to).then_some(Arc { vertex: at, from, to, slope });
    [arc(from, (from + width).min(TAU)), arc(0.0, from + width - TAU)]
}

/// Change of a face's depth right and down: `Z = (gx x + gy y + c) W` for all corners, by Cramer's
/// rule.
fn slope(view: &ScreenMesh<'_>, corners: [u32; 3]) -> [f64; 2] {
    let [p, q, r] = corners.map(|v| view.homogeneous(v));
    let determinant = |[a, b, c]: [usize; 3]| {
        let minor = |i: usize, j: usize| q[i] * r[j] - q[j] * r[i];
        p[a] * minor(b, c) + p[b] * minor(c, a) + p[c] * minor(a, b)
    };
    let whole = determinant([0, 1, 3]);
    [determinant([2, 1, 3]) / whole, determinant([0, 2, 3]) / whole]
}

/// The same angle, from 0 to a whole turn.
pub fn wrapped(angle: f64) -> f64 {
    angle.rem_euclid(TAU)
}

#[cfg(test)]
mod tests;
