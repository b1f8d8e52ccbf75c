// The layout of the buffer `mixed` (stage mixed). It says which pixels of a band of rows are mixed, and what is
// known of each. Mixed pixels are drawn again, from 64 or 256 points each, because different colours meet there.
// The CPU's counterpart is MixedPixels in src/render/backend/cpu/mixed/find/pixels.rs.
//
// Mixed pixels are numbered from 0. The words of the buffer are, one group after the other:
// - 4 words: the number of mixed pixels; 1 if lists or parts overflowed (no room, or a list too long), else 0; the
//   number of items of all lists; the number of all parts
// - for each pixel of the band: 0 if it is not mixed, else 1 more than its number; with the bit FEW where 64 of
//   its 256 points are enough
// - for each mixed pixel, by number: its index in the band, with FEW likewise
// - for each pixel of the band, and of a border of one pixel around it: bits for its colour breaks, places where
//   the colour differs clearly (find/seen_faces.wgsl)
// - for each mixed pixel: the first item of its list of triangles, or LIST_END
// - for each mixed pixel: its first part (a triangle that is visible at some of its points), times PARTS_OF_PIXEL,
//   plus the number of its parts
// - for each mixed pixel, where lines are drawn: a bit for each point at which something is visible, in the order
//   in which lines/stroke.wgsl numbers points; no bits if something is visible at all points, or if 64 points were
//   enough
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
