// Stage visibility, per triangle of the work list (triangles that are too large for one thread, and pieces that
// clipping has left). One workgroup draws a large triangle, in tiles of 64 x 64 pixels. All workgroups together
// draw a huge one, whose box in the picture is more than 128 px wide or high: its tiles are divided among them. No
// twin: on the CPU, threads do not divide a triangle's pixels like this.
//
// Uses: common.wgsl (ITEM_VECTORS, JOBS_MAX, WORKGROUP), one_job.wgsl or gang.wgsl (batch,
// begin_job, frame, job), geometry/tile.wgsl (draw_tiles), geometry/triangle.wgsl (Setup).

struct WorkList {
    // Large and huge ones of each job of a gang.
    counts: array<vec2<u32>, JOBS_MAX>,
    items: array<vec4<u32>>,
};

@group(1) @binding(5) var<storage, read> work: WorkList;

@compute @workgroup_size(WORKGROUP)
fn visibility_tile(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    begin_job(workgroup.z);
    let large_end = min(work.counts[job()].x, batch.large_end);
    for (var i = batch.large_first + workgroup.x; i < large_end; i += groups.x) {
        draw_item(i, i32(thread), 0, 1);
    }
    let huge_end = min(work.counts[job()].y, batch.huge_end);
    for (var i = batch.huge_first; i < huge_end; i++) {
        // Every workgroup takes every n-th tile; beginning elsewhere for each triangle evens out
        // the load.
        let start = (workgroup.x + i * 61u) % groups.x;
        draw_item(batch.capacity - 1u - i, i32(thread), i32(start), i32(groups.x));
    }
}

// Draws every step-th tile of an item.
fn draw_item(item: u32, thread: i32, start: i32, step: i32) {
    let first = ITEM_VECTORS * (frame.items_at + item);
    let x = work.items[first];
    let y = work.items[first + 1u];
    let depth = work.items[first + 2u];
    let s = Setup(
        bitcast<vec3<i32>>(x.xyz),
        bitcast<vec3<i32>>(y.xyz),
        bitcast<vec3<f32>>(depth.xyz),
        vec2(bitcast<f32>(y.w), bitcast<f32>(depth.w)),
    );
    draw_tiles(s, x.w, thread, start, step);
}
