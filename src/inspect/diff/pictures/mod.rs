//! The differences between two pictures (PNG, WebP or JPEG), for `meshsnap diff` and for reports of `meshsnap check`:
//! how many pixels differ and by how much, and how large the difference is for the eye of a person (FLIP). Also the
//! pictures that show in colour where two pictures differ.

mod flip;
#[cfg(test)]
mod tests;

use image::{ImageFormat, ImageReader};
use serde::Serialize;
use std::io::Cursor;

use crate::report::significant;
pub use flip::{Flip, flip};
use meshsnap_render::guard::{Panicked, guarded};
use meshsnap_render::image::Image;
use meshsnap_render::limits::Limits;
use meshsnap_render::pluralise::pluralise;

/// The longest side of a picture, pixels.
const SIDE_PX_MAX: u32 = 16_384;

/// The largest number of a channel.
const CHANNEL_MAX: f64 = 65_535.0;

/// Steps of a channel in which differences are told, as most pictures have them.
const STEPS: f64 = 255.0;

/// A picture that was read: colours times alpha, and alpha, 16 bits each.
#[derive(Debug)]
pub struct Picture {
    width_px: u32,
    height_px: u32,
    pixels: Vec<[u16; 4]>,
}

/// The reason why a picture cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// It is broken, or too large.
    #[error("the picture cannot be read: {0}")]
    Unreadable(#[from] image::ImageError),
    /// The decoder failed.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

/// What counts as the same.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tolerance {
    /// Pixels that may differ. None: none, unless `flip` is given.
    pub pixels: Option<u64>,
    /// The largest difference of a channel at which a pixel is the same, in steps of 255.
    pub error: f64,
    /// The mean FLIP that may be.
    pub flip: Option<f64>,
}

/// What differs between two pictures.
#[derive(Clone, Debug, Serialize)]
pub struct PictureDifference {
    /// True if no more differs than may.
    pub same: bool,
    /// The sizes.
    pub sizes: [SizePx; 2],
    /// The pixels; null where the sizes differ.
    pub pixels: Option<PixelDifference>,
    /// What a reviewer would say, in sentences.
    pub summary: Vec<String>,
}

/// The size of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SizePx {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

/// The pixels that differ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelDifference {
    /// Pixels that differ by more than the tolerance.
    pub differ: u64,
    /// All pixels.
    pub total: u64,
    /// The largest difference of a channel, in steps of 255. Colours count as far as they are opaque.
    pub max: f64,
    /// The mean over all pixels of each one's largest difference, in steps of 255.
    pub mean: f64,
    /// Column and row of the upper left and the lower right corner of the box around those that differ; null if
    /// none does.
    pub bounds_px: Option<[[u32; 2]; 2]>,
    /// The difference that a person sees, from 0 to 1.
    pub flip: FlipFigures,
}

/// FLIP over all pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FlipFigures {
    /// The mean.
    pub mean: f64,
    /// The largest.
    pub max: f64,
}

/// The format of a picture that can be compared; none for other bytes.
pub fn sniff(bytes: &[u8]) -> Option<ImageFormat> {
    let format = image::guess_format(bytes).ok()?;
    matches!(format, ImageFormat::Png | ImageFormat::WebP | ImageFormat::Jpeg).then_some(format)
}

impl Picture {
    /// Reads a picture.
    pub fn read(bytes: &[u8], format: ImageFormat, limits: &Limits) -> Result<Self, PictureError> {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut of_reader = image::Limits::default();
        (of_reader.max_image_width, of_reader.max_image_height) = (Some(SIDE_PX_MAX), Some(SIDE_PX_MAX));
        // Two pictures, and of each what is decoded and what is compared.
        of_reader.max_alloc = Some(limits.memory_bytes / 6);
        reader.limits(of_reader);
        let decoded = guarded("picture", || reader.decode())??.into_rgba16();
        let (width_px, height_px) = decoded.dimensions();
        let over_nothing = |[r, g, b, a]: [u16; 4]| {
            let times_alpha = |value: u16| ((u32::from(value) * u32::from(a) + 32_767) / 65_535) as u16;
            [times_alpha(r), times_alpha(g), times_alpha(b), a]
        };
        let pixels = decoded.as_raw().as_chunks::<4>().0.iter().map(|pixel| over_nothing(*pixel)).collect();
        Ok(Self { width_px, height_px, pixels })
    }

    /// Its pixels, 8 bits each, with colours as they are.
    pub fn image(&self) -> Image {
        let byte = |value: u16| ((u32::from(value) * 255 + 32_767) / 65_535) as u8;
        let plain = |[r, g, b, a]: &[u16; 4]| {
            let color = |value: u16| (u32::from(value) * 65_535 / u32::from(*a).max(1)).min(65_535) as u16;
            [byte(color(*r)), byte(color(*g)), byte(color(*b)), byte(*a)]
        };
        let rgba = self.pixels.iter().flat_map(plain).collect();
        Image { width_px: self.width_px, height_px: self.height_px, rgba }
    }

    fn size(&self) -> SizePx {
        SizePx { width_px: self.width_px, height_px: self.height_px }
    }
}

/// Compares two pictures.
pub fn compare(a: &Picture, b: &Picture, tolerance: Tolerance) -> PictureDifference {
    let sizes = [a.size(), b.size()];
    if sizes[0] != sizes[1] {
        let [before, now] = sizes.map(|size| format!("{} x {}", size.width_px, size.height_px));
        let summary = vec![format!("the size is {now} px, before {before} px")];
        return PictureDifference { same: false, sizes, pixels: None, summary };
    }
    let (mut differ, mut max, mut sum) = (0, 0_u16, 0_u64);
    let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
    for (number, (before, now)) in (0_u32..).zip(a.pixels.iter().zip(&b.pixels)) {
        let largest = distance(*before, *now);
        if largest == 0 {
            continue;
        }
        max = max.max(largest);
        sum += u64::from(largest);
        if in_steps(largest) > tolerance.error {
            differ += 1;
            let at = [number % a.width_px, number / a.width_px];
            low = std::array::from_fn(|k| low[k].min(at[k]));
            high = std::array::from_fn(|k| high[k].max(at[k]));
        }
    }
    let total = a.pixels.len() as u64;
    let mean = sum as f64 / total.max(1) as f64 * STEPS / CHANNEL_MAX;
    let bounds_px = (differ > 0).then_some([low, high]);
    let seen = if max > 0 { flip(a, b) } else { None };
    let flip = seen.map(|Flip { mean, max, .. }| FlipFigures { mean, max }).unwrap_or_default();
    let pixels = PixelDifference { differ, total, max: in_steps(max), mean, bounds_px, flip };
    let summary = vec![pixels.sentence(tolerance.error)];
    PictureDifference { same: tolerance.holds(&pixels), sizes, pixels: Some(pixels), summary }
}

impl Tolerance {
    fn holds(&self, found: &PixelDifference) -> bool {
        let pixels_max = self.pixels.unwrap_or(if self.flip.is_some() { u64::MAX } else { 0 });
        found.differ <= pixels_max && self.flip.is_none_or(|flip| found.flip.mean <= flip)
    }
}

impl PixelDifference {
    fn sentence(&self, error: f64) -> String {
        let Some([[left, top], [right, bottom]]) = self.bounds_px else {
            return match self.max > 0.0 {
                true => format!(
                    "no pixel differs by more than {error} of 255: the largest difference is {}",
                    significant(self.max, 3)
                ),
                false => "no pixel differs".to_owned(),
            };
        };
        let differ = pluralise(self.differ, "pixel differs", "pixels differ");
        let share = 100.0 * self.differ as f64 / self.total as f64;
        format!(
            "{differ} of {} ({} %), by up to {} of 255, within ({left}, {top}) to ({right}, {bottom}); FLIP {} on \
             average, {} at most",
            self.total,
            significant(share, 3),
            significant(self.max, 3),
            significant(self.flip.mean, 3),
            significant(self.flip.max, 3)
        )
    }
}

impl PictureDifference {
    /// For people.
    pub fn text(&self) -> String {
        let mut text = String::from(if self.same { "same\n" } else { "different\n" });
        self.summary.iter().for_each(|sentence| text += &format!("  {sentence}\n"));
        text
    }
}

/// The second picture in pale grey, with the pixels that differ in colour: from yellow, by little, to red. None where
/// the sizes differ.
pub fn heat(a: &Picture, b: &Picture, tolerance: Tolerance) -> Option<Image> {
    if a.size() != b.size() {
        return None;
    }
    let color = |(before, now): (&[u16; 4], &[u16; 4])| {
        let difference = in_steps(distance(*before, *now));
        if difference <= tolerance.error {
            return pale(*now);
        }
        // The eye sees small differences of large ones, and so does a root.
        let share = (difference / STEPS).sqrt();
        [255 - (80.0 * share) as u8, (200.0 * (1.0 - share)) as u8, 0, 255]
    };
    let rgba = a.pixels.iter().zip(&b.pixels).flat_map(color).collect();
    Some(Image { width_px: a.width_px, height_px: a.height_px, rgba })
}

/// The second picture in pale grey, with what a person sees of the difference in colour: from yellow, a little, to red.
/// None where the sizes differ.
pub fn flip_heat(a: &Picture, b: &Picture) -> Option<Image> {
    let Flip { errors, .. } = flip(a, b)?;
    let color = |(error, now): (&f32, &[u16; 4])| {
        // A smaller error is not visible.
        if *error < 0.02 {
            return pale(*now);
        }
        let share = error.min(1.0);
        [255 - (80.0 * share) as u8, (200.0 * (1.0 - share)) as u8, 0, 255]
    };
    let rgba = errors.iter().zip(&b.pixels).flat_map(color).collect();
    Some(Image { width_px: a.width_px, height_px: a.height_px, rgba })
}

/// The largest difference of a channel.
fn distance(before: [u16; 4], now: [u16; 4]) -> u16 {
    (0..4).fold(0, |largest, k| largest.max(before[k].abs_diff(now[k])))
}

fn in_steps(difference: u16) -> f64 {
    f64::from(difference) * STEPS / CHANNEL_MAX
}

/// A pixel over white, without its colour, and near white.
fn pale([r, g, b, a]: [u16; 4]) -> [u8; 4] {
    let luma = (54 * u32::from(r) + 183 * u32::from(g) + 19 * u32::from(b)) / 256 + (65_535 - u32::from(a));
    let grey = 190 + (luma.min(65_535) * 65 / 65_535) as u8;
    [grey, grey, grey, 255]
}
