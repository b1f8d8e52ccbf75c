// The drawing of a triangle into the points of mixed pixels (stage mixed). Mixed pixels are drawn again, from 64
// or 256 points each, because different colours meet there. The kernel computes the triangle's depth at each point
// that it covers, and a buffer keeps the nearest triangle of each point, for mixed_color.wgsl. Used where mixed
// pixels have no lists of triangles (lists.wgsl): for pictures in linear light, and if a picture is drawn once
// more because the lists of the first attempt overflowed. Twin of src/render/backend/cpu/mixed/triangle/mod.rs.
//
// Uses: common.wgsl (pixel_corner), one_job.wgsl (batch, frame), geometry/triangle.wgsl (Edges,
// edges_of, Setup), mixed/lattice.wgsl (depth_at_point, FEW_FIRST, FEW_STEP, POINTS,
// PointTriangle), mixed/place.wgsl (FEW, number_at), mixed/point_edges.wgsl (is_beside,
// point_edges), samples/samples32.wgsl or samples/samples64.wgsl (keep_nearest).

@group(1) @binding(22) var<storage, read> mixed: array<u32>;

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

// Corner of a block, given its first pixel.
fn block_corner(pixel: vec2<i32>) -> vec2<i32> {
    return pixel_corner(pixel);
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
    let values = point_edges(s, e, corner);
    if is_beside(e, values) {
        return;
    }
    let start = vec2(corner.x - s.x.x, corner.y - s.y.x);
    let triangle = PointTriangle(values, e.dx, e.dy, start, s.depth, s.depth_range);
    let first = (slot - batch.slots_first) * POINTS;
    if (number & FEW) != 0u {
        for (var i = FEW_FIRST; i < POINTS; i += FEW_STEP) {
            draw_point(triangle, i, first, id);
        }
        return;
    }
    // Four at a time: a thread may run few iterations only (src/render/backend/gpu/schedule/tiles.rs).
    for (var i = 0u; i < POINTS; i += 4u) {
        draw_point(triangle, i, first, id);
        draw_point(triangle, i + 1u, first, id);
        draw_point(triangle, i + 2u, first, id);
        draw_point(triangle, i + 3u, first, id);
    }
}

// Offers a triangle to point i of a pixel, whose first point is in memory there.
fn draw_point(triangle: PointTriangle, i: u32, first: u32, id: u32) {
    let z = depth_at_point(triangle, i);
    if z > 0.0 {
        keep_nearest(first + i, z, id);
    }
}
