//! A finished picture.

use crate::srgb::srgb_to_linear;

/// Pixels in sRGB with straight (not premultiplied) alpha, 8 bits per channel, rows from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// R, G, B and A of each pixel, `width_px * height_px * 4` bytes.
    pub rgba: Vec<u8>,
}

impl Image {
    /// R, G, B and A at column `x`, row `y`.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let i = (y as usize * self.width_px as usize + x as usize) * 4;
        [self.rgba[i], self.rgba[i + 1], self.rgba[i + 2], self.rgba[i + 3]]
    }

    /// True if every pixel is fully opaque. Then an encoder may drop the alpha channel.
    pub fn is_opaque(&self) -> bool {
        // Whole words and no branch per pixel, so that a vector holds many.
        let all = |pixels: &[u8]| pixels.as_chunks::<4>().0.iter().fold(!0, |all, p| all & u32::from_le_bytes(*p));
        self.rgba.chunks(4096).all(|pixels| all(pixels) >> 24 == 255)
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({}x{})", self.width_px, self.height_px)
    }
}

/// Takes the rows of a picture from the top to the bottom, while those below are being drawn.
pub trait RowSink: Send {
    /// The next rows, whole: R, G, B and A of each pixel.
    fn write_rows(&mut self, rgba: &[u8]);
}

/// The file format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// PNG: lossless, the default.
    Png,
    /// WebP, always lossless here.
    Webp,
    /// JPEG: lossy, without alpha.
    Jpeg,
}

/// The 255 linear values at which the stored sRGB byte changes: `thresholds[k]` is the smallest
/// that is stored as `k + 1` or more.
///
/// Both back-ends search this table to round to the nearest of 256 levels, so both store the same
/// byte.
pub fn srgb8_thresholds() -> [f32; 255] {
    std::array::from_fn(|k| srgb_to_linear((k as f64 + 0.5) / 255.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_invert_the_transfer_function() {
        let thresholds = srgb8_thresholds();
        for level in 0..=255_u8 {
            let linear = srgb_to_linear(f64::from(level) / 255.0) as f32;
            assert_eq!(thresholds.partition_point(|&t| t <= linear), level as usize);
        }
    }
}
