//! Convex polygons: clipping by a half plane or by another polygon, and area. Rounding costs about
//! 1e-14 of the square of the largest coordinate, so callers first shift polygons to near the
//! origin.

use super::vector::{V2, cross2, mix, sub};

/// The part of a polygon with `inside(p) >= 0`, `inside` being affine (Sutherland and Hodgman's
/// algorithm).
pub fn clip(polygon: &[V2], inside: impl Fn(V2) -> f64) -> Vec<V2> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let (a, b) = (inside(from), inside(to));
        if a >= 0.0 {
            kept.push(from);
        }
        if (a >= 0.0) != (b >= 0.0) {
            kept.push(mix(from, to, a / (a - b)));
        }
    }
    kept
}

/// The part of a polygon in a convex one whose corners run clockwise on screen.
pub fn clip_by(polygon: &[V2], by: &[V2]) -> Vec<V2> {
    let mut rest = polygon.to_vec();
    for (i, &a) in by.iter().enumerate() {
        let along = sub(by[(i + 1) % by.len()], a);
        rest = clip(&rest, |p| cross2(along, sub(p, a)));
    }
    rest
}

/// Signed: positive where the corners run clockwise on screen.
pub fn area(polygon: &[V2]) -> f64 {
    let Some(&first) = polygon.first() else { return 0.0 };
    let pairs = polygon.windows(2);
    pairs.map(|pair| 0.5 * cross2(sub(pair[0], first), sub(pair[1], first))).sum()
}

/// The unit square around the origin, clockwise on screen.
pub const UNIT_BOX: [V2; 4] = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
