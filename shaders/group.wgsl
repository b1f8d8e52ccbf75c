// The samples of a pixel that see the same triangle, and their colour. Shared by shade and layers.

@group(1) @binding(24) var<storage, read> roles: array<u32>;
// Colours, then the materials of the surface's triangles and of the hull's.
@group(1) @binding(25) var<storage, read> hull_looks: array<u32>;

const NOTHING: u32 = 0xFFFFFFFFu;

struct Group {
    id: u32,
    // Which of the pixel's samples.
    same: vec4<bool>,
    // Their number, and the sum of their offsets in 1/16 px.
    count: i32,
    offset_sum: vec2<i32>,
};

// The triangle that the first of the samples `left` sees.
fn first_group(ids: vec4<u32>, left: vec4<bool>) -> Group {
    let id = select(select(select(ids.w, ids.z, left.z), ids.y, left.y), ids.x, left.x);
    let same = ids == vec4(id);
    let counts = select(vec4(0), vec4(1), same);
    // The samples' offsets: 6 14 2 10 across, 2 6 10 14 down.
    let across = counts * vec4(6, 14, 2, 10);
    let down = counts * vec4(2, 6, 10, 14);
    let offset = vec2(across.x + across.y + across.z + across.w, down.x + down.y + down.z + down.w);
    return Group(id, same, counts.x + counts.y + counts.z + counts.w, offset);
}

// The only sample of a pixel.
fn lone_group(id: u32) -> Group {
    return Group(id, vec4(true, false, false, false), 1, vec2(8, 8));
}

// The colour of a group's triangle at the mean of its samples.
fn group_color(g: Group, pixel: vec2<i32>, show: Show) -> vec4<f32> {
    if g.id == NOTHING {
        return vec4(0.0);
    }
    if g.id >= frame.triangle_count {
        return hull_color(g.id);
    }
    if !has(SURFACE) {
        return vec4(0.0);
    }
    let share = select(select(select(0.25, 1.0 / 3.0, g.count == 3), 0.5, g.count == 2), 1.0, g.count == 1);
    let scale = 16.0 * share;
    return point_color(g.id, vec2<f32>(pixel_corner(pixel)) + rn2(vec2<f32>(g.offset_sum) * scale), show);
}

// Of an id, the hull's or not.
fn hull_material(id: u32) -> u32 {
    if has(HULL_LOOKS) {
        return hull_looks[4u * frame.hull_color_count + id];
    }
    return 0u;
}

fn hull_color(id: u32) -> vec4<f32> {
    if !has(HULL_LOOKS) {
        return frame.hull_color;
    }
    let at = 4u * min(hull_material(id), frame.hull_color_count - 1u);
    return bitcast<vec4<f32>>(vec4(hull_looks[at], hull_looks[at + 1u], hull_looks[at + 2u], hull_looks[at + 3u]));
}
