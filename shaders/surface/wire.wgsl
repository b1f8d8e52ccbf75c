// Wires along the edges of triangles (stage shade): how much a wire covers of a point, found from the point's
// barycentric coordinates. Twin of src/render/backend/cpu/surface/wire.rs.
//
// Uses: common.wgsl (EDGE_MASKS, has, rn, WIRE_MINIMUM), one_job.wgsl or gang.wgsl (frame),
// surface/barycentric.wgsl (Barycentrics, quad_around), surface/material.wgsl (attributes,
// MATERIAL_WIRE_BARYCENTRIC, MATERIAL_WIRE_FWIDTH, MATERIAL_WIRE_FWIDTH_MIN, materials).

// 1 on the wire, 0 away from it.
fn wire_cover(id: u32, at: vec2<f32>, m: u32, b: Barycentrics) -> f32 {
    let drawn = drawn_edges(id);
    let flags = materials[m].flags;
    let thickness = materials[m].wire_thickness;
    let end = thickness + materials[m].wire_smoothing;
    if !has(WIRE_MINIMUM) || (flags & MATERIAL_WIRE_FWIDTH) != 0u {
        let d = abs(b.dx) + abs(b.dy);
        let near = thickness * d;
        let far = end * d;
        let ramps = vec3(ramp(near.x, far.x, b.value.x), ramp(near.y, far.y, b.value.y), ramp(near.z, far.z, b.value.z));
        let away = select(vec3(1.0), ramps, drawn);
        return 1.0 - min(min(away.x, away.y), away.z);
    }
    let nearest = min_drawn(drawn, b.value);
    if (flags & MATERIAL_WIRE_FWIDTH_MIN) != 0u {
        // As a GPU's derivatives of the minimum would be: across a corner's bisector they mix two
        // coordinates.
        let quad = quad_around(id, at);
        let own = min_drawn(drawn, quad.own);
        let d = abs(min_drawn(drawn, quad.across) - own) + abs(min_drawn(drawn, quad.down) - own);
        return 1.0 - ramp(rn(thickness * d), rn(end * d), nearest);
    }
    if (flags & MATERIAL_WIRE_BARYCENTRIC) != 0u {
        return 1.0 - ramp(0.0, 0.1 * thickness, nearest);
    }
    return select(0.0, 1.0, nearest < 0.02 * thickness);
}

// Coordinate i vanishes on the edge opposite corner i, which runs from corner i + 1 to i + 2.
fn drawn_edges(id: u32) -> vec3<bool> {
    var mask = 7u;
    if has(EDGE_MASKS) {
        mask = attributes[frame.masks_at + id / 4u] >> (8u * (id & 3u));
    }
    return (vec3(mask) & vec3(2u, 4u, 1u)) != vec3(0u);
}

// The smallest coordinate of a drawn edge; far away where none is drawn.
fn min_drawn(drawn: vec3<bool>, value: vec3<f32>) -> f32 {
    let v = select(vec3(1e30), value, drawn);
    return min(min(v.x, v.y), v.z);
}

fn ramp(near: f32, far: f32, v: f32) -> f32 {
    if far <= near {
        return select(1.0, 0.0, v < near);
    }
    let t = clamp((v - near) / (far - near), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
