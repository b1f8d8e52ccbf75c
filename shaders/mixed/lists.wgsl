// Lists of triangles, one list per mixed pixel (stage mixed). Mixed pixels are drawn again, from 64 or 256 points
// each, because different colours meet there. A triangle is put into the list of each mixed pixel that it may
// touch. mixed_parts.wgsl then reads the lists. Their order varies from run to run, but nothing depends on it.
// Twin of src/render/backend/cpu/mixed/lists.rs.
//
// Uses: common.wgsl (pixel_corner), one_job.wgsl (batch, frame), geometry/triangle.wgsl (Edges,
// edges_of, Setup), mixed/place.wgsl (FEW, item_at, ITEM_COUNT, list_at, number_at, OVERFLOW),
// mixed/point_edges.wgsl (is_beside, point_edges).

@group(1) @binding(22) var<storage, read_write> mixed: array<atomic<u32>>;
@group(1) @binding(31) var<storage, read_write> lists: array<vec4<u32>>;

// True if there are mixed pixels, and room for their triangles so far.
fn is_any_wanted() -> bool {
    return atomicLoad(&mixed[0]) != 0u && atomicLoad(&mixed[OVERFLOW]) == 0u;
}

fn draw_small(s: Setup, bounds: vec4<i32>, id: u32) {
    let e = edges_of(s);
    for (var y = bounds.y; y <= bounds.w; y++) {
        for (var x = bounds.x; x <= bounds.z; x++) {
            append(s, e, vec2(x, y), id);
        }
    }
}

// Corner of a block, given its first pixel.
fn block_corner(pixel: vec2<i32>) -> vec2<i32> {
    return pixel_corner(pixel);
}

fn draw_pixel(s: Setup, e: Edges, values: vec3<i32>, in_block: vec2<i32>, pixel: vec2<i32>, id: u32) {
    append(s, e, pixel, id);
}

// Puts a triangle in front of a pixel's list if the pixel is mixed and the triangle may touch it.
fn append(s: Setup, e: Edges, pixel: vec2<i32>, id: u32) {
    let number = atomicLoad(&mixed[number_at(u32((pixel.y - batch.row_first) * frame.width + pixel.x))]);
    if number == 0u || atomicLoad(&mixed[OVERFLOW]) != 0u {
        return;
    }
    let corner = pixel_corner(pixel);
    let values = point_edges(s, e, corner);
    if is_beside(e, values) {
        return;
    }
    let item = atomicAdd(&mixed[ITEM_COUNT], 1u);
    if item >= batch.list_capacity {
        atomicStore(&mixed[OVERFLOW], 1u);
        return;
    }
    let start = vec2(corner.x - s.x.x, corner.y - s.y.x);
    let first = item_at(item);
    // The third changes of edge functions are what is missing to 0.
    lists[first] = bitcast<vec4<u32>>(vec4(values, start.x));
    lists[first + 1u] = bitcast<vec4<u32>>(vec4(e.dx.xy, e.dy.xy));
    lists[first + 2u] = vec4(bitcast<vec3<u32>>(s.depth), bitcast<u32>(start.y));
    let next = atomicExchange(&mixed[list_at((number & ~FEW) - 1u)], item);
    lists[first + 3u] = vec4(bitcast<vec2<u32>>(s.depth_range), id, next);
}
