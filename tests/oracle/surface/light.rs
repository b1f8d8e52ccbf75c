//! Part 4: the colour of a lit surface that is no metal.
//!
//! Each lamp adds Lambert's diffuse light and a GGX highlight (Walter et al. 2007) in the short
//! form that needs no visibility term of its own (Karis 2013, "Optimizing PBR for Mobile"), with a
//! reflectance of 0.04 head on. Light from everywhere is brighter from above than from below.

use super::super::vector::{V2, V3, cross, dot, length, sub, unit};

/// A surface's material. Colours are linear.
#[derive(Clone, Copy, Debug)]
pub struct Material {
    pub base: V3,
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
    pub up: V3,
}

/// The colour of a surface with unit normal `n` on the viewer's side.
pub fn lit(material: &Material, lights: &Lights, n: V3) -> V3 {
    let alpha = (material.roughness * material.roughness).max(0.0025);
    let mut diffuse = lights.ambient * (0.7 + 0.3 * dot(n, lights.up));
    let mut highlight = 0.0;
    for lamp in &lights.lamps {
        let received = lamp.strength * dot(n, lamp.to_light).max(0.0);
        let n_h = dot(n, lamp.halfway).max(0.0);
        let l_h = dot(lamp.to_light, lamp.halfway);
        let d = 1.0 + n_h * n_h * (alpha * alpha - 1.0);
        diffuse += received;
        highlight += received * (alpha / d) * (alpha / d) / ((l_h * l_h).max(0.1) * (4.0 * material.roughness + 2.0));
    }
    material.base.map(|base| (base * diffuse + 0.04 * highlight).clamp(0.0, 1.0))
}

/// The unit normal of a triangle whose corners run counter-clockwise; None where it has no area.
pub fn face_normal([a, b, c]: [V3; 3]) -> Option<V3> {
    let n = cross(sub(b, a), sub(c, a));
    (length(n) > 0.0).then(|| unit(n))
}

/// A normal a position: the mean of its faces' normals, weighted by the angle of each face there.
pub fn smooth_normals(positions: &[V3], triangles: &[[u32; 3]]) -> Vec<V3> {
    let mut sums = vec![[0.0; 3]; positions.len()];
    for t in triangles {
        let p = t.map(|v| positions[v as usize]);
        let Some(normal) = face_normal(p) else { continue };
        for k in 0..3 {
            let (u, v) = (sub(p[(k + 1) % 3], p[k]), sub(p[(k + 2) % 3], p[k]));
            let angle = length(cross(u, v)).atan2(dot(u, v));
            let sum = &mut sums[t[k] as usize];
            *sum = std::array::from_fn(|i| sum[i] + angle * normal[i]);
        }
    }
    sums.into_iter().map(|sum| if length(sum) > 0.0 { unit(sum) } else { sum }).collect()
}

/// Perspective-correct weights of a triangle's corners at a point: the ray's own, by ratios of
/// volumes, in pixels times W.
pub fn weights(corners: [[f64; 4]; 3], p: V2) -> V3 {
    let [a, b, c] = corners.map(|h| [h[0] - p[0] * h[3], h[1] - p[1] * h[3]]);
    let volumes = [(b, c), (c, a), (a, b)].map(|(u, v)| u[0] * v[1] - u[1] * v[0]);
    let total: f64 = volumes.iter().sum();
    volumes.map(|v| v / total)
}
