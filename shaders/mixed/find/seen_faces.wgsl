// Access to the visibility buffer for the search for mixed pixels, which are drawn again from more points because
// different colours meet there (stage mixed): the triangle at a sample, and its depth. Also the bits that note
// where in a pixel there are colour breaks, places where the colour differs clearly.
//
// Uses: common.wgsl (sample_count), one_job.wgsl (batch, frame), mixed/find/look.wgsl (STEP_HARD,
// STEP_NONE), surface/hull.wgsl (NOTHING).

// Low word: complement of the id. High word: depth.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;

// From the pixel's first sample to its others, one after the other.
const BREAKS_OWN: u32 = 1u;
// From the rightmost sample of the pixel on the left to the leftmost of this one.
const BREAKS_LEFT: u32 = 2u;
// From the lowest sample of the pixel above to the topmost of this one.
const BREAKS_UPPER: u32 = 4u;
// To a thin triangle in the pixel that no sample need see.
const BREAKS_THIN: u32 = 8u;
// From the bits above to those of the same places where colours break off more than slightly.
const BREAKS_HARD: u32 = 4u;

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
    let word = sample_at(pixel, s);
    return select(~word.x, NOTHING, word.y == 0u);
}

// The depth of sample s of a pixel of the visibility buffer.
fn depth_of(pixel: vec2<i32>, s: i32) -> f32 {
    return bitcast<f32>(sample_at(pixel, s).y);
}

fn sample_at(pixel: vec2<i32>, s: i32) -> vec2<u32> {
    let row = (pixel.y - batch.seen_first) * (frame.width + 2 * batch.seen_margin);
    return samples[(row + pixel.x + batch.seen_margin) * sample_count() + s];
}
