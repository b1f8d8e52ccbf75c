// Stage lines, per piece of an edge: hidden-line removal, which finds the intervals that no
// triangle hides. Twin of src/backend/cpu/lines/hidden_lines.rs; edge.wgsl declares the buffers.
//
// The CPU sorts all intervals in which something hides the edge. A thread here has no room for
// them, so it finds one interval per scan along the edge.

// Smallest ratio of a hiding surface's depth to the edge's: covers the rounding of f32.
const NEARER_RATIO: f32 = 1.0000019073486328;

// Largest position error on screen, 1/256 px: half a unit each for the snapping of a triangle and
// of an edge, and some for f32.
const SNAP_ERROR: f32 = 1.25;

// Shortest visible interval, pixels. Shorter ones come from rounding, and their round ends would
// show as dots.
const INTERVAL_MIN_PX: f32 = 0.0625;

// Shortest visible interval between two hidden ones, pixels: a sliver of surface there may have no
// sample.
const GAP_MIN_PX: f32 = 0.25;

const MIN_POSITIVE: f32 = 1.17549435e-38;

// State of the search for the shown intervals in a range of the edge.
struct Search {
    range: vec2<f32>,
    // Pixels beside and beyond the edge whose triangles are candidates too.
    radius: u32,
    // Start of the rest to be searched; the range's end when finished.
    begin: f32,
    // Start of the hidden interval whose end is not found yet.
    hidden_from: f32,
    // UNSCANNED, WHOLE (the range is one interval), or INTERVALS.
    state: u32,
};

const UNSCANNED: u32 = 0u;
const WHOLE: u32 = 1u;
const INTERVALS: u32 = 2u;

// More than any place on an edge.
const BEYOND: f32 = 2.0;

// Result of one scan along a range, from `begin` on.
struct Scan {
    // End of the hidden interval that starts at `begin`.
    until: f32,
    // Start of the next hidden interval.
    next: f32,
    any: bool,
};

fn begin_search(s: Segment, range: vec2<f32>) -> Search {
    if (batch.line_flags & (SHOWN_VISIBLE | SHOWN_HIDDEN)) == 0u {
        return Search(range, 0u, range.x, BEYOND, WHOLE);
    }
    if is_fully_hidden(s, range) {
        let shows_hidden = (batch.line_flags & SHOWN_HIDDEN) != 0u;
        return Search(range, 0u, select(range.y, range.x, shows_hidden), BEYOND, WHOLE);
    }
    return Search(range, 0u, range.x, BEYOND, UNSCANNED);
}

// Scans along the edge once and returns an interval to draw; empty (x >= y) if this scan has
// completed none.
fn next_interval(edge: vec4<u32>, s: Segment, search: ptr<function, Search>) -> vec2<f32> {
    let range = (*search).range;
    let begin = (*search).begin;
    if (*search).state == WHOLE {
        (*search).begin = range.y;
        return range;
    }
    let scan = scan_along(edge, s, *search);
    let shows_visible = (batch.line_flags & SHOWN_VISIBLE) != 0u;
    if (*search).state == UNSCANNED {
        if !scan.any {
            (*search).begin = range.y;
            return select(vec2(0.0), range, shows_visible);
        }
        // Where an edge passes under another surface, a sliver of that may have its samples only
        // beside the edge.
        (*search).state = INTERVALS;
        (*search).radius = 1u;
        return vec2(0.0);
    }
    let hidden_from = (*search).hidden_from;
    if scan.until > begin {
        // Hidden from here on, perhaps farther than this scan has shown.
        (*search).hidden_from = min(hidden_from, begin);
        (*search).begin = scan.until;
        return select(vec2(0.0), vec2(min(hidden_from, begin), range.y), !shows_visible && scan.until >= range.y);
    }
    let end = min(scan.next, range.y);
    (*search).begin = end;
    (*search).hidden_from = BEYOND;
    if !shows_visible {
        return vec2(hidden_from, begin);
    }
    let is_gap = begin > range.x && end < range.y;
    let is_interval = end - begin > rn(s.inverse_length * select(INTERVAL_MIN_PX, GAP_MIN_PX, is_gap));
    return select(vec2(0.0), vec2(begin, end), is_interval);
}

// Combines the hidden intervals of all triangles visible along the edge.
fn scan_along(edge: vec4<u32>, s: Segment, search: Search) -> Scan {
    let count = u32(sample_count());
    // Samples of the pixel itself and, with a radius, of one on each side of it across the edge.
    let words = count * (2u * search.radius + 1u);
    let across = select(vec2(1, 0), vec2(0, 1), abs(s.along.x) >= abs(s.along.y));
    var scan = Scan(search.begin, 2.0, false);
    var recent = vec4(NOTHING);
    var last = vec2(OUTSIDE);
    let beyond = f32(search.radius) * s.inverse_length;
    let walked = vec2(search.range.x - beyond, search.range.y + beyond);
    let steps = walk_steps(s, walked);
    for (var i = 0u; i <= steps; i++) {
        let pixel = walk_pixel(s, walked, i);
        if all(pixel == last) {
            continue;
        }
        last = pixel;
        for (var n = 0u; n < words; n++) {
            let id = seen_at(pixel + (i32(n / count) - i32(search.radius)) * across, n % count).x;
            if id == NOTHING || any(recent == vec4(id)) {
                continue;
            }
            recent = vec4(id, recent.xyz);
            var interval = hidden_by(edge, s, id);
            interval = vec2(max(interval.x, search.range.x), min(interval.y, search.range.y));
            if interval.x >= interval.y {
                continue;
            }
            scan.any = true;
            if interval.x <= scan.until {
                scan.until = max(scan.until, interval.y);
            } else {
                scan.next = min(scan.next, interval.x);
            }
        }
    }
    return scan;
}

// True if every triangle visible along the edge is nearer than all of it.
fn is_fully_hidden(s: Segment, range: vec2<f32>) -> bool {
    let nearest = rn(max(depth_of(s, 0.0), depth_of(s, 1.0)) * NEARER_RATIO);
    let count = u32(sample_count());
    var last_id = NOTHING;
    var last = vec2(OUTSIDE);
    let steps = walk_steps(s, range);
    for (var i = 0u; i <= steps; i++) {
        let pixel = walk_pixel(s, range, i);
        if all(pixel == last) || !has_samples(pixel) {
            continue;
        }
        last = pixel;
        for (var n = 0u; n < count; n++) {
            let seen = seen_at(pixel, n);
            if seen.x == NOTHING || bitcast<f32>(seen.y) <= nearest {
                return false;
            }
            if seen.x != last_id {
                last_id = seen.x;
                let corners = corners_of_id(seen.x);
                let a = vertices[corners.x];
                let b = vertices[corners.y];
                let c = vertices[corners.z];
                if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE || min(min(a.z, b.z), c.z) <= nearest {
                    return false;
                }
            }
        }
    }
    return last_id != NOTHING;
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
    let first = nearer_by(s, at_start, at_end, depths, ws, slack, interval.x);
    let last = nearer_by(s, at_start, at_end, depths, ws, slack, interval.y);
    if first <= 0.0 && last <= 0.0 {
        return none;
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
    return max(max(a.z, b.z), c.z) > min(s.depths.x, s.depths.y)
        && all(low <= max(s.ends.xy, s.ends.zw)) && all(high >= min(s.ends.xy, s.ends.zw));
}

// Depth error of a triangle's plane due to snapping; -1 without area.
fn slack_of(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>) -> f32 {
    // So that nothing overflows, by exponents: 2^31.
    let exponents = max(max(exponents_of(p), exponents_of(q)), exponents_of(r));
    if any(exponents >= vec4(0x4F000000u)) {
        return 0.0;
    }
    let in_x = vec3(p.x, q.x, r.x);
    let in_z = vec3(p.z, q.z, r.z);
    let x = cofactors(vec3(p.y, q.y, r.y), vec3(p.w, q.w, r.w));
    let y = cofactors(vec3(p.w, q.w, r.w), in_x);
    let volume = abs(sum3(rn3(x * in_x)));
    if volume > MIN_POSITIVE {
        return rn(rn((abs(sum3(rn3(x * in_z))) + abs(sum3(rn3(y * in_z)))) * recip(volume)) * SNAP_ERROR);
    }
    return -1.0;
}

fn exponents_of(p: vec4<f32>) -> vec4<u32> {
    return bitcast<vec4<u32>>(p) & vec4(0x7F800000u);
}

// Per corner, a x b of the other two corners.
fn cofactors(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return rn3(a.yzx * b.zxy) - rn3(b.yzx * a.zxy);
}

fn sum3(v: vec3<f32>) -> f32 {
    return rn(v.x + v.y) + v.z;
}

// Per side of a triangle, twice the area that it spans with a point; positive inside.
fn sides_of(p: vec4<f32>, q: vec4<f32>, r: vec4<f32>, at: vec2<f32>, is_clockwise: bool) -> vec3<f32> {
    let a = rn2(p.xy - rn2(at * p.w));
    let b = rn2(q.xy - rn2(at * q.w));
    let c = rn2(r.xy - rn2(at * r.w));
    let sides = rn3(vec3(b.x, c.x, a.x) * vec3(c.y, a.y, b.y)) - rn3(vec3(b.y, c.y, a.y) * vec3(c.x, a.x, b.x));
    return select(-sides, sides, is_clockwise);
}

// By how much the triangle is nearer than the edge at t of the way.
fn nearer_by(
    s: Segment, at_start: vec3<f32>, at_end: vec3<f32>, depths: vec3<f32>, ws: vec3<f32>, slack: f32, t: f32,
) -> f32 {
    let weights = max(at_start + rn3(t * (at_end - at_start)), vec3(0.0));
    let z = rn3(weights * depths);
    let w = rn3(weights * ws);
    let depth = rn(rn(z.x + z.y) + z.z);
    let scale = rn(rn(w.x + w.y) + w.z);
    if scale > MIN_POSITIVE {
        return (rn(depth * recip(scale)) - rn(depth_of(s, t) * NEARER_RATIO)) - slack;
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
