// Stage visibility: a triangle of the plan by its number.
//
// Uses: common.wgsl (has, OUTSIDE, PEELING, Vertex), one_job.wgsl or gang.wgsl (batch, frame).

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

// Per layer: 1 if there may be another behind it.
@group(1) @binding(28) var<storage, read> peel_rounds: array<u32>;

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

// True if the previous round of depth peeling has left nothing to find.
fn is_peeling_done() -> bool {
    return has(PEELING) && batch.layer > 0u && peel_rounds[batch.layer - 1u] == 0u;
}
