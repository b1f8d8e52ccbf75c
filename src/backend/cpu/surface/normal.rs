//! Stage shade, per point: the normal for lighting. Twin of `shaders/surface/normal.wgsl`.

use super::barycentric::Quad;
use super::texture::{Uv, blend, sample};
use super::wire::Place;
use crate::backend::cpu::vector::{across, cross, facing, sub, turned_to_viewer, unit_or};
use crate::plan::{ShadedMaterial, SurfacePass, flags, slots};

/// The unit normal on the viewer's side, without normal textures.
pub fn normal(surface: &SurfacePass<'_>, material: &ShadedMaterial, place: &Place<'_>) -> [f32; 3] {
    let Place { context, id, b, .. } = place;
    let to_viewer = context.plan.projection.to_viewer;
    if material.flags & flags::DERIVATIVE_NORMALS != 0 {
        return derivative_normal(place);
    }
    if material.flags & flags::FACE_NORMALS != 0 {
        return turned_to_viewer(surface.face_normals[*id as usize], b.front);
    }
    match &surface.vertex_normals {
        Some(normals) => {
            let corners = normals.triangles[*id as usize].map(|i| normals.values[i as usize]);
            facing(blend(corners, b.value), b.front)
        }
        None => to_viewer,
    }
}

/// The cross product of the position's fine derivatives in a block of 2 x 2 pixels, as a GPU's
/// rasterizer has them: in f32, with the same rounding errors on both back-ends.
fn derivative_normal(place: &Place<'_>) -> [f32; 3] {
    let Place { context, id, at, .. } = place;
    let quad = Quad::around(context.plan, *at);
    let corners = context.positions_of(*id).map(|(position, _)| position);
    // Bounds a neighbour beyond the horizon of the triangle's plane.
    let bounded = |b: [f32; 3]| b.map(|v| v.clamp(-1e6, 1e6));
    let [own, across, down] = quad.barycentrics(context, *id).map(|b| blend(corners, bounded(b)));
    // The factor keeps squares from vanishing.
    let step = |p: [f32; 3], sign: f32| sub(p, own).map(|v| v * (4096.0 * sign));
    let (dx, dy) = (step(across, quad.sign[0]), step(down, quad.sign[1]));
    unit_or(cross(dy, dx), context.plan.projection.to_viewer)
}

/// The normal `n` perturbed by the normal texture. The axes are the triangle's own: increasing u
/// and decreasing v.
pub fn normal_mapped(
    surface: &SurfacePass<'_>,
    material: &ShadedMaterial,
    place: &Place<'_>,
    uv: &Uv,
    n: [f32; 3],
) -> [f32; 3] {
    let Some(uvs) = &surface.uvs else { return n };
    let used = &material.textures[slots::NORMAL];
    let p = place.context.positions_of(place.id).map(|(position, _)| position);
    let [t0, t1, t2] = uvs.triangles[place.id as usize].map(|i| {
        let [u, v] = uvs.values[i as usize];
        used.transform.map(|[a, b, _]| a * u + b * v)
    });
    let (e1, e2) = (sub(p[1], p[0]), sub(p[2], p[0]));
    let (d1, d2) = ([t1[0] - t0[0], t1[1] - t0[1]], [t2[0] - t0[0], t2[1] - t0[1]]);
    let turn = d1[0] * d2[1] - d2[0] * d1[1];
    if !(turn.abs() > 1e-30 && turn.abs() < 1e30) {
        return n;
    }
    // Seen from behind, bumps are dents. v runs down in the image, the texture's y up.
    let side = if (turn > 0.0) == place.b.front { 1.0 } else { -1.0 };
    let along_u: [f32; 3] = std::array::from_fn(|k| side * (e1[k] * d2[1] - e2[k] * d1[1]));
    let along_up: [f32; 3] = std::array::from_fn(|k| side * (e1[k] * d2[0] - e2[k] * d1[0]));
    let tangent = unit_or(across(along_u, n), [0.0; 3]);
    let up = unit_or(across(across(along_up, n), tangent), [0.0; 3]);
    let [x, y, z, _] = sample(&surface.textures, used, uv).map(|v| 2.0 * v - 1.0);
    let (x, y) = (x * material.normal_scale, y * material.normal_scale);
    unit_or(std::array::from_fn(|k| (x * tangent[k] + y * up[k]) + z * n[k]), n)
}
