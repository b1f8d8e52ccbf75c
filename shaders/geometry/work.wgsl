// The work list (stage visibility): triangles that are too large to be drawn by one thread, and the pieces that
// clipping has left of triangles. visibility.wgsl and clip.wgsl append to it with the function here, and
// visibility_tile.wgsl draws its items.
//
// Uses: common.wgsl (ITEM_VECTORS, JOBS_MAX), one_job.wgsl or gang.wgsl (batch, frame, job),
// geometry/triangle.wgsl (Setup).

struct Counts {
    large: atomic<u32>,
    huge: atomic<u32>,
};

struct Work {
    // Of each job of a gang.
    counts: array<Counts, JOBS_MAX>,
    // Three vectors of four words per item; a job's large ones from the front, huge ones from the back.
    items: array<vec4<u32>>,
};

@group(1) @binding(5) var<storage, read_write> work: Work;

// Triangles more than this many pixels wide or high, in the picture, are shared out over all workgroups.
const HUGE_PX: i32 = 128;

fn append_work_item(s: Setup, size: vec2<i32>, id: u32) {
    var slot: u32;
    if max(size.x, size.y) < HUGE_PX {
        slot = atomicAdd(&work.counts[job()].large, 1u);
    } else {
        slot = batch.capacity - 1u - atomicAdd(&work.counts[job()].huge, 1u);
    }
    let first = ITEM_VECTORS * (frame.items_at + slot);
    work.items[first] = vec4(bitcast<vec3<u32>>(s.x), id);
    work.items[first + 1u] = vec4(bitcast<vec3<u32>>(s.y), bitcast<u32>(s.depth_range.x));
    work.items[first + 2u] = vec4(bitcast<vec3<u32>>(s.depth), bitcast<u32>(s.depth_range.y));
}
