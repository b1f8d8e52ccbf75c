// The linear depth of the surface at each pixel's first sample (stage occlusion, which darkens hollows): the distance
// from the far plane towards the viewer. This kernel writes it for each pixel, by the formula of place.wgsl, from the
// value of the depth buffer. gather.wgsl and spread.wgsl read it. Twin of src/render/backend/cpu/occlusion/grid.rs.
//
// Uses: common.wgsl (first_visibility_sample, WORKGROUP), one_job.wgsl or gang.wgsl (batch,
// begin_job, frame), occlusion/place.wgsl (NOWHERE, place_of).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Of each job of a gang: places of all pixels of the picture, then what each found.
@group(1) @binding(30) var<storage, read_write> occlusion: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn grid(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let word = samples[first_visibility_sample(i)];
    var place = NOWHERE;
    if word.y != 0u && ~word.x < frame.triangle_count {
        place = place_of(bitcast<f32>(word.y));
    }
    occlusion[2u * frame.pixels_at + i + u32(batch.row_first * frame.width)] = bitcast<u32>(place);
}
