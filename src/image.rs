//! A finished picture.

use crate::srgb::srgb_to_linear;

/// sRGB colours with straight (not premultiplied) alpha, 8 bits a channel, rows from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// `width_px * height_px` times R, G, B, A.
    pub rgba: Vec<u8>,
}

impl Image {
    /// The colour at column `x`, row `y`.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let i = (y as usize * self.width_px as usize + x as usize) * 4;
        [self.rgba[i], self.rgba[i + 1], self.rgba[i + 2], self.rgba[i + 3]]
    }

    /// Whether every pixel is fully opaque, so that an encoder may drop the alpha channel.
    pub fn is_opaque(&self) -> bool {
        self.rgba.chunks_exact(4).all(|p| p[3] == 255)
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({}x{})", self.width_px, self.height_px)
    }
}

/// File format of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// Lossless, the default.
    Png,
    /// Lossless WebP.
    Webp,
    /// Lossy, opaque.
    Jpeg,
}

/// `thresholds[k]` is the smallest linear value that is stored as `k + 1` or more: rounding to the nearest of 256 sRGB
/// levels, as a table that both back-ends search, so that both store the same byte.
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
