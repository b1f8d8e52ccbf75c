//! Exact tests in two dimensions, after points were projected along an axis: the side of a line on which a point
//! lies, and whether a segment and a triangle of one plane have a point in common.

use robust::{Coord, orient2d};

use super::Point;

type Point2 = [f64; 2];

/// A projection along an axis.
#[derive(Clone, Copy, Debug)]
pub struct Projection([usize; 2]);

impl Projection {
    /// Along each axis.
    pub const ALL: [Self; 3] = [Self([0, 1]), Self([1, 2]), Self([2, 0])];

    /// One that leaves a triangle an area; none if its corners lie on a line.
    pub fn of([a, b, c]: [Point; 3]) -> Option<Self> {
        let has_area = |plane: &Self| side(plane.project(a), plane.project(b), plane.project(c)) != 0.0;
        Self::ALL.into_iter().find(has_area)
    }

    /// A point in it.
    pub fn project(self, point: Point) -> Point2 {
        self.0.map(|k| point[k])
    }

    /// True if a segment and a triangle of one plane have a point in common. The projection leaves
    /// the triangle an area.
    pub fn meets(self, segment: [Point; 2], triangle: [Point; 3]) -> bool {
        let [p, q] = segment.map(|point| self.project(point));
        let [a, b, c] = triangle.map(|point| self.project(point));
        let is_inside = !have_mixed_signs(&[side(a, b, p), side(b, c, p), side(c, a, p)]);
        is_inside || [[a, b], [b, c], [c, a]].into_iter().any(|edge| do_meet([p, q], edge))
    }
}

/// True if two segments have a point in common.
fn do_meet([p, q]: [Point2; 2], [r, s]: [Point2; 2]) -> bool {
    let of_ends = [side(p, q, r), side(p, q, s)];
    if of_ends == [0.0; 2] {
        // All on one line.
        return (0..2).all(|k| p[k].min(q[k]) <= r[k].max(s[k]) && r[k].min(s[k]) <= p[k].max(q[k]));
    }
    !are_on_one_side(&of_ends) && !are_on_one_side(&[side(r, s, p), side(r, s, q)])
}

/// The side of the line through `a` and `b` that `c` lies on: positive, negative, or 0 on it.
pub fn side(a: Point2, b: Point2, c: Point2) -> f64 {
    if (0..2).any(|k| a[k] == b[k] && a[k] == c[k]) {
        return 0.0;
    }
    let [a, b, c] = [a, b, c].map(|[x, y]| Coord { x, y });
    orient2d(a, b, c)
}

/// True if some are positive and some negative.
pub fn have_mixed_signs(sides: &[f64]) -> bool {
    sides.iter().any(|side| *side > 0.0) && sides.iter().any(|side| *side < 0.0)
}

/// True if all are positive or all negative.
pub fn are_on_one_side(sides: &[f64]) -> bool {
    sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0)
}
