// Stage visibility: the triangles that visibility.wgsl and clip.wgsl read, and the work list of
// large ones for visibility_tile.wgsl.

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;

struct Work {
    large: atomic<u32>,
    huge: atomic<u32>,
    // Three words of four an item; large ones from the front, huge ones from the back.
    items: array<vec4<u32>>,
};

@group(1) @binding(5) var<storage, read_write> work: Work;
// One byte per triangle.
@group(1) @binding(24) var<storage, read> pass_masks: array<u32>;
// Per layer: 1 if there may be another behind it.
@group(1) @binding(28) var<storage, read> peel_rounds: array<u32>;

// Triangles of this many pixels, in the picture, are shared out over all workgroups.
const HUGE_PX: i32 = 128;

struct Corners {
    a: Vertex,
    b: Vertex,
    c: Vertex,
};

fn screen_triangle(t: u32) -> Corners {
    return Corners(
        vertices[triangles[3u * t]],
        vertices[triangles[3u * t + 1u]],
        vertices[triangles[3u * t + 2u]],
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

fn append_work_item(s: Setup, size: vec2<i32>, id: u32) {
    var slot: u32;
    if max(size.x, size.y) < HUGE_PX {
        slot = atomicAdd(&work.large, 1u);
    } else {
        slot = batch.capacity - 1u - atomicAdd(&work.huge, 1u);
    }
    work.items[ITEM_VECTORS * slot] = vec4(bitcast<vec3<u32>>(s.x), id);
    work.items[ITEM_VECTORS * slot + 1u] = vec4(bitcast<vec3<u32>>(s.y), bitcast<u32>(s.depth_range.x));
    work.items[ITEM_VECTORS * slot + 2u] = vec4(bitcast<vec3<u32>>(s.depth), bitcast<u32>(s.depth_range.y));
}
