// The work of one thread in one pixel of a tile (tile.wgsl draws triangles in tiles of 64 x 64 pixels): the samples
// of the pixel that the triangle covers, and its depth at each (stage visibility).
//
// Uses: common.wgsl (sample_corner, sample_count, sample_step), geometry/triangle.wgsl (depth_at,
// Edges, Setup), peeling/emit_layer.wgsl or samples/emit.wgsl (emit).

// Corner of a block, given its first pixel.
fn block_corner(pixel: vec2<i32>) -> vec2<i32> {
    return sample_corner(pixel);
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
