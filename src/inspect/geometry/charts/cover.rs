//! The part of a triangle that other triangles do not cover, for the area of overlaps in a texture. It is kept as a
//! list of convex polygons: each triangle that is taken away cuts the polygons along the lines of its edges.

use super::Uv;

/// A convex polygon, counter-clockwise.
type Polygon = Vec<Uv>;

/// The rounding of one cut: a corner is moved by at most this, times the size of the triangle.
const ROUNDING_PER_CUT: f64 = 16.0 * f64::EPSILON;

/// The part of a triangle that is not covered yet.
pub struct Uncovered {
    /// About the first corner of the triangle, so that far from the origin no digits are lost.
    origin: Uv,
    pieces: Vec<Polygon>,
    /// The size of the triangle: the sum of its box's sides.
    size: f64,
    /// The number of cuts.
    pub cuts: u64,
}

impl Uncovered {
    /// The whole of a triangle.
    pub fn of(triangle: [Uv; 3]) -> Self {
        let origin = triangle[0];
        let side = |k: usize| {
            let values = triangle.map(|corner| corner[k]);
            values.iter().fold(f64::MIN, |a, b| a.max(*b)) - values.iter().fold(f64::MAX, |a, b| a.min(*b))
        };
        let size = side(0) + side(1);
        Self { origin, pieces: vec![counter_clockwise(triangle, origin).to_vec()], size, cuts: 0 }
    }

    /// Takes away what another triangle covers.
    pub fn take(&mut self, other: [Uv; 3]) {
        let other = counter_clockwise(other, self.origin);
        let pieces = std::mem::take(&mut self.pieces);
        for piece in pieces {
            self.take_from(piece, other);
        }
    }

    /// The area that is left.
    pub fn area(&self) -> f64 {
        self.pieces.iter().map(|piece| area(piece)).sum()
    }

    /// The number of polygons that are left.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// The most by which rounding has changed the area.
    pub fn error(&self) -> f64 {
        // Each cut makes a side of at most the triangle's size, on both of whose polygons it counts; the sum of
        // the areas adds the last one.
        (self.cuts + 1) as f64 * 2.0 * ROUNDING_PER_CUT * self.size * self.size
    }

    /// Keeps the parts of a polygon that lie outside of a triangle.
    fn take_from(&mut self, piece: Polygon, other: [Uv; 3]) {
        let edges = [[other[0], other[1]], [other[1], other[2]], [other[2], other[0]]];
        // A line that has all of the polygon on its outer side parts them: nothing is cut.
        if edges.iter().any(|edge| piece.iter().all(|at| side(*edge, *at) <= 0.0)) {
            self.pieces.push(piece);
            return;
        }
        let mut inside = piece;
        for edge in edges {
            self.cuts += 1;
            let outside = half(&inside, [edge[1], edge[0]]);
            if area(&outside) > 0.0 {
                self.pieces.push(outside);
            }
            inside = half(&inside, edge);
            if inside.len() < 3 {
                return;
            }
        }
    }
}

/// The part of a polygon to the left of a line.
fn half(polygon: &[Uv], line: [Uv; 2]) -> Polygon {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, &from) in polygon.iter().enumerate() {
        let to = polygon[(k + 1) % polygon.len()];
        let (at_from, at_to) = (side(line, from), side(line, to));
        if at_from >= 0.0 {
            kept.push(from);
        }
        if at_from > 0.0 && at_to < 0.0 || at_from < 0.0 && at_to > 0.0 {
            let share = at_from / (at_from - at_to);
            kept.push(std::array::from_fn(|k| from[k] + (to[k] - from[k]) * share));
        }
    }
    kept
}

/// Twice the area of the triangle of a line and a point: positive on the left.
fn side([from, to]: [Uv; 2], at: Uv) -> f64 {
    (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0])
}

fn area(polygon: &[Uv]) -> f64 {
    let Some((first, others)) = polygon.split_first() else { return 0.0 };
    others.windows(2).map(|pair| side([*first, pair[0]], pair[1])).sum::<f64>() / 2.0
}

fn counter_clockwise(triangle: [Uv; 3], origin: Uv) -> [Uv; 3] {
    let [a, b, c] = triangle.map(|corner| [corner[0] - origin[0], corner[1] - origin[1]]);
    if side([a, b], c) < 0.0 { [a, c, b] } else { [a, b, c] }
}
