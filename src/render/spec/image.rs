//! The picture, as a request describes it: size, format, sampling, background, compression and legend.

use super::background::Background;
use super::color::Rgba;
pub use crate::image::ImageFormat;

/// The picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSpec {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// None: the caller decides, by file extension or Accept header, and else takes PNG.
    pub format: Option<ImageFormat>,
    /// Visibility samples per pixel.
    pub samples: Samples,
    /// What is behind the mesh; alpha 0 is transparent.
    pub background: Background,
    /// Time that is spent to make a PNG small, from 0 to 9. Other formats ignore it.
    pub effort: u32,
    /// Tells in the picture what the colours of its diagnostics mean.
    pub legend: bool,
}

/// Pixels of the largest picture that has more samples by default.
const SMALL_PX: u64 = 256 * 256;

/// Visibility samples per pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Samples {
    /// 1, 4, 8 or 16.
    Fixed(u32),
    /// 4, and points in pixels that show several faces. Pictures with something transparent have 16 in place of 4; those
    /// without opaque faces have 16 and no points.
    Adaptive,
}

impl Samples {
    /// The numbers that a request may ask for.
    pub const FIXED: &'static [u32] = &[1, 4, 8, 16];

    /// The samples of a picture whose request leaves them open. Steps along edges are seen most in small pictures, where
    /// more samples cost little. Wires cover edges, and are as exact with few samples.
    pub(crate) fn default_of(size_px: [u32; 2], has_wires: bool) -> Self {
        let is_small = u64::from(size_px[0]) * u64::from(size_px[1]) <= SMALL_PX;
        if is_small && !has_wires { Self::Fixed(16) } else { ImageSpec::default().samples }
    }

    /// Samples in every pixel, where adaptive ones are asked for, of pictures with something transparent or without
    /// surfaces.
    pub const LAYERED: u32 = 16;

    /// Samples in every pixel of a picture in which nothing is transparent.
    pub fn per_pixel(self) -> u32 {
        match self {
            Self::Fixed(samples) => samples,
            Self::Adaptive => 4,
        }
    }
}

/// The value of `image.samples`.
impl std::fmt::Display for Samples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fixed(samples) => samples.fmt(f),
            Self::Adaptive => f.write_str(ADAPTIVE),
        }
    }
}

/// The word for [`Samples::Adaptive`].
pub const ADAPTIVE: &str = "adaptive";

impl Default for ImageSpec {
    fn default() -> Self {
        Self {
            width_px: 512,
            height_px: 512,
            format: None,
            samples: Samples::Fixed(4),
            background: Rgba::WHITE.into(),
            effort: crate::image::DEFAULT_EFFORT,
            legend: false,
        }
    }
}
