//! Filters of rows: PNG specification, 9.2 and 9.4.

use png::Filter;

/// Bytes that are compared with their neighbours at a time: 8 pixels.
const BLOCK: usize = 32;

/// Filters a row by Paeth, or else by Sub. Of each pixel, `CHANNELS` bytes are stored. `above` is the
/// row above, or zeros.
pub fn filter_row<const CHANNELS: usize>(filter: Filter, row: &[u8], above: &[u8], out: &mut [u8]) {
    if filter == Filter::Paeth { paeth::<CHANNELS>(row, above, out) } else { sub::<CHANNELS>(row, out) }
}

/// What each pixel differs by from the one left of it.
fn sub<const CHANNELS: usize>(row: &[u8], out: &mut [u8]) {
    let Some((first, pixels)) = row.split_first_chunk::<4>() else { return };
    let (first_out, out) = out.split_at_mut(CHANNELS);
    first_out.copy_from_slice(&first[..CHANNELS]);
    let blocks = pixels.as_chunks::<BLOCK>().0.iter().zip(row.as_chunks::<BLOCK>().0);
    let mut places = out.chunks_exact_mut(BLOCK / 4 * CHANNELS);
    for ((block, left), place) in blocks.zip(&mut places) {
        if block == left {
            place.fill(0);
        } else {
            store::<CHANNELS>(place, &difference(block, left));
        }
    }
    let done = pixels.len() / BLOCK * (BLOCK / 4);
    for i in done..pixels.len() / 4 {
        for k in 0..CHANNELS {
            out[i * CHANNELS + k] = pixels[4 * i + k].wrapping_sub(row[4 * i + k]);
        }
    }
}

/// The bytes of a block less those left of it, eight in a word: no byte borrows from the next one,
/// because its highest bit is set before and put right afterwards.
#[inline(always)]
fn difference(block: &[u8; BLOCK], left: &[u8; BLOCK]) -> [u8; BLOCK] {
    const HIGH: u64 = 0x8080_8080_8080_8080;
    let mut out = [0; BLOCK];
    let words = block.as_chunks::<8>().0.iter().zip(left.as_chunks::<8>().0);
    for ((word, left), out) in words.zip(out.as_chunks_mut::<8>().0) {
        let (word, left) = (u64::from_le_bytes(*word), u64::from_le_bytes(*left));
        let below = (word | HIGH).wrapping_sub(left & !HIGH);
        *out = (below ^ ((word ^ !left) & HIGH)).to_le_bytes();
    }
    out
}

/// What each pixel differs by from the nearest of its neighbours left, above and left above.
fn paeth<const CHANNELS: usize>(row: &[u8], above: &[u8], out: &mut [u8]) {
    // Left of the first pixel are zeros.
    let (first, first_above) = (first_block(row), first_block(above));
    let blocks = row.len() / BLOCK;
    for i in 0..blocks {
        let at = i * BLOCK;
        let (Some(block), Some(block_above)) = (row[at..].first_chunk(), above[at..].first_chunk()) else { break };
        let (left, above_left) = match at.checked_sub(4) {
            Some(at) => (row[at..].first_chunk().unwrap_or(&first), above[at..].first_chunk().unwrap_or(&first_above)),
            None => (&first, &first_above),
        };
        let out = &mut out[i * BLOCK / 4 * CHANNELS..][..BLOCK / 4 * CHANNELS];
        if block == block_above && left[..4] == above_left[..4] {
            out.fill(0);
            continue;
        }
        store::<CHANNELS>(out, &paeth_block(block, block_above, left, above_left));
    }
    let at = |row: &[u8], i: usize, k: usize| if i == 0 { 0 } else { row[4 * (i - 1) + k] };
    for i in blocks * BLOCK / 4..row.len() / 4 {
        for k in 0..CHANNELS {
            let value = predicted(at(row, i, k), above[4 * i + k], at(above, i, k));
            out[i * CHANNELS + k] = row[4 * i + k].wrapping_sub(value);
        }
    }
}

/// Filters the bytes of a block, given those left of it, above it, and left above it.
#[inline]
fn paeth_block(block: &[u8; BLOCK], above: &[u8; BLOCK], left: &[u8; BLOCK], above_left: &[u8; BLOCK]) -> [u8; BLOCK] {
    std::array::from_fn(|i| block[i].wrapping_sub(predicted(left[i], above[i], above_left[i])))
}

/// The bytes left of a row's first block, and its own but the last pixel.
fn first_block(row: &[u8]) -> [u8; BLOCK] {
    let mut block = [0; BLOCK];
    if let Some(start) = row.first_chunk::<{ BLOCK - 4 }>() {
        block[4..].copy_from_slice(start);
    }
    block
}

/// Stores the filtered bytes of a block.
#[inline(always)]
fn store<const CHANNELS: usize>(out: &mut [u8], block: &[u8; BLOCK]) {
    if CHANNELS == 3 { out.copy_from_slice(&without_alpha(block)) } else { out.copy_from_slice(block) }
}

/// The first three of each four bytes, in whole words: byte by byte takes twice as long as the
/// filter.
#[inline(always)]
fn without_alpha(block: &[u8; BLOCK]) -> [u8; BLOCK / 4 * 3] {
    // Two pixels in six bytes of each.
    let mut pairs = [0; BLOCK / 8];
    for (place, pair) in pairs.iter_mut().zip(block.as_chunks::<8>().0) {
        let pair = u64::from_le_bytes(*pair);
        *place = (pair & 0xff_ffff) | ((pair >> 8) & 0xffff_ff00_0000);
    }
    let [a, b, c, d] = pairs;
    let words = [a | b << 48, b >> 16 | c << 32, c >> 32 | d << 16];
    let mut out = [0; BLOCK / 4 * 3];
    for (place, word) in out.as_chunks_mut::<8>().0.iter_mut().zip(words) {
        *place = word.to_le_bytes();
    }
    out
}

/// Of the three neighbours, the one that is nearest to `left + above - above_left`; the first one
/// of equals. Bytes and masks of bytes alone, so that a vector holds many.
#[inline(always)]
fn predicted(left: u8, above: u8, above_left: u8) -> u8 {
    let mask = |is: bool| if is { 255_u8 } else { 0 };
    let (to_left, to_above) = (above.abs_diff(above_left), left.abs_diff(above_left));
    let sides_differ = mask(left < above_left) ^ mask(above < above_left);
    // With both neighbours on one side of the one above left, the distances add up: never nearest.
    let to_above_left = to_left.abs_diff(to_above) | !sides_differ;
    let is_left = mask(to_left <= to_above.min(to_above_left));
    let is_above = mask(to_above <= to_above_left);
    (left & is_left) | (((above & is_above) | (above_left & !is_above)) & !is_left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prediction_is_that_of_the_specification() {
        for i in 0..1_u32 << 24 {
            let [a, b, c, _] = i.to_le_bytes();
            let [left, above, above_left] = [a, b, c].map(i32::from);
            let p = left + above - above_left;
            let [to_left, to_above, to_above_left] = [left, above, above_left].map(|v| (p - v).abs());
            let nearest = if to_left <= to_above && to_left <= to_above_left {
                a
            } else if to_above <= to_above_left {
                b
            } else {
                c
            };
            assert_eq!(predicted(a, b, c), nearest, "{a} {b} {c}");
        }
    }

    /// A filtered row, byte by byte.
    fn expected(filter: Filter, row: &[u8], above: &[u8], channels: usize) -> Vec<u8> {
        let left = |row: &[u8], i: usize| if i < 4 { 0 } else { row[i - 4] };
        let prediction = |i: usize| match filter {
            Filter::Paeth => predicted(left(row, i), above[i], left(above, i)),
            _ => left(row, i),
        };
        (0..row.len()).filter(|i| i % 4 < channels).map(|i| row[i].wrapping_sub(prediction(i))).collect()
    }

    #[test]
    fn equal_pixels_filter_to_zeros_without_being_looked_at() {
        let mut rows = 0;
        for width_px in [1, 7, 8, 9, 16, 17, 40] {
            // Rows of runs, and rows of one byte after the other.
            for above in [|i: usize| (i * 7 % 11) as u8, |i: usize| (i % 4 + i / 60 * 9) as u8] {
                let above: Vec<u8> = (0..width_px * 4).map(above).collect();
                for changed in 0..width_px * 4 {
                    let mut row = above.clone();
                    row[changed] ^= 5;
                    for filter in [Filter::Sub, Filter::Paeth] {
                        let mut out = [vec![9; 3 * width_px], vec![9; 4 * width_px]];
                        filter_row::<3>(filter, &row, &above, &mut out[0]);
                        filter_row::<4>(filter, &row, &above, &mut out[1]);
                        let expected = [3, 4].map(|channels| expected(filter, &row, &above, channels));
                        assert_eq!(out, expected, "{width_px} {changed} {filter:?}");
                        rows += 1;
                    }
                }
            }
        }
        assert_eq!(rows, (1 + 7 + 8 + 9 + 16 + 17 + 40) * 4 * 2 * 2);
    }
}
