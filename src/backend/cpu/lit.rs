//! Stage 4, a pixel: the light that falls on lines which take the surface's. Twin of `shaders/lit.wgsl`.
//!
//! Light is affine in the colour that it falls on, `lit = base * A + B`, so one pair a pixel lights lines of any colour: the mean
//! over the samples that see the surface. Where none does, beyond a silhouette, it is the light on the line's own face.

use super::Stages;
use super::barycentric::{Barycentrics, corners};
use super::point::{dot, facing, interpolate};
use super::samples::SampleBand;
use crate::plan::{Lights, MaterialLook, SurfacePass, flags, sample_offsets};

/// Light that changes nothing.
pub const WHITE: [f32; 2] = [1.0, 0.0];

/// The light of every pixel of the band that has an owner: a face of a lit line there, plus 1.
pub fn light_lines(stages: &Stages<'_>, band: &SampleBand, owners: &[u32], light: &mut [[f32; 2]]) {
    let Some(surface) = &stages.plan.surface else { return };
    for (i, (&owner, out)) in (0_u32..).zip(owners.iter().zip(light)) {
        if owner > 0 {
            *out = pixel(stages, surface, band, [i % band.size_px[0], band.first_row + i / band.size_px[0]], owner - 1);
        }
    }
}

fn pixel(stages: &Stages<'_>, surface: &SurfacePass<'_>, band: &SampleBand, [x, y]: [u32; 2], owner: u32) -> [f32; 2] {
    let plan = stages.plan;
    let corner = [x as i32 * 256 - plan.width_px as i32 * 128, y as i32 * 256 - plan.height_px as i32 * 128];
    let (mut sum, mut count) = ([0.0_f32; 2], 0.0_f32);
    for (&id, offset) in band.pixel(x, y).0.iter().zip(sample_offsets(band.samples)) {
        // Neither a hull nor nothing.
        if id < plan.triangles.len() as u32 {
            let at = [(corner[0] + 16 * offset[0]) as f32, (corner[1] + 16 * offset[1]) as f32];
            let light = point(stages, surface, id, at);
            sum = [sum[0] + light[0], sum[1] + light[1]];
            count += 1.0;
        }
    }
    if count == 0.0 {
        return point(stages, surface, owner, [(corner[0] + 128) as f32, (corner[1] + 128) as f32]);
    }
    sum.map(|v| v / count)
}

/// The light on a triangle at a point, in 1/256 px from the picture's centre, which may lie beside it.
fn point(stages: &Stages<'_>, surface: &SurfacePass<'_>, id: u32, at: [f32; 2]) -> [f32; 2] {
    let material = surface.material(id as usize);
    if material.flags & (flags::FACE_NORMALS | flags::VERTEX_NORMALS) == 0 {
        return WHITE;
    }
    let b = Barycentrics::new(&corners(stages, id, at));
    let smooth = surface.vertex_normals.as_ref().filter(|_| material.flags & flags::VERTEX_NORMALS != 0);
    let normal = match smooth {
        Some(normals) => interpolate(&normals.values, normals.triangles[id as usize], inside(b.value)),
        None => surface.face_normals[id as usize],
    };
    terms(&surface.lights, material, stages.plan.projection.screen_up, facing(normal, b.front))
}

/// Barycentrics of a point of the triangle: those of one beside it do not extrapolate.
fn inside(b: [f32; 3]) -> [f32; 3] {
    // NaN, of a triangle seen from its very edge, becomes 0.
    let b = b.map(|v| if v > 0.0 { v.min(1.0) } else { 0.0 });
    let sum = (b[0] + b[1]) + b[2];
    if sum > 0.0 { b.map(|v| v / sum) } else { [1.0 / 3.0; 3] }
}

/// `A` and `B` of light on a surface with unit normal `n`: [`light`](super::light::light) taken apart.
fn terms(lights: &Lights, s: &MaterialLook, up: [f32; 3], n: [f32; 3]) -> [f32; 2] {
    let alpha = (s.roughness * s.roughness).max(0.0025);
    let alpha_squared = alpha * alpha;
    let ambient = lights.ambient * (0.7 + 0.3 * dot(n, up));
    let (mut diffuse, mut shine) = (0.0, 0.0);
    for lamp in &lights.lamps {
        let n_light = dot(n, lamp.to_light).max(0.0);
        let n_half = dot(n, lamp.halfway).max(0.0);
        let light_half = dot(lamp.to_light, lamp.halfway);
        let lobe = n_half * n_half * (alpha_squared - 1.0) + 1.0;
        let gloss = alpha_squared / (lobe * lobe * (light_half * light_half).max(0.1) * (4.0 * s.roughness + 2.0));
        diffuse += lamp.strength * n_light;
        shine += lamp.strength * n_light * gloss;
    }
    [ambient + (1.0 - s.metallic) * diffuse + s.metallic * shine, 0.04 * (1.0 - s.metallic) * shine]
}
