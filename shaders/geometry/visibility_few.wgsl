// Stage visibility for a dispatch of few triangles, none of which has to be clipped: each triangle has one or more
// workgroups of its own, which draw it in tiles of 64 x 64 pixels, whatever its size. If one thread drew each
// small triangle, as in visibility.wgsl, so few triangles would leave most of a GPU idle. No work list of large
// triangles is needed. No twin: on the CPU, threads do not share a triangle's pixels like this.
//
// Uses: common.wgsl (WORKGROUP), one_job.wgsl or gang.wgsl (batch, begin_job),
// geometry/corners.wgsl (is_outside, screen_triangle), geometry/culling.wgsl (passes_culling),
// geometry/tile.wgsl (draw_tiles), geometry/triangle.wgsl (area_of, pixel_bounds, setup_of).

@compute @workgroup_size(WORKGROUP)
fn visibility_few(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    begin_job(workgroup.z);
    // All threads of a workgroup take the same way up to draw_tiles, because they compute the same.
    let g = workgroup.x + workgroup.y * groups.x;
    let i = g / batch.groups_each;
    if i >= batch.count {
        return;
    }
    let t = batch.first + i;
    let v = screen_triangle(t);
    if is_outside(v) {
        return;
    }
    let bounds = pixel_bounds(vec3(v.a.x, v.b.x, v.c.x), vec3(v.a.y, v.b.y, v.c.y));
    if bounds.x > bounds.z || bounds.y > bounds.w {
        return;
    }
    let area = area_of(v.a, v.b, v.c);
    if passes_culling(t, area) {
        draw_tiles(setup_of(v.a, v.b, v.c, area), t, i32(thread), i32(g % batch.groups_each), i32(batch.groups_each));
    }
}
