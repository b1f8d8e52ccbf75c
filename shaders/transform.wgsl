// Stage 1, a vertex: unit box to snapped screen coordinates. Twin of src/backend/cpu/transform.rs.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(1) var<storage, read> hull_normals: array<f32>;
// How far each moves, where they differ: as frame.hull_push.
@group(1) @binding(29) var<storage, read> hull_amounts: array<f32>;
@group(1) @binding(3) var<storage, read_write> vertices: array<Vertex>;

// Farthest a snapped coordinate may lie from the picture's centre: 4096 px.
const GUARD: f32 = 1048576.0;

@compute @workgroup_size(64)
fn transform(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * 64u;
    if i >= batch.count {
        return;
    }
    var p = vec3(positions[3u * i], positions[3u * i + 1u], positions[3u * i + 2u]);
    if batch.vertex_base == 0u {
        vertices[i] = snap_vertex(p, vec3(0.0), 0.0);
        return;
    }
    let n = vec3(hull_normals[3u * i], hull_normals[3u * i + 1u], hull_normals[3u * i + 2u]);
    var amount = frame.hull_push;
    if has(HULL_AMOUNTS) {
        amount = hull_amounts[i];
    }
    var push = 0.0;
    if has(HULL_PX) {
        push = amount;
    } else {
        p = hull_position(p, n, amount);
    }
    vertices[batch.vertex_base + i] = snap_vertex(p, n, push);
}

fn hull_position(p: vec3<f32>, n: vec3<f32>, t: f32) -> vec3<f32> {
    return vec3(p.x + rn(t * n.x), p.y + rn(t * n.y), p.z + rn(t * n.z));
}

fn snap_vertex(p: vec3<f32>, normal: vec3<f32>, push: f32) -> Vertex {
    let h = homogeneous(p);
    if !(h.w >= frame.near_w) {
        return Vertex(OUTSIDE, 0, 0.0, 0.0);
    }
    let r = recip(h.w);
    var sx = rn(h.x * r);
    var sy = rn(h.y * r);
    if push != 0.0 {
        // The direction in which the projected point moves along the normal: d(X/W) = (dX - (X/W) dW) / W.
        let dw = rn(row_dot3(frame.w_row, normal));
        let dx = rn(row_dot3(frame.x_row, normal) - rn(sx * dw));
        let dy = rn(row_dot3(frame.y_row, normal) - rn(sy * dw));
        let length_squared = rn(dx * dx) + rn(dy * dy);
        if length_squared >= 1e-20 {
            let q = rsqrt(length_squared);
            sx = sx + rn(push * rn(dx * q));
            sy = sy + rn(push * rn(dy * q));
        }
    }
    if abs(sx) <= GUARD && abs(sy) <= GUARD {
        return Vertex(round_to_i32(sx), round_to_i32(sy), rn(h.z * r), r);
    }
    return Vertex(OUTSIDE, 0, 0.0, 0.0);
}
