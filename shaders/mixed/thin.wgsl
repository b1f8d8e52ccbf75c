// Stage mixed, per triangle: those that are so thin that samples miss them, as hairs and slivers. Twin of
// src/backend/cpu/mixed/find/thin.rs and thinness.rs.

@group(1) @binding(22) var<storage, read_write> mixed: array<atomic<u32>>;

// A thin triangle is this many times as long as it is high, or more.
const ASPECT: i32 = 4;
// Thin triangles are less high than this, 1/256 px.
const HEIGHT_MAX: i32 = 256;
// Pixels on each side of the longer side's line in which a thin triangle may lie, at most.
const REACH_PX: i32 = 2;
// Thin triangles are this long, 1/256 px, or more.
const LENGTH_MIN: i32 = 256;
// Longest sides count as no longer than this, 1/256 px, where they are squared.
const LENGTH_MAX: i32 = 32768;

@compute @workgroup_size(WORKGROUP)
fn thin(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let t = batch.first + i;
    let a = corner_on_screen(t, 0u);
    let b = corner_on_screen(t, 1u);
    let c = corner_on_screen(t, 2u);
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        return;
    }
    let area = area_of(a, b, c);
    if !passes_culling(t, area) || !is_thin(vec3(a.x, b.x, c.x), vec3(a.y, b.y, c.y), area) {
        return;
    }
    follow(setup_of(a, b, c, area), t);
}

fn is_thin(x: vec3<i32>, y: vec3<i32>, area: vec2<u32>) -> bool {
    var positive = area;
    if is_negative(area) {
        positive = negate_wide(area);
    }
    let length = max(max(max(x.x, x.y), x.z) - min(min(x.x, x.y), x.z), max(max(y.x, y.y), y.z) - min(min(y.x, y.y), y.z));
    let bounded = min(length, LENGTH_MAX);
    let is_low = is_negative(sub_wide(positive, mul_wide(HEIGHT_MAX, length)));
    let four = mul_wide(ASPECT, bitcast<i32>(positive.x));
    // An area of more than the square has more than 31 bits, or is less than it.
    return length >= LENGTH_MIN && is_low && positive.y == 0u && positive.x < 0x40000000u
        && !is_negative(sub_wide(mul_wide(bounded, bounded), four));
}

// Marks the pixels that a triangle touches.
fn follow(s: Setup, id: u32) {
    let half = vec2(frame.width, frame.height) * 128;
    let x = s.x + half.x;
    let y = s.y + half.y;
    let low = vec2(min(min(x.x, x.y), x.z), min(min(y.x, y.y), y.z));
    let high = vec2(max(max(x.x, x.y), x.z), max(max(y.x, y.y), y.z));
    // Columns and rows of points, each in the middle of 1/256 px.
    if any(low >= high) {
        return;
    }
    let first = max(low >> vec2(8u), vec2(0, batch.row_first));
    let last = min((high - 1) >> vec2(8u), vec2(frame.width, batch.row_end) - 1);
    let size = high - low;
    let is_upright = size.x < size.y;
    // Along the longer side, and across it.
    let along = select(x, y, is_upright);
    let across = select(y, x, is_upright);
    let ends = select(low.x, low.y, is_upright);
    let length = max(size.x, size.y);
    let near = select(select(across.z, across.y, along.y == ends), across.x, along.x == ends);
    let far = ends + length;
    let to = select(select(across.z, across.y, along.y == far), across.x, along.x == far);
    let rise = f32(to - near) / f32(length);
    let e = edges_of(s);
    let steps = select(vec2(first.x, last.x), vec2(first.y, last.y), is_upright);
    let sides = select(vec2(first.y, last.y), vec2(first.x, last.x), is_upright);
    for (var step = steps.x; step <= steps.y; step++) {
        let ahead = clamp(256 * step + 128 - ends, 0, length);
        let middle = (near + i32(f32(ahead) * rise)) >> 8u;
        let end = min(middle + REACH_PX, sides.y);
        for (var beside = max(middle - REACH_PX, sides.x); beside <= end; beside++) {
            mark(s, e, select(vec2(step, beside), vec2(beside, step), is_upright), id);
        }
    }
}

// Marks a pixel if the triangle touches it, some sample sees what may lie behind it, and colours break off.
fn mark(s: Setup, e: Edges, pixel: vec2<i32>, id: u32) {
    var may_be_seen = false;
    for (var n = 0; n < sample_count(); n++) {
        may_be_seen |= s.depth_range.y > depth_of(pixel, n);
    }
    if !may_be_seen || is_beside(e, point_edges(s, e, pixel_corner(pixel))) {
        return;
    }
    var found = 0u;
    for (var n = 0; n < sample_count(); n++) {
        if s.depth_range.y > depth_of(pixel, n) {
            found |= breaks_of(step_between(id_at(pixel, n), id), BREAKS_THIN);
        }
    }
    if found != 0u {
        atomicOr(&mixed[breaks_at(pixel)], found);
    }
}
