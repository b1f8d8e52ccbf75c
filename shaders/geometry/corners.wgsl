// The three corners of a triangle on screen, given the triangle's number, and the test whether one of them is
// behind the near plane or too far outside the picture. Such a triangle has to be clipped before it is drawn (stage
// visibility).
//
// Uses: common.wgsl (OUTSIDE, Vertex), one_job.wgsl or gang.wgsl (frame).

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

struct Corners {
    a: Vertex,
    b: Vertex,
    c: Vertex,
};

fn screen_triangle(t: u32) -> Corners {
    return Corners(
        vertices[frame.vertices_at + triangles[3u * t]],
        vertices[frame.vertices_at + triangles[3u * t + 1u]],
        vertices[frame.vertices_at + triangles[3u * t + 2u]],
    );
}

fn is_outside(v: Corners) -> bool {
    return v.a.x == OUTSIDE || v.b.x == OUTSIDE || v.c.x == OUTSIDE;
}
