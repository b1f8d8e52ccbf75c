//! The PNG encoder, in two ways. For an `effort` of 0 to 3 it is quick, for a picture that a client waits
//! for. From 4 to 9 it takes longer and makes smaller files, for pictures that are stored. Animated PNG
//! is written here, too.

mod quick;

use png::{BitDepth, BlendOp, ColorType, DeflateCompression, Encoder, Filter};

pub use self::quick::QuickPng;

use super::{EncodeError, drop_alpha};
use crate::image::Image;
use crate::limits::Deadline;

/// The effort from which the file's size counts for more than time.
const SMALL_EFFORT_MIN: u32 = 4;

/// Rows compressed between two polls of the deadline.
const POLL_ROWS: usize = 64;

/// Encodes a picture, without alpha where every pixel is opaque. `effort` is from 0 to 9.
pub fn encode(image: &Image, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    if is_quick(effort) { quick::encode(image) } else { small(image, effort, deadline) }
}

/// True if time counts for more than the file's size.
pub fn is_quick(effort: u32) -> bool {
    effort < SMALL_EFFORT_MIN
}

/// The smaller of two files: flat faces in few colours repeat themselves best as they are, shaded
/// ones best after filters.
fn small(image: &Image, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    let rgb = image.is_opaque().then(|| drop_alpha(&image.rgba));
    let (color, pixels) = match &rgb {
        Some(rgb) => (ColorType::Rgb, &**rgb),
        None => (ColorType::Rgba, &*image.rgba),
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
    let mut encoder = encoder(&mut bytes, [image.width_px, image.height_px], color);
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
    if is_quick(effort) {
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

fn encoder(bytes: &mut Vec<u8>, [width_px, height_px]: [u32; 2], color: ColorType) -> Encoder<'_, &mut Vec<u8>> {
    let mut encoder = Encoder::new(bytes, width_px, height_px);
    encoder.set_color(color);
    encoder.set_depth(BitDepth::Eight);
    encoder
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stopped_deadline_ends_a_long_effort() {
        let image = Image { width_px: 4, height_px: 1000, rgba: vec![1; 16_000].into() };
        let deadline = Deadline::after_polls(3);
        assert!(matches!(encode(&image, 9, &deadline), Err(EncodeError::Stopped(_))));
        // Each of the two files takes 16 polls; at most one more after the stop.
        assert!(deadline.polls() <= 4, "{}", deadline.polls());
        assert!(encode(&image, 9, &Deadline::default()).is_ok());
    }
}
