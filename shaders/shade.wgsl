// Stage 3, a pixel: the colour of each triangle that is seen there. Twin of src/backend/cpu/shade.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;

const NOTHING: u32 = 0xFFFFFFFFu;

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    if sample_count() == 1 {
        colors[i] = group_color(id_at(i), pixel, vec2(8, 8), 1);
        return;
    }
    let ids = vec4(id_at(4u * i), id_at(4u * i + 1u), id_at(4u * i + 2u), id_at(4u * i + 3u));
    var left = ids != vec4(NOTHING);
    var sum = vec4(0.0);
    // Once for each triangle among the samples.
    while any(left) {
        let id = select(select(select(ids.w, ids.z, left.z), ids.y, left.y), ids.x, left.x);
        let same = ids == vec4(id);
        left = left & !same;
        let counts = select(vec4(0), vec4(1), same);
        // The samples' offsets: 6 14 2 10 across, 2 6 10 14 down.
        let across = counts * vec4(6, 14, 2, 10);
        let down = counts * vec4(2, 6, 10, 14);
        let offset = vec2(across.x + across.y + across.z + across.w, down.x + down.y + down.z + down.w);
        let count = counts.x + counts.y + counts.z + counts.w;
        sum += f32(count) * 0.25 * group_color(id, pixel, offset, count);
    }
    colors[i] = sum;
}

fn id_at(sample: u32) -> u32 {
    let word = samples[sample];
    return select(~word.x, NOTHING, word.y == 0u);
}

// The colour of a triangle at the mean of `count` samples whose offsets in 1/16 px add up to `offset_sum`.
fn group_color(id: u32, pixel: vec2<i32>, offset_sum: vec2<i32>, count: i32) -> vec4<f32> {
    if id == NOTHING {
        return vec4(0.0);
    }
    if id >= frame.triangle_count || !has(SURFACE) {
        return frame.hull_color;
    }
    let share = select(select(select(0.25, 1.0 / 3.0, count == 3), 0.5, count == 2), 1.0, count == 1);
    let scale = 16.0 * share;
    return point_color(id, vec2<f32>(pixel_corner(pixel)) + rn2(vec2<f32>(offset_sum) * scale));
}
