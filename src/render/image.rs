//! A finished picture in memory: sRGB bytes (`Image`), or half floats in linear light (`LinearImage`).
//! The bytes of an `Image` may lie in memory that a GPU has written, and are then read in place. The
//! formats of picture files, the interface to an encoder that takes rows while others are being drawn,
//! and the linear values at which an sRGB byte changes are defined here, too.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

pub use half::f16;

use crate::srgb::srgb_to_linear;

/// The default of `image.effort`: quick, because pictures are drawn more often than stored.
pub const DEFAULT_EFFORT: u32 = 3;

/// Pixels in sRGB with straight (not premultiplied) alpha, 8 bits per channel, rows from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// R, G, B and A of each pixel, `width_px * height_px * 4` bytes.
    pub rgba: Pixels,
}

/// Pixels in linear light with premultiplied alpha, as half floats, rows from the top: what compositing programs and
/// OpenEXR expect.
///
/// The primaries are those of sRGB, and 1 is its white. Each value is the one that an [`Image`] stores as a byte, rounded to
/// the nearest half float instead, so it is light for a display: what lamps give is rolled off below white. Nothing is
/// clamped: what shines by itself (`surface.emissive`) comes on top of that and may exceed 1.
#[derive(Clone, PartialEq)]
#[non_exhaustive]
pub struct LinearImage {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// R, G, B and A of each pixel, `width_px * height_px` of them. `rgba.as_flattened()` is the list of their values.
    pub rgba: Vec<[f16; 4]>,
}

/// The bytes of a picture. They may lie in memory that a GPU has written: then encoders read them in place, and the
/// picture holds that memory until it and its clones are dropped. [`into_vec`](Pixels::into_vec), and writing, make a copy.
#[derive(Clone)]
pub struct Pixels(Memory);

/// Memory that holds the bytes of a picture until it is dropped.
pub(crate) trait SharedMemory: Send + Sync {
    /// The bytes.
    fn bytes(&self) -> &[u8];
}

#[derive(Clone)]
enum Memory {
    Own(Vec<u8>),
    #[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "only a GPU writes into memory of its own"))]
    Shared(Arc<dyn SharedMemory>),
}

impl Pixels {
    /// Pixels in memory that another owner has lent.
    #[cfg(feature = "gpu")]
    pub(crate) fn shared(memory: Arc<dyn SharedMemory>) -> Self {
        Self(Memory::Shared(memory))
    }

    /// The bytes as a vector: a copy, if they lie in memory of a GPU.
    pub fn into_vec(self) -> Vec<u8> {
        match self.0 {
            Memory::Own(bytes) => bytes,
            Memory::Shared(memory) => memory.bytes().to_vec(),
        }
    }
}

impl Deref for Pixels {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.0 {
            Memory::Own(bytes) => bytes,
            Memory::Shared(memory) => memory.bytes(),
        }
    }
}

/// Bytes that lie in memory of a GPU are copied first.
impl DerefMut for Pixels {
    fn deref_mut(&mut self) -> &mut [u8] {
        if let Memory::Shared(memory) = &self.0 {
            self.0 = Memory::Own(memory.bytes().to_vec());
        }
        match &mut self.0 {
            Memory::Own(bytes) => bytes,
            Memory::Shared(_) => &mut [],
        }
    }
}

impl From<Vec<u8>> for Pixels {
    fn from(bytes: Vec<u8>) -> Self {
        Self(Memory::Own(bytes))
    }
}

impl FromIterator<u8> for Pixels {
    fn from_iter<I: IntoIterator<Item = u8>>(bytes: I) -> Self {
        bytes.into_iter().collect::<Vec<u8>>().into()
    }
}

impl<'a> IntoIterator for &'a Pixels {
    type Item = &'a u8;
    type IntoIter = std::slice::Iter<'a, u8>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl PartialEq for Pixels {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Pixels {}

impl std::fmt::Debug for Pixels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Pixels({} bytes)", self.len())
    }
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

impl LinearImage {
    /// R, G, B and A at column `x`, row `y`.
    pub fn pixel(&self, x: u32, y: u32) -> [f16; 4] {
        self.rgba[y as usize * self.width_px as usize + x as usize]
    }
}

impl std::fmt::Debug for LinearImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LinearImage({}x{})", self.width_px, self.height_px)
    }
}

/// Takes the rows of a picture from the top to the bottom, while those below are being drawn.
pub trait RowSink: Send {
    /// The next rows, whole: R, G, B and A of each pixel.
    fn write_rows(&mut self, rgba: &[u8]);
}

/// The file format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageFormat {
    /// PNG: lossless, the default.
    Png,
    /// WebP, always lossless here.
    Webp,
    /// JPEG: lossy, without alpha.
    Jpeg,
}

impl ImageFormat {
    /// The usual extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Webp => "webp",
            Self::Jpeg => "jpg",
        }
    }

    /// Its media type.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Webp => "image/webp",
            Self::Jpeg => "image/jpeg",
        }
    }
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
