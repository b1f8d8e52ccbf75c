// The planes of clipping in homogeneous coordinates, which are the near plane and four planes far outside the
// picture: the distance of a point from a plane, and the point where a line between two points crosses it. Shared
// by the clipping of triangles (clip.wgsl) and that of edges (lines/segment.wgsl).
//
// Uses: common.wgsl (recip, rn, round_to_i32, Vertex), one_job.wgsl (frame).

// Bound of clipped coordinates, a little inside the guard band so that rounding cannot leave it.
const BOUND: f32 = 1048064.0;

fn plane_distance(plane: u32, p: vec4<f32>) -> f32 {
    let reach = rn(BOUND * p.w);
    switch plane {
        case 0u: { return rn(p.w - frame.near_w); }
        case 1u: { return rn(reach - p.x); }
        case 2u: { return rn(reach + p.x); }
        case 3u: { return rn(reach - p.y); }
        default: { return rn(reach + p.y); }
    }
}

fn intersect(inside: vec4<f32>, outside: vec4<f32>, d_inside: f32, d_outside: f32) -> vec4<f32> {
    let t = rn(d_inside * recip(rn(d_inside - d_outside)));
    return vec4(
        inside.x + rn(t * rn(outside.x - inside.x)),
        inside.y + rn(t * rn(outside.y - inside.y)),
        inside.z + rn(t * rn(outside.z - inside.z)),
        inside.w + rn(t * rn(outside.w - inside.w)),
    );
}

fn snap_clipped(p: vec4<f32>) -> Vertex {
    // With a near plane below the precision of f32, rounding may move W behind it, or behind the
    // eye.
    let r = recip(max(p.w, frame.near_w));
    let x = clamp(rn(p.x * r), -BOUND, BOUND);
    let y = clamp(rn(p.y * r), -BOUND, BOUND);
    return Vertex(round_to_i32(x), round_to_i32(y), rn(p.z * r), r);
}

// True if all coordinates are numbers below 2^64: then no step of clipping overflows. Tests
// exponents, because compilers may treat comparisons with infinity and NaN as they like.
fn is_moderate(p: vec4<f32>) -> bool {
    return all((bitcast<vec4<u32>>(p) & vec4(0x7F800000u)) < vec4(0x5F800000u));
}
