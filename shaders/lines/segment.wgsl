// An edge on screen, as a straight segment (stage lines): its two ends, clipped where necessary, its points and
// their depths, and the walk over the pixels along it. Twin of src/render/backend/cpu/lines/segment.rs. edge.wgsl
// declares the buffers.
//
// Uses: common.wgsl (CLIPPED, has, homogeneous, OUTSIDE, rn, rn2, rsqrt, Vertex), one_job.wgsl
// (batch, frame), geometry/planes.wgsl (intersect, is_moderate, plane_distance, snap_clipped),
// lines/edge.wgsl (positions, vertices), lines/stroke.wgsl (reach_of_line).

// Slack for roundings where only too much is harmless, pixels.
const SLACK_PX: f32 = 0.05;

// An edge on screen.
struct Segment {
    // Ends, in 1/256 px from the picture's centre.
    ends: vec4<f32>,
    depths: vec2<f32>,
    // First end, pixels from the picture's upper left corner, and the way from there to the other.
    start: vec2<f32>,
    along: vec2<f32>,
    // Pixels, and its inverse; 0 where it is a point.
    length: f32,
    inverse_length: f32,
    // Unit vector along; zero for a point.
    direction: vec2<f32>,
    // False if nothing is left of it after clipping.
    exists: bool,
};

// The edge on screen. Callers ask `is_drawn` first: compilers copy what is asked here into each of them.
fn segment_of(edge: vec4<u32>) -> Segment {
    var a = vertices[edge.x];
    var b = vertices[edge.y];
    var exists = true;
    if a.x == OUTSIDE || b.x == OUTSIDE {
        exists = has(CLIPPED) && clip_segment(edge.xy, &a, &b);
    }
    let half = vec2(frame.width, frame.height) * 128;
    let start = vec2<f32>(vec2(a.x, a.y) + half) * (1.0 / 256.0);
    let end = vec2<f32>(vec2(b.x, b.y) + half) * (1.0 / 256.0);
    let along = end - start;
    let squared = rn(along.x * along.x) + rn(along.y * along.y);
    var inverse = 0.0;
    if squared > 0.0 {
        inverse = rsqrt(squared);
    }
    let ends = vec4(f32(a.x), f32(a.y), f32(b.x), f32(b.y));
    return Segment(ends, vec2(a.z, b.z), start, along, rn(squared * inverse), inverse, rn2(along * inverse), exists);
}

// Depth at t of the way.
fn depth_of(s: Segment, t: f32) -> f32 {
    return s.depths.x + rn(t * rn(s.depths.y - s.depths.x));
}

// The point at t of the way, pixels from the picture's upper left corner.
fn point_at(s: Segment, t: f32) -> vec2<f32> {
    return s.start + rn2(t * s.along);
}

fn homogeneous_of(v: u32) -> vec4<f32> {
    return homogeneous(position_of(v));
}

fn position_of(v: u32) -> vec3<f32> {
    return vec3(positions[3u * v], positions[3u * v + 1u], positions[3u * v + 2u]);
}

// Clips a segment in place. False if nothing is left.
fn clip_segment(ends: vec2<u32>, a: ptr<function, Vertex>, b: ptr<function, Vertex>) -> bool {
    var p = homogeneous_of(ends.x);
    var q = homogeneous_of(ends.y);
    if !is_moderate(p) || !is_moderate(q) {
        return false;
    }
    for (var plane = 0u; plane < 5u; plane++) {
        let d_p = plane_distance(plane, p);
        let d_q = plane_distance(plane, q);
        let has_p = d_p >= 0.0;
        let has_q = d_q >= 0.0;
        if has_p && !has_q {
            q = intersect(p, q, d_p, d_q);
        } else if !has_p && has_q {
            p = intersect(q, p, d_q, d_p);
        } else if !has_p {
            return false;
        }
    }
    *a = snap_clipped(p);
    *b = snap_clipped(q);
    return true;
}

// First and last picture row of the batch that a line between these heights may touch; empty if
// first > last.
fn rows_of(a: f32, b: f32) -> vec2<i32> {
    let reach = reach_of_line() + SLACK_PX;
    return vec2(max(i32(min(a, b) - reach), batch.row_first), min(i32(max(a, b) + reach), batch.row_end - 1));
}

fn walk_steps(s: Segment, range: vec2<f32>) -> u32 {
    return u32(rn(rn(s.length * (range.y - range.x)) * 2.0)) + 1u;
}

// The pixel in which step i along a range of the edge lies, in the picture or beyond.
fn walk_pixel(s: Segment, range: vec2<f32>, i: u32) -> vec2<i32> {
    let p = point_at(s, min(range.x + rn(f32(i) * (0.5 * s.inverse_length)), range.y));
    return vec2<i32>(floor(p));
}
