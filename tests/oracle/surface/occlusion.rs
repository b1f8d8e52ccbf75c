//! Screen-space ambient occlusion: the share of light that a surface in a hollow loses.
//!
//! Around a place on screen, many points are looked at, spread evenly over directions and
//! distances. A surface that is seen there and rises above the place takes light from it: more the
//! steeper it rises, and less the farther away it is.

use super::super::camera::Camera;
use super::super::screen::{Scene, Screen};
use super::super::vector::{V2, V3, cross, dot, length, sub};
use super::light::{face_normal, weights};
use super::rays::nearest;

/// The reach of occlusion, as a share of the diagonal of the mesh's box.
const REACH: f64 = 0.11;
/// Sine of the height below which a surface takes nothing.
const LOWEST: f64 = 0.1;
/// Factor of the mean.
const FACTOR: f64 = 6.0;

/// The share of light that the surface at `p` goes without, by `side * side` rays; None where there is
/// no surface.
pub fn shut(scene: &Scene, screen: &Screen, p: V2, side: u32) -> Option<f64> {
    let (place, normal) = seen(scene, screen, p)?;
    let reach = REACH * diagonal(&scene.positions);
    let reach_px = reach * length([0, 1, 2].map(|k| scene.camera.x[k])) / scene.camera.w[3];
    let n = f64::from(side);
    let mut sum = 0.0;
    for i in 0..side {
        let (sin, cos) = ((f64::from(i) + 0.5) / n * std::f64::consts::TAU).sin_cos();
        for j in 0..side {
            let away = (f64::from(j) + 0.5) / n * reach_px;
            let at = [p[0] + away * cos, p[1] + away * sin];
            let size = screen.camera.size_px.map(f64::from);
            if at.iter().zip(size).any(|(v, size)| *v < 0.0 || *v >= size) {
                continue;
            }
            let Some((other, _)) = seen(scene, screen, at) else { continue };
            let v = sub(other, place);
            let distance = length(v);
            if distance > 0.0 && distance < reach {
                let fade = 1.0 - (distance / reach).powi(2);
                sum += (dot(v, normal) / distance - LOWEST).max(0.0) * fade * fade;
            }
        }
    }
    Some((FACTOR * sum / (n * n)).min(1.0))
}

/// The place of what is seen at a point, and its normal on the viewer's side.
fn seen(scene: &Scene, screen: &Screen, p: V2) -> Option<(V3, V3)> {
    let (piece, _) = nearest(&screen.near(&[p]), p)?;
    let corners = scene.triangles[piece.triangle as usize].map(|v| scene.positions[v as usize]);
    let projected = corners.map(|c| scene.camera.homogeneous(c));
    let share = weights(projected, p);
    let place = [0, 1, 2].map(|k| (0..3).map(|i| share[i] * corners[i][k]).sum());
    let normal = face_normal(corners)?;
    let row = |r: &[f64; 4]| [r[0], r[1], r[2]];
    let to_viewer =
        if row(&scene.camera.w) == [0.0; 3] { row(&scene.camera.z) } else { sub(eye(&scene.camera), place) };
    let is_front = dot(normal, to_viewer) > 0.0;
    Some((place, if is_front { normal } else { sub([0.0; 3], normal) }))
}

/// The point at which x, y and W are 0.
fn eye(camera: &Camera) -> V3 {
    let [x, y, w] = [&camera.x, &camera.y, &camera.w].map(|r| [r[0], r[1], r[2]]);
    let parts = [cross(y, w), cross(w, x), cross(x, y)];
    let at = [camera.x[3], camera.y[3], camera.w[3]];
    [0, 1, 2].map(|k| -(0..3).map(|i| at[i] * parts[i][k]).sum::<f64>() / dot(x, cross(y, w)))
}

fn diagonal(positions: &[V3]) -> f64 {
    let side = |k: usize| {
        let (low, high) =
            positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[k]), high.max(p[k])));
        high - low
    };
    length([side(0), side(1), side(2)])
}
