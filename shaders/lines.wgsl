// Stage 4, an edge: lines of exact width. Twin of src/backend/cpu/lines.rs.
//
// A thread draws a short edge itself; the windows of long ones are shared out among the workgroup.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Two vertices, two faces.
@group(1) @binding(10) var<storage, read> edges: array<vec4<u32>>;
// Behind all passes' coverage, whose light falls on lines.
@group(1) @binding(11) var<storage, read_write> ink: array<atomic<u32>>;
// Of each pixel, what stroke.wgsl says.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;

// Slack for roundings where only too much is harmless, pixels.
const SLACK_PX: f32 = 0.05;

// Shares of an edge that a thread draws by itself.
const SHORT: u32 = 2u;

// Long edges: which, and where the shares of each begin among those of all.
var<workgroup> long_edges: array<u32, 64>;
var<workgroup> long_starts: array<u32, 64>;
var<workgroup> long_count: atomic<u32>;
var<workgroup> long_shares: atomic<u32>;

@compute @workgroup_size(64)
fn lines(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    if thread == 0u {
        atomicStore(&long_count, 0u);
        atomicStore(&long_shares, 0u);
    }
    workgroupBarrier();
    let i = (workgroup.x + workgroup.y * groups.x) * batch.edges_per_group + thread;
    let index = batch.first + i;
    var shares = 0u;
    if thread < batch.edges_per_group && i < batch.count {
        let s = segment_of(edges[index]);
        let rows = rows_of(s.start.y, s.start.y + s.along.y);
        if s.drawn && rows.x <= rows.y {
            shares = window_count(s) * batch.line_slices;
            if shares > SHORT {
                if (batch.line_flags & SHORT_ONLY) == 0u {
                    let slot = atomicAdd(&long_count, 1u);
                    long_edges[slot] = index;
                    long_starts[slot] = atomicAdd(&long_shares, shares);
                }
                shares = 0u;
            } else if (batch.line_flags & LONG_ONLY) != 0u {
                shares = 0u;
            }
        }
    }
    workgroupBarrier();
    // The thread's own edge, then every 64th share of the long ones.
    let count = atomicLoad(&long_count);
    let all = atomicLoad(&long_shares);
    var share = 0u;
    var next = thread;
    while share < shares || next < all {
        var edge = index;
        var number = share;
        if share < shares {
            share++;
        } else {
            // The edge whose start is the last before the share.
            var start = 0u;
            for (var slot = 0u; slot < count; slot++) {
                if long_starts[slot] <= next && long_starts[slot] >= start {
                    start = long_starts[slot];
                    edge = long_edges[slot];
                }
            }
            number = next - start;
            next += 64u;
        }
        draw_share(edges[edge], number);
    }
}

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
    let squared = rn(along.x * along.x) + rn(along.y * along.y);
    var inverse = 0.0;
    if squared > 0.0 {
        inverse = rsqrt(squared);
    }
    let ends = vec4(f32(a.x), f32(a.y), f32(b.x), f32(b.y));
    return Segment(ends, vec2(a.z, b.z), start, along, rn(squared * inverse), inverse, rn2(along * inverse), drawn);
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

// Windows of an edge: what is visible close to a pixel is found close to it. One where nothing hides lines.
fn window_count(s: Segment) -> u32 {
    if (batch.line_flags & (SHOWN_VISIBLE | SHOWN_HIDDEN)) == 0u {
        return 1u;
    }
    return u32(rn(s.length * batch.line_windows)) + 1u;
}

// The range of an edge that is a window's, 0 to 1.
fn window_range(window: u32, count: u32) -> vec2<f32> {
    let step = recip(f32(count));
    return vec2(rn(f32(window) * step), rn(f32(window + 1u) * step));
}

// The range as far as it touches the window's pixels.
fn widened(s: Segment, range: vec2<f32>) -> vec2<f32> {
    if (batch.line_flags & (SHOWN_VISIBLE | SHOWN_HIDDEN)) == 0u {
        return range;
    }
    let beyond = rn((reach_of_line() + 1.0) * s.inverse_length);
    return vec2(max(range.x - beyond, 0.0), min(range.y + beyond, 1.0));
}

// First and last picture row of the batch that a line between these heights may touch; empty if first > last.
fn rows_of(a: f32, b: f32) -> vec2<i32> {
    let reach = reach_of_line() + SLACK_PX;
    return vec2(max(i32(min(a, b) - reach), batch.row_first), min(i32(max(a, b) + reach), batch.row_end - 1));
}

// First and last column whose pixel centre may lie within reach in pixel row y.
fn columns_of(s: Segment, a: vec2<f32>, b: vec2<f32>, y: i32) -> vec2<i32> {
    let reach = reach_of_line() + SLACK_PX;
    var low = min(a.x, b.x) - reach;
    var high = max(a.x, b.x) + reach;
    // A steep or slanted line touches only a short piece of each row.
    if s.along.y * s.along.y > 1e-6 {
        let slope = s.along.x / s.along.y;
        let center = a.x + (f32(y) + 0.5 - a.y) * slope;
        let spread = reach * sqrt(1.0 + slope * slope);
        low = max(low, center - spread);
        high = min(high, center + spread);
    }
    return vec2(max(i32(low), 0), min(i32(high), frame.width - 1));
}

// Draws every slices-th row of a window of an edge.
fn draw_share(edge: vec4<u32>, share: u32) {
    let s = segment_of(edge);
    let count = window_count(s);
    let window = share / batch.line_slices;
    let range = window_range(window, count);
    let a = point_at(s, range.x);
    let b = point_at(s, range.y);
    let rows = rows_of(a.y, b.y);
    if rows.x > rows.y {
        return;
    }
    let is_lit = (batch.line_flags & LIT_PASS) != 0u;
    var search = begin_search(s, widened(s, range));
    var part = next_part(edge, s, &search);
    while part.x < part.y {
        let start = point_at(s, part.x);
        let end = point_at(s, part.y);
        var y = rows.x + i32(share % batch.line_slices);
        var columns = columns_of(s, a, b, y);
        var x = columns.x;
        while y <= rows.y {
            // Finding a pixel is far cheaper than covering it: threads that have found theirs wait here for those that have not.
            var center = vec2(0.0);
            var at = 0u;
            var found = false;
            while !found && y <= rows.y {
                if x > columns.y {
                    y += i32(batch.line_slices);
                    columns = columns_of(s, a, b, y);
                    x = columns.x;
                    continue;
                }
                center = vec2(f32(x), f32(y)) + 0.5;
                at = u32((y - batch.row_first) * frame.width + x);
                x++;
                // What is full stays full, whatever else comes; only a lit line still asks whose it is.
                found = touches(s.direction, start - center, end - center) && owns(s, window, count, center)
                    && (is_lit || !is_full(at));
            }
            if found && add_stroke(at, s.direction, start - center, end - center) && is_lit {
                atomicMax(&ink[batch.owners_at + at], lit_by(edge));
            }
        }
        part = next_part(edge, s, &search);
    }
}

// Whether of all windows of the edge the pixel is this one's.
fn owns(s: Segment, window: u32, count: u32, center: vec2<f32>) -> bool {
    if count == 1u {
        return true;
    }
    let from_start = center - s.start;
    let way = rn((rn(from_start.x * s.along.x) + rn(from_start.y * s.along.y)) * s.inverse_length);
    let at = rn(rn(way * s.inverse_length) * f32(count));
    return min(u32(max(at, 0.0)), count - 1u) == window;
}
