//! Encoders: a finished [`Image`] to the bytes of a file. The same picture, format and effort always
//! give the same bytes.

mod png;
mod webp;

use std::io::{self, Write};

use image::ImageEncoder as _;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageError};

pub use self::png::QuickPng;
use crate::image::{DEFAULT_EFFORT, Image, ImageFormat};
use crate::limits::{Deadline, Stopped};

/// The lowest quality at which artefacts around thin dark lines are invisible at normal viewing
/// distance.
const JPEG_QUALITY: u8 = 85;

/// Bytes of a file after which the deadline is polled: a white picture of 4096 px has some 100 kB as JPEG.
const BYTES_PER_POLL: usize = 1 << 10;

/// The time of a whole animation, milliseconds: one turn is slow enough to look at.
const ROUND_MS: u32 = 3000;

/// The shortest time that players show a frame for without slowing down, milliseconds.
const DELAY_MS_MIN: u32 = 20;

/// Encoding failed, which is never the client's fault, or was stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The encoder failed.
    #[error("the picture could not be encoded: {0}")]
    Failed(String),
    /// The deadline was raised.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Encoding. The same picture always gives the same bytes.
impl Image {
    /// The bytes of a PNG file: lossless, without an alpha channel where every pixel is opaque.
    pub fn to_png(&self) -> Result<Vec<u8>, EncodeError> {
        self.encode(ImageFormat::Png)
    }

    /// The bytes of a file in the given format. JPEG has no alpha: what is transparent is laid over
    /// white.
    pub fn encode(&self, format: ImageFormat) -> Result<Vec<u8>, EncodeError> {
        self.encode_with_effort(format, DEFAULT_EFFORT)
    }

    /// As [`Image::encode`]. An effort from 4 to 9 makes smaller PNG files, in 5 to 100 times the
    /// time.
    pub fn encode_with_effort(&self, format: ImageFormat, effort: u32) -> Result<Vec<u8>, EncodeError> {
        encode(self, format, effort, &Deadline::default())
    }
}

/// Encodes a picture. `effort` is that of `image.effort`.
///
/// PNG and WebP are lossless, and an opaque picture is stored without alpha. JPEG has no alpha, so
/// transparent pixels are laid over white.
pub fn encode(image: &Image, format: ImageFormat, effort: u32, deadline: &Deadline) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = (image.width_px, image.height_px);
    let mut bytes = Vec::new();
    match (format, image.is_opaque()) {
        (ImageFormat::Png, _) => return png::encode(image, effort, deadline),
        (ImageFormat::Webp, true) => {
            let rgb = drop_alpha(&image.rgba);
            WebPEncoder::new_lossless(&mut bytes).encode(&rgb, width, height, ExtendedColorType::Rgb8)?;
        }
        (ImageFormat::Webp, false) => {
            WebPEncoder::new_lossless(&mut bytes).encode(&image.rgba, width, height, ExtendedColorType::Rgba8)?;
        }
        (ImageFormat::Jpeg, is_opaque) => {
            // The largest pictures take tens of milliseconds for each of these steps.
            deadline.check()?;
            let rgb = if is_opaque { drop_alpha(&image.rgba) } else { over_white(image) };
            deadline.check()?;
            let encoder = JpegEncoder::new_with_quality(Stoppable { bytes: &mut bytes, deadline }, JPEG_QUALITY);
            let written = encoder.write_image(&rgb, width, height, ExtendedColorType::Rgb8);
            // A writer's errors are of one kind, so that the reason is asked for again.
            deadline.check()?;
            written?;
        }
    }
    Ok(bytes)
}

/// An encoder that takes rows while the picture is being drawn. None if the format needs them all at once. It is
/// fastest if the picture is opaque where that is expected.
pub fn row_encoder(format: ImageFormat, effort: u32, size_px: [u32; 2], is_opaque: bool) -> Option<QuickPng> {
    let is_in_rows = format == ImageFormat::Png && png::is_quick(effort);
    // An error comes again when the picture is encoded.
    if is_in_rows { QuickPng::new(size_px, is_opaque).ok() } else { None }
}

/// Encodes an animation that begins again for ever. Its frames are the picture's parts from the top to the
/// bottom, all of one height. Only PNG and WebP have animations.
pub fn encode_animation(
    frames: &Image,
    count: u32,
    format: ImageFormat,
    effort: u32,
    deadline: &Deadline,
) -> Result<Vec<u8>, EncodeError> {
    let delay_ms = (ROUND_MS / count.max(1)).max(DELAY_MS_MIN);
    match format {
        ImageFormat::Png => png::encode_animation(frames, count, delay_ms, effort, deadline),
        ImageFormat::Webp => webp::encode_animation(frames, count, delay_ms, deadline),
        ImageFormat::Jpeg => Err(EncodeError::Failed("JPEG has no animations".to_owned())),
    }
}

/// The pixels of frame `index` of `count`, and how many rows it has.
fn frame(frames: &Image, index: u32, count: u32) -> (&[u8], u32) {
    let height_px = frames.height_px / count.max(1);
    let bytes = frames.width_px as usize * height_px as usize * 4;
    (&frames.rgba[index as usize * bytes..][..bytes], height_px)
}

/// Bytes that are written while a deadline is not raised.
struct Stoppable<'a> {
    bytes: &'a mut Vec<u8>,
    deadline: &'a Deadline,
}

impl Write for Stoppable<'_> {
    fn write(&mut self, more: &[u8]) -> io::Result<usize> {
        let before = self.bytes.len();
        self.bytes.extend_from_slice(more);
        // Encoders write a byte or two at a time.
        if before / BYTES_PER_POLL != self.bytes.len() / BYTES_PER_POLL {
            self.deadline.check().map_err(io::Error::other)?;
        }
        Ok(more.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// RGB of RGBA.
fn drop_alpha(rgba: &[u8]) -> Vec<u8> {
    let mut rgb = vec![0; rgba.len() / 4 * 3];
    for (rgb, rgba) in rgb.as_chunks_mut::<3>().0.iter_mut().zip(rgba.as_chunks::<4>().0) {
        *rgb = [rgba[0], rgba[1], rgba[2]];
    }
    rgb
}

/// The picture as RGB over white, rows from the top. Opaque pixels keep their bytes.
///
/// The blend is in sRGB space, which is not exact. Our own pictures for JPEG never need it, because
/// a request for JPEG gets an opaque background, blended in linear light. It serves pictures from
/// elsewhere.
fn over_white(image: &Image) -> Vec<u8> {
    let over = |value: u8, alpha: u8| {
        let (value, alpha) = (u32::from(value), u32::from(alpha));
        ((value * alpha + 255 * (255 - alpha) + 127) / 255) as u8
    };
    image.rgba.chunks_exact(4).flat_map(|p| [over(p[0], p[3]), over(p[1], p[3]), over(p[2], p[3])]).collect()
}

impl From<ImageError> for EncodeError {
    fn from(error: ImageError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<::png::EncodingError> for EncodeError {
    fn from(error: ::png::EncodingError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<io::Error> for EncodeError {
    fn from(error: io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORMATS: [ImageFormat; 3] = [ImageFormat::Png, ImageFormat::Webp, ImageFormat::Jpeg];

    fn gradient(alpha: u8) -> Image {
        let (width_px, height_px) = (37, 19);
        let rgba = (0..width_px * height_px).flat_map(|i| [(i % 256) as u8, (i / 7 % 256) as u8, 200, alpha]).collect();
        Image { width_px, height_px, rgba }
    }

    fn encode(image: &Image, format: ImageFormat) -> Result<Vec<u8>, EncodeError> {
        super::encode(image, format, 3, &Deadline::default())
    }

    fn guess(bytes: &[u8]) -> image::DynamicImage {
        image::load_from_memory(bytes).expect("our own bytes decode")
    }

    #[test]
    fn lossless_formats_come_back_exactly() {
        for format in [ImageFormat::Png, ImageFormat::Webp] {
            for (alpha, effort) in [255, 77, 0].into_iter().flat_map(|alpha| [0, 3, 4, 9].map(|effort| (alpha, effort)))
            {
                let image = gradient(alpha);
                let decoded = guess(&super::encode(&image, format, effort, &Deadline::default()).unwrap());
                assert_eq!(decoded.color().has_alpha(), alpha != 255, "{format:?} {alpha} {effort}");
                assert_eq!(decoded.to_rgba8().into_raw(), *image.rgba, "{format:?} {alpha} {effort}");
            }
        }
    }

    #[test]
    fn jpeg_is_close_and_over_white() {
        let opaque = gradient(255);
        let decoded = guess(&encode(&opaque, ImageFormat::Jpeg).unwrap()).to_rgb8();
        assert_eq!(decoded.dimensions(), (37, 19));
        let clear = guess(&encode(&gradient(0), ImageFormat::Jpeg).unwrap()).to_rgb8();
        assert!(clear.as_raw().iter().all(|&v| v >= 250), "a clear picture is white");
    }

    #[test]
    fn the_same_picture_gives_the_same_bytes() {
        for format in FORMATS {
            assert_eq!(encode(&gradient(80), format).unwrap(), encode(&gradient(80), format).unwrap());
        }
    }

    /// WebP is missing here: its encoder writes when it has finished.
    #[test]
    fn a_deadline_stops_png_and_jpeg() {
        let image = Image { width_px: 512, height_px: 512, rgba: vec![255; 512 * 512 * 4].into() };
        // PNG of a low effort is encoded while it is drawn, or soon.
        for (format, effort) in [(ImageFormat::Png, 9), (ImageFormat::Jpeg, 3)] {
            let counting = Deadline::after_polls(u64::MAX);
            super::encode(&image, format, effort, &counting).unwrap();
            let polls = counting.polls();
            assert!(polls > 1, "{format:?} {effort}: {polls} polls");
            let stopped = super::encode(&image, format, effort, &Deadline::after_polls(polls / 2 + 1));
            assert!(matches!(stopped, Err(EncodeError::Stopped(_))), "{format:?} {effort}");
        }
    }

    #[test]
    fn one_pixel_and_one_row_encode() {
        for (width_px, height_px) in [(1, 1), (4096, 1), (1, 4096)] {
            for format in FORMATS {
                let image = Image { width_px, height_px, rgba: vec![9; (width_px * height_px * 4) as usize].into() };
                let decoded = guess(&encode(&image, format).unwrap());
                assert_eq!((decoded.width(), decoded.height()), (width_px, height_px));
            }
        }
    }
}
