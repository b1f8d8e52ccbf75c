// Stage shade, per pixel: the colour of each visible triangle. Twin of
// src/backend/cpu/surface/shade.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;

// Peeled layers per sample.
@group(1) @binding(27) var<storage, read> peel_state: array<PeelState>;

@compute @workgroup_size(WORKGROUP)
fn shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if sample_count() == 1 {
        let id = triangle_of_sample(first_visibility_sample(i));
        var color = group_color(single_sample_group(id), pixel, surface_show(id));
        if has(PEELING) {
            color = peel_state[i].color + rn4((1.0 - peel_state[i].color.w) * color);
        }
        colors[i] = color;
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
        var weight = f32(group.count);
        if has(PEELING) {
            weight = uncovered(first, group.same);
        }
        sum += rn4(rn(share * weight) * group_color(group, pixel, surface_show(group.id)));
    }
    colors[i] = sum;
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

fn triangle_of_sample(sample: u32) -> u32 {
    let word = samples[sample];
    return select(~word.x, NOTHING, word.y == 0u);
}

// Parts of its material that a surface triangle shows: no wires where the peeled layers show them.
fn surface_show(id: u32) -> Show {
    if has(WIRES_ONLY) && id < frame.triangle_count {
        let mask = pass_masks[id / 4u] >> (8u * (id & 3u));
        return Show(true, select(1.0, 0.0, (mask & PASS_LAYER) != 0u));
    }
    return Show(true, 1.0);
}
