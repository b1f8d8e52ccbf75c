// Screen-space ambient occlusion at half resolution (stage occlusion, which darkens hollows): the light that the
// surface around a pixel blocks. It is computed for the pixels of every second column and row: 16 places around
// the pixel are looked at, and what each of them blocks is added up. Twin of
// src/render/backend/cpu/occlusion/gather.rs.
//
// Uses: common.wgsl (dot3, pixel_corner, quick_rsqrt, rn, rn2, rn3, round_to_i32, sample_offset,
// WORKGROUP), one_job.wgsl or gang.wgsl (batch, begin_job, frame), occlusion/place.wgsl
// (is_in_picture, NOWHERE).

// Of each job of a gang: places of all pixels of the picture, then what each found.
@group(1) @binding(30) var<storage, read_write> occlusion: array<u32>;

// Sine of the angle above the surface below which nothing takes light.
const BIAS: f32 = 0.1;
// Factor of the mean that the places block.
const GAIN: f32 = 6.0;
// Places that a pixel looks at.
const TAPS_PER_PIXEL: u32 = 16u;

@compute @workgroup_size(WORKGROUP)
fn gather(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, i32(i) / frame.width);
    if ((pixel.x | pixel.y) & 1) == 1 {
        return;
    }
    let own = depth_at(pixel);
    var found = 0u;
    if own != NOWHERE {
        found = look(pixel, place_at(pixel, own));
    }
    occlusion[2u * frame.pixels_at + batch.count + i] = found;
}

// The light that the places around a pixel take, 1/255.
fn look(pixel: vec2<i32>, place: vec3<f32>) -> u32 {
    let normal = normal_of(pixel, place);
    let part = TAPS_PER_PIXEL * u32(((pixel.x >> 1u) & 1) + 2 * ((pixel.y >> 1u) & 1));
    var taken = 0.0;
    for (var t = part; t < part + TAPS_PER_PIXEL; t++) {
        // Four taps to a vector, two halves of a word each.
        let word = frame.taps[t / 4u][t & 3u];
        let to = pixel + vec2(extractBits(i32(word), 0u, 16u), extractBits(i32(word), 16u, 16u));
        let v = place_at(to, depth_at(to)) - place;
        let square = dot3(v, v);
        let sine = rn(dot3(v, normal) * quick_rsqrt(max(square, 1e-6)));
        let near = max(1.0 - rn(square * frame.occlusion_reach), 0.0);
        taken += rn(max(sine - BIAS, 0.0) * rn(near * near));
    }
    let share = min(rn(taken * (GAIN / f32(TAPS_PER_PIXEL))), 1.0);
    return u32(round_to_i32(rn(share * 255.0)));
}

// Unit normal, towards the viewer; zero where a tangent is.
fn normal_of(pixel: vec2<i32>, place: vec3<f32>) -> vec3<f32> {
    let a = tangent(pixel, place, vec2(1, 0));
    let b = tangent(pixel, place, vec2(0, 1));
    let n = rn3(a.yzx * b.zxy) - rn3(a.zxy * b.yzx);
    return rn3(n * quick_rsqrt(max(dot3(n, n), 1e-12)));
}

// A tangent along an axis: to the neighbour on that side on which depths lie on a straight line. Zero
// between two that show nothing: then nothing takes light.
fn tangent(pixel: vec2<i32>, place: vec3<f32>, axis: vec2<i32>) -> vec3<f32> {
    let before = depth_at(pixel - axis);
    let after = depth_at(pixel + axis);
    let bend_before = (depth_at(pixel - 2 * axis) - 2.0 * before) + place.z;
    let bend_after = (depth_at(pixel + 2 * axis) - 2.0 * after) + place.z;
    let is_before = abs(bend_before) < abs(bend_after);
    if select(after, before, is_before) == NOWHERE {
        return vec3(0.0);
    }
    if is_before {
        return place - place_at(pixel - axis, before);
    }
    return place_at(pixel + axis, after) - place;
}

fn depth_at(pixel: vec2<i32>) -> f32 {
    if !is_in_picture(pixel) {
        return NOWHERE;
    }
    return bitcast<f32>(occlusion[2u * frame.pixels_at + u32(pixel.y * frame.width + pixel.x)]);
}

// Where the surface of a pixel is, at a depth.
fn place_at(pixel: vec2<i32>, depth: f32) -> vec3<f32> {
    // Exact: multiples of 1/256.
    let at = vec2<f32>(pixel_corner(pixel) + sample_offset(0)) * (1.0 / 256.0);
    let wide = frame.occlusion_spread.x - rn(frame.occlusion_spread.y * depth);
    return vec3(rn2(at * wide), depth);
}
