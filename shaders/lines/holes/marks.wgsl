// The marking of the pixels around a given one (stage lines). In a marked pixel, the summed areas of insets (parts
// of faces between the lines) do not tell how much the lines leave free, so its coverage is found in another way.
// Shared by holes.wgsl and tips.wgsl, which declare the buffer `strokes`.
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
