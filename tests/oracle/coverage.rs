//! The pixels that a triangle covers, and how much of each. Corners are snapped to 1/256
//! pixel, so the sign of each side test is exact in integers.

use super::polygon::{UNIT_BOX, area, clip_by};

/// In 1/256 px from the picture's upper left corner.
pub type Snapped = [i64; 2];

/// A triangle's coverage of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    None,
    Partial,
    Full,
}

/// To the nearest 1/256 px.
pub fn snap(p: [f64; 2]) -> Snapped {
    p.map(|v| (v * 256.0).round_ties_even() as i64)
}

/// Twice the area of `a, b, p`, exactly: positive where they run clockwise on screen.
pub fn orient(a: Snapped, b: Snapped, p: Snapped) -> i128 {
    let d = |u: i64, v: i64| i128::from(u) - i128::from(v);
    d(b[0], a[0]) * d(p[1], a[1]) - d(b[1], a[1]) * d(p[0], a[0])
}

/// The same corners in clockwise order; None where there is no area.
pub fn clockwise(t: [Snapped; 3]) -> Option<[Snapped; 3]> {
    match orient(t[0], t[1], t[2]) {
        0 => None,
        v if v > 0 => Some(t),
        _ => Some([t[0], t[2], t[1]]),
    }
}

/// Exact. Full: all corners of the pixel lie in the closed triangle. None: their insides do not
/// meet, which for two convex shapes is so exactly if a side of one of them has the other on its
/// far side.
pub fn classify(triangle: [Snapped; 3], pixel: [i64; 2]) -> Coverage {
    let Some(t) = clockwise(triangle) else { return Coverage::None };
    let low = pixel.map(|v| v * 256);
    let corners = [[0, 0], [256, 0], [256, 256], [0, 256]].map(|d: [i64; 2]| [low[0] + d[0], low[1] + d[1]]);
    let beside = (0..2).any(|k| t.iter().all(|v| v[k] <= low[k]) || t.iter().all(|v| v[k] >= low[k] + 256));
    let signs: Vec<i128> =
        (0..3).flat_map(|k| corners.map(|corner| orient(t[k], t[(k + 1) % 3], corner).signum())).collect();
    if beside || signs.chunks(4).any(|side| side.iter().all(|&s| s <= 0)) {
        Coverage::None
    } else if signs.iter().all(|&s| s >= 0) {
        Coverage::Full
    } else {
        Coverage::Partial
    }
}

/// The covered share of a pixel, to about 1e-12.
pub fn share(triangle: [Snapped; 3], pixel: [i64; 2]) -> f64 {
    let Some(t) = clockwise(triangle) else { return 0.0 };
    // Relative to the pixel's centre: an exact subtraction of integers.
    let local = t.map(|v| [0, 1].map(|k| (v[k] - pixel[k] * 256 - 128) as f64 / 256.0));
    area(&clip_by(&UNIT_BOX, &local))
}
