// The test whether a triangle hides an edge that lies in the triangle's own plane (stage lines). For this, all
// faces of the edge have to lie behind the plane, as those of a wall on a floor do if seen from below. Depths
// cannot tell this, because edge and triangle have the same depth. Twin of
// src/render/backend/cpu/lines/coplanar.rs, which says more. edge.wgsl declares the buffers.
//
// Uses: common.wgsl (NAMES_ALL_FACES, OUTSIDE, recip, rn, rn3), one_job.wgsl (batch, frame),
// geometry/steepness.wgsl (MIN_POSITIVE, NEARER_RATIO, sides_of, sum3), lines/contour.wgsl
// (NO_FACE), lines/edge.wgsl (vertices), lines/hidden_lines.wgsl (corners_of_id),
// lines/segment.wgsl (position_of).

// Least distance of an edge from the triangle's sides, 1/256 px. A closer edge may be one of the triangle itself, or of
// a neighbour that has vertices of its own.
const SIDE_MARGIN: f32 = 4.0;

// Share of positions by which rounding may move them out of a triangle's plane: some units of f32's last place.
const IN_PLANE: f32 = 4.76837158203125e-7;

// True if an edge lies in the triangle's plane, and all of its faces on the side that the viewer does not see. The middle
// of the part that is inside the triangle on screen has these weights. False for lines and points without faces, and in a
// plan with edges that have more than two faces.
fn has_beneath(
    edge: vec4<u32>, id: u32, p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, is_clockwise: bool, slack: f32, middle: vec3<f32>,
) -> bool {
    if (batch.line_flags & NAMES_ALL_FACES) == 0u || edge.z == NO_FACE {
        return false;
    }
    if !is_inside_by_margin(p, q, r, middle) || !is_plane_of(edge, id) {
        return false;
    }
    for (var side = 0u; side < 2u; side++) {
        let face = edge[2u + side];
        if face != NO_FACE && !hides_face(edge, face, p, q, r, is_clockwise, slack) {
            return false;
        }
    }
    return true;
}

// True if a point on screen is farther from all sides than rounding moves them: all is times the W of two corners.
fn is_inside_by_margin(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, weights: vec3<f32>) -> bool {
    let x = vec3(p.x, q.x, r.x);
    let y = vec3(p.y, q.y, r.y);
    let w = vec3(p.w, q.w, r.w);
    let lengths = rn3(abs(rn3(x.yzx * w.zxy) - rn3(x.zxy * w.yzx))) + rn3(abs(rn3(y.yzx * w.zxy) - rn3(y.zxy * w.yzx)));
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
    let area = sum3(abs(normal));
    let longest = max(sum3(abs(q)), sum3(abs(r)));
    for (var end = 0u; end < 2u; end++) {
        let at_end = position_of(edge[end]);
        let to_end = at_end - p;
        // Rounding of positions, times the area, and how the farther away the more it tilts the plane.
        let rounding = rn(IN_PLANE * rn(sum3(abs(p)) + sum3(abs(at_end))));
        if !(abs(sum3(rn3(normal * to_end))) <= rn(rounding * rn(area + rn(sum3(abs(to_end)) * longest)))) {
            return false;
        }
    }
    return true;
}

// True if the third corner of an edge's face surely lies behind the triangle's plane.
fn hides_face(
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
    let ws = rn3(sides * vec3(p.w, q.w, r.w));
    let w = sum3(ws);
    if w <= MIN_POSITIVE {
        return false;
    }
    let share = recip(w);
    let depth = rn(sum3(rn3(sides * vec3(p.z, q.z, r.z))) * share);
    // The farther from the triangle, the more its corners' rounding moves the plane.
    let reach = rn(sum3(abs(ws)) * share);
    return depth - third.z > rn(reach * (rn(2.0 * slack) + rn(third.z * (NEARER_RATIO - 1.0))));
}
