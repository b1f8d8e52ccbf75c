//! Captions: additions to a finished picture. They are texts in a small font of dots, legends that
//! explain the colours of a picture, and marks that show places in it.

mod font;
mod legend;
mod marks;

pub use font::text_width_px;
pub use legend::{Scale, draw_legend};
pub use marks::{Mark, draw_marks};

use crate::image::Image;

/// Rows of a text in dots.
pub const TEXT_HEIGHT: u32 = font::ROWS;

/// Pixels of a picture's shorter side per pixel of a dot.
const PICTURE_PER_DOT_PX: u32 = 200;

/// Text on light and on dark ground, sRGB.
const DARK: [u8; 3] = [0x33, 0x3a, 0x44];
const LIGHT: [u8; 3] = [0xe8, 0xea, 0xee];

/// The size of a text's dots in a picture of this size, pixels.
pub fn dot_px([width_px, height_px]: [u32; 2]) -> u32 {
    (width_px.min(height_px) / PICTURE_PER_DOT_PX).max(1)
}

/// Writes a text whose dots have `dot_px` pixels, with its upper left corner at a pixel: dark, or light where
/// it is dark there. It must lie in the picture wholly.
pub fn write(image: &mut Image, at_px: [u32; 2], dot_px: u32, text: &str) {
    let size_px = [text_width_px(text) * dot_px, TEXT_HEIGHT * dot_px];
    let color = contrast(image, at_px, size_px);
    font::dots(text, |column, row| {
        let corner = [at_px[0] + column * dot_px, at_px[1] + row * dot_px];
        fill(image, corner, [dot_px, dot_px], color);
    });
}

/// Fills a part of a picture with an opaque colour.
fn fill(image: &mut Image, at_px: [u32; 2], size_px: [u32; 2], [r, g, b]: [u8; 3]) {
    let width_px = image.width_px as usize;
    for y in at_px[1]..at_px[1] + size_px[1] {
        let first = 4 * (y as usize * width_px + at_px[0] as usize);
        for pixel in image.rgba[first..first + 4 * size_px[0] as usize].chunks_exact_mut(4) {
            pixel.copy_from_slice(&[r, g, b, 255]);
        }
    }
}

/// The colour of text that is read best over a part of a picture.
fn contrast(image: &Image, at_px: [u32; 2], size_px: [u32; 2]) -> [u8; 3] {
    let mut sum = 0_u64;
    for (y, x) in (0..size_px[1]).flat_map(|y| (0..size_px[0]).map(move |x| (y, x))) {
        let [r, g, b, a] = image.pixel(at_px[0] + x, at_px[1] + y).map(u64::from);
        // Luma of the bytes; what is behind a transparent picture is most often white.
        sum += (54 * r + 183 * g + 19 * b) / 256 * a / 255 + (255 - a);
    }
    let pixels = u64::from(size_px[0]) * u64::from(size_px[1]);
    if sum >= 110 * pixels { DARK } else { LIGHT }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_dark_on_light_and_light_on_dark() {
        for (ground, expected) in [([255; 4], DARK), ([0; 4], DARK), ([10, 10, 10, 255], LIGHT)] {
            let mut image = Image { width_px: 60, height_px: 40, rgba: ground.repeat(60 * 40).into() };
            write(&mut image, [4, 27], 1, "front");
            let written = image.rgba.chunks(4).filter(|pixel| *pixel != ground);
            assert!(written.clone().count() > 30 && written.into_iter().all(|pixel| pixel[..3] == expected));
        }
    }
}
