//! Round joins, the corners of outlines. An outline has a quad beside each silhouette edge. Where two
//! such edges meet in a vertex, triangles around the vertex fill what is between their quads. Where the
//! vertex's own faces hide one of the two edges, the join is left out where these faces cover it.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::limits::{Budget, Deadline, Stopped};
use crate::plan::PlanError;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::outline::hidden_directions::{HiddenDirections, wrapped};
use crate::plan::outline::silhouette_edges::ScreenMesh;
use crate::plan::outline::sort::sort;
use crate::plan::outline::{EdgeEnd, HullPass, ScreenVertex};

/// Largest distance of an arc from its chords, 1/256 px: 1/64 px.
const SAGITTA: f64 = 4.0;

/// Triangles of all joins up to which arcs are as round as `SAGITTA` says. Beyond it, or beyond the
/// limit per pixel of the picture, arcs get fewer corners: as many in all, and up to three per arc.
const TRIANGLES_MAX: f64 = (1 << 20) as f64;
/// The same limit per pixel of the picture.
const TRIANGLES_MAX_PER_PX: f64 = 16.0;

/// Largest angle of a chord. Of half a turn, 3.14, no triangle would be left.
const CHORD_MAX: f64 = 2.8;

/// Gaps between two edges up to which they are the tip of a needle, narrowed by rounding. The
/// outline goes all around such a tip.
const GAP_MIN: f64 = 1e-9;

/// The narrowest piece of a join, as an angle.
const PIECE_MIN: f64 = 1e-9;

/// Ends of silhouette edges, and the joins between them.
pub struct RoundJoins {
    ends: Vec<EdgeEnd>,
    triangles_max: f64,
}

/// A piece of a join around a vertex.
struct Join {
    /// The end from whose outer corner the join starts.
    from: usize,
    /// Angle of the whole join.
    sweep: f64,
    /// The end at whose outer corner the join stops, if there is one.
    to: Option<usize>,
    /// The angles between which the join is drawn, from 0 to `sweep`.
    piece: [f64; 2],
}

impl RoundJoins {
    /// Joins of at most so many ends, in a picture of this size.
    pub fn with_capacity(ends: usize, size_px: [u32; 2]) -> Self {
        let pixels = size_px.map(f64::from);
        let triangles_max = TRIANGLES_MAX.min(TRIANGLES_MAX_PER_PX * pixels[0] * pixels[1]);
        Self { ends: Vec::with_capacity(ends), triangles_max }
    }

    /// Adds an end.
    pub fn push(&mut self, end: EdgeEnd) {
        self.ends.push(end);
    }

    /// Adds the joins of all vertices to the hull, whose own vertices are numbered from `first` on.
    pub fn finish(
        &mut self,
        view: &ScreenMesh<'_>,
        first: u32,
        hull: &mut HullPass<'_>,
        cx: &mut PlanContext<'_>,
    ) -> Result<(), PlanError> {
        self.sort(cx.deadline)?;
        let hidden = HiddenDirections::around(&mut self.ends, view, cx)?;
        self.draw(&hidden, first, hull, cx)
    }

    /// Puts the ends in order, by vertex and angle.
    fn sort(&mut self, deadline: &Deadline) -> Result<(), Stopped> {
        // Of two ends in one direction, the one whose edge is free below comes first: the gap from
        // the other to it is a whole turn.
        let order = |a: &EdgeEnd, b: &EdgeEnd| {
            (a.vertex.cmp(&b.vertex)).then(a.angle.total_cmp(&b.angle)).then(a.free.cmp(&b.free))
        };
        sort(&mut self.ends, &order, deadline)
    }

    /// Adds the joins; the hull's own vertices are numbered from `first` on.
    fn draw(
        &self,
        hidden: &HiddenDirections,
        first: u32,
        hull: &mut HullPass<'_>,
        cx: &mut PlanContext<'_>,
    ) -> Result<(), PlanError> {
        let (ends, deadline) = (&self.ends, cx.deadline);
        let mut steps = 0.0;
        each_join(ends, hidden, deadline, |join| steps += join.angle() / step(ends, &join))?;
        let coarser = (steps / self.triangles_max).max(1.0);
        let (mut vertices, mut triangles) = (0, 0);
        each_join(ends, hidden, deadline, |join| {
            let count = chords(ends, &join, coarser) as usize;
            triangles += count;
            vertices += count + 1 - usize::from(join.begins(ends).is_some()) - usize::from(join.meets(ends).is_some());
        })?;
        grow("an outline's corners", &mut hull.vertices, vertices, cx.budget)?;
        grow("an outline's corners", &mut hull.triangles, triangles, cx.budget)?;
        grow("an outline's corners", &mut hull.triangle_materials, triangles, cx.budget)?;
        each_join(ends, hidden, deadline, |join| draw(ends, &join, coarser, first, hull))?;
        Ok(())
    }
}

/// Makes room for exactly so many more items. While a list moves, it takes its memory twice.
fn grow<T>(what: &str, list: &mut Vec<T>, more: usize, budget: &mut Budget) -> Result<(), PlanError> {
    if list.capacity() - list.len() < more {
        budget.spend(what, (list.len() + more) as u64, size_of::<T>() as u64)?;
        list.reserve_exact(more);
    }
    Ok(())
}

impl Join {
    /// Angle of the piece.
    fn angle(&self) -> f64 {
        self.piece[1] - self.piece[0]
    }

    /// The outer corner of a quad at which the piece starts, if it does.
    fn begins(&self, ends: &[EdgeEnd]) -> Option<u32> {
        if self.piece[0] <= 0.0 { ends[self.from].outer } else { None }
    }

    /// The outer corner of a quad at which the piece stops, if it does.
    fn meets(&self, ends: &[EdgeEnd]) -> Option<u32> {
        self.to.filter(|_| self.piece[1] >= self.sweep).and_then(|to| ends[to].outer)
    }
}

/// Calls `each` with every piece of a join, vertex by vertex.
fn each_join(
    ends: &[EdgeEnd],
    hidden: &HiddenDirections,
    deadline: &Deadline,
    mut each: impl FnMut(Join),
) -> Result<(), Stopped> {
    let mut each_piece = |from: usize, sweep: f64, next: usize, to: Option<usize>| {
        // An edge without a quad is hidden by the vertex's own faces, or by others, which hide the
        // vertex too.
        let is_missing = [from, next].map(|end| ends[end].outer.is_none());
        let is_hidden = [from, next].map(|end| ends[end].is_hidden);
        if is_missing == [true; 2] || (0..2).any(|k| is_missing[k] && !is_hidden[k]) {
            return;
        }
        if to.is_some() && is_hidden == [false; 2] {
            return each(Join { from, sweep, to, piece: [0.0, sweep] });
        }
        let EdgeEnd { vertex, free, angle, turn, .. } = ends[from];
        let (start, free) = (angle + f64::from(free) * turn, f64::from(free));
        let low = wrapped(if free > 0.0 { start } else { start - sweep });
        hidden.gaps(vertex, [low, low + sweep], |[a, b]| {
            let [a, b] = if free > 0.0 { [a - low, b - low] } else { [low + sweep - b, low + sweep - a] };
            // Slivers that rounding leaves beside a face are not drawn.
            let piece = [if a < PIECE_MIN { 0.0 } else { a }, if b > sweep - PIECE_MIN { sweep } else { b }];
            if piece[1] - piece[0] > PIECE_MIN {
                each(Join { from, sweep, to, piece });
            }
        });
    };
    let mut unchecked = CHECK_EVERY;
    for (first, group) in groups(ends) {
        let count = group.len();
        unchecked += count;
        if unchecked >= CHECK_EVERY {
            unchecked = 0;
            deadline.check()?;
        }
        for (i, end) in group.iter().enumerate() {
            // The next end on the free side, and how far it is.
            let next = if end.free > 0 { (i + 1) % count } else { (i + count - 1) % count };
            let mut gap = f64::from(end.free) * (group[next].angle - end.angle);
            if gap < 0.0 || next == i || (next > i) != (end.free > 0) {
                gap += TAU;
            }
            if gap < GAP_MIN {
                gap += TAU;
            }
            let meets = group[next].free != end.free;
            // Of two ends that meet, the one that is free above draws the join between them.
            if meets && end.free > 0 {
                let sweep = gap - end.turn - group[next].turn;
                if sweep > 0.0 {
                    each_piece(first + i, sweep, first + next, Some(first + next));
                }
            } else if !meets {
                let sweep = (gap - end.turn).min(FRAC_PI_2);
                if sweep > 0.0 {
                    each_piece(first + i, sweep, first + next, None);
                }
            }
        }
    }
    Ok(())
}

/// The ends at each vertex, with the index of the first.
fn groups(ends: &[EdgeEnd]) -> impl Iterator<Item = (usize, &[EdgeEnd])> {
    let mut first = 0;
    ends.chunk_by(|a, b| a.vertex == b.vertex).map(move |group| {
        first += group.len();
        (first - group.len(), group)
    })
}

/// The angle between the corners of an arc whose chords are `SAGITTA` away from it,
/// `r (1 - cos(a / 2))`.
fn step(ends: &[EdgeEnd], join: &Join) -> f64 {
    let from = &ends[join.from];
    let reach = join.to.map_or(from.reach, |to| ends[to].reach.max(from.reach));
    (8.0 * SAGITTA / reach.max(1.0)).sqrt().min(FRAC_PI_4)
}

/// The number of triangles of a piece.
fn chords(ends: &[EdgeEnd], join: &Join, coarser: f64) -> u32 {
    let chord = (step(ends, join) * coarser).min(CHORD_MAX);
    (join.angle() / chord).max(0.0) as u32 + 1
}

fn draw(ends: &[EdgeEnd], join: &Join, coarser: f64, first: u32, hull: &mut HullPass<'_>) {
    let from = &ends[join.from];
    let (reach, depth) = join.to.map_or((from.reach, from.depth), |to| (ends[to].reach, ends[to].depth));
    let free = f64::from(from.free);
    let start = from.angle + free * from.turn;
    let mut corner = |swept: f64| {
        let (angle, share) = (start + free * swept, swept / join.sweep);
        let reach = from.reach + share * (reach - from.reach);
        let at = [libm::cos(angle), libm::sin(angle)];
        let [x, y] = [0, 1].map(|k| from.middle[k] + reach * at[k]);
        hull.vertices.push(ScreenVertex::snapped([x, y, from.depth + share * (depth - from.depth), from.inv_w]));
        first + hull.vertices.len() as u32 - 1
    };
    let count = chords(ends, join, coarser);
    let mut last = join.begins(ends).unwrap_or_else(|| corner(join.piece[0]));
    for i in 1..=count {
        let next = match join.meets(ends) {
            Some(outer) if i == count => outer,
            _ => corner(join.piece[0] + join.angle() * (f64::from(i) / f64::from(count))),
        };
        hull.triangles.push([from.vertex, last, next]);
        hull.triangle_materials.push(from.material);
        last = next;
    }
}

#[cfg(test)]
mod tests;
