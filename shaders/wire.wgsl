// Wires from barycentric coordinates. Twin of src/backend/cpu/wire.rs.

// 1 on the wire, 0 away from it.
fn wire_factor(id: u32, m: u32, b: Barycentrics) -> f32 {
    var mask = 7u;
    if has(EDGE_MASKS) {
        mask = attributes[frame.masks_at + id / 4u] >> (8u * (id & 3u));
    }
    // Coordinate i vanishes on the edge opposite corner i, which runs from corner i + 1 to i + 2.
    let drawn = (vec3(mask) & vec3(2u, 4u, 1u)) != vec3(0u);
    let near = materials[m].wire_thickness * b.fwidth;
    let far = (materials[m].wire_thickness + materials[m].wire_smoothing) * b.fwidth;
    let away = select(vec3(1.0), vec3(ramp(near.x, far.x, b.value.x), ramp(near.y, far.y, b.value.y), ramp(near.z, far.z, b.value.z)), drawn);
    return 1.0 - min(min(away.x, away.y), away.z);
}

fn ramp(near: f32, far: f32, v: f32) -> f32 {
    if far <= near {
        return select(1.0, 0.0, v < near);
    }
    let t = clamp((v - near) / (far - near), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
