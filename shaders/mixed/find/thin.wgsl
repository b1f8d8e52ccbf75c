// The search for thin triangles, such as hairs and slivers, which samples may miss (stage mixed). They are less
// than a pixel high, and at least a pixel and four times their height long. A pixel that such a triangle touches
// is marked if no sample of it shows the triangle and the triangle's colour differs clearly from that of what lies
// behind it. mixed_pixels.wgsl chooses marked pixels to be drawn again from more points. Twin of
// src/render/backend/cpu/mixed/find/thin.rs and src/render/backend/cpu/mixed/thinness.rs.
//
// Uses: common.wgsl (has, mul_wide, negate_wide, OUTSIDE, pixel_corner, SIXTEEN_SAMPLES, sub_wide,
// WORKGROUP), one_job.wgsl (batch, frame), geometry/culling.wgsl (passes_culling),
// geometry/triangle.wgsl (area_of, Edges, edges_of, is_negative, Setup, setup_of),
// mixed/find/look.wgsl (corner_on_screen, step_between), mixed/find/seen_faces.wgsl (breaks_of,
// BREAKS_THIN, depth_of, id_at), mixed/place.wgsl (breaks_at), mixed/point_edges.wgsl (is_beside,
// point_edges).

@group(1) @binding(22) var<storage, read_write> mixed: array<atomic<u32>>;

// A thin triangle is this many times as long as it is high, or more.
const ASPECT: i32 = 4;
// Thin triangles are less high than this, 1/256 px.
const HEIGHT_MAX: i32 = 256;
// By so much a line's place may be rounded, 1/256 px. Which pixels a triangle touches is decided by integers.
const SLACK: i32 = 4;
// Thin triangles are this long, 1/256 px, or more.
const LENGTH_MIN: i32 = 256;
// Triangles of this length, 1/256 px, that are less than HEIGHT_MAX high are ASPECT times as long in any case.
const LENGTH_MAX: i32 = 32768;

// Steps along the workgroup's thin triangles, up to each. A step is a column or row of pixels: threads take one after
// the other, because a few triangles may have most of them.
var<workgroup> ends: array<u32, WORKGROUP>;
var<workgroup> step_count: u32;

@compute @workgroup_size(WORKGROUP)
fn thin(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    // Several workgroups share the steps of the same triangles where there are few triangles.
    let group = workgroup.x + workgroup.y * groups.x;
    let first = group / batch.groups_each * WORKGROUP;
    var steps = 0u;
    if first + thread < batch.count {
        steps = steps_along(batch.first + first + thread);
    }
    ends[thread] = steps;
    workgroupBarrier();
    if thread == 0u {
        step_count = 0u;
        for (var n = 0u; n < WORKGROUP; n++) {
            step_count += ends[n];
            ends[n] = step_count;
        }
    }
    let count = workgroupUniformLoad(&step_count);
    var n = 0u;
    let stride = batch.groups_each * WORKGROUP;
    for (var step = group % batch.groups_each * WORKGROUP + thread; step < count; step += stride) {
        // Steps of a thread go up, and so do the triangles that they are of.
        while step >= ends[n] {
            n++;
        }
        var before = 0u;
        if n > 0u {
            before = ends[n - 1u];
        }
        let t = batch.first + first + n;
        let a = corner_on_screen(t, 0u);
        let b = corner_on_screen(t, 1u);
        let c = corner_on_screen(t, 2u);
        take_step(setup_of(a, b, c, area_of(a, b, c)), t, i32(step - before));
    }
}

// The number of steps along a triangle; 0 if it is not thin.
fn steps_along(t: u32) -> u32 {
    let a = corner_on_screen(t, 0u);
    let b = corner_on_screen(t, 1u);
    let c = corner_on_screen(t, 2u);
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        return 0u;
    }
    let area = area_of(a, b, c);
    if !passes_culling(t, area) || !is_thin(vec3(a.x, b.x, c.x), vec3(a.y, b.y, c.y), area) {
        return 0u;
    }
    let way = way_along(setup_of(a, b, c, area));
    return select(u32(max(way.last[way.axis] - way.first[way.axis] + 1, 0)), 0u, way.is_empty);
}

fn is_thin(x: vec3<i32>, y: vec3<i32>, area: vec2<u32>) -> bool {
    var positive = area;
    if is_negative(area) {
        positive = negate_wide(area);
    }
    let length = max(max(max(x.x, x.y), x.z) - min(min(x.x, x.y), x.z), max(max(y.x, y.y), y.z) - min(min(y.x, y.y), y.z));
    if length < LENGTH_MIN || !is_negative(sub_wide(positive, mul_wide(HEIGHT_MAX, length))) {
        return false;
    }
    // The area has less than 30 bits from here on.
    return length >= LENGTH_MAX || ASPECT * bitcast<i32>(positive.x) <= length * length;
}

// The pixels of the band that a triangle's box touches, and the axis along its longer side: 0 for columns, 1 for rows.
struct Way {
    first: vec2<i32>,
    last: vec2<i32>,
    low: vec2<i32>,
    high: vec2<i32>,
    axis: u32,
    is_empty: bool,
};

fn way_along(s: Setup) -> Way {
    let half = vec2(frame.width, frame.height) * 128;
    let x = s.x + half.x;
    let y = s.y + half.y;
    let low = vec2(min(min(x.x, x.y), x.z), min(min(y.x, y.y), y.z));
    let high = vec2(max(max(x.x, x.y), x.z), max(max(y.x, y.y), y.z));
    let first = max(low >> vec2(8u), vec2(0, batch.row_first));
    let last = min((high - 1) >> vec2(8u), vec2(frame.width, batch.row_end) - 1);
    let axis = select(0u, 1u, high.x - low.x < high.y - low.y);
    // Points lie in the middle of 1/256 px, so there is none where low is high.
    return Way(first, last, low, high, axis, any(low >= high));
}

// Marks the pixels that a triangle touches in the step-th column or row.
fn take_step(s: Setup, id: u32, step: i32) {
    let half = vec2(frame.width, frame.height) * 128;
    let x = s.x + half.x;
    let y = s.y + half.y;
    let way = way_along(s);
    let is_upright = way.axis == 1u;
    // Along the longer side, and across it: its ends, and on which side of it the third corner lies.
    let along = select(x, y, is_upright);
    let across = select(y, x, is_upright);
    let ends_along = vec2(way.low[way.axis], way.high[way.axis]);
    let start = corner_at(along, ends_along.x);
    let end = corner_at(along, ends_along.y);
    let third = 3u - start - end;
    let origin = vec2(ends_along.x, across[start]);
    let slope = f32(across[end] - origin.y) / f32(ends_along.y - ends_along.x);
    let aside = across[third] - line_at(origin, slope, along[third]);
    let slack = i32(128.0 * abs(slope)) + SLACK;
    let e = edges_of(s);
    let sides = vec2(way.first[1u - way.axis], way.last[1u - way.axis]);
    let place = way.first[way.axis] + step;
    let middle = line_at(origin, slope, clamp(256 * place + 128, ends_along.x, ends_along.y));
    let beside_last = min((middle + max(aside, 0) + slack) >> 8u, sides.y);
    for (var beside = max((middle + min(aside, 0) - slack) >> 8u, sides.x); beside <= beside_last; beside++) {
        mark(s, e, select(vec2(place, beside), vec2(beside, place), is_upright), id);
    }
}

// Number of the first corner at this place.
fn corner_at(places: vec3<i32>, place: i32) -> u32 {
    return select(select(2u, 1u, places.y == place), 0u, places.x == place);
}

// Where a line through a point is, that much further along.
fn line_at(origin: vec2<i32>, slope: f32, along: i32) -> i32 {
    return origin.y + i32(f32(along - origin.x) * slope);
}

// Marks a pixel if the triangle touches it, some sample sees what may lie behind it, none sees the triangle, and
// colours break off.
fn mark(s: Setup, e: Edges, pixel: vec2<i32>, id: u32) {
    // Adaptive plans have four samples, or 16 where they have layers. They are written out, because a thread may run few
    // iterations only (src/render/backend/gpu/schedule/tiles.rs).
    let first = four_from(s, pixel, 0);
    var any_behind = any(first.are_behind);
    var is_seen = any(first.ids == vec4(id));
    if has(SIXTEEN_SAMPLES) {
        let second = four_from(s, pixel, 4);
        let third = four_from(s, pixel, 8);
        let last = four_from(s, pixel, 12);
        any_behind |= any(second.are_behind) || any(third.are_behind) || any(last.are_behind);
        is_seen |= any(second.ids == vec4(id)) || any(third.ids == vec4(id)) || any(last.ids == vec4(id));
    }
    if !any_behind || is_seen || is_beside(e, point_edges(s, e, pixel_corner(pixel))) {
        return;
    }
    var found = 0u;
    if has(SIXTEEN_SAMPLES) {
        // Few pixels come so far. Compilers copy what is called, which takes long.
        for (var n = 0; n < 16; n += 4) {
            found |= breaks_to_four(id, four_from(s, pixel, n));
        }
    } else {
        found = breaks_to_four(id, first);
    }
    if found != 0u {
        atomicOr(&mixed[breaks_at(pixel)], found);
    }
}

// Four samples of a pixel: the triangles that they see, and whether these may lie behind another one.
struct Four {
    ids: vec4<u32>,
    are_behind: vec4<bool>,
};

// Those from the n-th on.
fn four_from(s: Setup, pixel: vec2<i32>, n: i32) -> Four {
    let ids = vec4(id_at(pixel, n), id_at(pixel, n + 1), id_at(pixel, n + 2), id_at(pixel, n + 3));
    let depths = vec4(depth_of(pixel, n), depth_of(pixel, n + 1), depth_of(pixel, n + 2), depth_of(pixel, n + 3));
    return Four(ids, depths < vec4(s.depth_range.y));
}

// The bits of the steps from what four samples see.
fn breaks_to_four(id: u32, four: Four) -> u32 {
    let ids = four.ids;
    let are_behind = four.are_behind;
    // Most samples see what one before them sees.
    var found = breaks_to(id, ids.x, are_behind.x);
    found |= breaks_to(id, ids.y, are_behind.y && !(are_behind.x && ids.y == ids.x));
    found |= breaks_to(id, ids.z, are_behind.z && !any(are_behind.xy & (ids.xy == ids.zz)));
    return found | breaks_to(id, ids.w, are_behind.w && !any(are_behind.xyz & (ids.xyz == ids.www)));
}

// The bits of the step from what a sample sees, if it lies behind.
fn breaks_to(id: u32, seen: u32, is_behind: bool) -> u32 {
    if !is_behind {
        return 0u;
    }
    return breaks_of(step_between(seen, id), BREAKS_THIN);
}
