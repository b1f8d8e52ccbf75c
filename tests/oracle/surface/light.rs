//! The colour of a lit surface.
//!
//! Each lamp adds Lambert's diffuse light and a GGX highlight (Walter et al. 2007) in the short
//! form that needs no visibility term of its own (Karis 2013, "Optimizing PBR for Mobile"), with a
//! reflectance of 0.04 head on. Ambient light is brighter from above than from below. Metals have
//! highlights of their own colour, and mirror their surroundings. Light above 0.8 is rolled off.

use super::super::vector::{V2, V3, cross, dot, length, sub, unit};
use super::surroundings::{blurred, mirror_image};

/// A surface's material. Colours are linear.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub base: V3,
    pub metallic: f64,
    pub roughness: f64,
}

/// A lamp infinitely far away; unit vectors towards it, and halfway between it and the viewer.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    pub to_light: V3,
    pub halfway: V3,
    pub strength: f64,
}

/// All light there is.
#[derive(Clone, Debug)]
pub struct Lights {
    pub lamps: Vec<Lamp>,
    pub ambient: f64,
    /// The camera's axes: right, up, and towards the viewer.
    pub axes: [V3; 3],
}

/// The colour of a surface with unit normal `n` on the viewer's side.
pub fn lit(material: &Material, lights: &Lights, n: V3) -> V3 {
    let alpha = (material.roughness * material.roughness).max(0.0025);
    let mut diffuse = lights.ambient * (0.7 + 0.3 * dot(n, lights.axes[1]));
    let (mut highlight, mut strengths) = (0.0, 0.0);
    for lamp in &lights.lamps {
        let received = lamp.strength * dot(n, lamp.to_light).max(0.0);
        let n_h = dot(n, lamp.halfway).max(0.0);
        let l_h = dot(lamp.to_light, lamp.halfway);
        let d = 1.0 + n_h * n_h * (alpha * alpha - 1.0);
        diffuse += received;
        strengths += lamp.strength;
        highlight += received * (alpha / d) * (alpha / d) / ((l_h * l_h).max(0.1) * (4.0 * material.roughness + 2.0));
    }
    let to_viewer = lights.axes[2];
    let image = mirror_image(n, to_viewer);
    let seen = (lights.ambient + 0.5 * strengths)
        * blurred(dot(image, lights.axes[0]), dot(image, lights.axes[1]), material.roughness);
    let rise = (1.0 - dot(n, to_viewer).clamp(0.0, 1.0)).powi(5) * (1.0 - material.roughness);
    material.base.map(|base| {
        let matte = base * diffuse + 0.04 * highlight;
        let metal = base * highlight + seen * (base * (1.0 - rise) + rise);
        rolled_off((1.0 - material.metallic) * matte + material.metallic * metal)
    })
}

/// Light as it is shown: above 0.8, half of the rest to white is left where there is 0.2 more, a third
/// where there is 0.4 more, and so on.
fn rolled_off(v: f64) -> f64 {
    let over = (v - 0.8).max(0.0);
    v.clamp(0.0, 0.8) + 0.2 * over / (0.2 + over)
}

/// The unit normal of a triangle whose corners run counter-clockwise; None where it has no area.
pub fn face_normal([a, b, c]: [V3; 3]) -> Option<V3> {
    let n = cross(sub(b, a), sub(c, a));
    (length(n) > 0.0).then(|| unit(n))
}

/// A normal per corner of each triangle: the mean of the normals of the faces on its side of the creases at
/// its position, weighted by the angle of each face there.
///
/// A crease is an edge whose two faces' normals differ by more than `crease_deg`.
pub fn smooth_normals(positions: &[V3], triangles: &[[u32; 3]], crease_deg: f64) -> Vec<[V3; 3]> {
    let normals: Vec<Option<V3>> = triangles.iter().map(|t| face_normal(t.map(|v| positions[v as usize]))).collect();
    let mut faces_at = vec![Vec::new(); positions.len()];
    for (f, t) in triangles.iter().enumerate().filter(|(f, _)| normals[*f].is_some()) {
        t.iter().for_each(|&v| faces_at[v as usize].push(f));
    }
    let is_crease = |f: usize, g: usize| {
        let angle = |a: V3, b: V3| length(cross(a, b)).atan2(dot(a, b)).to_degrees();
        normals[f].zip(normals[g]).is_some_and(|(a, b)| angle(a, b) > crease_deg)
    };
    let share_edge =
        |f: usize, g: usize| f != g && triangles[f].iter().filter(|v| triangles[g].contains(v)).count() == 2;
    let corner = |f: usize, v: u32| {
        let faces = &faces_at[v as usize];
        let has_crease = faces.iter().any(|&f| faces.iter().any(|&g| share_edge(f, g) && is_crease(f, g)));
        let mut side = if has_crease { vec![f] } else { faces.clone() };
        let joins = |side: &[usize], g: usize| side.iter().any(|&h| share_edge(g, h) && !is_crease(g, h));
        while let Some(&more) = faces.iter().find(|&&g| !side.contains(&g) && joins(&side, g)) {
            side.push(more);
        }
        let sum = side.iter().fold([0.0; 3], |sum, &g| {
            let (t, normal) = (triangles[g], normals[g].unwrap_or_default());
            let k = t.iter().position(|&u| u == v).unwrap_or_default();
            let at = |step: usize| positions[t[(k + step) % 3] as usize];
            let (a, b) = (sub(at(1), at(0)), sub(at(2), at(0)));
            let angle = length(cross(a, b)).atan2(dot(a, b));
            std::array::from_fn(|i| sum[i] + angle * normal[i])
        });
        if length(sum) > 0.0 { unit(sum) } else { sum }
    };
    (0..triangles.len()).map(|f| triangles[f].map(|v| corner(f, v))).collect()
}

/// Perspective-correct weights of a triangle's corners at a point: the ray's own, by ratios of
/// volumes, in pixels times W.
pub fn weights(corners: [[f64; 4]; 3], p: V2) -> V3 {
    let [a, b, c] = corners.map(|h| [h[0] - p[0] * h[3], h[1] - p[1] * h[3]]);
    let volumes = [(b, c), (c, a), (a, b)].map(|(u, v)| u[0] * v[1] - u[1] * v[0]);
    let total: f64 = volumes.iter().sum();
    volumes.map(|v| v / total)
}
