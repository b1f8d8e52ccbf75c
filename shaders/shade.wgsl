// Stage 3, a pixel: the colour of each triangle that is seen there. Twin of src/backend/cpu/shade.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;

// What lies over each sample.
@group(1) @binding(27) var<storage, read> layered: array<Layered>;

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if sample_count() == 1 {
        let id = id_at(i);
        var color = group_color(lone_group(id), pixel, surface_show(id));
        if has(LAYERS) {
            color = layered[i].color + rn4((1.0 - layered[i].color.w) * color);
        }
        colors[i] = color;
        return;
    }
    let ids = vec4(id_at(4u * i), id_at(4u * i + 1u), id_at(4u * i + 2u), id_at(4u * i + 3u));
    var left = ids != vec4(NOTHING);
    var sum = vec4(0.0);
    // What of each sample is left for the surface.
    var rest = vec4(1.0);
    if has(LAYERS) {
        let a = layered[4u * i].color;
        let b = layered[4u * i + 1u].color;
        let c = layered[4u * i + 2u].color;
        let d = layered[4u * i + 3u].color;
        sum = rn4(0.25 * (((a + b) + c) + d));
        rest = 1.0 - vec4(a.w, b.w, c.w, d.w);
    }
    // Once for each triangle among the samples.
    while any(left) {
        let group = first_group(ids, left);
        left = left & !group.same;
        var weight = f32(group.count);
        if has(LAYERS) {
            let share = select(vec4(0.0), rest, group.same);
            weight = ((share.x + share.y) + share.z) + share.w;
        }
        sum += rn4(rn(0.25 * weight) * group_color(group, pixel, surface_show(group.id)));
    }
    colors[i] = sum;
}

fn id_at(sample: u32) -> u32 {
    let word = samples[batch.samples_at + sample];
    return select(~word.x, NOTHING, word.y == 0u);
}

// What of its material a surface triangle shows: where layers show wires, not these.
fn surface_show(id: u32) -> Show {
    if has(WIRES_ONLY) && id < frame.triangle_count {
        let role = roles[id / 4u] >> (8u * (id & 3u));
        return Show(true, select(1.0, 0.0, (role & ROLE_LAYER) != 0u));
    }
    return Show(true, 1.0);
}
