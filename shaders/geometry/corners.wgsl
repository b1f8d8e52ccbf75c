// Stage visibility: a triangle of the plan by its number, and whether a batch draws it.

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

// One byte per triangle.
@group(1) @binding(24) var<storage, read> pass_masks: array<u32>;
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

// True if the batch draws triangle t of this area: pass mask and face culling.
fn passes_culling(t: u32, area: vec2<u32>) -> bool {
    if is_zero(area) {
        return false;
    }
    var faces = batch.faces;
    if has(PASS_MASKS) && batch.pass_bit != 0u {
        let mask = pass_masks[t / 4u] >> (8u * (t & 3u));
        if (mask & batch.pass_bit) == 0u {
            return false;
        }
        if (mask & (PASS_FRONT_ONLY | PASS_BACK_ONLY)) != 0u {
            faces = select(FACES_BACK, FACES_FRONT, (mask & PASS_FRONT_ONLY) != 0u);
        }
    }
    return faces == FACES_BOTH || (faces == FACES_FRONT) == is_negative(area);
}

// True if the previous round of depth peeling has left nothing to find.
fn is_peeling_done() -> bool {
    return has(PEELING) && batch.layer > 0u && peel_rounds[batch.layer - 1u] == 0u;
}
