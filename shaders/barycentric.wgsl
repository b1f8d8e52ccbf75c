// Where a point lies in its triangle. Twin of src/backend/cpu/barycentric.rs.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

// Corners relative to the shaded point, by corner: homogeneous x, y, w, and the factor that each barycentric takes besides.
struct Corners {
    x: vec3<f32>,
    y: vec3<f32>,
    w: vec3<f32>,
    weight: vec3<f32>,
    snapped: bool,
    front: bool,
};

// Snapped corners where there are some; where one is behind the eye, the homogeneous ones, which stay right there.
fn corners_of(id: u32, at: vec2<f32>) -> Corners {
    let a = vertices[triangles[3u * id]];
    let b = vertices[triangles[3u * id + 1u]];
    let c = vertices[triangles[3u * id + 2u]];
    if !has(CLIPPED) || (a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE) {
        let x = vec3<f32>(vec3(a.x, b.x, c.x)) - at.x;
        let y = vec3<f32>(vec3(a.y, b.y, c.y)) - at.y;
        return Corners(x, y, vec3(1.0), vec3(a.inv_w, b.inv_w, c.inv_w), true, is_negative(area_of(a, b, c)));
    }
    let p = corner_position(triangles[3u * id]);
    let q = corner_position(triangles[3u * id + 1u]);
    let r = corner_position(triangles[3u * id + 2u]);
    let w = vec3(p.w, q.w, r.w);
    return Corners(vec3(p.x, q.x, r.x) - at.x * w, vec3(p.y, q.y, r.y) - at.y * w, w, vec3(1.0), false, false);
}

fn corner_position(v: u32) -> vec4<f32> {
    return homogeneous(vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]));
}

fn is_front(id: u32, at: vec2<f32>) -> bool {
    let corners = corners_of(id, at);
    if corners.snapped {
        return corners.front;
    }
    return barycentrics_of(corners).front;
}

// Perspective-correct barycentrics at a point, and |db/dx| + |db/dy| a pixel.
struct Barycentrics {
    value: vec3<f32>,
    fwidth: vec3<f32>,
    front: bool,
};

fn barycentrics(id: u32, at: vec2<f32>) -> Barycentrics {
    return barycentrics_of(corners_of(id, at));
}

// b_i is proportional to weight_i * (corner_j x corner_k), the area opposite the corner; linear in the point, so that its
// derivatives are exact.
fn barycentrics_of(c: Corners) -> Barycentrics {
    let u = c.weight * (c.x.yzx * c.y.zxy - c.x.zxy * c.y.yzx);
    let ux = c.weight * (c.w.zxy * c.y.yzx - c.w.yzx * c.y.zxy);
    let uy = c.weight * (c.w.yzx * c.x.zxy - c.w.zxy * c.x.yzx);
    let total = (u.x + u.y) + u.z;
    let inverse = 1.0 / total;
    let value = u * inverse;
    let dx = (ux - value * ((ux.x + ux.y) + ux.z)) * inverse;
    let dy = (uy - value * ((uy.x + uy.y) + uy.z)) * inverse;
    return Barycentrics(value, 256.0 * (abs(dx) + abs(dy)), total < 0.0);
}
