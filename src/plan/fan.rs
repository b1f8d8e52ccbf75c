//! Round corners of outlines: the fan around a vertex between the strips of two rims that meet there.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use super::HullPass;
use super::outline::snapped;
use crate::limits::Budget;
use crate::plan::PlanError;

/// How far an arc may lie from its chords, 1/256 px: 1/64 px.
const SAGITTA: f64 = 4.0;

/// Triangles of all fans up to which arcs are as round as they should be. With more of them they have fewer corners, as many in all and
/// one for each arc.
const TRIANGLES_MAX: f64 = (1 << 20) as f64;

/// Gaps between two rims that are this narrow are what rounding makes of a needle's tip, around which its outline goes.
const GAP_MIN: f64 = 1e-9;

/// An end of a rim that has a strip.
#[derive(Clone, Copy, Debug)]
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
}

/// Ends of rims, and what is between them.
pub struct Fans(Vec<End>);

/// A fan: from an end's outer corner on, by an angle; to another end's, if there is one.
struct Fan {
    from: usize,
    sweep: f64,
    to: Option<usize>,
}

impl Fans {
    /// Of so many ends.
    pub fn with_capacity(ends: usize) -> Self {
        Self(Vec::with_capacity(ends))
    }

    /// Adds an end.
    pub fn push(&mut self, end: End) {
        self.0.push(end);
    }

    /// Adds the fans of all vertices to the hull, whose own vertices are numbered from `first` on.
    pub fn finish(&mut self, first: u32, hull: &mut HullPass<'_>, budget: &mut Budget) -> Result<(), PlanError> {
        // Of two ends in one direction the one whose rim is free below comes first: the gap from the other to it is a whole turn.
        let order = |e: &End| (e.vertex, e.free);
        self.0.sort_unstable_by(|a, b| {
            a.vertex.cmp(&b.vertex).then(a.angle.total_cmp(&b.angle)).then(order(a).cmp(&order(b)))
        });
        let ends = &self.0;
        let (mut count, mut steps) = (0_u64, 0.0);
        each_fan(ends, |fan| {
            count += 1;
            steps += fan.sweep / step(&ends[fan.from], &fan, ends);
        });
        let coarser = (steps / TRIANGLES_MAX).max(1.0);
        // A triangle with its material, and the corner that it adds.
        budget.spend("an outline's corners", count + (steps / coarser) as u64, 32)?;
        each_fan(ends, |fan| draw(ends, &fan, coarser, first, hull));
        Ok(())
    }
}

/// Calls `each` with every fan, vertex by vertex.
fn each_fan(ends: &[End], mut each: impl FnMut(Fan)) {
    for (first, group) in groups(ends) {
        let count = group.len();
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
                    each(Fan { from: first + i, sweep, to: Some(first + next) });
                }
            } else if !meets {
                let sweep = (gap - end.turn).min(FRAC_PI_2);
                if sweep > 0.0 {
                    each(Fan { from: first + i, sweep, to: None });
                }
            }
        }
    }
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
fn step(from: &End, fan: &Fan, ends: &[End]) -> f64 {
    let reach = fan.to.map_or(from.reach, |to| ends[to].reach.max(from.reach));
    (8.0 * SAGITTA / reach.max(1.0)).sqrt().min(FRAC_PI_4)
}

fn draw(ends: &[End], fan: &Fan, coarser: f64, first: u32, hull: &mut HullPass<'_>) {
    let from = &ends[fan.from];
    let (reach, depth) = fan.to.map_or((from.reach, from.depth), |to| (ends[to].reach, ends[to].depth));
    let free = f64::from(from.free);
    let start = from.angle + free * from.turn;
    let count = (fan.sweep / (step(from, fan, ends) * coarser)).max(0.0) as u32 + 1;
    let mut last = from.outer;
    for i in 1..=count {
        let share = f64::from(i) / f64::from(count);
        let next = match fan.to {
            Some(to) if i == count => ends[to].outer,
            _ => {
                let angle = start + free * share * fan.sweep;
                let reach = from.reach + share * (reach - from.reach);
                let at = [libm::cos(angle), libm::sin(angle)];
                let [x, y] = [0, 1].map(|k| from.middle[k] + reach * at[k]);
                hull.vertices.push(snapped([x, y, from.depth + share * (depth - from.depth), from.inv_w]));
                first + hull.vertices.len() as u32 - 1
            }
        };
        hull.triangles.push([from.vertex, last, next]);
        hull.triangle_materials.push(from.material);
        last = next;
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::limits::Limits;

    /// Two rims that leave a vertex at these angles, nothing between the first and the second.
    fn corner(vertex: u32, angles: [f64; 2], reach_px: f64) -> [End; 2] {
        [1, -1].map(|free| End {
            vertex,
            outer: 7,
            material: 0,
            free,
            angle: angles[usize::from(free < 0)],
            turn: FRAC_PI_2,
            middle: [0.0; 2],
            reach: 256.0 * reach_px,
            depth: 0.5,
            inv_w: 1.0,
        })
    }

    fn finish(ends: Vec<End>) -> (HullPass<'static>, Result<(), PlanError>) {
        let mut hull = HullPass::default();
        let result = Fans(ends).finish(10, &mut hull, &mut Budget::new(&Limits::default()));
        (hull, result)
    }

    /// Sums of the angles of all fans.
    fn swept(ends: Vec<End>) -> f64 {
        let mut fans = Fans(ends);
        let (mut hull, mut sum) = (HullPass::default(), 0.0);
        fans.finish(10, &mut hull, &mut Budget::new(&Limits::default())).unwrap();
        each_fan(&fans.0, |fan| sum += fan.sweep);
        sum
    }

    #[test]
    fn fans_fill_what_strips_leave() {
        let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-6, "{got}, not {want}");
        // A corner of a square, where three quarters of a turn are free; one that turns inwards; a needle, and one that is rounded flat.
        near(swept(corner(0, [0.0, 1.5 * PI], 4.0).into()), FRAC_PI_2);
        near(swept(corner(0, [3.0, 3.0 + 1.5 * PI - TAU], 4.0).into()), FRAC_PI_2);
        near(swept(corner(0, [0.0, FRAC_PI_2], 4.0).into()), 0.0);
        near(swept(corner(0, [0.001, 0.0], 4.0).into()), PI - 0.001);
        near(swept(corner(0, [1.0, 1.0], 4.0).into()), PI);
        near(swept(corner(0, [1.0, 1.0 + 1e-15], 4.0).into()), PI);
        // An end that meets none, and a rim with both sides free.
        near(swept(corner(0, [1.0, 1.0], 4.0)[..1].to_vec()), FRAC_PI_2);
        // Two squares that touch at a corner.
        let two = [corner(0, [FRAC_PI_2, PI], 4.0), corner(0, [1.5 * PI, 2.0 * PI], 4.0)].concat();
        near(swept(two), 0.0);
    }

    #[test]
    fn however_many_corners_there_are_their_fans_are_bounded() {
        let (few, result) = finish(corner(0, [0.0, 1.5 * PI], 32.0).into());
        result.unwrap();
        assert!((20..40).contains(&few.triangles.len()), "{}", few.triangles.len());
        let count = 100_000;
        let ends: Vec<End> = (0..count).flat_map(|v| corner(v, [0.0, 1.5 * PI], 32.0)).collect();
        let (many, result) = finish(ends);
        result.unwrap();
        let triangles = many.triangles.len();
        assert!((count as usize * 4..TRIANGLES_MAX as usize + count as usize).contains(&triangles), "{triangles}");
        assert_eq!(many.triangle_materials.len(), triangles);
    }
}
