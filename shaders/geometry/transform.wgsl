// Stage transform, per vertex: from its position in the mesh's unit box to coordinates on screen, snapped to 1/256
// px. Twin of src/render/backend/cpu/geometry/transform.rs.
//
// The same kernel empties two buffers: the visibility buffer for the first band of rows of the picture, and the
// work list (triangles that whole workgroups draw). Separate commands would be slower than these stores.
//
// Uses: common.wgsl (homogeneous, OUTSIDE, recip, rn, round_to_i32, Vertex, WORKGROUP),
// one_job.wgsl or gang.wgsl (batch, begin_job, frame, job).

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(3) var<storage, read_write> vertices: array<Vertex>;
@group(1) @binding(4) var<storage, read_write> samples: array<vec2<u32>>;
@group(1) @binding(5) var<storage, read_write> work: array<vec2<u32>>;

// Farthest a snapped coordinate may lie from the picture's centre: 4096 px.
const GUARD: f32 = 1048576.0;

@compute @workgroup_size(WORKGROUP)
fn transform(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    begin_job(gid.z);
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i == 0u {
        work[job()] = vec2(0u);
    }
    for (var s = i; s < batch.cleared; s += groups.x * groups.y * WORKGROUP) {
        samples[batch.samples_at + s] = vec2(0u);
    }
    if i >= batch.count {
        return;
    }
    vertices[frame.vertices_at + i] = snap_vertex(vec3(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]));
}

fn snap_vertex(p: vec3<f32>) -> Vertex {
    let h = homogeneous(p);
    if !(h.w >= frame.near_w) {
        return Vertex(OUTSIDE, 0, 0.0, 0.0);
    }
    let r = recip(h.w);
    let sx = rn(h.x * r);
    let sy = rn(h.y * r);
    if abs(sx) <= GUARD && abs(sy) <= GUARD {
        return Vertex(round_to_i32(sx), round_to_i32(sy), rn(h.z * r), r);
    }
    return Vertex(OUTSIDE, 0, 0.0, 0.0);
}
