// Access to the visibility buffer for stage lines: the nearest triangle at a sample of a pixel, and its depth. The
// CPU's counterpart is SampleBand in src/render/backend/cpu/geometry/samples.rs.
//
// Uses: common.wgsl (sample_count), one_job.wgsl (batch, frame), lines/coverage.wgsl or
// lines/edge.wgsl or lines/holes/holes.wgsl or lines/holes/tips.wgsl (samples).

const NOTHING: u32 = 0xFFFFFFFFu;

// Id and depth bits of a sample.
fn seen_at(pixel: vec2<i32>, sample: u32) -> vec2<u32> {
    if !has_samples(pixel) {
        return vec2(NOTHING, 0u);
    }
    let row = (pixel.y - batch.seen_first) * (frame.width + 2 * batch.seen_margin);
    let word = samples[u32(row + pixel.x + batch.seen_margin) * u32(sample_count()) + sample];
    return vec2(select(~word.x, NOTHING, word.y == 0u), word.y);
}

// True if the visibility buffer holds a pixel of the picture or beyond.
fn has_samples(pixel: vec2<i32>) -> bool {
    return all(pixel >= vec2(-batch.seen_margin, batch.seen_first))
        && all(pixel < vec2(frame.width + batch.seen_margin, batch.seen_end));
}
