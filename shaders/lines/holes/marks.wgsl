// Stage lines, per pixel: marks the pixels in which the summed areas of insets do not tell how much
// the lines leave free. Shared by holes.wgsl and tips.wgsl, which declare the buffer `strokes`.
//
// Uses: one_job.wgsl (batch, frame), lines/holes/holes.wgsl or lines/holes/tips.wgsl (strokes),
// lines/stroke_words.wgsl (HOLE_WORD, STROKE_WORDS).

// Marks the shown pixels up to `reach` columns and rows from one.
fn mark_around(pixel: vec2<i32>, reach: i32, marks: u32) {
    let low = max(pixel - reach, vec2(0, batch.row_first));
    let high = min(pixel + reach, vec2(frame.width, batch.row_end) - 1);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let at = u32((y - batch.row_first) * frame.width + x);
            atomicOr(&strokes[at * STROKE_WORDS + HOLE_WORD], marks);
        }
    }
}
