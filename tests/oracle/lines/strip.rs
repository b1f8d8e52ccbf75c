//! The share of a pixel that an infinite straight line covers, in closed form.

use super::super::vector::V2;

/// The share of a pixel in the strip of width `width` around a line with unit normal `n`, whose
/// distance from the pixel's centre is `distance`: T(d + w/2) - T(d - w/2), T the integral of the
/// box filter's profile across the line.
pub fn coverage(distance: f64, n: V2, width: f64) -> f64 {
    profile_integral(distance + 0.5 * width, n) - profile_integral(distance - 0.5 * width, n)
}

/// The unit square, seen along a line with normal `n`, has a trapezoid's profile of area 1: half as
/// wide as `(|nx| + |ny|) / 2` at the foot and `||nx| - |ny|| / 2` at the top. Its integral from
/// the middle to `u`.
fn profile_integral(u: f64, n: V2) -> f64 {
    let (foot, top) = (0.5 * (n[0].abs() + n[1].abs()), 0.5 * (n[0].abs() - n[1].abs()).abs());
    let a = u.abs().min(foot);
    let height = 1.0 / (foot + top);
    // The area by which the flank, which falls from `height` at `top` to 0 at `foot`, is short of a
    // rectangle.
    let missing = if a > top { 0.5 * height * (a - top) * (a - top) / (foot - top) } else { 0.0 };
    (height * a - missing).copysign(u)
}
