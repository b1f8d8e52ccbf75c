// Stage mixed: the coverage points of a pixel. Twin of src/backend/cpu/mixed/points.rs.

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

// Depth of a triangle at point i of a pixel whose edge functions are c; 0 where the triangle does not cover it. start: the
// pixel's corner, seen from the triangle's first.
fn depth_at_point(s: Setup, e: Edges, c: vec3<i32>, start: vec2<i32>, i: u32) -> f32 {
    let place = point_place(i);
    let value = c + e.dx * place.y - e.dy * place.x;
    if (value.x | value.y | value.z) < 0 {
        return 0.0;
    }
    let p = rn2(vec2<f32>(2 * (start + place) + 1) * 0.5);
    let plane = rn(s.depth.x + rn(s.depth.y * p.x)) + rn(s.depth.z * p.y);
    return max(min(max(plane, s.depth_range.x), s.depth_range.y), 0.0);
}
