// Stage mixed, per mixed pixel: its colour by what its points see. Twin of src/backend/cpu/mixed/color.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;
// What the points see, in words like those of samples.
@group(1) @binding(23) var<storage, read> points: array<vec2<u32>>;

// Points whose colour is in the sum, a bit each.
var<private> done: array<u32, 8>;

@compute @workgroup_size(WORKGROUP)
fn mixed_color(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    let number = batch.slots_first + i;
    if i >= batch.count || number >= mixed[0] {
        return;
    }
    let entry = mixed[pixel_at(number)];
    let at = entry & ~FEW;
    let pixel = vec2(i32(at) % frame.width, batch.row_first + i32(at) / frame.width);
    let own_z = bitcast<f32>(samples[first_visibility_sample(at)].y);
    let is_few = (entry & FEW) != 0u;
    let step = select(1u, FEW_STEP, is_few);
    let base = i * POINTS;
    for (var w = 0u; w < 8u; w++) {
        done[w] = 0u;
    }
    var sum = vec4(0.0);
    for (var p = select(0u, FEW_FIRST, is_few); p < POINTS; p += step) {
        let word = points[base + p];
        if word.y == 0u || ((done[p / 32u] >> (p % 32u)) & 1u) != 0u {
            continue;
        }
        var count = 0;
        var places = vec2(0);
        for (var q = p; q < POINTS; q += step) {
            let other = points[base + q];
            if other.y != 0u && other.x == word.x {
                done[q / 32u] |= 1u << (q % 32u);
                count++;
                places += 2 * point_place(q) + 1;
            }
        }
        let weight = f32(count) / f32(POINTS / step);
        let mean = rn2(vec2<f32>(places) * recip(f32(2 * count)));
        sum += rn4(weight * share_color(~word.x, pixel, mean, vec2(bitcast<f32>(word.y), own_z)));
    }
    colors[at] = sum;
    if has(LINES) {
        write_border(number, !is_few);
    }
}

// Writes the points that see something, for lines over the pixel; none if they are all, or if the pixel has few.
fn write_border(number: u32, has_all: bool) {
    var unseen = 0u;
    for (var w = 0u; w < 8u; w++) {
        unseen |= ~done[w];
    }
    let is_border = has_all && unseen != 0u;
    for (var w = 0u; w < BORDER_WORDS; w++) {
        var word = 0u;
        if is_border {
            for (var bit = 0u; bit < 32u; bit++) {
                let p = 16u * (bit % 16u) + 2u * w + bit / 16u;
                word |= ((done[p / 32u] >> (p % 32u)) & 1u) << bit;
            }
        }
        mixed[border_at(number) + w] = word;
    }
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
