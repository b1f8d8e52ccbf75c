// Arithmetic on the depths of triangles on screen, by which other files find out what lies in front of a line: the
// tolerance for rounding, the slope of a triangle's depth, and where a point lies relative to a triangle's sides.
// Corners are homogeneous: x, y and depth, each times W, and W. Twin of
// src/render/backend/cpu/geometry/steepness.rs.
//
// Uses: common.wgsl (recip, rn, rn2, rn3).

// Smallest ratio of the depth of what lies in front of a line to the line's: covers the rounding of
// f32.
const NEARER_RATIO: f32 = 1.0000019073486328;

const MIN_POSITIVE: f32 = 1.17549435e-38;

// True if a triangle reaches so far that sums of its coordinates might overflow, and f32 is coarser there than the
// snapping of corners: by exponents, 2^31.
fn is_far(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> bool {
    let exponents = max(max(exponents_of(p), exponents_of(q)), exponents_of(r));
    return any(exponents >= vec4(0x4F000000u));
}

fn exponents_of(p: vec4<f32>) -> vec4<u32> {
    return bitcast<vec4<u32>>(p) & vec4(0x7F800000u);
}

// Change of a triangle's depth per 1/256 px to the right plus that per 1/256 px down, both positive; -1 without area.
// Not for triangles that reach far.
fn steepness(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> f32 {
    let in_x = vec3(p.x, q.x, r.x);
    let in_z = vec3(p.z, q.z, r.z);
    let x = cofactors(vec3(p.y, q.y, r.y), vec3(p.w, q.w, r.w));
    let y = cofactors(vec3(p.w, q.w, r.w), in_x);
    let volume = abs(sum3(rn3(x * in_x)));
    if volume > MIN_POSITIVE {
        return rn((abs(sum3(rn3(x * in_z))) + abs(sum3(rn3(y * in_z)))) * recip(volume));
    }
    return -1.0;
}

// Per corner, a x b of the other two corners.
fn cofactors(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return rn3(a.yzx * b.zxy) - rn3(b.yzx * a.zxy);
}

fn sum3(v: vec3<f32>) -> f32 {
    return rn(v.x + v.y) + v.z;
}

// Per side of a triangle, twice the area that it spans with a point; positive inside.
fn sides_of(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, at: vec2<f32>, is_clockwise: bool) -> vec3<f32> {
    let a = rn2(p.xy - rn2(at * p.w));
    let b = rn2(q.xy - rn2(at * q.w));
    let c = rn2(r.xy - rn2(at * r.w));
    let sides = rn3(vec3(b.x, c.x, a.x) * vec3(c.y, a.y, b.y)) - rn3(vec3(b.y, c.y, a.y) * vec3(c.x, a.x, b.x));
    return select(-sides, sides, is_clockwise);
}
