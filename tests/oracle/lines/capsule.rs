//! The share of a pixel that a line segment with round caps covers, in closed form.

use super::super::polygon::{UNIT_BOX, area, clip, clip_by};
use super::super::vector::{V2, cross2, dot, mix, sub, unit};

/// The share of the pixel with this centre that lies within half of `width` of the segment.
pub fn coverage(center: V2, [a, b]: [V2; 2], width: f64) -> f64 {
    let radius = 0.5 * width;
    let (a, b) = (sub(a, center), sub(b, center));
    if a == b {
        return disc(a, radius, &UNIT_BOX);
    }
    let along = unit(sub(b, a));
    // The half discs beyond each end, and the rectangle between.
    let before = clip(&UNIT_BOX, |p| -dot(sub(p, a), along));
    let beyond = clip(&UNIT_BOX, |p| dot(sub(p, b), along));
    disc(a, radius, &before) + disc(b, radius, &beyond) + rectangle([a, b], radius)
}

/// The area of the unit box around the origin within the rectangle of half width `radius` around a
/// segment.
pub fn rectangle([a, b]: [V2; 2], radius: f64) -> f64 {
    let along = unit(sub(b, a));
    let side = [-along[1] * radius, along[0] * radius];
    let corner = |p: V2, s: f64| [p[0] + s * side[0], p[1] + s * side[1]];
    area(&clip_by(&UNIT_BOX, &[corner(a, -1.0), corner(b, -1.0), corner(b, 1.0), corner(a, 1.0)]))
}

/// The area of a convex polygon (clockwise on screen) within a disc: the sum over its sides of the
/// signed area that the disc has in common with the triangle of its centre and that side.
fn disc(center: V2, radius: f64, polygon: &[V2]) -> f64 {
    (0..polygon.len())
        .map(|i| sector_or_triangle(sub(polygon[i], center), sub(polygon[(i + 1) % polygon.len()], center), radius))
        .sum()
}

/// The signed area of the disc around the origin within the triangle of the origin, `p` and `q`.
fn sector_or_triangle(p: V2, q: V2, radius: f64) -> f64 {
    let sector = |u: V2, v: V2| 0.5 * radius * radius * cross2(u, v).atan2(dot(u, v));
    // |p + t (q - p)| = radius.
    let along = sub(q, p);
    let (a, b, c) = (dot(along, along), dot(p, along), dot(p, p) - radius * radius);
    let root = b * b - a * c;
    if a == 0.0 {
        return 0.0;
    }
    if root <= 0.0 {
        return sector(p, q);
    }
    let [enter, leave] = [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a].map(|t| t.clamp(0.0, 1.0));
    let (enter_at, leave_at) = (mix(p, q, enter), mix(p, q, leave));
    let before = if enter > 0.0 { sector(p, enter_at) } else { 0.0 };
    let after = if leave < 1.0 { sector(leave_at, q) } else { 0.0 };
    // Where the side misses the disc, both crossings were clamped to the same end.
    if enter >= leave { sector(p, q) } else { before + 0.5 * cross2(enter_at, leave_at) + after }
}
