// Stage lines, per edge: lines of exact width. Twin of src/backend/cpu/lines/edge.rs.
//
// Edges are cut into windows and those into slices of rows: shares, which are dealt out to the
// threads of a workgroup. A thread works in units: one scan along its window, and the drawing of
// the interval found. Where dispatches must be short, a thread pauses after a number of units and
// the next dispatch continues there.

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Two vertices, two faces.
@group(1) @binding(10) var<storage, read> edges: array<vec4<u32>>;
// Per pixel, the face that lights the pass's lines, plus 1.
@group(1) @binding(11) var<storage, read_write> owners: array<atomic<u32>>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;
// Number of paused threads, then the state of each.
@group(1) @binding(21) var<storage, read_write> progress: Progress;

struct Progress {
    left: atomic<u32>,
    threads: array<Paused>,
};

// A thread that is not done, or all zeros.
struct Paused {
    // Its next share, plus 1.
    share: u32,
    // `state` and `radius` of the search in that share, plus 1; 0 if it has not begun.
    search: u32,
    begin: f32,
    hidden_from: f32,
};

// `line_units` where a dispatch may take as long as it takes.
const NO_LIMIT: u32 = 0xFFFFFFFFu;

// Per edge of the workgroup, one per thread: end of its shares among all shares.
var<workgroup> share_ends: array<u32, WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn edge(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    let i = group * batch.edges_per_group + thread;
    var shares = 0u;
    if thread < batch.edges_per_group && i < batch.count {
        shares = shares_of(edges[batch.first + i]);
    }
    share_ends[thread] = shares;
    workgroupBarrier();
    for (var step = 1u; step < WORKGROUP; step *= 2u) {
        var before = 0u;
        if thread >= step {
            before = share_ends[thread - step];
        }
        workgroupBarrier();
        share_ends[thread] += before;
        workgroupBarrier();
    }
    if share_ends[WORKGROUP - 1u] > 0u {
        draw_shares(batch.first + group * batch.edges_per_group, group * WORKGROUP + thread, thread);
    }
}

fn shares_of(edge: vec4<u32>) -> u32 {
    let s = segment_of(edge);
    let rows = rows_of(s.start.y, s.start.y + s.along.y);
    if !s.drawn || rows.x > rows.y {
        return 0u;
    }
    // Rims are drawn first, because they mark the pixels that the other edges are drawn into.
    if has(HOLED) && (batch.line_flags & (HOLES | RIM_PASS)) != 0u && is_silhouette(edge) != is_rim_pass() {
        return 0u;
    }
    return window_count(s) * batch.line_slices;
}

// Draws every 64th share of the workgroup's, whose edges begin at `first`, from where the thread
// paused.
fn draw_shares(first: u32, self_at: u32, thread: u32) {
    let all = share_ends[WORKGROUP - 1u];
    let may_pause = batch.line_units != NO_LIMIT;
    var next = thread;
    var paused = Paused(0u, 0u, 0.0, 0.0);
    if may_pause {
        paused = progress.threads[self_at];
        next = select(thread, paused.share - 1u, paused.share > 0u);
    }
    var units = batch.line_units;
    var has_share = false;
    var edge = vec4(0u);
    var s: Segment;
    var window: Window;
    var search: Search;
    while next < all && units > 0u {
        if !has_share {
            let slot = edge_of_share(next);
            edge = edges[first + slot];
            s = segment_of(edge);
            window = window_of(s, next - select(0u, share_ends[max(slot, 1u) - 1u], slot > 0u));
            let range = widened(s, window.range);
            if paused.search > 0u {
                let found = paused.search - 1u;
                search = Search(range, found / 4u, paused.begin, paused.hidden_from, found % 4u);
                paused.search = 0u;
            } else if window.rows.x <= window.rows.y && gets_strokes(s, window) {
                search = begin_search(s, range);
            } else {
                search = Search(range, 0u, range.y, BEYOND, WHOLE);
            }
            has_share = true;
        }
        // Threads that have found an interval wait here for those that have not. Not where loops
        // are limited, because there an iteration of one thread counts for all.
        let units_before = units;
        var interval = vec2(0.0);
        while search.begin < search.range.y && interval.x >= interval.y && units > 0u {
            units--;
            interval = next_interval(edge, s, &search);
            if may_pause {
                break;
            }
        }
        if units == units_before {
            // Starting a share is work too.
            units--;
        }
        if interval.x < interval.y {
            draw_interval(edge, s, window, interval);
        }
        // Also where it is no number.
        if !(search.begin < search.range.y) {
            next += WORKGROUP;
            has_share = false;
        }
    }
    if may_pause {
        var left = Paused(all + WORKGROUP, 0u, 0.0, 0.0);
        if next < all {
            atomicAdd(&progress.left, 1u);
            left.share = next + 1u;
            if has_share {
                left.search = search.radius * 4u + search.state + 1u;
                left.begin = search.begin;
                left.hidden_from = search.hidden_from;
            }
        }
        progress.threads[self_at] = left;
    }
}

// Edge of the workgroup that a share belongs to: the first whose shares end after it.
fn edge_of_share(share: u32) -> u32 {
    var slot = 0u;
    for (var step = WORKGROUP / 2u; step > 0u; step /= 2u) {
        if share_ends[slot + step - 1u] <= share {
            slot += step;
        }
    }
    return slot;
}

// Windows of an edge: what is visible close to a pixel is found close to it.
fn window_count(s: Segment) -> u32 {
    return u32(rn(s.length * batch.line_windows)) + 1u;
}

// The range of an edge that is a window's, 0 to 1.
fn window_range(window: u32, count: u32) -> vec2<f32> {
    let step = recip(f32(count));
    return vec2(rn(f32(window) * step), rn(f32(window + 1u) * step));
}

// The range as far as it touches the window's pixels; where nothing hides lines, all of the edge.
fn widened(s: Segment, range: vec2<f32>) -> vec2<f32> {
    if (batch.line_flags & (SHOWN_VISIBLE | SHOWN_HIDDEN)) == 0u {
        return vec2(0.0, 1.0);
    }
    let beyond = rn((reach_of_line() + 1.0) * s.inverse_length);
    return vec2(max(range.x - beyond, 0.0), min(range.y + beyond, 1.0));
}

// First and last column whose pixel centre may lie within reach in pixel row y.
fn columns_of(s: Segment, ends: vec4<f32>, y: i32) -> vec2<i32> {
    let reach = reach_of_line() + SLACK_PX;
    var low = min(ends.x, ends.z) - reach;
    var high = max(ends.x, ends.z) + reach;
    // A steep or slanted line touches only a short piece of each row.
    if s.along.y * s.along.y > 1e-6 {
        let slope = s.along.x / s.along.y;
        let center = ends.x + (f32(y) + 0.5 - ends.y) * slope;
        let spread = reach * sqrt(1.0 + slope * slope);
        low = max(low, center - spread);
        high = min(high, center + spread);
    }
    return vec2(max(i32(low), 0), min(i32(high), frame.width - 1));
}

// A share of an edge: every slices-th row of one of its windows.
struct Window {
    number: u32,
    count: u32,
    range: vec2<f32>,
    ends: vec4<f32>,
    rows: vec2<i32>,
    // The share's first row.
    first: i32,
};

fn window_of(s: Segment, share: u32) -> Window {
    let count = window_count(s);
    let number = share / batch.line_slices;
    let range = window_range(number, count);
    let ends = vec4(point_at(s, range.x), point_at(s, range.y));
    let rows = rows_of(ends.y, ends.w);
    return Window(number, count, range, ends, rows, rows.x + i32(share % batch.line_slices));
}

// Draws a part of an edge into the pixels of a share.
fn draw_interval(edge: vec4<u32>, s: Segment, window: Window, interval: vec2<f32>) {
    let is_lit = (batch.line_flags & LIT_PASS) != 0u;
    let start = point_at(s, interval.x);
    let end = point_at(s, interval.y);
    var y = window.first;
    var columns = columns_of(s, window.ends, y);
    var x = columns.x;
    while y <= window.rows.y {
        // Finding a pixel is far cheaper than covering it, so threads that have found theirs wait
        // here for the others.
        var center = vec2(0.0);
        var at = 0u;
        var found = false;
        while !found && y <= window.rows.y {
            if x > columns.y {
                y += i32(batch.line_slices);
                columns = columns_of(s, window.ends, y);
                x = columns.x;
                continue;
            }
            center = vec2(f32(x), f32(y)) + 0.5;
            at = u32((y - batch.row_first) * frame.width + x);
            x++;
            // A full pixel stays full. Only a lit line goes on, to find the face that lights it.
            found = touches(place_of(s.direction, start - center, end - center)) && owns(s, window, center)
                && (is_lit || !is_full(at)) && (!only_marked() || is_marked(at));
        }
        if found && is_rim_pass() {
            atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], MARKED);
        }
        if found && add_stroke(at, s.direction, start - center, end - center) && is_lit {
            atomicMax(&owners[at], lighting_face(edge));
        }
    }
}

// True if only marked pixels get strokes.
fn only_marked() -> bool {
    return has(HOLED) && (batch.line_flags & (HOLES | RIM_PASS)) == HOLES;
}

// True if rims alone are drawn, and mark the pixels that they reach.
fn is_rim_pass() -> bool {
    return has(HOLED) && (batch.line_flags & RIM_PASS) != 0u;
}

fn is_marked(pixel_at: u32) -> bool {
    return (atomicLoad(&strokes[pixel_at * STROKE_WORDS + HOLE_WORD]) & MARKED) != 0u;
}

// False if no pixel of a share gets strokes.
fn gets_strokes(s: Segment, window: Window) -> bool {
    if !only_marked() {
        return true;
    }
    for (var y = window.first; y <= window.rows.y; y += i32(batch.line_slices)) {
        let columns = columns_of(s, window.ends, y);
        for (var x = columns.x; x <= columns.y; x++) {
            if is_marked(u32((y - batch.row_first) * frame.width + x)) {
                return true;
            }
        }
    }
    return false;
}

// True if the pixel belongs to this window of the edge.
fn owns(s: Segment, window: Window, center: vec2<f32>) -> bool {
    if window.count == 1u {
        return true;
    }
    let from_start = center - s.start;
    let way = rn((rn(from_start.x * s.along.x) + rn(from_start.y * s.along.y)) * s.inverse_length);
    let at = rn(rn(way * s.inverse_length) * f32(window.count));
    return min(u32(max(at, 0.0)), window.count - 1u) == window.number;
}
