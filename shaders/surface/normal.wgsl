// The normal at a point of the surface, for lighting (stage shade): that of the face, the interpolated one of its
// corners, or one from derivatives of the position; a normal texture may bend it. Twin of
// src/render/backend/cpu/surface/normal.rs.
//
// Uses: common.wgsl (DERIVATIVE_NORMALS, dot3, FACE_NORMALS, has, rn, rn3, VERTEX_NORMALS),
// one_job.wgsl or gang.wgsl (frame), surface/barycentric.wgsl (Barycentrics, blend3,
// corner_position, quad_around, triangles), surface/material.wgsl (MATERIAL_DERIVATIVE_NORMALS,
// MATERIAL_FACE_NORMALS, materials, SLOT_NORMAL), surface/point.wgsl (corner_triangles),
// surface/texture.wgsl (sample_texture, set_at, transformed, use_of, Uv, uvs).

@group(1) @binding(6) var<storage, read> normals: array<f32>;
@group(1) @binding(16) var<storage, read> face_normals: array<f32>;

// Value of normal_triangles_at for normals that are indexed by the plan's own triangles.
const OWN_TRIANGLES: u32 = 0xFFFFFFFFu;

fn face_normal(id: u32) -> vec3<f32> {
    return vec3(face_normals[3u * id], face_normals[3u * id + 1u], face_normals[3u * id + 2u]);
}

fn normal_at(id: u32, corner: u32) -> vec3<f32> {
    var v: u32;
    if frame.normal_triangles_at == OWN_TRIANGLES {
        v = triangles[3u * id + corner];
    } else {
        v = corner_triangles[frame.normal_triangles_at + 3u * id + corner];
    }
    return vec3(normals[3u * v], normals[3u * v + 1u], normals[3u * v + 2u]);
}

// The unit normal on the viewer's side, without normal textures.
fn normal(id: u32, at: vec2<f32>, m: u32, b: Barycentrics) -> vec3<f32> {
    let flags = materials[m].flags;
    if has(DERIVATIVE_NORMALS) && (flags & MATERIAL_DERIVATIVE_NORMALS) != 0u {
        return derivative_normal(id, at);
    }
    if has(FACE_NORMALS) && (flags & MATERIAL_FACE_NORMALS) != 0u {
        return turned_to_viewer(face_normal(id), b.front);
    }
    if has(VERTEX_NORMALS) {
        return facing(blend3(b.value, normal_at(id, 0u), normal_at(id, 1u), normal_at(id, 2u)), b.front);
    }
    return frame.to_viewer.xyz;
}

// Share of alpha that a material of MATERIAL_BY_ANGLE keeps where its unit normal is n: all at grazing
// angles.
fn angle_share(m: u32, at: vec2<f32>, n: vec3<f32>) -> f32 {
    let away = frame.to_viewer.w * at;
    // Towards the eye.
    let ray = (frame.to_viewer.xyz - rn3(away.x * frame.screen_right.xyz)) + rn3(away.y * frame.screen_up.xyz);
    let facing = dot3(n, ray) / sqrt(dot3(ray, ray));
    let grazing = 1.0 - clamp(facing, 0.0, 1.0);
    let least = materials[m].facing_opacity;
    return least + rn((1.0 - least) * rn(grazing * grazing));
}

// The cross product of the position's fine derivatives in a block of 2 x 2 pixels, as a GPU's
// rasterizer has them: in f32, with the same rounding errors on both back-ends.
fn derivative_normal(id: u32, at: vec2<f32>) -> vec3<f32> {
    let quad = quad_around(id, at);
    let own = quad_position(id, quad.own);
    // The factor keeps squares from vanishing.
    let dx = rn3((quad_position(id, quad.across) - own) * (4096.0 * quad.sign.x));
    let dy = rn3((quad_position(id, quad.down) - own) * (4096.0 * quad.sign.y));
    return unit_or(rn3(dy.yzx * dx.zxy) - rn3(dy.zxy * dx.yzx), frame.to_viewer.xyz);
}

fn quad_position(id: u32, b: vec3<f32>) -> vec3<f32> {
    // Bounds a neighbour beyond the horizon of the triangle's plane.
    let w = clamp(b, vec3(-1e6), vec3(1e6));
    return rn3(blend3(w, corner_position(id, 0u), corner_position(id, 1u), corner_position(id, 2u)));
}

// The normal n perturbed by the normal texture. The axes are the triangle's own: increasing u and
// decreasing v.
fn normal_mapped(id: u32, m: u32, b: Barycentrics, uv: Uv, n: vec3<f32>) -> vec3<f32> {
    let used = use_of(m, SLOT_NORMAL);
    let p = corner_position(id, 0u);
    let e1 = corner_position(id, 1u) - p;
    let e2 = corner_position(id, 2u) - p;
    let first = frame.uv_triangles_at + 3u * id;
    let start = set_at(used);
    let t = transformed(used, uvs[start + corner_triangles[first]]);
    let d1 = transformed(used, uvs[start + corner_triangles[first + 1u]]) - t;
    let d2 = transformed(used, uvs[start + corner_triangles[first + 2u]]) - t;
    let turn = rn(d1.x * d2.y) - rn(d2.x * d1.y);
    if !(abs(turn) > 1e-30 && abs(turn) < 1e30) {
        return n;
    }
    // Seen from behind, bumps are dents. v runs down in the image, the texture's y up.
    let side = select(-1.0, 1.0, (turn > 0.0) == b.front);
    let along_u = side * (e1 * d2.y - e2 * d1.y);
    let along_up = side * (e1 * d2.x - e2 * d1.x);
    let tangent = unit_or(across(along_u, n), vec3(0.0));
    let up = unit_or(across(across(along_up, n), tangent), vec3(0.0));
    let v = 2.0 * sample_texture(m, SLOT_NORMAL, id, b, uv).xyz - 1.0;
    let x = v.x * materials[m].normal_scale;
    let y = v.y * materials[m].normal_scale;
    return unit_or((x * tangent + y * up) + v.z * n, n);
}

// A face's unit normal on the viewer's side. It is not normalised again, so that it keeps its bits.
fn turned_to_viewer(n: vec3<f32>, front: bool) -> vec3<f32> {
    return select(-n, n, front);
}

// The unit normal on the viewer's side of interpolated corner normals.
fn facing(n: vec3<f32>, front: bool) -> vec3<f32> {
    let length_squared = dot(n, n);
    var scale = 0.0;
    if length_squared > 1e-20 {
        scale = 1.0 / sqrt(length_squared);
    }
    return n * select(-scale, scale, front);
}

fn unit_or(v: vec3<f32>, otherwise: vec3<f32>) -> vec3<f32> {
    let length_squared = dot(v, v);
    if length_squared > 1e-20 && length_squared < 1e30 {
        return v / sqrt(length_squared);
    }
    return otherwise;
}

// Component of v at right angles to the unit vector n; about unit length where it is not zero.
fn across(v: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let largest = max(max(abs(v.x), abs(v.y)), abs(v.z));
    let scaled = select(v, v / largest, largest > 0.0);
    return scaled - dot(scaled, n) * n;
}
