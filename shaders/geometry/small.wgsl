// The drawing of a small triangle by a single thread (stage visibility). For all pixels of the triangle's bounding
// box it finds the samples that the triangle covers, and the triangle's depth at each. Used by visibility.wgsl.
//
// Uses: common.wgsl (sample_corner, sample_count, sample_step), geometry/triangle.wgsl (depth_at,
// edges_of, Setup), peeling/emit_layer.wgsl or samples/emit.wgsl (emit).

fn draw_small(s: Setup, bounds: vec4<i32>, id: u32) {
    let e = edges_of(s);
    let corner = sample_corner(bounds.xy);
    let c = (e.dx * (corner.y - s.y) - e.dy * (corner.x - s.x) + e.bias) >> vec3(4u);
    for (var y = bounds.y; y <= bounds.w; y++) {
        for (var x = bounds.x; x <= bounds.z; x++) {
            for (var n = 0; n < sample_count(); n++) {
                let at = 16 * (vec2(x, y) - bounds.xy) + sample_step(n);
                let value = c + e.dx * at.y - e.dy * at.x;
                if (value.x | value.y | value.z) >= 0 {
                    let z = depth_at(s, corner + 16 * at);
                    if z > 0.0 {
                        emit(vec2(x, y), n, z, id);
                    }
                }
            }
        }
    }
}
