// The edge functions of a triangle in a mixed pixel, which is drawn again from 64 or 256 points because different
// colours meet there (stage mixed): their values at the pixel's first point, and the test whether all points lie
// outside of one edge, so that the triangle need not be looked at in this pixel.
//
// Uses: common.wgsl (mul_wide, sub_wide), geometry/triangle.wgsl (Edges, Setup).

// Largest column or row of a point.
const PLACE_MAX: i32 = 255;

// Bound of edge functions in a pixel: what lies beyond has all of it inside, or outside.
const EDGE_MAX: i32 = 0x40000000;

// Values of the edge functions at the first point of the pixel with this corner, halved.
fn point_edges(s: Setup, e: Edges, corner: vec2<i32>) -> vec3<i32> {
    return vec3(
        point_edge(e.dx.x, e.dy.x, e.bias.x, corner - vec2(s.x.x, s.y.x)),
        point_edge(e.dx.y, e.dy.y, e.bias.y, corner - vec2(s.x.y, s.y.y)),
        point_edge(e.dx.z, e.dy.z, e.bias.z, corner - vec2(s.x.z, s.y.z)),
    );
}

// True if all points of a pixel lie outside of one edge.
fn is_beside(e: Edges, c: vec3<i32>) -> bool {
    let most = c + PLACE_MAX * (max(e.dx, vec3(0)) + max(-e.dy, vec3(0)));
    return (most.x | most.y | most.z) < 0;
}

// Value of an edge function at a pixel's first point, halved. p: the pixel's corner, seen from the edge's first.
fn point_edge(dx: i32, dy: i32, bias: i32, p: vec2<i32>) -> i32 {
    let half = (dx - dy + bias) >> 1u;
    let v = sub_wide(sub_wide(mul_wide(dx, p.y), mul_wide(dy, p.x)), vec2(bitcast<u32>(-half), bitcast<u32>(-half >> 31u)));
    let high = bitcast<i32>(v.y);
    if high < -1 || (high == -1 && v.x < 0xC0000000u) {
        return -EDGE_MAX;
    }
    if high > 0 || (high == 0 && v.x > 0x40000000u) {
        return EDGE_MAX;
    }
    return bitcast<i32>(v.x);
}
