// What the two visibility kernels share: where triangles come from and samples go.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(1) var<storage, read> hull_normals: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

// Whether any triangle of the plan may need clipping.
override CLIP: bool = false;

// Triangles of this many pixels, in the picture, are shared out over all workgroups.
const HUGE_PX: i32 = 128;

struct Corners {
    a: Vertex,
    b: Vertex,
    c: Vertex,
};

fn screen_triangle(t: u32) -> Corners {
    let base = batch.vertex_base;
    return Corners(
        vertices[base + triangles[3u * t]],
        vertices[base + triangles[3u * t + 1u]],
        vertices[base + triangles[3u * t + 2u]],
    );
}

fn is_outside(v: Corners) -> bool {
    return v.a.x == OUTSIDE || v.b.x == OUTSIDE || v.c.x == OUTSIDE;
}

fn homogeneous_corner(v: u32) -> vec4<f32> {
    var p = vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
    if batch.vertex_base != 0u && !has(HULL_PX) {
        let t = frame.hull_push;
        let n = vec3(hull_normals[3u * v], hull_normals[3u * v + 1u], hull_normals[3u * v + 2u]);
        p = vec3(p.x + rn(t * n.x), p.y + rn(t * n.y), p.z + rn(t * n.z));
    }
    return homogeneous(p);
}

fn clipped(t: u32) -> Polygon {
    return clip_triangle(
        homogeneous_corner(triangles[3u * t]),
        homogeneous_corner(triangles[3u * t + 1u]),
        homogeneous_corner(triangles[3u * t + 2u]),
    );
}

// Triangle k of the fan, k >= 1.
fn piece(p: Polygon, k: u32) -> Corners {
    var polygon = p;
    return Corners(
        snap_clipped(polygon.corners[0]),
        snap_clipped(polygon.corners[k]),
        snap_clipped(polygon.corners[k + 1u]),
    );
}

fn sample_index(x: i32, y: i32, n: i32) -> u32 {
    return u32(((y - batch.row_first) * frame.width + x) * frame.samples + n);
}
