//! The surroundings that metals mirror: a dark room with windows. `blurred` is how renderers have
//! to draw them, with soft edges that are wider for rough metals. `mirrored` is what that stands in
//! for: the integral over the lobe of a rough surface.

use super::super::vector::{V3, cross, dot, unit};

/// Left, right, lower and upper edge on screen, of directions of length 1, and brightness.
const WINDOWS: [[f64; 5]; 3] =
    [[-0.5, -0.22, 0.68, 0.86, 3.5], [0.74, 0.92, -0.35, 0.5, 3.2], [-0.92, -0.8, -0.4, 0.6, 3.2]];

/// Directions over which a lobe is integrated.
const DIRECTIONS: usize = 1024;

/// Brightness in a direction of length 1: right, up, towards the viewer.
fn brightness(direction: V3) -> f64 {
    let [right, up, _] = direction;
    let t = (0.5 + 2.0 * up).clamp(0.0, 1.0);
    let is_in = |[left, right_edge, lower, upper, _]: &&[f64; 5]| {
        (*left..*right_edge).contains(&right) && (*lower..*upper).contains(&up)
    };
    let windows: f64 = WINDOWS.iter().filter(is_in).map(|window| window[4]).sum();
    0.08 + 0.34 * t * t * (3.0 - 2.0 * t) + windows
}

/// Brightness by definition in a direction of length 1 that points so far to the right and up.
pub fn blurred(right: f64, up: f64, roughness: f64) -> f64 {
    let alpha = (roughness * roughness).max(0.0025);
    let blur = 1.8 * alpha / (alpha + 0.7);
    let rise = |place: f64, edge: f64, width: f64| {
        let t = (0.5 + 0.5 * (place - edge) / width).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let width = blur.max(0.02);
    let window = |[left, right_edge, lower, upper, brightness]: &[f64; 5]| {
        let across = rise(right, *left, width) - rise(right, *right_edge, width);
        brightness * across * (rise(up, *lower, width) - rise(up, *upper, width))
    };
    0.08 + 0.34 * rise(up, 0.0, width.max(0.25)) + (1.0 + blur * blur) * WINDOWS.iter().map(window).sum::<f64>()
}

/// Brightness that a rough mirror shows from the direction that a smooth one would show: the mean over GGX's halfway
/// vectors about it, weighted by the cosine of the angle of light (Karis 2013, "Real Shading in Unreal Engine 4", with
/// the surface seen head on).
pub fn mirrored(direction: V3, roughness: f64) -> f64 {
    let alpha = (roughness * roughness).max(0.0025);
    let aside = if direction[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let across = unit(cross(aside, direction));
    let along = cross(direction, across);
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..DIRECTIONS {
        let share = (i as f64 + 0.5) / DIRECTIONS as f64;
        let turn = std::f64::consts::TAU * (i as f64 * 0.618_033_988_749_895).fract();
        let cos = ((1.0 - share) / (1.0 + (alpha * alpha - 1.0) * share)).sqrt();
        let sin = (1.0 - cos * cos).sqrt();
        let cos_of_light = 2.0 * cos * cos - 1.0;
        if cos_of_light > 0.0 {
            let light = std::array::from_fn(|k| {
                2.0 * cos * sin * (turn.cos() * across[k] + turn.sin() * along[k]) + cos_of_light * direction[k]
            });
            sum += cos_of_light * brightness(light);
            weights += cos_of_light;
        }
    }
    sum / weights
}

/// The mirror image of a viewer on a surface with unit normal `n`, both from the surface.
pub fn mirror_image(n: V3, to_viewer: V3) -> V3 {
    let twice = 2.0 * dot(n, to_viewer);
    std::array::from_fn(|k| twice * n[k] - to_viewer[k])
}
