//! PNG in two ways: quickly for a picture that one client waits for, and small for one that is
//! stored.
//!
//! Quickly means one filter for the whole picture, Paeth, and Huffman codes that are not fitted to
//! it. What Paeth leaves of a rendering is mostly runs of zeros, so trying more filters pays little.
//! A row that equals the one above it, as in background and flat faces, is written as zeros without
//! computing anything.

use fdeflate::Compressor;
use png::{BitDepth, BlendOp, ColorType, DeflateCompression, Encoder, Filter, chunk};

use super::{EncodeError, drop_alpha};
use crate::image::Image;
use crate::limits::Deadline;

/// The effort from which the file's size counts for more than time.
const SMALL_EFFORT_MIN: u32 = 4;

/// Bytes that are compared with the row above at a time: 8 pixels.
const BLOCK: usize = 32;

/// Rows compressed between two polls of the deadline.
const POLL_ROWS: usize = 64;

/// Encodes a picture, without alpha where every pixel is opaque. `effort` is from 0 to 9.
pub fn encode(image: &Image, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    if effort < SMALL_EFFORT_MIN { quick(image) } else { small(image, effort, deadline) }
}

fn quick(image: &Image) -> Result<Vec<u8>, EncodeError> {
    let (color, data) = if image.is_opaque() {
        (ColorType::Rgb, compressed::<3>(image)?)
    } else {
        (ColorType::Rgba, compressed::<4>(image)?)
    };
    let mut bytes = Vec::with_capacity(data.len() + 128);
    let mut writer = encoder(&mut bytes, image, color).write_header()?;
    writer.write_chunk(chunk::IDAT, &data)?;
    writer.finish()?;
    Ok(bytes)
}

/// The smaller of two files: flat faces in few colours repeat themselves best as they are, shaded
/// ones best after filters.
fn small(image: &Image, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    let rgb = image.is_opaque().then(|| drop_alpha(&image.rgba));
    let (color, pixels) = match &rgb {
        Some(rgb) => (ColorType::Rgb, rgb),
        None => (ColorType::Rgba, &image.rgba),
    };
    let by = |filter| filtered_by(filter, image, color, pixels, effort, deadline);
    let (plain, adaptive) = rayon::join(|| by(Filter::NoFilter), || by(Filter::Adaptive));
    let (plain, adaptive) = (plain?, adaptive?);
    Ok(if adaptive.len() < plain.len() { adaptive } else { plain })
}

fn filtered_by(
    filter: Filter,
    image: &Image,
    color: ColorType,
    pixels: &[u8],
    effort: u32,
    deadline: &Deadline,
) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let mut encoder = encoder(&mut bytes, image, color);
    encoder.set_filter(filter);
    // The levels of zlib, which also end at 9.
    encoder.set_deflate_compression(DeflateCompression::Level(effort.min(9) as u8));
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer()?;
    for rows in pixels.chunks(image.width_px as usize * color.samples() * POLL_ROWS) {
        deadline.check()?;
        std::io::Write::write_all(&mut stream, rows)?;
    }
    stream.finish()?;
    writer.finish()?;
    Ok(bytes)
}

/// Encodes the frames of an animation (APNG), as [`super::encode_animation`] has them.
pub fn encode_animation(
    frames: &Image,
    count: u32,
    delay_ms: u32,
    effort: u32,
    deadline: &Deadline,
) -> Result<Vec<u8>, EncodeError> {
    let (_, height_px) = super::frame(frames, 0, count);
    let color = if frames.is_opaque() { ColorType::Rgb } else { ColorType::Rgba };
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, frames.width_px, height_px);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_animated(count, 0)?;
    encoder.set_frame_delay(delay_ms.min(60_000) as u16, 1000)?;
    // Each frame replaces the one before, also where it is transparent.
    encoder.set_blend_op(BlendOp::Source)?;
    if effort < SMALL_EFFORT_MIN {
        encoder.set_filter(Filter::Paeth);
        encoder.set_deflate_compression(DeflateCompression::FdeflateUltraFast);
    } else {
        encoder.set_filter(Filter::Adaptive);
        encoder.set_deflate_compression(DeflateCompression::Level(effort.min(9) as u8));
    }
    let mut writer = encoder.write_header()?;
    for index in 0..count {
        deadline.check()?;
        let (rgba, _) = super::frame(frames, index, count);
        match color {
            ColorType::Rgb => writer.write_image_data(&drop_alpha(rgba))?,
            _ => writer.write_image_data(rgba)?,
        }
    }
    writer.finish()?;
    Ok(bytes)
}

fn encoder<'a>(bytes: &'a mut Vec<u8>, image: &Image, color: ColorType) -> Encoder<'a, &'a mut Vec<u8>> {
    let mut encoder = Encoder::new(bytes, image.width_px, image.height_px);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder
}

/// The filtered rows as a zlib stream. Of each pixel, `CHANNELS` bytes are stored.
fn compressed<const CHANNELS: usize>(image: &Image) -> Result<Vec<u8>, EncodeError> {
    let row_len = image.width_px as usize * 4;
    let mut compressor = Compressor::new(Vec::with_capacity(image.rgba.len() / 8))?;
    let mut line = vec![0; 1 + image.width_px as usize * CHANNELS];
    line[0] = Filter::Paeth as u8;
    let mut above = &vec![0; row_len][..];
    for row in image.rgba.chunks_exact(row_len) {
        filter_row::<CHANNELS>(row, above, &mut line[1..]);
        compressor.write_data(&line)?;
        above = row;
    }
    Ok(compressor.finish()?)
}

/// Filters a row by Paeth: PNG specification, 9.2 and 9.4.
fn filter_row<const CHANNELS: usize>(row: &[u8], above: &[u8], out: &mut [u8]) {
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
        let residuals = filter_block(block, block_above, left, above_left);
        if CHANNELS == 3 { out.copy_from_slice(&without_alpha(&residuals)) } else { out.copy_from_slice(&residuals) }
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
fn filter_block(block: &[u8; BLOCK], above: &[u8; BLOCK], left: &[u8; BLOCK], above_left: &[u8; BLOCK]) -> [u8; BLOCK] {
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

/// The first three of each four bytes, in whole words: byte by byte takes twice as long as the
/// filter.
#[inline]
fn without_alpha(block: &[u8; BLOCK]) -> [u8; BLOCK / 4 * 3] {
    let pairs = block.as_chunks::<8>().0.iter().map(|pair| {
        let pair = u64::from_le_bytes(*pair);
        (pair & 0xff_ffff) | ((pair >> 8) & 0xffff_ff00_0000)
    });
    let mut out = [0; BLOCK / 4 * 3];
    for (out, pair) in out.as_chunks_mut::<6>().0.iter_mut().zip(pairs) {
        out.copy_from_slice(&pair.to_le_bytes()[..6]);
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

    /// The filtered rows of so many channels, without the shortcut for equal pixels.
    fn lines(image: &Image, channels: usize) -> Vec<u8> {
        let row_len = image.width_px as usize * 4;
        let at = |x: i64, y: i64| if x < 0 || y < 0 { 0 } else { image.rgba[y as usize * row_len + x as usize] };
        let mut lines = Vec::new();
        for y in 0..i64::from(image.height_px) {
            lines.push(4);
            lines.extend(
                (0..row_len as i64)
                    .filter(|x| (*x as usize) % 4 < channels)
                    .map(|x| at(x, y).wrapping_sub(predicted(at(x - 4, y), at(x, y - 1), at(x - 4, y - 1)))),
            );
        }
        lines
    }

    #[test]
    fn equal_pixels_filter_to_zeros_without_being_looked_at() {
        for width_px in [1, 7, 8, 9, 16, 17, 40] {
            for changed in 0..width_px * 4 {
                // Equal rows but for one byte, which is another one in each picture.
                let mut rgba: Vec<u8> = (0..width_px * 4).map(|i| (i * 7 % 11) as u8).collect::<Vec<_>>().repeat(3);
                rgba[(width_px * 4 + changed) as usize] ^= 5;
                let image = Image { width_px, height_px: 3, rgba };
                for (channels, stream) in [(3, compressed::<3>(&image)), (4, compressed::<4>(&image))] {
                    let filtered = fdeflate::decompress_to_vec(&stream.unwrap()).unwrap();
                    assert_eq!(filtered, lines(&image, channels), "{width_px} {changed} {channels}");
                }
            }
        }
    }

    #[test]
    fn a_stopped_deadline_ends_a_long_effort() {
        let image = Image { width_px: 4, height_px: 1000, rgba: vec![1; 16_000] };
        let deadline = Deadline::after_polls(3);
        assert!(matches!(encode(&image, 9, &deadline), Err(EncodeError::Stopped(_))));
        // Each of the two files takes 16 polls; at most one more after the stop.
        assert!(deadline.polls() <= 4, "{}", deadline.polls());
        assert!(encode(&image, 9, &Deadline::default()).is_ok());
    }
}
