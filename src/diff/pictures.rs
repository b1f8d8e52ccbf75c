//! What differs between two pictures, pixel by pixel.

use image::{ImageFormat, ImageReader};
use serde::Serialize;
use std::io::Cursor;

use crate::guard::{Panicked, guarded};
use crate::image::Image;
use crate::limits::Limits;
use crate::pluralise::pluralise;

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
    /// Pixels that may differ.
    pub pixels: u64,
    /// The largest difference of a channel at which a pixel is the same, in steps of 255.
    pub error: f64,
}

/// What differs between two pictures.
#[derive(Clone, Debug, Serialize)]
pub struct PictureDifference {
    /// True if no more pixels differ than may.
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
    let pixels = PixelDifference { differ, total, max: in_steps(max), mean, bounds_px };
    let summary = vec![pixels.sentence(tolerance.error)];
    PictureDifference { same: differ <= tolerance.pixels, sizes, pixels: Some(pixels), summary }
}

impl PixelDifference {
    fn sentence(&self, error: f64) -> String {
        let Some([[left, top], [right, bottom]]) = self.bounds_px else {
            return match self.max > 0.0 {
                true => format!(
                    "no pixel differs by more than {error} of 255: the largest difference is {}",
                    short(self.max)
                ),
                false => "no pixel differs".to_owned(),
            };
        };
        let differ = pluralise(self.differ, "pixel differs", "pixels differ");
        let share = 100.0 * self.differ as f64 / self.total as f64;
        format!(
            "{differ} of {} ({} %), by up to {} of 255, within ({left}, {top}) to ({right}, {bottom})",
            self.total,
            short(share),
            short(self.max)
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

/// Three digits.
fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width_px: u32, pixels: &[[u8; 4]]) -> Picture {
        let bytes = pixels.as_flattened().to_vec();
        let image = image::RgbaImage::from_raw(width_px, pixels.len() as u32 / width_px, bytes).unwrap();
        let mut png = Vec::new();
        image.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
        Picture::read(&png, sniff(&png).unwrap(), &Limits::default()).unwrap()
    }

    const GREY: [u8; 4] = [100, 100, 100, 255];

    #[test]
    fn pixels_that_differ_are_counted_and_found() {
        let mut pixels = [GREY; 12];
        let a = picture(4, &pixels);
        assert_eq!(compare(&a, &a, Tolerance::default()).summary, ["no pixel differs"]);
        (pixels[5], pixels[11]) = ([100, 102, 100, 255], [100, 100, 110, 255]);
        let b = picture(4, &pixels);
        let found = compare(&a, &b, Tolerance::default());
        let numbers = found.pixels.unwrap();
        assert_eq!((numbers.differ, numbers.total, numbers.max), (2, 12, 10.0));
        assert_eq!((numbers.mean, numbers.bounds_px), (1.0, Some([[1, 1], [3, 2]])));
        assert_eq!(found.summary, ["2 pixels differ of 12 (16.7 %), by up to 10 of 255, within (1, 1) to (3, 2)"]);
        let is_same = |pixels, error| compare(&a, &b, Tolerance { pixels, error }).same;
        assert!(!is_same(0, 0.0) && !is_same(1, 0.0) && is_same(2, 0.0));
        assert!(!is_same(0, 2.0) && is_same(1, 2.0) && is_same(0, 10.0));
        let heat = heat(&a, &b, Tolerance { pixels: 0, error: 2.0 }).unwrap();
        let is_colored = |i: usize| heat.rgba[4 * i] != heat.rgba[4 * i + 1];
        assert!((0..12).all(|i| is_colored(i) == (i == 11)));
    }

    #[test]
    fn what_is_transparent_has_no_colour() {
        let clear = |red| picture(1, &[[red, 0, 0, 0]]);
        assert!(compare(&clear(0), &clear(255), Tolerance::default()).same);
        let half = compare(&picture(1, &[[255, 0, 0, 128]]), &picture(1, &[[0, 0, 0, 128]]), Tolerance::default());
        assert_eq!(half.pixels.unwrap().max.round(), 128.0);
        assert!(!compare(&clear(0), &picture(1, &[[0, 0, 0, 255]]), Tolerance::default()).same);
    }

    #[test]
    fn other_sizes_and_what_is_no_picture_are_told() {
        let (a, b) = (picture(2, &[GREY; 4]), picture(4, &[GREY; 4]));
        let found = compare(&a, &b, Tolerance { pixels: 100, error: 255.0 });
        assert!(!found.same && found.pixels.is_none() && heat(&a, &b, Tolerance::default()).is_none());
        assert_eq!(found.summary, ["the size is 4 x 1 px, before 2 x 2 px"]);
        assert_eq!(sniff(b"solid"), None);
        let broken = b"\x89PNG\r\n\x1a\n and so on";
        assert!(Picture::read(broken, sniff(broken).unwrap(), &Limits::default()).is_err());
        let small = Limits { memory_bytes: 64, ..Limits::default() };
        let mut png = Vec::new();
        image::RgbaImage::new(64, 64).write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
        assert!(Picture::read(&png, ImageFormat::Png, &small).is_err());
    }
}
