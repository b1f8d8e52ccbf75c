// Stage visibility, per triangle: the samples that it covers, and its depth at each. Twin of
// src/backend/cpu/geometry/visibility.rs.
//
// A thread draws a small triangle itself; larger ones go to the work list for visibility_tile.wgsl.

@compute @workgroup_size(WORKGROUP)
fn visibility(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count || is_peeling_done() {
        return;
    }
    let t = batch.first + i;
    let v = screen_triangle(t);
    if is_outside(v) {
        return;
    }
    let x = vec3(v.a.x, v.b.x, v.c.x);
    let y = vec3(v.a.y, v.b.y, v.c.y);
    let bounds = pixel_bounds(x, y);
    if bounds.x > bounds.z || bounds.y > bounds.w {
        return;
    }
    let area = area_of(v.a, v.b, v.c);
    if !passes_culling(t, area) {
        return;
    }
    let size_x = max(max(x.x, x.y), x.z) - min(min(x.x, x.y), x.z);
    let size_y = max(max(y.x, y.y), y.z) - min(min(y.x, y.y), y.z);
    let setup = setup_of(v.a, v.b, v.c, area);
    if max(size_x, size_y) <= batch.alone_size {
        draw_small(setup, bounds, t);
    } else {
        append_work_item(setup, bounds.zw - bounds.xy, t);
    }
}

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
