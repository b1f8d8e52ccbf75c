//! Round corners of outlines: the fan around a vertex between the strips of two rims that meet there. Where the vertex's own faces hide one
//! of the two, only where none of its faces is.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::limits::{Budget, Deadline, Stopped};
use crate::plan::HullPass;
use crate::plan::PlanError;
use crate::plan::context::CHECK_EVERY;
use crate::plan::context::PlanContext;
use crate::plan::outline::build::snapped;
use crate::plan::outline::silhouette_edges::View;
use crate::plan::outline::vertex_occlusion::{Sectors, turn as turned};
use crate::plan::sort::sort;

/// How far an arc may lie from its chords, 1/256 px: 1/64 px.
const SAGITTA: f64 = 4.0;

/// Triangles of all fans up to which arcs are as round as they should be, and how many for each pixel of the picture. With more of them
/// they have fewer corners, as many in all and up to three for each arc.
const TRIANGLES_MAX: f64 = (1 << 20) as f64;
const TRIANGLES_MAX_PER_PX: f64 = 16.0;

/// Angle of a chord, at most: of half a turn, 3.14, no triangle would be left.
const CHORD_MAX: f64 = 2.8;

/// Gaps between two rims that are this narrow are what rounding makes of a needle's tip, around which its outline goes.
const GAP_MIN: f64 = 1e-9;

/// The narrowest piece of a fan, as an angle.
const PIECE_MIN: f64 = 1e-9;

/// An end of a rim that has a strip.
#[derive(Clone, Copy, Debug, Default)]
pub struct End {
    /// Where it ends.
    pub vertex: u32,
    /// The strip's outer corner there.
    pub outer: u32,
    /// Whose outline it is.
    pub material: u32,
    /// To which side of the rim, seen from here, nothing is: 1 where angles grow, else -1.
    pub free: i8,
    /// In which direction the rim leaves.
    pub angle: f64,
    /// From there to the outer corner's direction, positive.
    pub turn: f64,
    /// On screen, 1/256 px.
    pub middle: [f64; 2],
    /// From the middle to the outer corner, 1/256 px.
    pub reach: f64,
    /// The outer corner's.
    pub depth: f64,
    /// 1 / W
    pub inv_w: f64,
    /// How depth changes along the rim, away from here, each 1/256 px.
    pub slope: f64,
    /// Whether a face of the vertex hides the rim.
    pub is_hidden: bool,
}

/// Ends of rims, and what is between them.
pub struct Fans {
    ends: Vec<End>,
    triangles_max: f64,
}

/// A fan: from an end's outer corner on, by an angle; to another end's, if there is one. Of it, what lies between two of its angles is
/// drawn.
struct Fan {
    from: usize,
    sweep: f64,
    to: Option<usize>,
    piece: [f64; 2],
}

impl Fans {
    /// Of so many ends at most, around what is seen in a picture of this size.
    pub fn with_capacity(ends: usize, size_px: [u32; 2]) -> Self {
        let pixels = size_px.map(f64::from);
        let triangles_max = TRIANGLES_MAX.min(TRIANGLES_MAX_PER_PX * pixels[0] * pixels[1]);
        Self { ends: Vec::with_capacity(ends), triangles_max }
    }

    /// Adds an end.
    pub fn push(&mut self, end: End) {
        self.ends.push(end);
    }

    /// Adds the fans of all vertices to the hull.
    pub fn finish(
        &mut self,
        view: &View<'_>,
        hull: &mut HullPass<'_>,
        cx: &mut PlanContext<'_>,
    ) -> Result<(), PlanError> {
        self.sort(cx.deadline)?;
        let sectors = Sectors::around(&mut self.ends, view, cx)?;
        self.draw(&sectors, view.mesh.positions.len() as u32, hull, cx)
    }

    /// Puts the ends in order, by vertex and angle.
    fn sort(&mut self, deadline: &Deadline) -> Result<(), Stopped> {
        // Of two ends in one direction the one whose rim is free below comes first: the gap from the other to it is a whole turn.
        let order =
            |a: &End, b: &End| (a.vertex.cmp(&b.vertex)).then(a.angle.total_cmp(&b.angle)).then(a.free.cmp(&b.free));
        sort(&mut self.ends, &order, deadline)
    }

    /// Adds the fans; the hull's own vertices are numbered from `first` on.
    fn draw(
        &self,
        sectors: &Sectors,
        first: u32,
        hull: &mut HullPass<'_>,
        cx: &mut PlanContext<'_>,
    ) -> Result<(), PlanError> {
        let (ends, deadline) = (&self.ends, cx.deadline);
        let mut steps = 0.0;
        each_fan(ends, sectors, deadline, |fan| steps += fan.angle() / step(ends, &fan))?;
        let coarser = (steps / self.triangles_max).max(1.0);
        let (mut vertices, mut triangles) = (0, 0);
        each_fan(ends, sectors, deadline, |fan| {
            let count = chords(ends, &fan, coarser) as usize;
            triangles += count;
            vertices += count + 1 - usize::from(fan.begins()) - usize::from(fan.meets().is_some());
        })?;
        grow("an outline's corners", &mut hull.vertices, vertices, cx.budget)?;
        grow("an outline's corners", &mut hull.triangles, triangles, cx.budget)?;
        grow("an outline's corners", &mut hull.triangle_materials, triangles, cx.budget)?;
        each_fan(ends, sectors, deadline, |fan| draw(ends, &fan, coarser, first, hull))?;
        Ok(())
    }
}

/// Makes room for so many more, and no others. While a list moves to where there is room, it is there twice.
fn grow<T>(what: &str, list: &mut Vec<T>, more: usize, budget: &mut Budget) -> Result<(), PlanError> {
    if list.capacity() - list.len() < more {
        budget.spend(what, (list.len() + more) as u64, size_of::<T>() as u64)?;
        list.reserve_exact(more);
    }
    Ok(())
}

impl Fan {
    /// How wide the piece is that is drawn.
    fn angle(&self) -> f64 {
        self.piece[1] - self.piece[0]
    }

    /// Whether it is drawn from the end's outer corner on.
    fn begins(&self) -> bool {
        self.piece[0] <= 0.0
    }

    /// The other end, if it is drawn up to there.
    fn meets(&self) -> Option<usize> {
        self.to.filter(|_| self.piece[1] >= self.sweep)
    }
}

/// Calls `each` with every piece of a fan, vertex by vertex.
fn each_fan(ends: &[End], sectors: &Sectors, deadline: &Deadline, mut each: impl FnMut(Fan)) -> Result<(), Stopped> {
    let mut each_piece = |from: usize, sweep: f64, next: usize, to: Option<usize>| {
        if !ends[from].is_hidden && !ends[next].is_hidden {
            return each(Fan { from, sweep, to, piece: [0.0, sweep] });
        }
        let End { vertex, free, angle, turn, .. } = ends[from];
        let (start, free) = (angle + f64::from(free) * turn, f64::from(free));
        let low = turned(if free > 0.0 { start } else { start - sweep });
        sectors.gaps(vertex, [low, low + sweep], |[a, b]| {
            let [a, b] = if free > 0.0 { [a - low, b - low] } else { [low + sweep - b, low + sweep - a] };
            // What rounding leaves of a fan whose corner lies where a face ends is none.
            let piece = [if a < PIECE_MIN { 0.0 } else { a }, if b > sweep - PIECE_MIN { sweep } else { b }];
            if piece[1] - piece[0] > PIECE_MIN {
                each(Fan { from, sweep, to, piece });
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
            // The next one on the free side, and how far it is.
            let next = if end.free > 0 { (i + 1) % count } else { (i + count - 1) % count };
            let mut gap = f64::from(end.free) * (group[next].angle - end.angle);
            if gap < 0.0 || next == i || (next > i) != (end.free > 0) {
                gap += TAU;
            }
            if gap < GAP_MIN {
                gap += TAU;
            }
            let meets = group[next].free != end.free;
            // Of two that meet, the one that is free above draws the fan between them.
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

/// The ends at each vertex, and where they begin.
fn groups(ends: &[End]) -> impl Iterator<Item = (usize, &[End])> {
    let mut first = 0;
    ends.chunk_by(|a, b| a.vertex == b.vertex).map(move |group| {
        first += group.len();
        (first - group.len(), group)
    })
}

/// The angle between the corners of an arc: its chords are `SAGITTA` away from it, `r (1 - cos(a / 2))`.
fn step(ends: &[End], fan: &Fan) -> f64 {
    let from = &ends[fan.from];
    let reach = fan.to.map_or(from.reach, |to| ends[to].reach.max(from.reach));
    (8.0 * SAGITTA / reach.max(1.0)).sqrt().min(FRAC_PI_4)
}

/// Into how many triangles a fan is cut.
fn chords(ends: &[End], fan: &Fan, coarser: f64) -> u32 {
    let chord = (step(ends, fan) * coarser).min(CHORD_MAX);
    (fan.angle() / chord).max(0.0) as u32 + 1
}

fn draw(ends: &[End], fan: &Fan, coarser: f64, first: u32, hull: &mut HullPass<'_>) {
    let from = &ends[fan.from];
    let (reach, depth) = fan.to.map_or((from.reach, from.depth), |to| (ends[to].reach, ends[to].depth));
    let free = f64::from(from.free);
    let start = from.angle + free * from.turn;
    let mut corner = |swept: f64| {
        let (angle, share) = (start + free * swept, swept / fan.sweep);
        let reach = from.reach + share * (reach - from.reach);
        let at = [libm::cos(angle), libm::sin(angle)];
        let [x, y] = [0, 1].map(|k| from.middle[k] + reach * at[k]);
        hull.vertices.push(snapped([x, y, from.depth + share * (depth - from.depth), from.inv_w]));
        first + hull.vertices.len() as u32 - 1
    };
    let count = chords(ends, fan, coarser);
    let mut last = if fan.begins() { from.outer } else { corner(fan.piece[0]) };
    for i in 1..=count {
        let next = match fan.meets() {
            Some(to) if i == count => ends[to].outer,
            _ => corner(fan.piece[0] + fan.angle() * (f64::from(i) / f64::from(count))),
        };
        hull.triangles.push([from.vertex, last, next]);
        hull.triangle_materials.push(from.material);
        last = next;
    }
}

#[cfg(test)]
mod tests;
