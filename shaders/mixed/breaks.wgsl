// Stage mixed, per pixel of a band and one more on each side: where colours break off from sample to sample. Twin of
// find_breaks in src/backend/cpu/mixed/find.rs.

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;

// From the pixel's first sample to its others, one after the other.
const BREAKS_OWN: u32 = 1u;
// From the first sample of the pixel on the left to this one's.
const BREAKS_LEFT: u32 = 2u;
// The same from the pixel above.
const BREAKS_UPPER: u32 = 4u;
// From the bits above to those of the same places where colours break off more than slightly.
const BREAKS_HARD: u32 = 4u;

@compute @workgroup_size(WORKGROUP)
fn breaks(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let columns = frame.width + 2;
    let pixel = vec2(i32(i) % columns - 1, batch.row_first - 1 + i32(i) / columns);
    let first = id_at(pixel, 0);
    var found = 0u;
    if is_seen(pixel) {
        var before = first;
        for (var s = 1; s < sample_count(); s++) {
            let id = id_at(pixel, s);
            found |= breaks_of(step_between(before, id), BREAKS_OWN);
            before = id;
        }
    }
    found |= breaks_of(step_between(id_at(pixel - vec2(1, 0), 0), first), BREAKS_LEFT);
    found |= breaks_of(step_between(id_at(pixel - vec2(0, 1), 0), first), BREAKS_UPPER);
    mixed[breaks_at(pixel)] = found;
}

// The bits of a step, given that of its place.
fn breaks_of(step: u32, place: u32) -> u32 {
    if step == STEP_NONE {
        return 0u;
    }
    return select(place, place | (place << BREAKS_HARD), step == STEP_HARD);
}

// True if the visibility buffer has the pixel.
fn is_seen(pixel: vec2<i32>) -> bool {
    return pixel.x >= -batch.seen_margin && pixel.x < frame.width + batch.seen_margin && pixel.y >= batch.seen_first
        && pixel.y < batch.seen_end;
}

// The triangle that sample s of a pixel shows.
fn id_at(pixel: vec2<i32>, s: i32) -> u32 {
    if !is_seen(pixel) {
        return NOTHING;
    }
    let row = (pixel.y - batch.seen_first) * (frame.width + 2 * batch.seen_margin);
    let word = samples[(row + pixel.x + batch.seen_margin) * sample_count() + s];
    return select(~word.x, NOTHING, word.y == 0u);
}
