// Stage lines, per edge and triangle: what stands on a sheet that is seen from below. Twin of
// src/backend/cpu/lines/sheets.rs, which says why; edge.wgsl declares the buffers.

// Least distance of an edge from the sides of a sheet's triangle, 1/256 px. Closer to them it may be an edge of the
// triangle itself, or of its neighbour, whose vertices are others.
const SIDE_MARGIN: f32 = 4.0;

// An edge lies in a triangle's plane if the distances of its ends from that are at most this share of those from a
// corner: the rounding of coordinates.
const IN_PLANE: f32 = 3.814697265625e-6;

// True if an edge lies in the plane of a triangle that is wholly on screen, and all of its faces on the side that the
// viewer does not see. The middle of the part that is inside the triangle on screen has these weights.
fn has_beneath(
    edge: vec4<u32>, id: u32, p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, is_clockwise: bool, slack: f32, middle: vec3<f32>,
) -> bool {
    if !all(vec3(p.w, q.w, r.w) == vec3(1.0)) || !is_inside_by_margin(p, q, r, middle) || !is_plane_of(edge, id) {
        return false;
    }
    for (var side = 0u; side < 2u; side++) {
        let face = edge[2u + side];
        if face != NO_FACE && !is_before(edge, face, p, q, r, is_clockwise, slack) {
            return false;
        }
    }
    return true;
}

// True if a point on screen is farther from all sides than rounding moves them.
fn is_inside_by_margin(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, weights: vec3<f32>) -> bool {
    let x = vec3(p.x, q.x, r.x);
    let y = vec3(p.y, q.y, r.y);
    let lengths = rn3(abs(x.yzx - x.zxy)) + rn3(abs(y.yzx - y.zxy));
    return all(weights > rn3(SIDE_MARGIN * lengths));
}

// True if an edge lies in the triangle's plane, by the positions themselves: on screen, planes are known less exactly.
// No hull's triangle has such an edge.
fn is_plane_of(edge: vec4<u32>, id: u32) -> bool {
    if id >= frame.triangle_count {
        return false;
    }
    let v = corners_of_id(id);
    let p = position_of(v.x);
    let q = position_of(v.y) - p;
    let r = position_of(v.z) - p;
    let normal = rn3(q.yzx * r.zxy) - rn3(q.zxy * r.yzx);
    let most = rn(IN_PLANE * sum3(abs(normal)));
    for (var end = 0u; end < 2u; end++) {
        let to_end = position_of(edge[end]) - p;
        if !(abs(sum3(rn3(normal * to_end))) <= rn(most * sum3(abs(to_end)))) {
            return false;
        }
    }
    return true;
}

fn position_of(v: u32) -> vec3<f32> {
    return vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
}

// True if the third corner of an edge's face surely lies behind the triangle's plane.
fn is_before(
    edge: vec4<u32>, face: u32, p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, is_clockwise: bool, slack: f32,
) -> bool {
    let v = corners_of_id(face);
    let is_third = (v != vec3(edge.x)) & (v != vec3(edge.y));
    if !any(is_third) {
        return false;
    }
    let third = vertices[select(select(v.z, v.y, is_third.y), v.x, is_third.x)];
    if third.x == OUTSIDE {
        return false;
    }
    let sides = sides_of(p, q, r, vec2(f32(third.x), f32(third.y)), is_clockwise);
    let weights = rn3(sides * recip(sum3(sides)));
    let depth = sum3(rn3(weights * vec3(p.z, q.z, r.z)));
    // The farther from the triangle, the more its corners' rounding moves the plane.
    let reach = sum3(abs(weights));
    return depth - third.z > rn(reach * (rn(2.0 * slack) + rn(third.z * (NEARER_RATIO - 1.0))));
}
