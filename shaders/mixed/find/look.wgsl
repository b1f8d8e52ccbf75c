// The look of a face (stage mixed): numbers for what decides its colour, such as material and normals, as far as
// that is known without shading it. From the looks of two faces, and from the corners that they share, breaks.wgsl
// and thin.wgsl find out whether there is a colour break between them, a place where the colour differs clearly.
// Twin of src/render/backend/cpu/mixed/find/look.rs.
//
// Uses: common.wgsl (has, OUTSIDE, rn3, SURFACE, TRIANGLE_MATERIALS, UVS, Vertex, VERTEX_COLORS,
// VERTEX_NORMALS), one_job.wgsl (frame), geometry/triangle.wgsl (area_of, is_negative),
// surface/barycentric.wgsl (triangles, vertices), surface/hull.wgsl (hull_color, NOTHING),
// surface/material.wgsl (attributes, MATERIAL_BLEND, MATERIAL_BY_ANGLE, MATERIAL_DEBUG_SHIFT,
// MATERIAL_DERIVATIVE_NORMALS, MATERIAL_FACE_NORMALS, material_index, MATERIAL_LIT, MATERIAL_MASK,
// MATERIAL_VERTEX_COLORS, MATERIAL_VERTEX_NORMALS, MATERIAL_WIRES, materials, mirrors_sharply,
// TEXTURE_NONE), surface/normal.wgsl (face_normal, normal_at, OWN_TRIANGLES, turned_to_viewer),
// surface/point.wgsl (corner_triangles), surface/texture.wgsl (use_of).

// Squared differences over sums up to which faces look alike, and up to which they differ slightly.
const ALIKE: f32 = 0.020833334;
const SLIGHT: f32 = 0.25;

// Added to normals, so that all values are above 0.
const NORMAL_SHIFT: f32 = 1.5;

// Factor of the normals of metals that mirror sharply.
const MIRROR_SCALE: f32 = 256.0;

// The highest bits of a key: what its other bits say.
const BY_NORMAL: u32 = 0x40000000u;
const BY_COLOR: u32 = 0x80000000u;
const UNIQUE: u32 = 0xC0000000u;

const TEXTURE_SLOTS: u32 = 5u;

// Ranges of what decides the colours of a face. Faces with different keys never look alike.
struct Look {
    low: vec3<f32>,
    high: vec3<f32>,
    key: u32,
};

// Steps of colours from one face to another.
const STEP_NONE: u32 = 0u;
const STEP_SLIGHT: u32 = 1u;
const STEP_HARD: u32 = 2u;

fn step_between(a: u32, b: u32) -> u32 {
    if a == b {
        return STEP_NONE;
    }
    let step = step_of_looks(look_of(a), look_of(b));
    if step == STEP_NONE {
        return step;
    }
    return min(step, step_of_linked(a, b));
}

// The step between two faces of which all but the normal goes on from one to the other; a hard one between others.
fn step_of_linked(a: u32, b: u32) -> u32 {
    if !are_linked(a, b) {
        return STEP_HARD;
    }
    let m = material_index(a);
    if (materials[m].flags & MATERIAL_FACE_NORMALS) == 0u {
        return STEP_NONE;
    }
    let front = is_negative(area_of_face(a));
    let n_a = normal_values(m, face_normal(a), front);
    let n_b = normal_values(m, face_normal(b), front);
    return step_of_looks(Look(n_a, n_a, 0u), Look(n_b, n_b, 0u));
}

fn step_of_looks(a: Look, b: Look) -> u32 {
    if a.key != b.key {
        return STEP_HARD;
    }
    let low = min(a.low, b.low);
    let high = max(a.high, b.high);
    let sum = high + low;
    let difference = high - low;
    let squared = rn3(difference * difference);
    if all(squared <= rn3(ALIKE * sum)) {
        return STEP_NONE;
    }
    return select(STEP_HARD, STEP_SLIGHT, all(squared <= rn3(SLIGHT * sum)));
}

fn unique_look(id: u32) -> Look {
    return Look(vec3(0.0), vec3(0.0), UNIQUE | id);
}

// The look of a face, or of the outline's triangle, or of nothing.
fn look_of(id: u32) -> Look {
    if id == NOTHING {
        return unique_look(id);
    }
    if id >= frame.triangle_count {
        let color = hull_color(id).xyz;
        return Look(color, color, BY_COLOR);
    }
    if !has(SURFACE) || is_face_outside(id) {
        return unique_look(id);
    }
    let m = material_index(id);
    let flags = materials[m].flags;
    let many = MATERIAL_DERIVATIVE_NORMALS | MATERIAL_VERTEX_COLORS | MATERIAL_WIRES
        | MATERIAL_BY_ANGLE | MATERIAL_MASK | MATERIAL_BLEND;
    if (flags & many) != 0u || debug_of(flags) != 0u || is_textured(m) {
        return unique_look(id);
    }
    let key = BY_NORMAL | own_material(id);
    if (flags & MATERIAL_LIT) == 0u {
        return Look(vec3(0.0), vec3(0.0), key);
    }
    let front = is_negative(area_of_face(id));
    if (flags & MATERIAL_VERTEX_NORMALS) == 0u {
        let n = normal_values(m, face_normal(id), front);
        return Look(n, n, key);
    }
    let a = normal_values(m, normal_at(id, 0u), front);
    let b = normal_values(m, normal_at(id, 1u), front);
    let c = normal_values(m, normal_at(id, 2u), front);
    return Look(min(min(a, b), c), max(max(a, b), c), key);
}

// True if two faces' colours go on from one to the other but for their face normals: they show the same side, and
// share a corner with all that is interpolated between corners.
fn are_linked(a: u32, b: u32) -> bool {
    if !has(SURFACE) || a >= frame.triangle_count || b >= frame.triangle_count {
        return false;
    }
    let m = material_index(a);
    let flags = materials[m].flags;
    let broken = MATERIAL_DERIVATIVE_NORMALS | MATERIAL_WIRES | MATERIAL_BY_ANGLE;
    if own_material(a) != own_material(b) || (flags & broken) != 0u || debug_of(flags) != 0u {
        return false;
    }
    if is_face_outside(a) || is_face_outside(b) || is_negative(area_of_face(a)) != is_negative(area_of_face(b)) {
        return false;
    }
    var pairs = 0u;
    for (var i = 0u; i < 3u; i++) {
        for (var j = 0u; j < 3u; j++) {
            let is_same = triangles[3u * a + i] == triangles[3u * b + j];
            pairs |= select(0u, 1u, is_same) << (3u * i + j);
        }
    }
    if has(VERTEX_NORMALS) && (flags & MATERIAL_VERTEX_NORMALS) != 0u && frame.normal_triangles_at != OWN_TRIANGLES {
        pairs &= shared_corners(frame.normal_triangles_at, a, b);
    }
    if has(UVS) && is_textured(m) {
        pairs &= shared_corners(frame.uv_triangles_at, a, b);
    }
    if has(VERTEX_COLORS) && (flags & MATERIAL_VERTEX_COLORS) != 0u {
        pairs &= shared_corners(frame.color_triangles_at, a, b);
    }
    return pairs != 0u;
}

// A bit for each pair of corners of two triangles that have the same index in the list that starts there.
fn shared_corners(start: u32, a: u32, b: u32) -> u32 {
    var pairs = 0u;
    for (var i = 0u; i < 3u; i++) {
        for (var j = 0u; j < 3u; j++) {
            let is_same = corner_triangles[start + 3u * a + i] == corner_triangles[start + 3u * b + j];
            pairs |= select(0u, 1u, is_same) << (3u * i + j);
        }
    }
    return pairs;
}

// The values of a normal.
fn normal_values(m: u32, n: vec3<f32>, front: bool) -> vec3<f32> {
    return select(1.0, MIRROR_SCALE, mirrors_sharply(m)) * (turned_to_viewer(n, front) + NORMAL_SHIFT);
}

fn own_material(id: u32) -> u32 {
    if has(TRIANGLE_MATERIALS) {
        return attributes[id];
    }
    return 0u;
}

fn debug_of(flags: u32) -> u32 {
    return (flags >> MATERIAL_DEBUG_SHIFT) & 7u;
}

fn is_textured(m: u32) -> bool {
    for (var slot = 0u; slot < TEXTURE_SLOTS; slot++) {
        if use_of(m, slot).texture != TEXTURE_NONE {
            return true;
        }
    }
    return false;
}

fn corner_on_screen(id: u32, corner: u32) -> Vertex {
    return vertices[frame.vertices_at + triangles[3u * id + corner]];
}

fn is_face_outside(id: u32) -> bool {
    return corner_on_screen(id, 0u).x == OUTSIDE || corner_on_screen(id, 1u).x == OUTSIDE || corner_on_screen(id, 2u).x == OUTSIDE;
}

fn area_of_face(id: u32) -> vec2<u32> {
    return area_of(corner_on_screen(id, 0u), corner_on_screen(id, 1u), corner_on_screen(id, 2u));
}
