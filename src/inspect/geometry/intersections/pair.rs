//! The test whether two faces intersect, and the test whether a vertex lies on an edge, between its ends. Both are
//! exact. Points that belong to the corners or the edge that two faces share are no intersection.

use super::Point;
use super::orient::orient;
use super::plane::{Projection, are_on_one_side, have_mixed_signs, side as side_of_line};

type Triangle = [Point; 3];

/// True if two faces have a point in common that is in none of their common corners, nor between
/// two of them. Both have an area. `is_point` says that their boxes have a single point in common.
pub fn intersect(a: [u32; 3], b: [u32; 3], is_point: bool, position: impl Fn(u32) -> Point) -> bool {
    let (common, own) = split(a, |v| b.contains(v));
    let (_, theirs) = split(b, |v| a.contains(v));
    match (common.as_slice(), own.as_slice(), theirs.as_slice()) {
        ([], ..) => do_meet(a.map(&position), b.map(&position)),
        // The point is the common corner.
        ([_], ..) if is_point => false,
        (&[v], &[a1, a2], &[b1, b2]) => {
            meet_beyond_corner(position(v), [a1, a2].map(&position), [b1, b2].map(&position))
        }
        (&[v, w], &[a], &[b]) => overlap_at_edge([v, w].map(&position), position(a), position(b)),
        // One repeats the other.
        _ => false,
    }
}

/// The corners that pass a test, and the others.
fn split(corners: [u32; 3], test: impl Fn(&u32) -> bool) -> (Corners, Corners) {
    let (mut passed, mut others) = (Corners::default(), Corners::default());
    for corner in corners {
        let some = if test(&corner) { &mut passed } else { &mut others };
        some.corners[some.count] = corner;
        some.count += 1;
    }
    (passed, others)
}

/// At most three corners.
#[derive(Default)]
struct Corners {
    corners: [u32; 3],
    count: usize,
}

impl Corners {
    fn as_slice(&self) -> &[u32] {
        &self.corners[..self.count]
    }
}

/// True if two triangles without common corners have a point in common. Then an edge of one has a
/// point in common with the other.
fn do_meet(a: Triangle, b: Triangle) -> bool {
    let sides_of_b = b.map(|corner| side(a, corner));
    if are_on_one_side(&sides_of_b) {
        return false;
    }
    let sides_of_a = a.map(|corner| side(b, corner));
    if are_on_one_side(&sides_of_a) {
        return false;
    }
    let edge_of =
        |[p, q, r]: Triangle, [sp, sq, sr]: [f64; 3]| [([p, q], [sp, sq]), ([q, r], [sq, sr]), ([r, p], [sr, sp])];
    edge_of(b, sides_of_b).into_iter().any(|(edge, sides)| meets(edge, sides, a))
        || edge_of(a, sides_of_a).into_iter().any(|(edge, sides)| meets(edge, sides, b))
}

/// True if triangles with the common corner `v` have another point in common. The way from `v` to it
/// goes on until it leaves one of the two, through the edge opposite to `v` and within the other.
fn meet_beyond_corner(v: Point, [a1, a2]: [Point; 2], [b1, b2]: [Point; 2]) -> bool {
    let (a, b) = ([v, a1, a2], [v, b1, b2]);
    let sides_of_b = [b1, b2].map(|corner| side(a, corner));
    if are_on_one_side(&sides_of_b) {
        return false;
    }
    let sides_of_a = [a1, a2].map(|corner| side(b, corner));
    if are_on_one_side(&sides_of_a) {
        return false;
    }
    meets([b1, b2], sides_of_b, a) || meets([a1, a2], sides_of_a, b)
}

/// True if triangles with a common edge, whose third corners are `a` and `b`, lie in one plane and
/// on the same side of the edge.
fn overlap_at_edge([v, w]: [Point; 2], a: Point, b: Point) -> bool {
    let triangle = [v, w, a];
    side(triangle, b) == 0.0
        && Projection::of(triangle).is_some_and(|plane| {
            let [v, w, a, b] = [v, w, a, b].map(|p| plane.project(p));
            !have_mixed_signs(&[side_of_line(v, w, a), side_of_line(v, w, b)])
        })
}

/// True if a segment and a triangle have a point in common. `sides` are those of its ends.
fn meets([p, q]: [Point; 2], sides: [f64; 2], [a, b, c]: Triangle) -> bool {
    if are_on_one_side(&sides) {
        return false;
    }
    if sides == [0.0; 2] {
        return Projection::of([a, b, c]).is_some_and(|plane| plane.meets([p, q], [a, b, c]));
    }
    // The line through both ends crosses the plane once. It does so within the triangle if it passes
    // no two edges on different sides.
    let of_edge = |from: Point, to: Point| side([p, q, from], to);
    let (ab, bc) = (of_edge(a, b), of_edge(b, c));
    !have_mixed_signs(&[ab, bc]) && !have_mixed_signs(&[ab, bc, of_edge(c, a)])
}

/// The side of the plane through a triangle that a point lies on: positive, negative, or 0 on it.
fn side(triangle @ [a, b, c]: Triangle, d: Point) -> f64 {
    // Most points that lie in a plane exactly lie in one along two axes.
    if (0..3).any(|k| a[k] == b[k] && a[k] == c[k] && a[k] == d[k]) {
        return 0.0;
    }
    orient(triangle, d)
}

/// True if a point lies within a segment, and is none of its ends.
pub fn is_within(point: Point, [a, b]: [Point; 2]) -> bool {
    let is_between = |k: usize| a[k].min(b[k]) <= point[k] && point[k] <= a[k].max(b[k]);
    (0..3).all(is_between)
        && point != a
        && point != b
        && Projection::ALL.iter().all(|plane| {
            let [a, b, point] = [a, b, point].map(|p| plane.project(p));
            side_of_line(a, b, point) == 0.0
        })
}

/// True if three points do not lie on a line.
pub fn has_area(triangle: Triangle) -> bool {
    Projection::of(triangle).is_some()
}
