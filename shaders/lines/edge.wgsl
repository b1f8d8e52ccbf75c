// Stage lines, per edge: draws the edge as a line of exact width. The kernel finds the visible parts of the edge,
// unless whole edges are drawn. To the pixels that a part touches (only to some, where holes/holes.wgsl finds the
// coverage) it adds a stroke: all that lies within half the line's width of the part. coverage.wgsl makes colours
// of the strokes. Twin of src/render/backend/cpu/lines/edge.rs.
//
// An edge is cut along its length into windows, and the pixel rows of a window into slices. Such a slice is called
// a share here. A workgroup has some edges. Each of its threads looks at one share, to find out whether there is
// something to draw. Shares with something to draw are then drawn one after the other, each by all threads
// together.
//
// Dispatches must be short on a software device, which cuts long loops off, and for wide lines, which take long.
// There a workgroup pauses after a number of units of work, and the next dispatch continues where it has paused. A
// unit is a look at shares (one by each thread), the search for what hides one, or the drawing of a part of it.
//
// Uses: common.wgsl (FRINGES, has, HOLED, HOLES, LIT_PASS, recip, RIM_PASS, rn, SHOWN_VISIBLE,
// TINTED_PASS, Vertex), one_job.wgsl (batch, frame), lines/contour.wgsl (is_drawn, is_silhouette,
// lighting_face), lines/fringed.wgsl (is_fringed), lines/hidden_lines.wgsl (begin_runs, BEYOND,
// count_found, has_too_many, is_all_hidden, joined_run, look_around, shows_interval),
// lines/segment.wgsl (depth_of, point_at, rows_of, Segment, segment_of, SLACK_PX),
// lines/stroke.wgsl (add_stroke, is_full, place_of, reach_of_line, touches),
// lines/stroke_words.wgsl (HOLE_WORD, point_marks, STROKE_WORDS, STROKED).

@group(1) @binding(0) var<storage, read> positions: array<f32>;
@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Two vertices, two faces.
@group(1) @binding(10) var<storage, read> edges: array<vec4<u32>>;
// Per pixel, the face that lights the pass's lines, plus 1; then, per pixel, the depth of its nearest line, where layers
// tint the pass.
@group(1) @binding(11) var<storage, read_write> owners: array<atomic<u32>>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;
// Number of paused workgroups, then the state of each.
@group(1) @binding(21) var<storage, read_write> progress: Progress;

struct Progress {
    left: atomic<u32>,
    groups: array<Paused>,
};

// A workgroup that is not done, or all zeros.
struct Paused {
    // Its next share.
    share: u32,
    // 1 if a part of that share is drawn, up to `begin`.
    is_begun: u32,
    begin: f32,
};

// Threads of a workgroup: a share has few samples and pixels, and few threads hardly wait for each other.
const LINE_THREADS: u32 = 32u;

// `line_units` where a dispatch may take as long as it takes.
const NO_LIMIT: u32 = 0xFFFFFFFFu;

// Per edge of the workgroup, one per thread: end of its shares among all shares.
var<workgroup> share_ends: array<u32, LINE_THREADS>;

// Bits of the shares with something to draw, of those that the threads look at; and a copy.
var<workgroup> due: atomic<u32>;
var<workgroup> due_now: u32;

// A stroke that is to be added to a pixel.
struct Waiting {
    // The edge's direction, and the ends of a part of it, in pixels from the pixel's centre.
    direction: vec2<f32>,
    start: vec2<f32>,
    end: vec2<f32>,
    // The pixel.
    at: u32,
    // The face that lights the line, plus 1, where it is lit.
    face: u32,
    // The depth in the point of the part that is nearest to the pixel's centre.
    depth: f32,
};

// Strokes that wait until there is one for each thread. At most 31 wait before each thread adds one, so 64
// places are enough.
var<workgroup> waiting: array<Waiting, 2u * LINE_THREADS>;
var<workgroup> waiting_count: atomic<u32>;
var<workgroup> waiting_now: u32;

// Units of work that are left to the workgroup, the same in all threads.
var<private> units_left: u32;

// How far a share is drawn of which nothing is drawn yet.
const FRESH: f32 = -1.0;

@compute @workgroup_size(LINE_THREADS)
fn edge(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    var shares = 0u;
    if has_edge(group, thread) {
        shares = shares_of(edge_of(group, thread));
    }
    share_ends[thread] = shares;
    if thread == 0u {
        atomicStore(&due, 0u);
        atomicStore(&waiting_count, 0u);
        begin_runs();
    }
    workgroupBarrier();
    for (var step = 1u; step < LINE_THREADS; step *= 2u) {
        var before = 0u;
        if thread >= step {
            before = share_ends[thread - step];
        }
        workgroupBarrier();
        share_ends[thread] += before;
        workgroupBarrier();
    }
    draw_shares(group, thread);
}

// The number of a workgroup's edge in the dispatch. Neighbouring edges, which often are long or silhouettes together,
// go to different workgroups, so that all have about as much to draw.
fn edge_number(group: u32, slot: u32) -> u32 {
    return group + slot * groups_with_edges();
}

// A dispatch may have more workgroups, which have no edges.
fn groups_with_edges() -> u32 {
    return (batch.count + batch.edges_per_group - 1u) / batch.edges_per_group;
}

fn has_edge(group: u32, slot: u32) -> bool {
    return slot < batch.edges_per_group && group < groups_with_edges() && edge_number(group, slot) < batch.count;
}

fn edge_of(group: u32, slot: u32) -> vec4<u32> {
    return edges[batch.first + edge_number(group, slot)];
}

fn shares_of(edge: vec4<u32>) -> u32 {
    if !is_drawn(edge) {
        return 0u;
    }
    let s = segment_of(edge);
    let rows = rows_of(s.start.y, s.start.y + s.along.y);
    if !s.exists || rows.x > rows.y {
        return 0u;
    }
    // Rims are drawn first, because they mark the pixels that the other edges are drawn into.
    if has(HOLED) && (batch.line_flags & (HOLES | RIM_PASS)) != 0u && is_silhouette(edge) != is_rim_pass() {
        return 0u;
    }
    if is_in_fringes(edge) {
        return 0u;
    }
    return window_count(s) * batch.line_slices;
}

// True if the fringes of faces tell what the edge's line covers.
fn is_in_fringes(edge: vec4<u32>) -> bool {
    return has(HOLED) && (batch.line_flags & FRINGES) != 0u && !is_silhouette(edge)
        && has_fringe(edge.z) && has_fringe(edge.w);
}

fn has_fringe(face: u32) -> bool {
    let a = vertices[triangles[3u * face]];
    let b = vertices[triangles[3u * face + 1u]];
    let c = vertices[triangles[3u * face + 2u]];
    return is_fringed(a, b, c);
}

// Draws the shares of the workgroup, from where it paused.
fn draw_shares(group: u32, thread: u32) {
    let all = share_ends[LINE_THREADS - 1u];
    let may_pause = batch.line_units != NO_LIMIT;
    units_left = batch.line_units;
    var next = 0u;
    var drawn_to = FRESH;
    if may_pause {
        let paused = progress.groups[group];
        next = paused.share;
        drawn_to = select(FRESH, paused.begin, paused.is_begun != 0u);
        // Before the first thread writes it again.
        storageBarrier();
    }
    while next < all && units_left > 0u {
        let base = next - next % LINE_THREADS;
        let own = base + thread;
        if own >= next && own < all && is_due(group, own) {
            atomicOr(&due, 1u << thread);
        }
        units_left--;
        workgroupBarrier();
        if thread == 0u {
            due_now = atomicExchange(&due, 0u);
        }
        var left = workgroupUniformLoad(&due_now);
        next = min(base + LINE_THREADS, all);
        while left != 0u {
            let share = base + firstTrailingBit(left);
            if units_left == 0u {
                next = share;
                break;
            }
            drawn_to = draw_share(group, share, drawn_to, thread);
            if drawn_to < BEYOND {
                next = share;
                break;
            }
            drawn_to = FRESH;
            left &= left - 1u;
        }
    }
    draw_waiting(1u, thread);
    if may_pause && thread == 0u && all > 0u {
        progress.groups[group] = Paused(next, select(0u, 1u, drawn_to >= 0.0), drawn_to);
        if next < all {
            atomicAdd(&progress.left, 1u);
        }
    }
}

// Edge of the workgroup that a share belongs to: the first whose shares end after it.
fn edge_of_share(share: u32) -> u32 {
    var slot = 0u;
    for (var step = LINE_THREADS / 2u; step > 0u; step /= 2u) {
        if share_ends[slot + step - 1u] <= share {
            slot += step;
        }
    }
    return slot;
}

// The first share of an edge of the workgroup.
fn first_share_of(slot: u32) -> u32 {
    return select(0u, share_ends[max(slot, 1u) - 1u], slot > 0u);
}

// True if a share may have something to draw.
fn is_due(group: u32, share: u32) -> bool {
    let slot = edge_of_share(share);
    let s = segment_of(edge_of(group, slot));
    let window = window_of(s, share - first_share_of(slot));
    return window.first <= window.rows.y && gets_strokes(s, window);
}

// Draws a share, by all threads of the workgroup. Returns how far it is drawn: BEYOND if it is done.
//
// One loop for all steps, because compilers copy what is called into each place that calls it, and
// here that is most of the kernel.
fn draw_share(group: u32, share: u32, drawn_to: f32, thread: u32) -> f32 {
    let slot = edge_of_share(share);
    let edge = edge_of(group, slot);
    let s = segment_of(edge);
    let window = window_of(s, share - first_share_of(slot));
    let range = widened(s, window.range);
    var step = DRAW_ALL;
    if (batch.line_flags & SHOWN_VISIBLE) != 0u {
        step = select(FIND_ALONG, DRAW_NOTHING, is_all_hidden(s, range, thread));
    }
    units_left--;
    var begin = max(range.x, drawn_to);
    // Also ends where `begin` is no number.
    while step < DRAW_RUNS || (step == DRAW_RUNS && begin < range.y) {
        var interval = vec2(0.0);
        var run = vec2(begin, BEYOND);
        if step == FIND_ALONG || step == FIND_AROUND || (step == DRAW_RUNS && has_too_many()) {
            run = look_around(edge, s, range, step, begin, thread);
        }
        if step == FIND_ALONG {
            // Where an edge passes under another surface, a sliver of that may have its samples only
            // beside the edge.
            step = select(DRAW_ALL, FIND_AROUND, count_found(thread) > 0u);
        } else if step == FIND_AROUND {
            count_found(thread);
            step = DRAW_RUNS;
        } else if step == DRAW_ALL {
            interval = range;
            step = DRAW_NOTHING;
        } else {
            if units_left == 0u {
                return begin;
            }
            units_left--;
            run = joined_run(run, begin, thread);
            if run.x > begin {
                // Hidden from here on, perhaps farther than this.
                begin = run.x;
            } else {
                let end = min(run.y, range.y);
                let is_gap = begin > range.x && end < range.y;
                if shows_interval(edge, s, vec2(begin, end), is_gap) {
                    interval = vec2(begin, end);
                }
                begin = end;
            }
        }
        if interval.x < interval.y {
            draw_interval(edge, s, window, interval, thread);
        }
    }
    return BEYOND;
}

// Steps of `draw_share`.
const FIND_ALONG: u32 = 0u;
const FIND_AROUND: u32 = 1u;
const DRAW_ALL: u32 = 2u;
const DRAW_RUNS: u32 = 3u;
const DRAW_NOTHING: u32 = 4u;

// Windows of an edge: what is visible close to a pixel is found close to it.
fn window_count(s: Segment) -> u32 {
    return u32(rn(s.length * batch.line_windows)) + 1u;
}

// The range of an edge that is a window's, 0 to 1.
fn window_range(window: u32, count: u32) -> vec2<f32> {
    let step = recip(f32(count));
    return vec2(rn(f32(window) * step), rn(f32(window + 1u) * step));
}

// The range as far as it touches the window's pixels; where whole edges are drawn, all of the edge.
fn widened(s: Segment, range: vec2<f32>) -> vec2<f32> {
    if (batch.line_flags & SHOWN_VISIBLE) == 0u {
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

// Finds the pixels of a share that a part of an edge touches, and lets them wait. As soon as there is one
// for each thread, they are drawn: that takes far longer than finding them.
fn draw_interval(edge: vec4<u32>, s: Segment, window: Window, interval: vec2<f32>, thread: u32) {
    let is_lit = (batch.line_flags & LIT_PASS) != 0u;
    let start = point_at(s, interval.x);
    let end = point_at(s, interval.y);
    let reach = reach_of_line() + SLACK_PX;
    let low = max(i32(min(window.ends.x, window.ends.z) - reach), 0);
    let high = min(i32(max(window.ends.x, window.ends.z) + reach), frame.width - 1);
    if low > high || window.first > window.rows.y {
        return;
    }
    let columns = u32(high - low) + 1u;
    let pixels = columns * (u32(window.rows.y - window.first) / batch.line_slices + 1u);
    for (var done_pixels = 0u; done_pixels < pixels; done_pixels += LINE_THREADS) {
        let p = done_pixels + thread;
        let pixel = vec2(low + i32(p % columns), window.first + i32(p / columns * batch.line_slices));
        let center = vec2<f32>(pixel) + 0.5;
        let at = u32((pixel.y - batch.row_first) * frame.width + pixel.x);
        let place = place_of(s.direction, start - center, end - center);
        var depth = 0.0;
        if (batch.line_flags & TINTED_PASS) != 0u {
            let nearest = interval.x + rn(place.past.x * s.inverse_length);
            depth = depth_of(s, min(max(nearest, interval.x), interval.y));
        }
        // A full pixel stays full. But a lit line still looks for the face that lights it, and one
        // that layers tint for the nearest depth.
        if p < pixels && touches(place) && owns(s, window, center)
            && (!only_stroked() || is_stroked(at)) && (is_lit || !is_full(at) || is_nearest(at, depth)) {
            if is_rim_pass() {
                atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], point_marks());
            }
            var face = 0u;
            if is_lit {
                face = lighting_face(edge);
            }
            waiting[atomicAdd(&waiting_count, 1u)] = Waiting(s.direction, start - center, end - center, at, face, depth);
        }
        draw_waiting(LINE_THREADS, thread);
    }
}

// Draws up to 32 waiting strokes, one for each thread. Does nothing if fewer than `least` wait.
fn draw_waiting(least: u32, thread: u32) {
    workgroupBarrier();
    if thread == 0u {
        let count = atomicLoad(&waiting_count);
        waiting_now = count;
        if count >= least {
            atomicStore(&waiting_count, count - min(count, LINE_THREADS));
        }
    }
    let count = workgroupUniformLoad(&waiting_now);
    if count < least {
        return;
    }
    let stroke = waiting[count - 1u - min(thread, count - 1u)];
    // Before another thread puts a new one in its place.
    workgroupBarrier();
    if thread < count && add_stroke(stroke.at, stroke.direction, stroke.start, stroke.end) {
        if stroke.face > 0u {
            atomicMax(&owners[stroke.at], stroke.face);
        }
        if (batch.line_flags & TINTED_PASS) != 0u {
            // Numbers that are not negative are in the order of their bits.
            atomicMax(&owners[depth_place(stroke.at)], bitcast<u32>(stroke.depth));
        }
    }
}

// The place of the depth of a pixel's nearest line.
fn depth_place(pixel_at: u32) -> u32 {
    return u32((batch.row_end - batch.row_first) * frame.width) + pixel_at;
}

// True if layers tint the pass, and no line in the pixel is as near so far.
fn is_nearest(pixel_at: u32, depth: f32) -> bool {
    return (batch.line_flags & TINTED_PASS) != 0u && bitcast<u32>(depth) > atomicLoad(&owners[depth_place(pixel_at)]);
}

// True if only the pixels that points do not tell about get strokes.
fn only_stroked() -> bool {
    return has(HOLED) && (batch.line_flags & (HOLES | RIM_PASS)) == HOLES;
}

// True if rims alone are drawn, and mark the pixels that they reach.
fn is_rim_pass() -> bool {
    return has(HOLED) && (batch.line_flags & RIM_PASS) != 0u;
}

fn is_stroked(pixel_at: u32) -> bool {
    return (atomicLoad(&strokes[pixel_at * STROKE_WORDS + HOLE_WORD]) & STROKED) != 0u;
}

// False if no pixel of a share gets strokes.
fn gets_strokes(s: Segment, window: Window) -> bool {
    if !only_stroked() {
        return true;
    }
    for (var y = window.first; y <= window.rows.y; y += i32(batch.line_slices)) {
        let columns = columns_of(s, window.ends, y);
        for (var x = columns.x; x <= columns.y; x++) {
            if is_stroked(u32((y - batch.row_first) * frame.width + x)) {
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
