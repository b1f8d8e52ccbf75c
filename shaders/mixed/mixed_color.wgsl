// The colours of mixed pixels (stage mixed). Mixed pixels are drawn again, from 64 or 256 points each, because
// different colours meet there. The buffer `points` holds, for each point, the triangle that is visible at it. The
// colours of these triangles are added up, each weighted by its share of the points. Twin of
// src/render/backend/cpu/mixed/color.rs.
//
// Used where mixed pixels have no lists of triangles (lists.wgsl): for pictures in linear light, and if a picture
// is drawn once more because the lists of the first attempt overflowed. Otherwise mixed_parts.wgsl,
// mixed_shade.wgsl and mixed_sum.wgsl do this work.
//
// Uses: common.wgsl (has, LINES, WORKGROUP), one_job.wgsl (batch), mixed/lattice.wgsl (FEW_STEP,
// POINTS), mixed/place.wgsl (border_at, BORDER_WORDS, FEW, pixel_at), mixed/share_color.wgsl
// (share_color), mixed/shares.wgsl (border_word, depth_of_share, find_firsts, firsts, FIRSTS_WORDS,
// is_first, own_points, seen, share_of).

@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;
// Of each pixel, the triangles that its points see, in words like those of samples.
@group(1) @binding(23) var<storage, read_write> points: array<vec2<u32>>;

// Pixels of the round; and what each triangle adds to the colour, at the first of its points.
var<workgroup> pixel_count: u32;
var<workgroup> parts: array<vec4<f32>, POINTS>;

@compute @workgroup_size(WORKGROUP)
fn mixed_color(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    if thread == 0u {
        pixel_count = min(batch.count, max(mixed[0], batch.slots_first) - batch.slots_first);
    }
    let count = workgroupUniformLoad(&pixel_count);
    for (var i = workgroup.x; i < count; i += groups.x) {
        color_pixel(i, thread);
        // Another pixel must not be read before all threads are done with this one.
        workgroupBarrier();
    }
}

// Colours the pixel whose points are the i-th.
fn color_pixel(i: u32, thread: u32) {
    let number = batch.slots_first + i;
    let entry = mixed[pixel_at(number)];
    let at = entry & ~FEW;
    let is_few = (entry & FEW) != 0u;
    for (var p = thread; p < POINTS; p += WORKGROUP) {
        seen[p] = points[i * POINTS + p];
        // For the next pixel that has the place.
        points[i * POINTS + p] = vec2(0u);
    }
    find_firsts(thread, is_few);
    let own = own_points(thread, is_few);
    for (var p = own.x; p < POINTS; p += own.y) {
        if is_first(p) {
            let depth = depth_of_share(p, select(1u, FEW_STEP, is_few));
            parts[p] = share_color(~seen[p].x, at, share_of(p, is_few), depth);
        }
    }
    workgroupBarrier();
    if thread == 0u {
        // In the order of points, as the CPU adds them.
        var sum = vec4(0.0);
        for (var w = 0u; w < FIRSTS_WORDS; w++) {
            for (var left = atomicLoad(&firsts[w]); left != 0u; left &= left - 1u) {
                sum += parts[32u * w + firstTrailingBit(left)];
            }
        }
        colors[at] = sum;
    }
    if has(LINES) && thread < BORDER_WORDS {
        mixed[border_at(number) + thread] = select(border_word(thread), 0u, is_few);
    }
}
