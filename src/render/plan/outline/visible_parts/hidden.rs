//! The part of a silhouette edge that one face hides: the range of the edge on screen in which the face
//! covers it and is nearer. What rounding may change does not count as nearer.

use super::grid::ScreenFace;
use crate::plan::outline::screen_edges::{ScreenEdge, narrow};

/// A face hides only what it would still hide if it were so much farther down its slope, 1/256 px:
/// what is on screen is rounded.
const ROUNDED: f64 = 1.25;

/// Distance up to which what lies beside a face counts as covered by it, 1/256 px: two faces that
/// share a side leave nothing between them.
const BESIDE: f64 = 1e-3;

/// The range of an edge that a face hides, as shares of the way; None if it hides nothing.
/// `vertices` are the mesh edge's, and depths that differ by less than `tiny` count as equal.
pub fn hidden_range(face: &ScreenFace, edge: &ScreenEdge, vertices: [u32; 2], tiny: f64) -> Option<[f64; 2]> {
    let ends = &edge.ends;
    if is_apart(face, &ends[0], &ends[1]) || highest(face, 2) <= lower(ends[0][2], ends[1][2]) {
        return None;
    }
    let shared = vertices.map(|v| face.vertices.contains(&v));
    if shared == [true; 2] {
        return None;
    }
    let sides = Sides::of(face);
    let at = [sides.values([ends[0][0], ends[0][1]]), sides.values([ends[1][0], ends[1][1]])];
    let mut range = [0.0, 1.0];
    for (k, length) in sides.lengths.iter().enumerate() {
        let beside = BESIDE * length;
        narrow(&mut range, at[0][k] + beside, at[1][k] + beside)?;
    }
    let nearer = range.map(|t| {
        let values = [0, 1, 2].map(|k| at[0][k] + t * (at[1][k] - at[0][k]));
        let depth = ends[0][2] + t * (ends[1][2] - ends[0][2]);
        sides.depth(face, values) - depth - ROUNDED * sides.slope(face) - tiny
    });
    // At a common vertex the face is as deep as the edge, and what counts is where it goes from there.
    for k in 0..2 {
        let begins = if k == 0 { range[0] <= 1e-6 } else { range[1] >= 1.0 - 1e-6 };
        if shared[k] && edge.is_whole[k] && begins {
            return (nearer[1 - k] > 0.0).then_some(range);
        }
    }
    match nearer.map(|v| v > 0.0) {
        [true, true] => Some(range),
        [false, false] => None,
        [first, _] => {
            let share = nearer[0] / (nearer[0] - nearer[1]);
            let border = range[0] + share * (range[1] - range[0]);
            Some(if first { [range[0], border] } else { [border, range[1]] })
        }
    }
}

/// True if the boxes around a face and an edge on screen do not touch.
#[inline]
fn is_apart(face: &ScreenFace, a: &[f64], b: &[f64]) -> bool {
    let is_apart = |axis: usize| {
        let (from, to) = (lower(a[axis], b[axis]), higher(a[axis], b[axis]));
        highest(face, axis) < from - BESIDE || lowest(face, axis) > to + BESIDE
    };
    is_apart(0) || is_apart(1)
}

#[inline]
fn highest(face: &ScreenFace, axis: usize) -> f64 {
    let [a, b, c] = &face.corners;
    higher(higher(a[axis], b[axis]), c[axis])
}

#[inline]
fn lowest(face: &ScreenFace, axis: usize) -> f64 {
    let [a, b, c] = &face.corners;
    lower(lower(a[axis], b[axis]), c[axis])
}

// Not `f64::min` and `max`, which look for NaN.
#[inline]
fn higher(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn lower(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The depth of a face at a point, if it covers the point.
pub fn depth_at(face: &ScreenFace, point: [f64; 2]) -> Option<f64> {
    if is_apart(face, &point, &point) {
        return None;
    }
    let sides = Sides::of(face);
    let values = sides.values(point);
    values.iter().all(|v| *v >= 0.0).then(|| sides.depth(face, values))
}

/// The three sides of a face: the k-th runs from corner k to the next, and is opposite of the one
/// before corner k.
struct Sides {
    from: [[f64; 2]; 3],
    way: [[f64; 2]; 3],
    lengths: [f64; 3],
    area: f64,
}

impl Sides {
    #[inline]
    fn of(face: &ScreenFace) -> Self {
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = face.corners;
        let from = [[ax, ay], [bx, by], [cx, cy]];
        let way = [[bx - ax, by - ay], [cx - bx, cy - by], [ax - cx, ay - cy]];
        let length = |way: [f64; 2]| way[0].abs() + way[1].abs();
        let lengths = [length(way[0]), length(way[1]), length(way[2])];
        let area = way[0][0] * -way[2][1] + way[0][1] * way[2][0];
        Self { from, way, lengths, area }
    }

    /// Twice the areas between the sides and a point: all are positive inside.
    #[inline]
    fn values(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let value = |k: usize| self.way[k][0] * (y - self.from[k][1]) - self.way[k][1] * (x - self.from[k][0]);
        [value(0), value(1), value(2)]
    }

    fn depth(&self, face: &ScreenFace, values: [f64; 3]) -> f64 {
        let [a, b, c] = face.corners.map(|corner| corner[2]);
        a + ((b - a) * values[2] + (c - a) * values[0]) / self.area
    }

    /// Change of depth down the face's slope, per 1/256 px; an upper limit.
    fn slope(&self, face: &ScreenFace) -> f64 {
        let [a, b, c] = face.corners.map(|corner| corner[2]);
        let [p, r] = [self.way[0], self.way[2]];
        let x = (b - a) * -r[1] - (c - a) * p[1];
        let y = (c - a) * p[0] - (b - a) * -r[0];
        (x.abs() + y.abs()) / self.area
    }
}
