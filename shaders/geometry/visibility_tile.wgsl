// Stage visibility, per large triangle: a workgroup draws tile by tile of 64 x 64 pixels. No twin:
// the CPU has one loop for all sizes. First each thread tests a block of 8 x 8 pixels against the
// edges, then all threads together fill the blocks that are left, one thread per pixel.

// Pixels along a side of a tile.
const TILE_PX: i32 = 64;

struct WorkList {
    large: u32,
    huge: u32,
    items: array<vec4<u32>>,
};

@group(1) @binding(5) var<storage, read> work: WorkList;

// Edge values at the corner of each block that is not empty, and which block it is.
var<workgroup> blocks: array<vec4<i32>, WORKGROUP>;
var<workgroup> block_count: atomic<u32>;

@compute @workgroup_size(WORKGROUP)
fn visibility_tile(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let large_end = min(work.large, batch.large_end);
    for (var i = batch.large_first + workgroup.x; i < large_end; i += groups.x) {
        draw_item(i, i32(thread), 0, 1);
    }
    let huge_end = min(work.huge, batch.huge_end);
    for (var i = batch.huge_first; i < huge_end; i++) {
        // Every workgroup takes every n-th tile; beginning elsewhere for each triangle evens out
        // the load.
        let start = (workgroup.x + i * 61u) % groups.x;
        draw_item(batch.capacity - 1u - i, i32(thread), i32(start), i32(groups.x));
    }
}

// Draws every step-th tile of an item.
fn draw_item(item: u32, thread: i32, start: i32, step: i32) {
    let x = work.items[ITEM_VECTORS * item];
    let y = work.items[ITEM_VECTORS * item + 1u];
    let depth = work.items[ITEM_VECTORS * item + 2u];
    let s = Setup(
        bitcast<vec3<i32>>(x.xyz),
        bitcast<vec3<i32>>(y.xyz),
        bitcast<vec3<f32>>(depth.xyz),
        vec2(bitcast<f32>(y.w), bitcast<f32>(depth.w)),
    );
    let e = edges_of(s);
    let bounds = pixel_bounds(s.x, s.y);
    let tiles = (bounds.zw - bounds.xy) / TILE_PX + 1;
    for (var i = start; i < tiles.x * tiles.y; i += step) {
        draw_tile(s, e, bounds, bounds.xy + TILE_PX * vec2(i % tiles.x, i / tiles.x), thread, x.w);
    }
}

fn draw_tile(s: Setup, e: Edges, bounds: vec4<i32>, tile: vec2<i32>, thread: i32, id: u32) {
    if thread == 0 {
        atomicStore(&block_count, 0u);
    }
    workgroupBarrier();
    let block = tile + 8 * vec2(thread & 7, thread >> 3u);
    if all(block <= bounds.zw) {
        let values = edge_values(s, e, sample_corner(block));
        // The largest each edge function can be in the block.
        let most = values + max(e.dx, vec3(0)) * 127 + max(-e.dy, vec3(0)) * 127;
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

fn draw_pixel(s: Setup, e: Edges, values: vec3<i32>, in_block: vec2<i32>, pixel: vec2<i32>, id: u32) {
    let corner = sample_corner(pixel);
    for (var n = 0; n < sample_count(); n++) {
        let offset = sample_step(n);
        let at = 16 * in_block + offset;
        let value = values + e.dx * at.y - e.dy * at.x;
        if (value.x | value.y | value.z) >= 0 {
            let z = depth_at(s, corner + 16 * offset);
            if z > 0.0 {
                emit(pixel, n, z, id);
            }
        }
    }
}

// Edge values in sixteenths at a pixel's sample corner, exact for the 8 x 8 pixels from there.
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
