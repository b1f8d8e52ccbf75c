// The set-up of a triangle on screen: its area, the plane of its depth, its edge functions, and the pixels that it
// spans. Made for stage visibility; later stages use it too.
//
// Uses: common.wgsl (mul_wide, negate_wide, recip, rn, sub_wide, Vertex, wide_to_f32), one_job.wgsl
// or gang.wgsl (batch, frame).

struct Setup {
    // Snapped corners, in an order that makes the area positive.
    x: vec3<i32>,
    y: vec3<i32>,
    // Depth at corner 0 and its change per 1/256 px.
    depth: vec3<f32>,
    depth_range: vec2<f32>,
};

// Twice the signed area; negative is counter-clockwise on screen, the front.
fn area_of(a: Vertex, b: Vertex, c: Vertex) -> vec2<u32> {
    return sub_wide(mul_wide(b.x - a.x, c.y - a.y), mul_wide(c.x - a.x, b.y - a.y));
}

fn is_negative(v: vec2<u32>) -> bool {
    return v.y >= 0x80000000u;
}

fn is_zero(v: vec2<u32>) -> bool {
    return (v.x | v.y) == 0u;
}

// The setup of a triangle whose area is not 0.
fn setup_of(a: Vertex, b_in: Vertex, c_in: Vertex, area: vec2<u32>) -> Setup {
    var b = b_in;
    var c = c_in;
    var positive = area;
    if is_negative(area) {
        b = c_in;
        c = b_in;
        positive = negate_wide(area);
    }
    let dx1 = f32(b.x - a.x);
    let dy1 = f32(b.y - a.y);
    let dx2 = f32(c.x - a.x);
    let dy2 = f32(c.y - a.y);
    let dz1 = rn(b.z - a.z);
    let dz2 = rn(c.z - a.z);
    let inverse = recip(wide_to_f32(positive));
    let gx = rn(rn(rn(dz1 * dy2) - rn(dz2 * dy1)) * inverse);
    let gy = rn(rn(rn(dz2 * dx1) - rn(dz1 * dx2)) * inverse);
    return Setup(
        vec3(a.x, b.x, c.x),
        vec3(a.y, b.y, c.y),
        vec3(a.z, gx, gy),
        vec2(min(min(a.z, b.z), c.z), max(max(a.z, b.z), c.z)),
    );
}

// Depth at a point, clamped to what the corners span.
fn depth_at(s: Setup, p: vec2<i32>) -> f32 {
    let z = rn(s.depth.x + rn(s.depth.y * f32(p.x - s.x.x))) + rn(s.depth.z * f32(p.y - s.y.x));
    return min(max(z, s.depth_range.x), s.depth_range.y);
}

// First and last pixel (x, y, x, y) that three corners span inside the batch's columns and rows;
// empty if first > last.
fn pixel_bounds(x: vec3<i32>, y: vec3<i32>) -> vec4<i32> {
    let half = vec2(frame.width, frame.height) * 128;
    let low = vec2(min(min(x.x, x.y), x.z), min(min(y.x, y.y), y.z));
    let high = vec2(max(max(x.x, x.y), x.z), max(max(y.x, y.y), y.z));
    let first = max((low + half) >> vec2(8u), vec2(batch.column_first, batch.row_first));
    let last = min((high + half) >> vec2(8u), vec2(batch.column_end, batch.row_end) - 1);
    return vec4(first, last);
}

// Change of the three edge functions to the right (negated) and down.
struct Edges {
    dx: vec3<i32>,
    dy: vec3<i32>,
    // The top-left rule: 0 for top and left edges, where a sample on the edge is inside; -1 for
    // the others.
    bias: vec3<i32>,
};

fn edges_of(s: Setup) -> Edges {
    let dx = s.x.yzx - s.x;
    let dy = s.y.yzx - s.y;
    let owns = (dy < vec3(0)) | ((dy == vec3(0)) & (dx > vec3(0)));
    return Edges(dx, dy, select(vec3(-1), vec3(0), owns));
}
