// Stage lines, per pixel: what the lines along all edges of a surface leave free of it. Twin of
// src/backend/cpu/lines/holes/mod.rs.
//
// The CPU goes from face to face. A thread here looks for the faces that are seen in its pixel and
// the eight around it, so that no two threads add to the same sum.

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Per pixel, the face that lights the pass's lines, plus 1.
@group(1) @binding(11) var<storage, read_write> owners: array<atomic<u32>>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<atomic<u32>>;

// Faces in nine pixels, at most: one for each sample.
const FACES_MAX: u32 = 144u;

@compute @workgroup_size(WORKGROUP)
fn holes(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = i32(gid.x + gid.y * groups.x * WORKGROUP);
    // What is hidden in part beyond the shown pixels may mark one of them.
    let reach = i32(0.5 * batch.line_width) + 1;
    let columns = frame.width + 2 * reach;
    let pixel = vec2(i % columns - reach, batch.row_first - reach + i / columns);
    if pixel.y >= batch.row_end + reach || !has_samples(pixel) {
        return;
    }
    let is_shown = pixel.x >= 0 && pixel.x < frame.width && pixel.y >= batch.row_first && pixel.y < batch.row_end;
    let count = u32(sample_count());
    var faces: array<u32, FACES_MAX>;
    var face_count = 0u;
    // True if a sample of the pixel shows no face of the surface.
    var is_odd = false;
    var last = NOTHING;
    for (var n = 0u; n < 9u * count; n++) {
        let place = n / count;
        let id = seen_at(pixel + vec2(i32(place % 3u), i32(place / 3u)) - 1, n % count).x;
        if id >= frame.triangle_count {
            is_odd = is_odd || place == 4u;
            continue;
        }
        if id == last {
            continue;
        }
        last = id;
        var k = 0u;
        while k < face_count && faces[k] != id {
            k++;
        }
        if k == face_count {
            faces[k] = id;
            face_count++;
        }
    }
    var free = 0u;
    var is_hidden = false;
    for (var k = 0u; k < face_count; k++) {
        let id = faces[k];
        let a = vertices[triangles[3u * id]];
        let b = vertices[triangles[3u * id + 1u]];
        let c = vertices[triangles[3u * id + 2u]];
        if a.x == OUTSIDE || b.x == OUTSIDE || c.x == OUTSIDE {
            is_odd = true;
            continue;
        }
        let inset = inset_of(vec2(a.x, a.y), vec2(b.x, b.y), vec2(c.x, c.y));
        if inset.is_open {
            is_hidden = is_hidden || hides_part(inset, id, pixel);
            free += inset_area(inset, pixel);
        }
    }
    if is_hidden {
        mark_around(pixel, reach);
    }
    if is_shown {
        let at = u32((pixel.y - batch.row_first) * frame.width + pixel.x);
        atomicAdd(&strokes[at * STROKE_WORDS + HOLE_WORD], free);
        if is_odd {
            atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], MARKED);
        } else if (batch.line_flags & LIT_PASS) != 0u && free < u32(HOLE_UNIT) {
            // Its light is that of its samples; any face will do.
            atomicMax(&owners[at], 1u);
        }
    }
}

// True if something else than the face shows in a sample of the pixel that lies well inside it.
fn hides_part(inset: Inset, id: u32, pixel: vec2<i32>) -> bool {
    let corner = pixel_corner(pixel);
    var is_hidden = false;
    for (var s = 0; s < sample_count(); s++) {
        if seen_at(pixel, u32(s)).x != id {
            is_hidden = is_hidden || inset_contains(inset, vec2<f32>(corner + sample_offset(s)));
        }
    }
    return is_hidden;
}

// Marks the shown pixels up to so far away.
fn mark_around(pixel: vec2<i32>, reach: i32) {
    let low = max(pixel - reach, vec2(0, batch.row_first));
    let high = min(pixel + reach, vec2(frame.width, batch.row_end) - 1);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let at = u32((y - batch.row_first) * frame.width + x);
            atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], MARKED);
        }
    }
}
