// The share of light that reaches a pixel (stage occlusion, which darkens hollows). It follows from a weighted
// mean of the blocked light that gather.wgsl has found, over the neighbours that show the same surface. The mean
// makes the darkness smooth, and serves the pixels for which gather.wgsl computes nothing. Twin of
// src/render/backend/cpu/occlusion/spread.rs.
//
// Uses: common.wgsl (rn, round_to_i32), one_job.wgsl or gang.wgsl (frame), occlusion/place.wgsl
// (is_in_picture, NOWHERE, place_of).

@group(1) @binding(30) var<storage, read> occlusion: array<u32>;

// The share of light that reaches a surface of depth z in a pixel whose first sample has the depth
// `own_z`.
fn open_share(pixel: vec2<i32>, z: f32, own_z: f32) -> f32 {
    var at = pixel;
    if own_z <= 0.0 || abs(z - own_z) > frame.occlusion_spread.w {
        at = nearest_neighbour(pixel, z);
        if at.x < 0 {
            return 1.0;
        }
    }
    return 1.0 - rn(rn(frame.occlusion_depth.w * (1.0 / 255.0)) * f32(mean_around(at)));
}

fn mean_around(pixel: vec2<i32>) -> i32 {
    let own = place_in(pixel);
    let found_at = 2u * frame.pixels_at + u32(frame.width * frame.height);
    var sum = 0;
    var weights = 0;
    // To the columns and rows of pixels that have looked around: -2, 0 and 2 from even ones, -3 to 3 from odd ones.
    let farthest = 2 + (pixel & vec2(1));
    for (var y = -farthest.y; y <= farthest.y; y += 2) {
        for (var x = -farthest.x; x <= farthest.x; x += 2) {
            let to = pixel + vec2(x, y);
            if is_in_picture(to) && abs(place_in(to) - own) <= frame.occlusion_spread.z {
                let weight = (4 - abs(x)) * (4 - abs(y));
                sum += weight * i32(occlusion[found_at + u32(to.y * frame.width + to.x)]);
                weights += weight;
            }
        }
    }
    // Where none of them shows the surface, nothing is taken.
    if weights == 0 {
        return 0;
    }
    // The nearest integer, halves up: what is rounded lies at least 1/256 from a half.
    // Without `rn`, a compiler may add up the two constants that follow each other here.
    return round_to_i32(rn((f32(2 * sum + weights) + 0.5) / f32(2 * weights) - 0.5));
}

// Of the eight pixels around one, that whose place is nearest to that of depth z; negative if none
// shows anything.
fn nearest_neighbour(pixel: vec2<i32>, z: f32) -> vec2<i32> {
    let place = place_of(z);
    var nearest = -2.0 * NOWHERE;
    var best = vec2(-1);
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let to = pixel + vec2(x, y);
            let depth = place_in(to);
            let difference = abs(depth - place);
            if depth > NOWHERE && difference < nearest {
                nearest = difference;
                best = to;
            }
        }
    }
    return best;
}

fn place_in(pixel: vec2<i32>) -> f32 {
    if !is_in_picture(pixel) {
        return NOWHERE;
    }
    return bitcast<f32>(occlusion[2u * frame.pixels_at + u32(pixel.y * frame.width + pixel.x)]);
}
