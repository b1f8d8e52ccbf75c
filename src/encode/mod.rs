//! Encoders: a finished [`Image`] to the bytes of a file. The same picture always gives the same
//! bytes.

use image::ImageEncoder as _;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageError};

use crate::image::{Image, ImageFormat};

/// The lowest quality at which artefacts around thin dark lines are invisible at normal viewing
/// distance.
const JPEG_QUALITY: u8 = 85;

/// The encoder failed, which is never the client's fault.
#[derive(Debug, thiserror::Error)]
#[error("the picture could not be encoded: {0}")]
pub struct EncodeError(String);

/// Encodes a picture.
///
/// PNG and WebP are lossless, and an opaque picture is stored without alpha. JPEG has no alpha, so
/// transparent pixels are laid over white.
pub fn encode(image: &Image, format: ImageFormat) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = (image.width_px, image.height_px);
    let rgb;
    let (pixels, color) = match (format, image.is_opaque()) {
        (ImageFormat::Png | ImageFormat::Webp, false) => (&image.rgba, ExtendedColorType::Rgba8),
        (ImageFormat::Png | ImageFormat::Webp, true) | (ImageFormat::Jpeg, _) => {
            rgb = over_white(image);
            (&rgb, ExtendedColorType::Rgb8)
        }
    };
    let mut bytes = Vec::new();
    match format {
        // Fast takes a sixth of Balanced's time for twice its size. Pictures are rendered more
        // often than stored.
        ImageFormat::Png => PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(pixels, width, height, color),
        ImageFormat::Webp => WebPEncoder::new_lossless(&mut bytes).encode(pixels, width, height, color),
        ImageFormat::Jpeg => {
            JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(pixels, width, height, color)
        }
    }
    .map_err(|error: ImageError| EncodeError(error.to_string()))?;
    Ok(bytes)
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

#[cfg(test)]
mod tests {
    use super::*;

    const FORMATS: [ImageFormat; 3] = [ImageFormat::Png, ImageFormat::Webp, ImageFormat::Jpeg];

    fn gradient(alpha: u8) -> Image {
        let (width_px, height_px) = (37, 19);
        let rgba = (0..width_px * height_px).flat_map(|i| [(i % 256) as u8, (i / 7 % 256) as u8, 200, alpha]).collect();
        Image { width_px, height_px, rgba }
    }

    fn guess(bytes: &[u8]) -> image::DynamicImage {
        image::load_from_memory(bytes).expect("our own bytes decode")
    }

    #[test]
    fn lossless_formats_come_back_exactly() {
        for format in [ImageFormat::Png, ImageFormat::Webp] {
            for alpha in [255, 77, 0] {
                let image = gradient(alpha);
                let decoded = guess(&encode(&image, format).unwrap());
                assert_eq!(decoded.color().has_alpha(), alpha != 255, "{format:?} {alpha}");
                assert_eq!(decoded.to_rgba8().into_raw(), image.rgba, "{format:?} {alpha}");
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

    #[test]
    fn one_pixel_and_one_row_encode() {
        for (width_px, height_px) in [(1, 1), (4096, 1), (1, 4096)] {
            for format in FORMATS {
                let image = Image { width_px, height_px, rgba: vec![9; (width_px * height_px * 4) as usize] };
                let decoded = guess(&encode(&image, format).unwrap());
                assert_eq!((decoded.width(), decoded.height()), (width_px, height_px));
            }
        }
    }
}
