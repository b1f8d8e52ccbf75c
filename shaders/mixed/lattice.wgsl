// The 256 points from which a mixed pixel is drawn again because different colours meet there (stage mixed). They
// form a rank-1 lattice, which is computed rather than stored. Where the colours differ little, every fourth point
// is enough. Also the depth of a triangle at a point that it covers. Twin of
// src/render/backend/cpu/mixed/points.rs.
//
// Uses: common.wgsl (rn, rn2).

const POINTS: u32 = 256u;
const GENERATOR: u32 = 181u;

// Of so many points, one is among few. The second of four is the first.
const FEW_STEP: u32 = 4u;
const FEW_FIRST: u32 = 1u;

// Some points of a pixel: their share of all, and their mean place, 1/256 px from the pixel's corner.
struct Share {
    weight: f32,
    mean: vec2<f32>,
};

// Column and row of point i in its pixel, 1/256 px, without the half.
fn point_place(i: u32) -> vec2<i32> {
    return vec2<i32>(vec2(i, (i * GENERATOR) % POINTS));
}

// A triangle, seen from a pixel.
struct PointTriangle {
    // Values of its edge functions at the pixel's first point, halved, and their changes down and, negated, to the
    // right.
    values: vec3<i32>,
    dx: vec3<i32>,
    dy: vec3<i32>,
    // The pixel's corner, seen from the triangle's first.
    start: vec2<i32>,
    depth: vec3<f32>,
    depth_range: vec2<f32>,
};

// Its depth at point i; 0 where it does not cover the point.
fn depth_at_point(t: PointTriangle, i: u32) -> f32 {
    let place = point_place(i);
    let value = t.values + t.dx * place.y - t.dy * place.x;
    if (value.x | value.y | value.z) < 0 {
        return 0.0;
    }
    let p = rn2(vec2<f32>(2 * (t.start + place) + 1) * 0.5);
    let plane = rn(t.depth.x + rn(t.depth.y * p.x)) + rn(t.depth.z * p.y);
    return max(min(max(plane, t.depth_range.x), t.depth_range.y), 0.0);
}
