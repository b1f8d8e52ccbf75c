// Stage mixed, per mixed pixel: its colour by what its points see. Twin of src/backend/cpu/mixed/color.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;
// What the points see, in words like those of samples.
@group(1) @binding(23) var<storage, read_write> points: array<vec2<u32>>;

// Pixels of the round. Of the one that the workgroup colours: what each point sees, as in `points`; which points are the
// first ones of their triangles, a bit each; and what each triangle adds to the colour, at the first of its points.
var<workgroup> pixel_count: u32;
var<workgroup> seen: array<vec2<u32>, POINTS>;
var<workgroup> firsts: array<atomic<u32>, FIRSTS_WORDS>;
var<workgroup> parts: array<vec4<f32>, POINTS>;

const FIRSTS_WORDS: u32 = POINTS / 32u;

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
    let pixel = vec2(i32(at) % frame.width, batch.row_first + i32(at) / frame.width);
    let own_z = bitcast<f32>(samples[first_visibility_sample(at)].y);
    let is_few = (entry & FEW) != 0u;
    for (var p = thread; p < POINTS; p += WORKGROUP) {
        seen[p] = points[i * POINTS + p];
        // For the next pixel that has the place.
        points[i * POINTS + p] = vec2(0u);
    }
    if thread < FIRSTS_WORDS {
        atomicStore(&firsts[thread], 0u);
    }
    workgroupBarrier();
    let step = select(1u, FEW_STEP, is_few);
    for (var p = select(thread, FEW_FIRST + FEW_STEP * thread, is_few); p < POINTS; p += step * WORKGROUP) {
        if seen[p].y != 0u && is_first(p, step) {
            atomicOr(&firsts[p / 32u], 1u << (p % 32u));
            parts[p] = part_of(p, step, pixel, own_z);
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

// True if no point before p sees its triangle.
fn is_first(p: u32, step: u32) -> bool {
    for (var q = p % step; q < p; q += step) {
        if seen[q].x == seen[p].x && seen[q].y != 0u {
            return false;
        }
    }
    return true;
}

// What a triangle adds to the colour, given the first of its points.
fn part_of(p: u32, step: u32, pixel: vec2<i32>, own_z: f32) -> vec4<f32> {
    var count = 0;
    var places = vec2(0);
    for (var q = p; q < POINTS; q += step) {
        if seen[q].x == seen[p].x && seen[q].y != 0u {
            count++;
            places += 2 * point_place(q) + 1;
        }
    }
    let weight = f32(count) / f32(POINTS / step);
    let mean = rn2(vec2<f32>(places) * recip(f32(2 * count)));
    return rn4(weight * share_color(~seen[p].x, pixel, mean, vec2(bitcast<f32>(seen[p].y), own_z)));
}

// A word of the points that see something, for lines over the pixel; none if all do.
fn border_word(w: u32) -> u32 {
    var is_border = false;
    for (var p = 0u; p < POINTS; p++) {
        is_border |= seen[p].y == 0u;
    }
    var word = 0u;
    for (var bit = 0u; is_border && bit < 32u; bit++) {
        word |= select(0u, 1u, seen[16u * (bit % 16u) + 2u * w + bit / 16u].y != 0u) << bit;
    }
    return word;
}

// The colour of a triangle at a point of a pixel, given its depth and that of the pixel's first sample.
fn share_color(id: u32, pixel: vec2<i32>, mean: vec2<f32>, depth: vec2<f32>) -> vec4<f32> {
    if id >= frame.triangle_count {
        return hull_color(id);
    }
    if !has(SURFACE) {
        return vec4(0.0);
    }
    var show = Show(true, 1.0, 1.0);
    if has(OCCLUSION) {
        show.open = open_share(pixel, depth.x, depth.y);
    }
    return point_color(id, vec2<f32>(pixel_corner(pixel)) + mean, show);
}
