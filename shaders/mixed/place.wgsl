// Stage mixed: the buffer of a band's mixed pixels. The CPU's is MixedPixels in src/render/backend/cpu/mixed/find/pixels.rs.
//
// Its words:
// - their number; 1 if there was no room for all lists; and the numbers of items of lists and of parts
// - by pixel of the band: 1 more than its number among them, or 0; with FEW where few points are enough
// - by number: the pixel, with FEW likewise
// - by pixel, and one more on each side: the places where colours break off
// - by number: the first item of the pixel's list of triangles, or LIST_END
// - by number: the first of the pixel's parts, times PARTS_OF_PIXEL, and how many they are
// - by number, where lines are drawn: the points that see something, as stroke.wgsl numbers them; none where all do, or
//   few points were enough
//
// Uses: one_job.wgsl (batch, frame).

const HEAD_WORDS: u32 = 4u;

// Indices of words of the head.
const OVERFLOW: u32 = 1u;
const ITEM_COUNT: u32 = 2u;
const PART_COUNT: u32 = 3u;

// The end of a list.
const LIST_END: u32 = 0xFFFFFFFFu;

// More than the parts of a pixel.
const PARTS_OF_PIXEL: u32 = 512u;

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

// Index of the word that has the first item of the list of the pixel of this number.
fn list_at(number: u32) -> u32 {
    let around = u32((frame.width + 2) * (batch.row_end - batch.row_first + 2));
    return HEAD_WORDS + 2u * band_pixels() + around + number;
}

// Index of the word that has the parts of the pixel of this number.
fn parts_at(number: u32) -> u32 {
    return list_at(band_pixels() + number);
}

// Index of the first word of the points of the pixel of this number.
fn border_at(number: u32) -> u32 {
    return list_at(2u * band_pixels() + BORDER_WORDS * number);
}

// Index of the first vector of an item in the buffer of lists.
fn item_at(i: u32) -> u32 {
    return 4u * i;
}

// The same of a part: parts follow the items.
fn part_at(i: u32) -> u32 {
    return item_at(batch.list_capacity) + 2u * i;
}

// Index of the word with the breaks of a pixel, of the band or beside it.
fn breaks_at(pixel: vec2<i32>) -> u32 {
    let at = (pixel.y - batch.row_first + 1) * (frame.width + 2) + pixel.x + 1;
    return HEAD_WORDS + 2u * band_pixels() + u32(at);
}
