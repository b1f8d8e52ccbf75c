// Hidden-line removal (stage lines): the intervals along a part of an edge in which no triangle hides the edge.
// Twin of src/render/backend/cpu/lines/hidden_lines.rs; edge.wgsl declares the buffers.
//
// All threads of a workgroup together find the triangles along the edge and the interval that each of them hides.
// The CPU sorts these intervals. Here they stay unsorted. The search for visible parts goes from one end of the
// edge to the other, and looks through all intervals again for each part.
//
// Uses: common.wgsl (CLIPPED, has, OUTSIDE, recip, rn, rn3, sample_count, Vertex), one_job.wgsl
// (batch, frame), geometry/planes.wgsl (is_moderate), geometry/steepness.wgsl (is_far,
// MIN_POSITIVE, NEARER_RATIO, sides_of, steepness), geometry/triangle.wgsl (area_of, is_negative,
// is_zero), lines/contour.wgsl (volume_of), lines/coplanar.wgsl (has_beneath), lines/edge.wgsl
// (DRAW_RUNS, FIND_ALONG, LINE_THREADS, triangles, vertices), lines/seen.wgsl (has_samples,
// NOTHING, seen_at), lines/segment.wgsl (depth_of, homogeneous_of, point_at, Segment, walk_pixel,
// walk_steps).

// Largest position error on screen, 1/256 px: half a unit each for the snapping of a triangle and
// of an edge, and some for f32.
const SNAP_ERROR: f32 = 1.25;

// Shortest visible interval, pixels. Shorter ones come from rounding, and their round ends would
// show as dots. A face without a sample may hide longer ones: see `shows_interval`.
const INTERVAL_MIN_PX: f32 = 0.0625;

// Shortest visible interval between two hidden ones, pixels.
const GAP_MIN_PX: f32 = 0.25;

// More than any place on an edge.
const BEYOND: f32 = 2.0;

// Places for triangles that were looked at, and for the intervals that they hide.
const IDS_MAX: u32 = 512u;
const INTERVALS_MAX: u32 = 512u;

// A table of the triangles that were looked at.
var<workgroup> seen_ids: array<atomic<u32>, IDS_MAX>;

// Intervals that a triangle hides. If they are more than there is room for, they are found anew whenever
// they are needed.
var<workgroup> hidden: array<vec2<f32>, INTERVALS_MAX>;
var<workgroup> hidden_count: atomic<u32>;

// Bits of what the samples along the edge are.
var<workgroup> looks: atomic<u32>;
const NEARER: u32 = 1u;
const OTHER: u32 = 2u;

// What `joined_run` returns, as bits.
var<workgroup> run_bits: array<atomic<u32>, 2>;

// Copies that all threads read.
var<workgroup> word_now: u32;
var<workgroup> run_now: vec2<u32>;

// Finds out whether every triangle visible along a range of the edge is nearer than all of it. Forgets
// what was found for others.
fn is_all_hidden(s: Segment, range: vec2<f32>, thread: u32) -> bool {
    for (var i = thread; i < IDS_MAX; i += LINE_THREADS) {
        atomicStore(&seen_ids[i], NOTHING);
    }
    if thread == 0u {
        atomicStore(&hidden_count, 0u);
        atomicStore(&looks, 0u);
    }
    workgroupBarrier();
    look_along(s, range, thread);
    workgroupBarrier();
    if thread == 0u {
        word_now = atomicLoad(&looks);
    }
    return workgroupUniformLoad(&word_now) == NEARER;
}

// Finds out whether the samples along the edge are nearer than all of it.
fn look_along(s: Segment, range: vec2<f32>, thread: u32) {
    let nearest = rn(max(depth_of(s, 0.0), depth_of(s, 1.0)) * NEARER_RATIO);
    let count = u32(sample_count());
    let items = (walk_steps(s, range) + 1u) * count;
    var found = 0u;
    for (var i = thread; i < items && (found & OTHER) == 0u; i += LINE_THREADS) {
        let pixel = walk_pixel(s, range, i / count);
        if has_samples(pixel) {
            found |= select(OTHER, NEARER, is_nearer(seen_at(pixel, i % count), nearest));
        }
    }
    atomicOr(&looks, found);
}

// True if a sample, and all of its triangle, is nearer than a depth.
fn is_nearer(seen: vec2<u32>, depth: f32) -> bool {
    if seen.x == NOTHING || bitcast<f32>(seen.y) <= depth {
        return false;
    }
    let corners = corners_of_id(seen.x);
    let a = vertices[corners.x];
    let b = vertices[corners.y];
    let c = vertices[corners.z];
    return a.x != OUTSIDE && b.x != OUTSIDE && c.x != OUTSIDE && min(min(a.z, b.z), c.z) > depth;
}

// Looks at the triangles that are visible along the edge, or at a pixel's distance (FIND_AROUND and
// DRAW_RUNS). Adds the intervals that they hide, or (DRAW_RUNS) joins them to a run from `begin`.
fn look_around(edge: vec4<u32>, s: Segment, range: vec2<f32>, step: u32, begin: f32, thread: u32) -> vec2<f32> {
    let radius = select(1u, 0u, step == FIND_ALONG);
    let beyond = f32(radius) * s.inverse_length;
    let walked = vec2(range.x - beyond, range.y + beyond);
    let items = items_along(s, walked, radius);
    var run = vec2(begin, BEYOND);
    for (var i = thread; i < items; i += LINE_THREADS) {
        let id = id_along(s, walked, radius, i);
        // Most samples show the edge's own faces, which do not hide it.
        if id == NOTHING || id == edge.z || id == edge.w || (step != DRAW_RUNS && !is_new(id)) {
            continue;
        }
        let all = hidden_by(edge, s, id);
        let interval = vec2(max(all.x, range.x), min(all.y, range.y));
        if !(interval.x < interval.y) {
            continue;
        }
        if step == DRAW_RUNS {
            run = joined(run, begin, interval);
        } else {
            let at = atomicAdd(&hidden_count, 1u);
            if at < INTERVALS_MAX {
                hidden[at] = interval;
            }
        }
    }
    return run;
}

// Number of the intervals that all threads have found.
fn count_found(thread: u32) -> u32 {
    workgroupBarrier();
    if thread == 0u {
        word_now = atomicLoad(&hidden_count);
    }
    return workgroupUniformLoad(&word_now);
}

// True if there are more intervals than there is room for.
fn has_too_many() -> bool {
    return atomicLoad(&hidden_count) > INTERVALS_MAX;
}

// Samples along a part of the edge: of a pixel in each step and, with a radius, of those beside it across
// the edge.
fn items_along(s: Segment, walked: vec2<f32>, radius: u32) -> u32 {
    return (walk_steps(s, walked) + 1u) * (2u * radius + 1u) * u32(sample_count());
}

// The triangle in one of those samples.
fn id_along(s: Segment, walked: vec2<f32>, radius: u32, i: u32) -> u32 {
    let count = u32(sample_count());
    let words = (2u * radius + 1u) * count;
    let across = select(vec2(1, 0), vec2(0, 1), abs(s.along.x) >= abs(s.along.y));
    let n = i % words;
    let pixel = walk_pixel(s, walked, i / words) + (i32(n / count) - i32(radius)) * across;
    return seen_at(pixel, n % count).x;
}

// True if no thread has looked at a triangle yet. Also where there is no room to remember it: to look at
// one twice is only slower.
fn is_new(id: u32) -> bool {
    // The upper 9 bits of a product by the golden ratio: a place of 512.
    var at = (id * 2654435761u) >> 23u;
    for (var tries = 0u; tries < 16u; tries++) {
        let before = atomicCompareExchangeWeak(&seen_ids[at], NOTHING, id);
        if before.exchanged || before.old_value == id {
            return before.exchanged;
        }
        // It may fail without a reason.
        if before.old_value != NOTHING {
            at = (at + 1u) % IDS_MAX;
        }
    }
    return true;
}

// To be called by one thread before the others call `joined_run`.
fn begin_runs() {
    atomicStore(&run_bits[0], 0u);
    atomicStore(&run_bits[1], bitcast<u32>(BEYOND));
}

// Where the hidden interval ends that `begin` lies in, if there is one, and where the next begins; given
// what this thread has found beside the list.
fn joined_run(found: vec2<f32>, begin: f32, thread: u32) -> vec2<f32> {
    var own = found;
    let count = atomicLoad(&hidden_count);
    if count <= INTERVALS_MAX {
        for (var i = thread; i < count; i += LINE_THREADS) {
            own = joined(own, begin, hidden[i]);
        }
    }
    // Numbers that are not negative are in the order of their bits.
    atomicMax(&run_bits[0], bitcast<u32>(own.x));
    atomicMin(&run_bits[1], bitcast<u32>(own.y));
    workgroupBarrier();
    if thread == 0u {
        run_now = vec2(atomicExchange(&run_bits[0], 0u), atomicExchange(&run_bits[1], bitcast<u32>(BEYOND)));
    }
    return bitcast<vec2<f32>>(workgroupUniformLoad(&run_now));
}

// True if an interval beside a hidden one is visible. One below the smallest length is not, and neither is one so
// short that a face there may have no sample, if the samples around it show what is nearer.
fn shows_interval(edge: vec4<u32>, s: Segment, interval: vec2<f32>, is_gap: bool) -> bool {
    let length = interval.y - interval.x;
    if !(length > rn(s.inverse_length * select(INTERVAL_MIN_PX, GAP_MIN_PX, is_gap))) {
        return false;
    }
    return length > rn(s.inverse_length * batch.unseen_part) || !is_behind_samples(edge, s, interval);
}

// True if no sample of the pixel in the middle of an interval shows one of the edge's own faces, and all but at most
// `farther_samples` show faces nearer than it.
fn is_behind_samples(edge: vec4<u32>, s: Segment, interval: vec2<f32>) -> bool {
    let pixel = vec2<i32>(floor(point_at(s, rn((interval.x + interval.y) * 0.5))));
    if !has_samples(pixel) {
        return false;
    }
    let nearest = rn(max(depth_of(s, interval.x), depth_of(s, interval.y)) * NEARER_RATIO);
    var nearer = 0u;
    for (var i = 0u; i < u32(sample_count()); i++) {
        let seen = seen_at(pixel, i);
        nearer += u32(bitcast<f32>(seen.y) > nearest);
        if seen.x != NOTHING && (seen.x == edge.z || seen.x == edge.w) {
            return false;
        }
    }
    return nearer + batch.farther_samples >= u32(sample_count());
}

// A run from `begin` with one more hidden interval.
fn joined(run: vec2<f32>, begin: f32, interval: vec2<f32>) -> vec2<f32> {
    if interval.x <= begin {
        return vec2(max(run.x, interval.y), run.y);
    }
    return vec2(run.x, min(run.y, interval.x));
}

// Vertex indices of a triangle.
fn corners_of_id(id: u32) -> vec3<u32> {
    return vec3(triangles[3u * id], triangles[3u * id + 1u], triangles[3u * id + 2u]);
}

// Interval of the edge that a triangle hides; empty (x >= y) if none.
fn hidden_by(edge: vec4<u32>, s: Segment, id: u32) -> vec2<f32> {
    let none = vec2(1.0, 0.0);
    let v = corners_of_id(id);
    if any(v == vec3(edge.x)) && any(v == vec3(edge.y)) {
        return none;
    }
    let a = vertices[v.x];
    let b = vertices[v.y];
    let c = vertices[v.z];
    // X, Y, Z, W of each corner.
    var p = vec4(f32(a.x), f32(a.y), a.z, 1.0);
    var q = vec4(f32(b.x), f32(b.y), b.z, 1.0);
    var r = vec4(f32(c.x), f32(c.y), c.z, 1.0);
    var is_clockwise: bool;
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
        if id >= frame.triangle_count || !has(CLIPPED) {
            return none;
        }
        p = homogeneous_of(v.x);
        q = homogeneous_of(v.y);
        r = homogeneous_of(v.z);
        if !is_moderate(p) || !is_moderate(q) || !is_moderate(r) {
            return none;
        }
        is_clockwise = volume_of(p, q, r) > 0.0;
    } else {
        let area = area_of(a, b, c);
        if is_zero(area) || !may_be_hidden_by(s, a, b, c) {
            return none;
        }
        is_clockwise = !is_negative(area);
    }
    let at_start = sides_of(p, q, r, s.ends.xy, is_clockwise);
    let at_end = sides_of(p, q, r, s.ends.zw, is_clockwise);
    // An edge along a side counts as inside. Otherwise two triangles that share the side would
    // leave it visible between them.
    let is_along = (at_start == vec3(0.0)) & (at_end == vec3(0.0));
    if any((at_start <= vec3(0.0)) & (at_end <= vec3(0.0)) & !is_along) {
        return none;
    }
    var interval = vec2(0.0, 1.0);
    interval = narrowed(interval, at_start.x, at_end.x);
    interval = narrowed(interval, at_start.y, at_end.y);
    interval = narrowed(interval, at_start.z, at_end.z);
    if interval.x >= interval.y {
        return none;
    }
    let slack = slack_of(p, q, r);
    if slack < 0.0 {
        return none;
    }
    // Depths are compared only where the edge is inside, so that thin triangles need not be
    // continued far.
    let depths = vec3(p.z, q.z, r.z);
    let ws = vec3(p.w, q.w, r.w);
    var first = nearer_by(s, weights_at(at_start, at_end, interval.x), depths, ws, NEARER_RATIO, slack, interval.x);
    var last = nearer_by(s, weights_at(at_start, at_end, interval.y), depths, ws, NEARER_RATIO, slack, interval.y);
    if min(first, last) <= 0.0 {
        let ratio = 2.0 - NEARER_RATIO;
        let perhaps_first = nearer_by(s, weights_at(at_start, at_end, interval.x), depths, ws, ratio, -slack, interval.x);
        let perhaps_last = nearer_by(s, weights_at(at_start, at_end, interval.y), depths, ws, ratio, -slack, interval.y);
        if max(perhaps_first, perhaps_last) <= 0.0 {
            return none;
        }
        let middle = weights_at(at_start, at_end, rn(0.5 * (interval.x + interval.y)));
        if has_beneath(edge, id, p, q, r, is_clockwise, slack, middle) {
            first = perhaps_first;
            last = perhaps_last;
        } else if first <= 0.0 && last <= 0.0 {
            return none;
        }
    }
    let share = narrowed(vec2(0.0, 1.0), first, last);
    if share.x >= share.y {
        return none;
    }
    let length = interval.y - interval.x;
    return vec2(interval.x + rn(share.x * length), interval.x + rn(share.y * length));
}

// False if the triangle is farther away than all of the edge, or beside its box.
fn may_be_hidden_by(s: Segment, a: Vertex, b: Vertex, c: Vertex) -> bool {
    let low = vec2<f32>(vec2(min(min(a.x, b.x), c.x), min(min(a.y, b.y), c.y)));
    let high = vec2<f32>(vec2(max(max(a.x, b.x), c.x), max(max(a.y, b.y), c.y)));
    return rn(max(max(a.z, b.z), c.z) * NEARER_RATIO) > min(s.depths.x, s.depths.y)
        && all(low <= max(s.ends.xy, s.ends.zw)) && all(high >= min(s.ends.xy, s.ends.zw));
}

// Depth error of a triangle's plane due to snapping; -1 without area.
fn slack_of(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> f32 {
    if is_far(p, q, r) {
        return 0.0;
    }
    let steep = steepness(p, q, r);
    return select(steep, rn(steep * SNAP_ERROR), steep >= 0.0);
}

// Weights of the corners at t of the way along an edge whose ends have these: not negative.
fn weights_at(at_start: vec3<f32>, at_end: vec3<f32>, t: f32) -> vec3<f32> {
    return max(at_start + rn3(t * (at_end - at_start)), vec3(0.0));
}

// By how much the triangle is nearer than the edge at t of the way.
fn nearer_by(
    s: Segment, weights: vec3<f32>, depths: vec3<f32>, ws: vec3<f32>, ratio: f32, slack: f32, t: f32,
) -> f32 {
    let z = rn3(weights * depths);
    let w = rn3(weights * ws);
    let depth = rn(rn(z.x + z.y) + z.z);
    let scale = rn(rn(w.x + w.y) + w.z);
    if scale > MIN_POSITIVE {
        return (rn(depth * recip(scale)) - rn(depth_of(s, t) * ratio)) - slack;
    }
    return -1.0;
}

// A range cut down to where the affine function with these values at 0 and 1 is positive.
fn narrowed(range: vec2<f32>, at_0: f32, at_1: f32) -> vec2<f32> {
    if at_0 < 0.0 {
        return vec2(max(range.x, rn(-at_0 * recip(at_1 - at_0))), range.y);
    } else if at_1 < 0.0 {
        return vec2(range.x, min(range.y, rn(at_0 * recip(at_0 - at_1))));
    }
    return range;
}
