// Stage mixed, per triangle and mixed pixel: the points that the triangle covers, and its depth at each. Twin of
// src/backend/cpu/mixed/triangle.rs.

@group(1) @binding(22) var<storage, read> mixed: array<u32>;

// Largest column or row of a point.
const PLACE_MAX: i32 = 255;

// Bound of edge functions in a pixel: what lies beyond has all of it inside, or outside.
const EDGE_MAX: i32 = 0x40000000;

// True if there are mixed pixels of these numbers.
fn is_any_wanted() -> bool {
    return batch.slots_first < mixed[0];
}

fn draw_small(s: Setup, bounds: vec4<i32>, id: u32) {
    let e = edges_of(s);
    for (var y = bounds.y; y <= bounds.w; y++) {
        for (var x = bounds.x; x <= bounds.z; x++) {
            draw_points(s, e, vec2(x, y), id);
        }
    }
}

fn draw_pixel(s: Setup, e: Edges, values: vec3<i32>, in_block: vec2<i32>, pixel: vec2<i32>, id: u32) {
    draw_points(s, e, pixel, id);
}

fn draw_points(s: Setup, e: Edges, pixel: vec2<i32>, id: u32) {
    let number = mixed[number_at(u32((pixel.y - batch.row_first) * frame.width + pixel.x))];
    let slot = (number & ~FEW) - 1u;
    if number == 0u || slot < batch.slots_first || slot >= batch.slots_end {
        return;
    }
    let corner = pixel_corner(pixel);
    let start = vec2(corner.x - s.x.x, corner.y - s.y.x);
    let c = vec3(
        point_edge(e.dx.x, e.dy.x, e.bias.x, start),
        point_edge(e.dx.y, e.dy.y, e.bias.y, corner - vec2(s.x.y, s.y.y)),
        point_edge(e.dx.z, e.dy.z, e.bias.z, corner - vec2(s.x.z, s.y.z)),
    );
    let most = c + PLACE_MAX * (max(e.dx, vec3(0)) + max(-e.dy, vec3(0)));
    if (most.x | most.y | most.z) < 0 {
        return;
    }
    let first = (slot - batch.slots_first) * POINTS;
    if (number & FEW) != 0u {
        for (var i = FEW_FIRST; i < POINTS; i += FEW_STEP) {
            draw_point(s, e, c, start, i, first, id);
        }
        return;
    }
    // Four at a time: a thread may run few iterations only (src/backend/gpu/schedule/tiles.rs).
    for (var i = 0u; i < POINTS; i += 4u) {
        draw_point(s, e, c, start, i, first, id);
        draw_point(s, e, c, start, i + 1u, first, id);
        draw_point(s, e, c, start, i + 2u, first, id);
        draw_point(s, e, c, start, i + 3u, first, id);
    }
}

// Offers a triangle to point i of a pixel whose edge functions are c; start: the pixel's corner, seen from the triangle's first.
fn draw_point(s: Setup, e: Edges, c: vec3<i32>, start: vec2<i32>, i: u32, first: u32, id: u32) {
    let place = point_place(i);
    let value = c + e.dx * place.y - e.dy * place.x;
    if (value.x | value.y | value.z) < 0 {
        return;
    }
    let p = rn2(vec2<f32>(2 * (start + place) + 1) * 0.5);
    let plane = rn(s.depth.x + rn(s.depth.y * p.x)) + rn(s.depth.z * p.y);
    let z = min(max(plane, s.depth_range.x), s.depth_range.y);
    if z > 0.0 {
        keep_nearest(first + i, z, id);
    }
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
