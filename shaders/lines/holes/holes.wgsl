// The area of each pixel that lines leave free (stage lines), for passes that draw all edges of a surface and satisfy
// DrawPlan::has_holes_under in src/render/plan/lines/mod.rs. It is the sum of the insets of the faces there: an inset
// is the part of a face that is at least half a line's width from all its sides. The kernel marks pixels in which
// this sum is not right (tips.wgsl and edge.wgsl mark others). Their coverage is found from points (free_points.wgsl)
// or by drawing edge by edge (edge.wgsl). Twin of src/render/backend/cpu/lines/holes/mod.rs, which explains insets,
// marks and points.
//
// The CPU goes from face to face. Here a thread has a pixel, so that no two threads add to the same sum. It goes
// through the faces that are visible in the pixel and in the eight around it, because an inset may reach into a
// pixel none of whose samples shows its face.
//
// Uses: common.wgsl (LIT_PASS, OUTSIDE, pixel_corner, rn, rn2, sample_count, sample_offset, Vertex,
// WORKGROUP), one_job.wgsl (batch, frame), geometry/triangle.wgsl (area_of, is_zero, setup_of),
// lines/holes/inset.wgsl (Inset, inset_area, inset_contains, inset_of), lines/holes/marks.wgsl
// (mark_around), lines/seen.wgsl (has_samples, NOTHING, seen_at), lines/stroke_words.wgsl
// (HOLE_WORD, MARKED, point_marks, STROKE_WORDS, STROKED).

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

// Faces pass through each other where their planes meet within this distance of a sample, pixels.
const CROSSING_PX: f32 = 6.0;

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
    // Does a sample of the pixel show nothing? Does one show a hull, or one close by a clipped face?
    var shows_nothing = false;
    var is_odd = false;
    var shows_face = false;
    var last = NOTHING;
    for (var n = 0u; n < 9u * count; n++) {
        let place = n / count;
        let id = seen_at(pixel + vec2(i32(place % 3u), i32(place / 3u)) - 1, n % count).x;
        if id >= frame.triangle_count {
            shows_nothing = shows_nothing || (place == 4u && id == NOTHING);
            is_odd = is_odd || (place == 4u && id != NOTHING);
            continue;
        }
        shows_face = shows_face || place == 4u;
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
    var marks = 0u;
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
            marks |= marks_of_hidden(inset, id, pixel);
            free += inset_area(inset, pixel);
        }
    }
    if marks != 0u {
        mark_around(pixel, reach, marks);
    }
    if is_shown {
        let at = u32((pixel.y - batch.row_first) * frame.width + pixel.x);
        atomicAdd(&strokes[at * STROKE_WORDS + HOLE_WORD], free);
        if is_odd {
            atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], MARKED | STROKED);
        } else {
            if shows_nothing {
                atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], point_marks());
            }
            if (batch.line_flags & LIT_PASS) != 0u && shows_face {
                // Its light is that of its samples; any face will do.
                atomicMax(&owners[at], 1u);
            }
        }
    }
}

// Marks for the pixels around one: 0 unless something else than the face shows in a sample of the pixel
// that lies well inside it.
fn marks_of_hidden(inset: Inset, id: u32, pixel: vec2<i32>) -> u32 {
    let corner = pixel_corner(pixel);
    var marks = 0u;
    for (var s = 0; s < sample_count(); s++) {
        let seen = seen_at(pixel, u32(s));
        let at = corner + sample_offset(s);
        if seen.x != id && inset_contains(inset, vec2<f32>(at)) {
            let is_crossing = may_cross(id, seen.x, at, bitcast<f32>(seen.y));
            marks |= select(point_marks(), MARKED | STROKED, is_crossing);
        }
    }
    return marks;
}

// False if the planes of a face and of one that hides it at a sample, where it has this depth, meet far
// from there.
fn may_cross(behind: u32, before: u32, at: vec2<i32>, depth: f32) -> bool {
    if before >= frame.triangle_count {
        return true;
    }
    let p = array<Vertex, 3>(
        vertices[triangles[3u * behind]],
        vertices[triangles[3u * behind + 1u]],
        vertices[triangles[3u * behind + 2u]],
    );
    let q = array<Vertex, 3>(
        vertices[triangles[3u * before]],
        vertices[triangles[3u * before + 1u]],
        vertices[triangles[3u * before + 2u]],
    );
    if q[0].x == OUTSIDE || q[1].x == OUTSIDE || q[2].x == OUTSIDE {
        return true;
    }
    let areas = array<vec2<u32>, 2>(area_of(p[0], p[1], p[2]), area_of(q[0], q[1], q[2]));
    if is_zero(areas[0]) || is_zero(areas[1]) {
        return true;
    }
    let far = setup_of(p[0], p[1], p[2], areas[0]);
    let near = setup_of(q[0], q[1], q[2], areas[1]);
    let z = rn(far.depth.x + rn(far.depth.y * f32(at.x - far.x.x))) + rn(far.depth.z * f32(at.y - far.y.x));
    // Squares of depths may be too small for f32.
    let scale = 8388608.0;
    let gap = rn((depth - z) * scale);
    let slope = rn2(rn2(vec2(far.depth.y - near.depth.y, far.depth.z - near.depth.z) * scale) * (CROSSING_PX * 256.0));
    return rn(gap * gap) <= rn(slope.x * slope.x) + rn(slope.y * slope.y);
}
