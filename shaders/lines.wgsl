// Stage 4, an edge: lines of exact width. Twin of src/backend/cpu/lines.rs.
//
// A thread draws a short edge itself; long ones are drawn by the whole workgroup.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Two vertices, two faces.
@group(1) @binding(10) var<storage, read> edges: array<vec4<u32>>;
@group(1) @binding(11) var<storage, read_write> ink: array<atomic<u32>>;
@group(1) @binding(12) var<storage, read> ink_table: array<u32>;

const NOTHING: u32 = 0xFFFFFFFFu;

// Farthest from the middle of a unit box to its corner.
const BOX_RADIUS: f32 = 0.70710678;

// Pixels that a thread draws by itself.
const SHORT_PX: i32 = 192;

var<workgroup> long_edges: array<u32, 64>;
var<workgroup> long_count: atomic<u32>;

@compute @workgroup_size(64)
fn lines(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    if thread == 0u {
        atomicStore(&long_count, 0u);
    }
    workgroupBarrier();
    let i = (workgroup.x + workgroup.y * groups.x) * batch.edges_per_group + thread;
    if thread < batch.edges_per_group && i < batch.count {
        let edge = edges[batch.first + i];
        let segment = segment_of(edge);
        if segment.drawn {
            let rows = rows_of(segment);
            let across = abs(segment.along.x) + 2.0 * segment.reach;
            let down = abs(segment.along.y) + 2.0 * segment.reach;
            let pixels = i32(min(across * down, max(across, down) * (4.0 * segment.reach)));
            if rows.x <= rows.y && pixels <= SHORT_PX {
                draw(edge, segment, rows, vec2(0), vec2(1));
            } else if rows.x <= rows.y {
                long_edges[atomicAdd(&long_count, 1u)] = batch.first + i;
            }
        }
    }
    workgroupBarrier();
    let count = atomicLoad(&long_count);
    let cell = vec2(i32(thread & 7u), i32(thread >> 3u));
    for (var n = 0u; n < count; n++) {
        let edge = edges[long_edges[n]];
        let segment = segment_of(edge);
        draw(edge, segment, rows_of(segment), cell, vec2(8));
    }
}

// An edge on screen, pixels from the picture's upper left corner.
struct Segment {
    start: vec2<f32>,
    along: vec2<f32>,
    inverse_length_squared: f32,
    // Reach across: half the width, the ramp, and the pixel's own box.
    reach: f32,
    depth: vec2<f32>,
    drawn: bool,
};

fn segment_of(edge: vec4<u32>) -> Segment {
    var a = vertices[edge.x];
    var b = vertices[edge.y];
    var drawn = is_drawn(edge);
    if drawn && (a.x == OUTSIDE || b.x == OUTSIDE) {
        drawn = has(CLIPPED) && clip_segment(edge.xy, &a, &b);
    }
    let half = vec2(frame.width, frame.height) * 128;
    let start = vec2<f32>(vec2(a.x, a.y) + half) * (1.0 / 256.0);
    let end = vec2<f32>(vec2(b.x, b.y) + half) * (1.0 / 256.0);
    let along = end - start;
    let length_squared = dot(along, along);
    var inverse = 0.0;
    if length_squared > 0.0 {
        inverse = 1.0 / length_squared;
    }
    let reach = 0.5 * batch.line_width + 0.5 * batch.line_smoothing + BOX_RADIUS;
    return Segment(start, along, inverse, reach, vec2(a.z, b.z), drawn);
}

fn homogeneous_of(v: u32) -> vec4<f32> {
    return homogeneous(vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]));
}

// Whether anything is left of the segment; what that is.
fn clip_segment(ends: vec2<u32>, a: ptr<function, Vertex>, b: ptr<function, Vertex>) -> bool {
    var p = homogeneous_of(ends.x);
    var q = homogeneous_of(ends.y);
    for (var plane = 0u; plane < 5u; plane++) {
        let d_p = plane_distance(plane, p);
        let d_q = plane_distance(plane, q);
        if d_p >= 0.0 && d_q < 0.0 {
            q = intersect(p, q, d_p, d_q);
        } else if d_p < 0.0 && d_q >= 0.0 {
            p = intersect(q, p, d_q, d_p);
        } else if d_p < 0.0 {
            return false;
        }
    }
    *a = snap_clipped(p);
    *b = snap_clipped(q);
    return true;
}

// First and last picture row of the batch that the capsule may touch; empty if first > last.
fn rows_of(s: Segment) -> vec2<i32> {
    let low = min(s.start.y, s.start.y + s.along.y) - s.reach;
    let high = max(s.start.y, s.start.y + s.along.y) + s.reach;
    return vec2(max(i32(low), batch.row_first), min(i32(high), batch.row_end - 1));
}

// First and last column whose pixel centre may lie within reach in pixel row y.
fn columns_of(s: Segment, y: i32) -> vec2<i32> {
    var low = min(s.start.x, s.start.x + s.along.x) - s.reach;
    var high = max(s.start.x, s.start.x + s.along.x) + s.reach;
    // A steep or slanted line touches only a short piece of each row.
    if s.along.y * s.along.y > 1e-6 {
        let slope = s.along.x / s.along.y;
        let center = s.start.x + (f32(y) + 0.5 - s.start.y) * slope;
        let spread = s.reach * sqrt(1.0 + slope * slope);
        low = max(low, center - spread);
        high = min(high, center + spread);
    }
    return vec2(max(i32(low), 0), min(i32(high), frame.width - 1));
}

// Draws every step-th pixel of the edge's capsule, beginning at `cell`.
fn draw(edge: vec4<u32>, s: Segment, rows: vec2<i32>, cell: vec2<i32>, step: vec2<i32>) {
    let inverse = sqrt(s.inverse_length_squared);
    let normal = vec2(-s.along.y * inverse, s.along.x * inverse);
    let strip = profile_of(normal);
    for (var y = rows.x + cell.y; y <= rows.y; y += step.y) {
        let columns = columns_of(s, y);
        for (var x = columns.x + cell.x; x <= columns.y; x += step.x) {
            // What is full stays full, whatever else comes; only a lit line still asks whose it is.
            let at = batch.ink_at + u32((y - batch.row_first) * frame.width + x);
            if (batch.line_flags & LIT_PASS) == 0u && atomicLoad(&ink[at]) >= INK_FULL {
                continue;
            }
            let from_start = vec2(f32(x), f32(y)) + 0.5 - s.start;
            let t = clamp(dot(from_start, s.along) * s.inverse_length_squared, 0.0, 1.0);
            let level = u32(coverage_of(strip, normal, t, from_start - t * s.along) * 1023.0 + 0.5);
            if level > 0u {
                add_ink(edge, s, t, vec2(x, y), level);
            }
        }
    }
}

fn add_ink(edge: vec4<u32>, s: Segment, t: f32, pixel: vec2<i32>, coverage: u32) {
    let pixel_at = u32((pixel.y - batch.row_first) * frame.width + pixel.x);
    let at = batch.ink_at + pixel_at;
    var level = coverage;
    if (batch.line_flags & (SHOWN_VISIBLE | SHOWN_HIDDEN)) != 0u {
        let count = u32(sample_count());
        let visible = visible_samples(edge, s, t, pixel_at * count);
        let shown = select(count - visible, visible, (batch.line_flags & SHOWN_VISIBLE) != 0u);
        level = (coverage * shown + count / 2u) / count;
    }
    // Once a pixel is full nothing changes it, so it may stop counting long before the sum could wrap.
    if atomicLoad(&ink[at]) < 0x80000000u {
        atomicAdd(&ink[at], ink_table[level]);
    }
    if level > 0u && (batch.line_flags & LIT_PASS) != 0u {
        atomicMax(&ink[batch.owners_at + pixel_at], lit_by(edge));
    }
}

// Coverage of a pixel's box by a strip, as a function of the distance between their centres: the integral over the strip's
// width of a trapezoid of area 1.
struct Profile {
    foot: f32,
    top: f32,
    height: f32,
    // Curvature of the integral on the flanks.
    flank: f32,
};

fn profile_of(normal: vec2<f32>) -> Profile {
    let n = abs(normal);
    let smoothing = 0.5 * batch.line_smoothing;
    let foot = 0.5 * (n.x + n.y) + smoothing;
    let top = abs(0.5 * abs(n.x - n.y) - smoothing);
    let height = 1.0 / (foot + top);
    var flank = 0.0;
    if foot > top {
        flank = 0.5 * height / (foot - top);
    }
    return Profile(foot, top, height, flank);
}

fn strip_coverage(p: Profile, distance: f32) -> f32 {
    let half_width = 0.5 * batch.line_width;
    if distance >= half_width + p.foot {
        return 0.0;
    }
    return clamp(half_integral(p, distance + half_width) - half_integral(p, distance - half_width), 0.0, 1.0);
}

// Integral of the trapezoid from its middle to u.
fn half_integral(p: Profile, u: f32) -> f32 {
    let a = min(abs(u), p.foot);
    let past = max(a - p.top, 0.0);
    let half = p.height * a - p.flank * past * past;
    return select(half, -half, u < 0.0);
}

// Coverage of a pixel at `offset` from the nearest point of the segment, which lies at t of its length.
fn coverage_of(strip: Profile, normal: vec2<f32>, t: f32, offset: vec2<f32>) -> f32 {
    if t > 0.0 && t < 1.0 {
        return strip_coverage(strip, abs(dot(offset, normal)));
    }
    let distance = sqrt(dot(offset, offset));
    if distance > 0.5 * batch.line_width + 0.5 * batch.line_smoothing + BOX_RADIUS {
        return 0.0;
    }
    var outwards = normal;
    if distance >= 1e-6 {
        outwards = offset / distance;
    }
    return strip_coverage(profile_of(outwards), distance);
}

// In how many of a pixel's samples the edge is not hidden.
fn visible_samples(edge: vec4<u32>, s: Segment, t: f32, first_sample: u32) -> u32 {
    let depth = s.depth.x + t * (s.depth.y - s.depth.x);
    var count = 0u;
    var last_id = NOTHING;
    var last_visible = true;
    for (var n = 0u; n < u32(sample_count()); n++) {
        let word = samples[first_sample + n];
        let id = select(~word.x, NOTHING, word.y == 0u);
        if id == NOTHING || depth >= bitcast<f32>(word.y) || id == edge.z || id == edge.w {
            count++;
            continue;
        }
        if id != last_id {
            last_id = id;
            last_visible = !hides(id, edge, s, t, depth, bitcast<f32>(word.y));
        }
        count += u32(last_visible);
    }
    return count;
}

// Whether a triangle, which is nearer than the edge at a sample close by, really lies in front of it. Its plane is continued
// to the edge's own point, because close to a fold the sample itself may be nearer without hiding anything.
//
// Of a contour: towards a silhouette the surface falls away faster than its plane: as much again as the plane falls is granted.
fn hides(id: u32, edge: vec4<u32>, s: Segment, t: f32, depth: f32, sample_depth: f32) -> bool {
    let is_hull = id >= frame.triangle_count;
    let index = 3u * select(id, id - frame.triangle_count, is_hull);
    let base = select(0u, frame.hull_base, is_hull);
    let v = vec3(triangles[index], triangles[index + 1u], triangles[index + 2u]);
    if !is_hull && meets(v, edge, s, t) {
        return false;
    }
    let a = vertices[base + v.x];
    let b = vertices[base + v.y];
    let c = vertices[base + v.z];
    let area = area_of(a, b, c);
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE || is_zero(area) {
        return true;
    }
    let setup = setup_of(a, b, c, area);
    let half = vec2<f32>(vec2(frame.width, frame.height)) * 128.0;
    let gx = setup.depth.y;
    let gy = setup.depth.z;
    let corner = setup.depth.x - gx * (f32(setup.x.x) + half.x) - gy * (f32(setup.y.x) + half.y);
    let point = s.start + t * s.along;
    let plane = corner + 256.0 * gx * point.x + 256.0 * gy * point.y;
    // What the surface may fall away over three quarters of a pixel: the curvature between neighbouring faces.
    let fall = select(0.0, max(sample_depth - plane, 0.0), is_contour_pass());
    return plane - fall > depth + 192.0 * (abs(gx) + abs(gy));
}

// Whether a triangle meets the edge at an end close to t: around a vertex, the faces of one fan do not hide each other's edges.
fn meets(v: vec3<u32>, edge: vec4<u32>, s: Segment, t: f32) -> bool {
    // Twice the reach as a share of the length, squared.
    let limit = 4.0 * s.reach * s.reach * s.inverse_length_squared;
    let first = t * t < limit && any(v == vec3(edge.x));
    let second = (1.0 - t) * (1.0 - t) < limit && any(v == vec3(edge.y));
    return first || second;
}
