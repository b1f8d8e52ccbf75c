//! Which directions around a vertex its own faces take up on screen, and which edges there they hide.
//!
//! A contour that ends inside a shape, where the surface folds, ends at a vertex around which the surface goes on, and where the fold's
//! other edge leaves that this surface hides: between the two nothing is free, and no outline belongs. Between two edges that are seen
//! nothing of the vertex is in the way, unless it lies behind.

use std::f64::consts::TAU;

use crate::limits::Stopped;
use crate::plan::PlanError;
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::outline::round_join::End;
use crate::plan::outline::silhouette_edges::{View, row_dot};
use crate::plan::sort::sort;

/// Ends times faces at a vertex up to which each is compared with each. Around a vertex of more, all ends count as seen.
const PAIRS_MAX: usize = 1 << 12;

/// What rounding makes of two angles that are equal, and of two slopes, as a share of them.
const EQUAL: f64 = 1e-9;

/// The directions that a vertex's own faces take up, by vertex and angle: arcs that do not touch.
#[derive(Debug, Default)]
pub struct Sectors {
    arcs: Vec<Arc>,
}

/// From one angle to a larger one, both from 0 to a whole turn.
#[derive(Clone, Copy, Debug)]
struct Arc {
    vertex: u32,
    from: f64,
    to: f64,
    /// How depth changes across the face, each 1/256 px right and down.
    slope: [f64; 2],
}

impl Sectors {
    /// Around the vertices of ends, which are in the order of these. Says of each end whether a face of its vertex hides it.
    pub fn around(ends: &mut [End], view: &View<'_>, cx: &mut PlanContext<'_>) -> Result<Self, PlanError> {
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

    /// That of one face.
    #[cfg(test)]
    pub fn of_one(vertex: u32, [from, to]: [f64; 2]) -> Self {
        Self { arcs: vec![Arc { vertex, from, to, slope: [0.0; 2] }] }
    }

    /// Calls `each` with the parts of a range of angles around a vertex that no face takes up. It begins between 0 and a whole turn,
    /// and is at most one long.
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
    /// Whether the face goes on under an edge that leaves its corner, nearer than the edge.
    fn hides(&self, end: &End) -> bool {
        let angle = turn(end.angle);
        let slope = self.slope[0] * libm::cos(angle) + self.slope[1] * libm::sin(angle);
        let rounded = EQUAL * (self.slope[0].abs() + self.slope[1].abs() + end.slope.abs());
        // One that goes past a whole turn is two arcs, and to the right is both ends of the turn.
        let is_within = |angle: f64| angle >= self.from - EQUAL && angle <= self.to + EQUAL;
        [angle, angle + TAU, angle - TAU].into_iter().any(is_within) && slope > end.slope + rounded
    }
}

/// The arcs of all faces around the vertices of ends.
fn arcs(ends: &[End], view: &View<'_>, cx: &mut PlanContext<'_>) -> Result<Vec<Arc>, PlanError> {
    let words = view.mesh.positions.len().div_ceil(64);
    cx.budget.spend("an outline's corners", words as u64, 8)?;
    let mut is_asked = vec![0_u64; words];
    for end in ends {
        is_asked[end.vertex as usize / 64] |= 1 << (end.vertex % 64);
    }
    let each = |each: &mut dyn FnMut(Arc)| {
        for (i, triangle) in view.mesh.triangles.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                cx.deadline.check()?;
            }
            let asked = |v: u32| is_asked[v as usize / 64] >> (v % 64) & 1 == 1;
            for k in (0..3).filter(|&k| asked(triangle[k])) {
                let corners = [0, 1, 2].map(|j| triangle[(k + j) % 3]);
                sector(view, i as u32, corners).into_iter().flatten().for_each(&mut *each);
            }
        }
        Ok::<(), Stopped>(())
    };
    let mut count = 0;
    each(&mut |_| count += 1)?;
    cx.budget.spend("an outline's corners", count, size_of::<Arc>() as u64)?;
    let mut arcs = Vec::with_capacity(count as usize);
    each(&mut |arc| arcs.push(arc))?;
    Ok(arcs)
}

/// The arc that a face takes up around its first corner, in two where it goes past a whole turn; nothing of a face that is not drawn or
/// seen edge on.
fn sector(view: &View<'_>, face: u32, [at, next, last]: [u32; 3]) -> [Option<Arc>; 2] {
    let shown = view.shown(face).unwrap_or(0);
    // The way in which a line leaves, which does not depend on whether its other end lies behind the eye: the derivative of its place.
    let here = view.places[at as usize];
    let angle = |there: u32| {
        let there = view.places[there as usize];
        let [x, y] = [0, 1].map(|axis| there[axis] * here[2] - here[axis] * there[2]);
        libm::atan2(y, x)
    };
    // Y points down: angles grow from the first to the last corner of what shows its back.
    let (from, to) = match shown {
        0 => return [None; 2],
        1 => (angle(next), angle(last)),
        _ => (angle(last), angle(next)),
    };
    let width = turn(to - from);
    // Rounding made it more than half a turn: it is seen edge on.
    if here[2] <= 0.0 || width.is_nan() || width > 0.5 * TAU {
        return [None; 2];
    }
    let from = turn(from);
    let slope = slope(view, [at, next, last]);
    let arc = |from: f64, to: f64| (from < to).then_some(Arc { vertex: at, from, to, slope });
    [arc(from, (from + width).min(TAU)), arc(0.0, from + width - TAU)]
}

/// How a face's depth changes right and down: `Z = (gx x + gy y + c) W` for all corners, by Cramer's rule.
fn slope(view: &View<'_>, corners: [u32; 3]) -> [f64; 2] {
    let [p, q, r] = corners.map(|v| {
        let [x, y, w] = view.places[v as usize];
        [x, y, row_dot(&view.projection.z, view.mesh.positions[v as usize]), w]
    });
    let determinant = |[a, b, c]: [usize; 3]| {
        let minor = |i: usize, j: usize| q[i] * r[j] - q[j] * r[i];
        p[a] * minor(b, c) + p[b] * minor(c, a) + p[c] * minor(a, b)
    };
    let whole = determinant([0, 1, 3]);
    [determinant([2, 1, 3]) / whole, determinant([0, 2, 3]) / whole]
}

/// The same angle, from 0 to a whole turn.
pub fn turn(angle: f64) -> f64 {
    angle.rem_euclid(TAU)
}

#[cfg(test)]
mod tests;
