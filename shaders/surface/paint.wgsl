// Stages shade and resolve in one, per pixel: the final bytes straight from the visible triangles, without the
// colours that shade.wgsl writes and resolve.wgsl reads. Not for pictures in linear light, which have no bytes.
// Used where no lines are drawn, no transparent layers are peeled, no hollows are darkened, and no pixels are
// drawn again from more points (stage mixed). No twin: the CPU has a path for flat faces instead.
//
// Uses: common.wgsl (first_visibility_sample, rn, rn4, sample_count, WORKGROUP), one_job.wgsl or
// gang.wgsl (batch, begin_job, frame), encode.wgsl (encode, rgba), over.wgsl (background_at,
// over_background), surface/group.wgsl (first_group, group_color, seen_samples,
// single_sample_group), surface/hull.wgsl (NOTHING), surface/point.wgsl (Show).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;

@compute @workgroup_size(WORKGROUP)
fn paint(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    rgba[batch.rgba_at + i] = encode(over_background(seen_color(first_visibility_sample(i), pixel), background_at(i)));
}

// Mean colour of a pixel's samples, the first of which is given.
fn seen_color(first: u32, pixel: vec2<i32>) -> vec4<f32> {
    if sample_count() == 1 {
        return group_color(single_sample_group(triangle_of_sample(first)), pixel, Show(true, 1.0, 1.0));
    }
    // A power of two.
    let share = 1.0 / f32(sample_count());
    var sum = vec4(0.0);
    // One iteration per triangle among the samples.
    var left = seen_samples(first);
    while left != 0u {
        let group = first_group(first, left);
        left &= ~group.same;
        sum += rn4(rn(share * f32(group.count)) * group_color(group, pixel, Show(true, 1.0, 1.0)));
    }
    return sum;
}

fn triangle_of_sample(sample: u32) -> u32 {
    let word = samples[sample];
    return select(~word.x, NOTHING, word.y == 0u);
}
