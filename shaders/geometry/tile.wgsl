// The drawing of a triangle by a whole workgroup, in tiles of 64 x 64 pixels (stage visibility). First each thread
// tests a block of 8 x 8 pixels against the triangle's edges. Then all threads together go through the blocks that
// are not empty, one thread per pixel. Shared by visibility_tile.wgsl and visibility_few.wgsl.
//
// What a thread does in its pixel is in tile_samples.wgsl or, for mixed pixels (which are drawn again from many
// points), in mixed/lists.wgsl or mixed/points.wgsl. No twin: on the CPU, threads do not share a triangle's pixels
// like this.
//
// Uses: common.wgsl (mul_wide, sub_wide, WORKGROUP), geometry/tile_samples.wgsl or mixed/lists.wgsl
// or mixed/points.wgsl (block_corner, draw_pixel), geometry/triangle.wgsl (Edges, edges_of,
// pixel_bounds, Setup).

// Pixels along a side of a tile.
const TILE_PX: i32 = 64;

// Edge values at the corner of each block that is not empty, and which block it is.
var<workgroup> blocks: array<vec4<i32>, WORKGROUP>;
var<workgroup> block_count: atomic<u32>;

// Draws every step-th tile of a triangle.
fn draw_tiles(s: Setup, id: u32, thread: i32, start: i32, step: i32) {
    let e = edges_of(s);
    let bounds = pixel_bounds(s.x, s.y);
    let tiles = (bounds.zw - bounds.xy) / TILE_PX + 1;
    for (var i = start; i < tiles.x * tiles.y; i += step) {
        draw_tile(s, e, bounds, bounds.xy + TILE_PX * vec2(i % tiles.x, i / tiles.x), thread, id);
    }
}

fn draw_tile(s: Setup, e: Edges, bounds: vec4<i32>, tile: vec2<i32>, thread: i32, id: u32) {
    if thread == 0 {
        atomicStore(&block_count, 0u);
    }
    workgroupBarrier();
    let block = tile + 8 * vec2(thread & 7, thread >> 3u);
    if all(block <= bounds.zw) {
        let values = edge_values(s, e, block_corner(block));
        // No edge function is larger anywhere in the block.
        let most = values + max(e.dx, vec3(0)) * 128 + max(-e.dy, vec3(0)) * 128;
        if (most.x | most.y | most.z) >= 0 {
            blocks[atomicAdd(&block_count, 1u)] = vec4(values, thread);
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&block_count);
    for (var i = 0u; i < count; i++) {
        let found = blocks[i];
        let in_block = vec2(thread & 7, thread >> 3u);
        let pixel = tile + 8 * vec2(found.w & 7, found.w >> 3u) + in_block;
        if all(pixel <= bounds.zw) {
            draw_pixel(s, e, found.xyz, in_block, pixel, id);
        }
    }
    // The list must not be emptied while another thread reads it.
    workgroupBarrier();
}

// Edge values in sixteenths at a pixel's corner, exact for the 8 x 8 pixels from there.
fn edge_values(s: Setup, e: Edges, corner: vec2<i32>) -> vec3<i32> {
    return vec3(
        edge_value(e.dx.x, e.dy.x, e.bias.x, corner - vec2(s.x.x, s.y.x)),
        edge_value(e.dx.y, e.dy.y, e.bias.y, corner - vec2(s.x.y, s.y.y)),
        edge_value(e.dx.z, e.dy.z, e.bias.z, corner - vec2(s.x.z, s.y.z)),
    );
}

fn edge_value(dx: i32, dy: i32, bias: i32, p: vec2<i32>) -> i32 {
    var v = sub_wide(mul_wide(dx, p.y), mul_wide(dy, p.x));
    if bias != 0 {
        v = vec2(v.x - 1u, v.y - select(0u, 1u, v.x == 0u));
    }
    let high = bitcast<i32>(v.y);
    if high < -4 {
        return -0x40000000;
    }
    if high > 3 {
        return 0x40000000;
    }
    return (high << 28u) | bitcast<i32>(v.x >> 4u);
}
