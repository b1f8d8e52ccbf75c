// The search for tips (stage lines): corners that are visible in front of other faces although no sample of their
// pixel shows their own triangle, such as the point of a spike. holes.wgsl finds faces by their samples, and so
// may miss these. This kernel marks the pixels around a tip, and edge.wgsl draws the lines in them edge by edge.
// Twin of src/render/backend/cpu/lines/holes/tips.rs.
//
// Uses: common.wgsl (mul_wide, OUTSIDE, rn, sample_count, sub_wide, Vertex, WORKGROUP),
// one_job.wgsl (batch, frame), geometry/culling.wgsl (passes_culling), geometry/triangle.wgsl
// (area_of, is_negative, is_zero, setup_of), lines/holes/inset.wgsl (inset_of),
// lines/holes/marks.wgsl (mark_around), lines/seen.wgsl (has_samples, NOTHING, seen_at),
// lines/stroke_words.wgsl (MARKED, STROKED).

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;

// A corner is in front of a face if it is nearer than the face's plane is anywhere up to this far away, across and down,
// 1/256 px.
const TIP_SLACK: f32 = 2.0;

// A vertex's relation to a face.
// Not in front of its plane, or not comparable.
const TIP_BEHIND: u32 = 0u;
// In front of its plane, and on screen not inside the face.
const TIP_BESIDE: u32 = 1u;
// In front of its plane, and on screen inside the face.
const TIP_INSIDE: u32 = 2u;

@compute @workgroup_size(WORKGROUP)
fn tips(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let t = batch.first + i;
    let corners = array<Vertex, 3>(corner_of(t, 0u), corner_of(t, 1u), corner_of(t, 2u));
    if corners[0].x == OUTSIDE || corners[1].x == OUTSIDE || corners[2].x == OUTSIDE {
        return;
    }
    let places = array<vec2<i32>, 3>(place_of(corners[0]), place_of(corners[1]), place_of(corners[2]));
    let area = area_of(corners[0], corners[1], corners[2]);
    if !passes_culling(t, area) || !inset_of(places[0], places[1], places[2]).is_open {
        return;
    }
    // Pixels beyond the shown ones may mark one of them.
    let reach = i32(0.5 * batch.line_width) + 1;
    let first = vec2(-reach, batch.row_first - reach);
    let end = vec2(frame.width, batch.row_end) + reach;
    for (var k = 0; k < 3; k++) {
        let pixel = (places[k] + vec2(frame.width, frame.height) * 128) >> vec2(8u);
        let is_looked_at = all(pixel >= first) && all(pixel < end) && has_samples(pixel);
        if is_looked_at && is_tip(t, corners[k], pixel) {
            mark_around(pixel, reach, MARKED | STROKED);
        }
    }
}

fn corner_of(t: u32, k: u32) -> Vertex {
    return vertices[triangles[3u * t + k]];
}

fn place_of(corner: Vertex) -> vec2<i32> {
    return vec2(corner.x, corner.y);
}

// True if the corner of a face is in front of all faces that its pixel shows, and on screen inside one of them.
fn is_tip(t: u32, corner: Vertex, pixel: vec2<i32>) -> bool {
    for (var s = 0; s < sample_count(); s++) {
        if seen_at(pixel, u32(s)).x == t {
            return false;
        }
    }
    if !is_before_some_around(corner, pixel) {
        return false;
    }
    var last = NOTHING;
    var is_inside_any = false;
    for (var s = 0; s < sample_count(); s++) {
        let seen = seen_at(pixel, u32(s)).x;
        if seen != last || seen == NOTHING {
            let relation = relation_to(seen, corner);
            if relation == TIP_BEHIND {
                return false;
            }
            is_inside_any = is_inside_any || relation == TIP_INSIDE;
        }
        last = seen;
    }
    return is_inside_any;
}

// True if a vertex is not behind all samples of its pixel and the eight around it.
fn is_before_some_around(vertex: Vertex, pixel: vec2<i32>) -> bool {
    for (var n = 0; n < 9 * sample_count(); n++) {
        let place = n / sample_count();
        let beside = pixel + vec2(place % 3, place / 3) - 1;
        if has_samples(beside) && bitcast<f32>(seen_at(beside, u32(n % sample_count())).y) <= vertex.z {
            return true;
        }
    }
    return false;
}

// A vertex's relation to a face.
fn relation_to(face: u32, vertex: Vertex) -> u32 {
    if face >= frame.triangle_count {
        return TIP_BEHIND;
    }
    let a = corner_of(face, 0u);
    let b = corner_of(face, 1u);
    let c = corner_of(face, 2u);
    let at = place_of(vertex);
    if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE
        || all(place_of(a) == at) || all(place_of(b) == at) || all(place_of(c) == at) {
        return TIP_BEHIND;
    }
    let area = area_of(a, b, c);
    if is_zero(area) {
        return TIP_BEHIND;
    }
    let setup = setup_of(a, b, c, area);
    let plane = rn(setup.depth.x + rn(setup.depth.y * f32(vertex.x - setup.x.x)))
        + rn(setup.depth.z * f32(vertex.y - setup.y.x));
    if vertex.z <= rn(plane) + rn(TIP_SLACK * (abs(setup.depth.y) + abs(setup.depth.z))) {
        return TIP_BEHIND;
    }
    // On the inner hand of each side.
    for (var k = 0; k < 3; k++) {
        let next = (k + 1) % 3;
        let along = vec2(setup.x[next] - setup.x[k], setup.y[next] - setup.y[k]);
        let from_start = vec2(vertex.x - setup.x[k], vertex.y - setup.y[k]);
        let side = sub_wide(mul_wide(along.x, from_start.y), mul_wide(along.y, from_start.x));
        if is_zero(side) || is_negative(side) {
            return TIP_BESIDE;
        }
    }
    return TIP_INSIDE;
}
