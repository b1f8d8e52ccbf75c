// Stage visibility, per triangle: finds the samples that the triangle covers and its depth at each. The visibility
// buffer keeps the nearest triangle for each sample. Twin of src/render/backend/cpu/geometry/visibility.rs.
//
// A thread draws a small triangle itself; larger ones go to the work list for visibility_tile.wgsl. Triangles that
// have to be clipped are left to clip.wgsl. Built with other files, the kernel draws triangles into a layer of
// depth peeling (peeling/emit_layer.wgsl) or offers them to mixed pixels, which are drawn again from many points
// (mixed/lists.wgsl, mixed/points.wgsl).
//
// Uses: common.wgsl (WORKGROUP), one_job.wgsl or gang.wgsl (batch, begin_job),
// geometry/corners.wgsl (is_outside, screen_triangle), geometry/culling.wgsl (passes_culling),
// geometry/small.wgsl or mixed/lists.wgsl or mixed/points.wgsl (draw_small), geometry/triangle.wgsl
// (area_of, pixel_bounds, setup_of), geometry/work.wgsl (append_work_item), mixed/lists.wgsl or
// mixed/points.wgsl or peeling/emit_layer.wgsl or samples/emit.wgsl (is_any_wanted).

@compute @workgroup_size(WORKGROUP)
fn visibility(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count || !is_any_wanted() {
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
