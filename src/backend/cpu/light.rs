//! Light without images. Twin of `shaders/light.wgsl`.
//!
//! Lambert plus the GGX lobe for each lamp, and a sky that is brighter than the ground.

use super::point::dot;
use crate::plan::{Lights, MaterialLook};

/// Light on a surface with unit normal `n`: straight alpha in, premultiplied out.
pub fn light(lights: &Lights, s: &MaterialLook, up: [f32; 3], n: [f32; 3]) -> [f32; 4] {
    let base = s.base_color;
    let alpha_squared = (s.roughness * s.roughness).max(0.0025) * (s.roughness * s.roughness).max(0.0025);
    let ambient = lights.ambient * (0.7 + 0.3 * dot(n, up));
    let (mut diffuse, mut shine) = (0.0, 0.0);
    for lamp in &lights.lamps {
        let n_light = dot(n, lamp.to_light).max(0.0);
        let n_half = dot(n, lamp.halfway).max(0.0);
        let light_half = dot(lamp.to_light, lamp.halfway);
        let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
        let gloss = alpha_squared / (lobe * lobe * (light_half * light_half).max(0.1) * (4.0 * s.roughness + 2.0));
        let direct = lamp.strength * n_light;
        diffuse += direct;
        shine += direct * gloss;
    }
    let mut out = base;
    for k in 0..3 {
        let specular = 0.04 + s.metallic * (base[k] - 0.04);
        let reflected = base[k] * (1.0 - s.metallic) * diffuse + specular * shine;
        out[k] = (base[k] * ambient + reflected).clamp(0.0, 1.0) * base[3];
    }
    out
}
