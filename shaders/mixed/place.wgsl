// Stage mixed: the buffer of a band's mixed pixels. The CPU's is MixedPixels in src/backend/cpu/mixed/find/mod.rs.
//
// Its words:
// - their number, and three unused words
// - by pixel of the band: 1 more than its number among them, or 0; with FEW where few points are enough
// - by number: the pixel, with FEW likewise
// - by pixel, and one more on each side: the places where colours break off
// - by number, where lines are drawn: the points that see something, as stroke.wgsl numbers them; none where all do, or few
//   points were enough

const HEAD_WORDS: u32 = 4u;

// Words of a pixel's points.
const BORDER_WORDS: u32 = 8u;

// Marks pixels for which few points are enough.
const FEW: u32 = 0x80000000u;

fn band_pixels() -> u32 {
    return u32(frame.width * (batch.row_end - batch.row_first));
}

// Index of the word that has a pixel's number.
fn number_at(pixel: u32) -> u32 {
    return HEAD_WORDS + pixel;
}

// Index of the word that has the pixel of this number.
fn pixel_at(number: u32) -> u32 {
    return HEAD_WORDS + band_pixels() + number;
}

// Index of the first word of the points of the pixel of this number.
fn border_at(number: u32) -> u32 {
    let around = u32((frame.width + 2) * (batch.row_end - batch.row_first + 2));
    return HEAD_WORDS + 2u * band_pixels() + around + BORDER_WORDS * number;
}

// Index of the word with the breaks of a pixel, of the band or beside it.
fn breaks_at(pixel: vec2<i32>) -> u32 {
    let at = (pixel.y - batch.row_first + 1) * (frame.width + 2) + pixel.x + 1;
    return HEAD_WORDS + 2u * band_pixels() + u32(at);
}
