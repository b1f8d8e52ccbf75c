//! Which directions around a vertex its own faces take up on screen.
//!
//! A contour that ends inside a shape, where the surface folds, ends at a vertex around which the surface goes on: there nothing is free,
//! and no outline belongs. Where the outline has a corner that is free, no face of its vertex is in the way.

use std::f64::consts::TAU;

use super::build::Means;
use super::order::sort;
use super::rim::{CHECK_EVERY, View};
use crate::limits::Stopped;
use crate::plan::PlanError;

/// The directions that a vertex's own faces take up: arcs that do not touch, by vertex and angle.
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
}

impl Sectors {
    /// Around these vertices, which are in order.
    pub fn around(
        vertices: impl Iterator<Item = u32>,
        view: &View<'_>,
        means: &mut Means<'_>,
    ) -> Result<Self, PlanError> {
        let words = view.mesh.positions.len().div_ceil(64);
        means.budget.spend("an outline's corners", words as u64, 8)?;
        let mut is_asked = vec![0_u64; words];
        let mut any = false;
        for vertex in vertices {
            is_asked[vertex as usize / 64] |= 1 << (vertex % 64);
            any = true;
        }
        if !any {
            return Ok(Self::default());
        }
        let each = |each: &mut dyn FnMut(Arc)| {
            for (i, triangle) in view.mesh.triangles.iter().enumerate() {
                if i % CHECK_EVERY == 0 {
                    means.deadline.check()?;
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
        means.budget.spend("an outline's corners", count, size_of::<Arc>() as u64)?;
        let mut arcs = Vec::with_capacity(count as usize);
        each(&mut |arc| arcs.push(arc))?;
        sort(&mut arcs, &|a, b| a.vertex.cmp(&b.vertex).then(a.from.total_cmp(&b.from)), means.deadline)?;
        arcs.dedup_by(|next, last| {
            let is_one = next.vertex == last.vertex && next.from <= last.to;
            if is_one {
                last.to = last.to.max(next.to);
            }
            is_one
        });
        Ok(Self { arcs })
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
    let arc = |from: f64, to: f64| (from < to).then_some(Arc { vertex: at, from, to });
    [arc(from, (from + width).min(TAU)), arc(0.0, from + width - TAU)]
}

/// The same angle, from 0 to a whole turn.
pub fn turn(angle: f64) -> f64 {
    angle.rem_euclid(TAU)
}

#[cfg(test)]
mod tests;
