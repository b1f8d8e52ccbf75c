//! PNG in two ways: quickly for a picture that one client waits for, and small for one that is
//! stored.
//!
//! Quickly means one filter for the whole picture, and literals and runs of zeros by one Huffman code
//! ([`deflate`]). Both are chosen by a few rows: Sub, or Paeth where that is smaller by far. What
//! filters leave of a rendering is mostly zeros, so trying more of them pays little.

mod deflate;
mod filter;
mod huffman;

use png::{BitDepth, ColorType, DeflateCompression, Encoder, Filter, chunk};

use self::deflate::{Sample, Stream};
use self::filter::filter_row;
use super::{EncodeError, drop_alpha};
use crate::image::Image;
use crate::limits::Deadline;

/// The effort from which the file's size counts for more than time.
const SMALL_EFFORT_MIN: u32 = 4;

/// Rows that the filter and the code of a quick file are chosen by, at least, where there are so many.
const SAMPLE_ROWS: usize = 16;

/// Pixels from which Sub may take more bits than Paeth.
const LARGE_PIXELS_MIN: usize = 1 << 16;

/// Rows compressed between two polls of the deadline.
const POLL_ROWS: usize = 64;

/// Encodes a picture, without alpha where every pixel is opaque. `effort` is from 0 to 9.
pub fn encode(image: &Image, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    if effort < SMALL_EFFORT_MIN { quick(image) } else { small(image, effort, deadline) }
}

fn quick(image: &Image) -> Result<Vec<u8>, EncodeError> {
    let (color, data) = if image.is_opaque() {
        (ColorType::Rgb, compressed::<3>(image))
    } else {
        (ColorType::Rgba, compressed::<4>(image))
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

fn encoder<'a>(bytes: &'a mut Vec<u8>, image: &Image, color: ColorType) -> Encoder<'a, &'a mut Vec<u8>> {
    let mut encoder = Encoder::new(bytes, image.width_px, image.height_px);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder
}

/// The filtered rows as a zlib stream. Of each pixel, `CHANNELS` bytes are stored.
fn compressed<const CHANNELS: usize>(image: &Image) -> Vec<u8> {
    let step = (image.height_px as usize / SAMPLE_ROWS).max(1);
    let [sub, paeth] = [Filter::Sub, Filter::Paeth].map(|filter| {
        let mut sample = Sample::new();
        filtered::<CHANNELS>(filter, image, step / 2, step, |line| sample.add(line));
        sample.fit()
    });
    // Paeth takes much longer, which matters for large pictures.
    let allowed_percent = if image.rgba.len() / 4 < LARGE_PIXELS_MIN { 100 } else { 108 };
    let suits = sub.sample_bits * 100 <= paeth.sample_bits * allowed_percent;
    let (filter, fitted) = if suits { (Filter::Sub, sub) } else { (Filter::Paeth, paeth) };
    let mut stream = Stream::new(&fitted, image.rgba.len() / 16);
    filtered::<CHANNELS>(filter, image, 0, 1, |line| stream.add(line));
    stream.finish()
}

/// Gives each `step`th row from `first` on to `each`, filtered.
fn filtered<const CHANNELS: usize>(
    filter: Filter,
    image: &Image,
    first: usize,
    step: usize,
    mut each: impl FnMut(&[u8]),
) {
    let row_len = image.width_px as usize * 4;
    let row = |y: usize| &image.rgba[y * row_len..(y + 1) * row_len];
    let zeros = vec![0; row_len];
    let mut line = vec![0; 1 + image.width_px as usize * CHANNELS];
    line[0] = filter as u8;
    for y in (first..image.height_px as usize).step_by(step) {
        let above = y.checked_sub(1).map_or(&zeros[..], row);
        filter_row::<CHANNELS>(filter, row(y), above, &mut line[1..]);
        each(&line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_filters_come_back_exactly() {
        let (width_px, height_px) = (61, 40);
        // Runs of any colours that begin elsewhere in each row, which spoils Paeth; and columns, which
        // it takes from above.
        let any = |i: u32| {
            let mixed = i.wrapping_mul(2_654_435_761);
            (mixed ^ mixed >> 15).wrapping_mul(2_246_822_519) >> 24
        };
        let pixel = |x: u32, y: u32| {
            let runs = [97, 131, 57].map(|k| any((x + 3 * y) / 8 + k * y));
            [[runs[0], runs[1], runs[2], 255], [any(x), any(x + 9), any(x + 99), x]]
        };
        for (kind, expected) in [(0, Filter::Sub), (1, Filter::Paeth)] {
            let pixels = (0..width_px * height_px).flat_map(|i| pixel(i % width_px, i / width_px)[kind]);
            let image = Image { width_px, height_px, rgba: pixels.map(|v| v as u8).collect() };
            let file = encode(&image, 0, &Deadline::default()).unwrap();
            let decoded = image::load_from_memory(&file).unwrap();
            assert_eq!(decoded.to_rgba8().into_raw(), image.rgba);
            let data = if kind == 0 { compressed::<3>(&image) } else { compressed::<4>(&image) };
            assert_eq!(fdeflate::decompress_to_vec(&data).unwrap()[0], expected as u8);
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
