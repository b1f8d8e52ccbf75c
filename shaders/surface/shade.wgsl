// Stage shade, per pixel: the colour of each visible triangle is computed once (of a metal that mirrors sharply,
// perhaps in each quarter of the pixel) and weighted by the number of samples that show it. Transparent layers in
// front are added. Twin of src/render/backend/cpu/surface/shade.rs.
//
// Uses: common.wgsl (first_visibility_sample, has, OCCLUSION, PASS_LAYER, PEELING, rn, rn4,
// sample_count, WIRES_ONLY, WORKGROUP), one_job.wgsl or gang.wgsl (batch, begin_job, frame),
// occlusion/spread.wgsl (open_share), peeling/state.wgsl (PeelState), surface/group.wgsl
// (first_group, group_color, pass_masks, seen_samples, single_sample_group), surface/hull.wgsl
// (NOTHING), surface/point.wgsl (Show).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;

// Peeled layers per sample.
@group(1) @binding(27) var<storage, read> peel_state: array<PeelState>;

@compute @workgroup_size(WORKGROUP)
fn shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if sample_count() == 1 {
        let sample = first_visibility_sample(i);
        let id = triangle_of_sample(sample);
        var color = group_color(single_sample_group(id), pixel, surface_show(id, pixel, sample, 0u));
        if has(PEELING) {
            color = peel_state[i].color + rn4((1.0 - peel_state[i].color.w) * color);
        }
        colors[frame.pixels_at + i] = color;
        return;
    }
    let first = u32(sample_count()) * i;
    let in_base = first_visibility_sample(i);
    // A power of two.
    let share = 1.0 / f32(sample_count());
    var sum = vec4(0.0);
    if has(PEELING) {
        for (var s = 0; s < sample_count(); s++) {
            sum += peel_state[first + u32(s)].color;
        }
        sum = rn4(share * sum);
    }
    // One iteration per triangle among the samples.
    var left = seen_samples(in_base);
    while left != 0u {
        let group = first_group(in_base, left);
        left &= ~group.same;
        let show = surface_show(group.id, pixel, in_base, firstTrailingBit(group.same));
        var weight = f32(group.count);
        if has(PEELING) {
            weight = uncovered(first, group.same);
        }
        sum += rn4(rn(share * weight) * group_color(group, pixel, show));
    }
    colors[frame.pixels_at + i] = sum;
}

// Share of the surface that the layers leave visible at some samples, in samples.
fn uncovered(first: u32, same: u32) -> f32 {
    var sum = 0.0;
    for (var s = 0; s < sample_count(); s++) {
        if ((same >> u32(s)) & 1u) != 0u {
            sum += 1.0 - peel_state[first + u32(s)].color.w;
        }
    }
    return sum;
}

fn depth_of_sample(sample: u32) -> f32 {
    return bitcast<f32>(samples[sample].y);
}

fn triangle_of_sample(sample: u32) -> u32 {
    let word = samples[sample];
    return select(~word.x, NOTHING, word.y == 0u);
}

// Parts of its material that a surface triangle shows: no wires where the peeled layers show them. Its
// first sample is number s of a pixel, whose first is at `in_base`.
fn surface_show(id: u32, pixel: vec2<i32>, in_base: u32, s: u32) -> Show {
    var show = Show(true, 1.0, 1.0);
    if has(OCCLUSION) && id < frame.triangle_count {
        show.open = open_share(pixel, depth_of_sample(in_base + s), depth_of_sample(in_base));
    }
    if has(WIRES_ONLY) && id < frame.triangle_count {
        let mask = pass_masks[id / 4u] >> (8u * (id & 3u));
        show.wires = select(1.0, 0.0, (mask & PASS_LAYER) != 0u);
    }
    return show;
}
