//! The legends of a picture whose colours stand for measured numbers, such as the lengths of edges. Each is
//! a bar of the colours from the lowest number to the highest, with the numbers at both ends and the name
//! of what is measured. They lie in the lower right corner of the picture, one above the other; those that
//! it has no room for are left out.

use super::{TEXT_HEIGHT, dot_px, fill, text_width_px, write};
use crate::image::Image;

/// A legend's bar in dots: width and height.
const BAR: [u32; 2] = [96, 6];

/// Dots between the picture's border and a legend's texts, and between a text and the bar.
const INSET: u32 = 4;
const GAP: u32 = 2;

/// The plate under a legend, sRGB, and the dots by which it is larger on each side.
const PLATE: [u8; 3] = [0xf7, 0xf8, 0xfa];
const PLATE_EDGE: u32 = 3;

/// The contents of a legend.
pub struct Scale<'a> {
    /// The name of the measured quantity.
    pub title: &'a str,
    /// The lowest and the highest number.
    pub ends: [f64; 2],
    /// sRGB colours from the lowest number to the highest.
    pub colors: &'a [[u8; 3]],
}

/// Draws legends into the lower right corner of a picture, the first one lowest. Those that the picture has no
/// room for are left out.
pub fn draw_legend(image: &mut Image, scales: &[Scale<'_>]) {
    let dot_px = dot_px([image.width_px, image.height_px]);
    let height = 2 * (TEXT_HEIGHT + GAP) + BAR[1];
    let mut bottom_px = image.height_px.saturating_sub(INSET * dot_px);
    for scale in scales {
        let ends = scale.ends.map(short);
        let wanted = [text_width_px(scale.title), text_width_px(&ends[0]) + 6 + text_width_px(&ends[1])];
        let width = wanted.into_iter().fold(BAR[0], u32::max);
        if width * dot_px + 2 * INSET * dot_px > image.width_px || bottom_px < (height + INSET) * dot_px {
            return;
        }
        let left_px = image.width_px - (width + INSET) * dot_px;
        let row_px = |row: u32| bottom_px - (height - row) * dot_px;
        let plate_px = [left_px - PLATE_EDGE * dot_px, row_px(0) - PLATE_EDGE * dot_px];
        fill(image, plate_px, [width, height].map(|dots| (dots + 2 * PLATE_EDGE) * dot_px), PLATE);
        write(image, [left_px, row_px(0)], dot_px, scale.title);
        let bar_px = row_px(TEXT_HEIGHT + GAP);
        for x in 0..width * dot_px {
            let at = x as usize * scale.colors.len() / (width * dot_px) as usize;
            fill(image, [left_px + x, bar_px], [1, BAR[1] * dot_px], scale.colors.get(at).copied().unwrap_or_default());
        }
        let ends_px = row_px(TEXT_HEIGHT + GAP + BAR[1] + GAP);
        let right_px = left_px + (width - text_width_px(&ends[1])) * dot_px;
        write(image, [left_px, ends_px], dot_px, &ends[0]);
        write(image, [right_px, ends_px], dot_px, &ends[1]);
        bottom_px = bottom_px.saturating_sub((height + 2 * INSET) * dot_px);
    }
}

/// A number with three digits, as short as that can be written.
fn short(number: f64) -> String {
    let size = number.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{number:.1e}").replace(".0e", "e");
    }
    let decimals = if size >= 100.0 || size == 0.0 { 0 } else { (2.0 - size.log10().floor()) as usize };
    let text = format!("{number:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (number, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.25, "0.25"),
            (-0.123_456, "-0.123"),
            (4.0, "4"),
            (12.345, "12.3"),
            (99.99, "100"),
            (123_456.0, "123456"),
            (1.5e9, "1.5e9"),
            (2e-7, "2e-7"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(number), text);
        }
    }

    #[test]
    fn a_legend_runs_from_the_first_colour_to_the_last_and_needs_room() {
        let colors: Vec<[u8; 3]> = (0..=255).map(|v| [v, 0, 255 - v]).collect();
        let scale = || Scale { title: "edge length", ends: [0.5, 1234.0], colors: &colors };
        let white = |width_px: u32, height_px: u32| Image {
            width_px,
            height_px,
            rgba: vec![255; 4 * (width_px * height_px) as usize].into(),
        };
        let mut image = white(400, 400);
        draw_legend(&mut image, &[scale(), scale()]);
        let bar = |y: u32| (0..400).map(|x| image.pixel(x, y)).filter(|p| p[1] == 0).collect::<Vec<_>>();
        let bars: Vec<_> = (0..400).map(bar).filter(|bar| !bar.is_empty()).collect();
        assert_eq!(bars.len(), 2 * 6 * 2, "two bars of six dots of two pixels");
        for bar in bars {
            assert_eq!(
                (bar.len(), bar.first(), bar.last().map(|p| p[0] > 250)),
                (192, Some(&[0, 0, 255, 255]), Some(true))
            );
        }
        for (width_px, height_px, fits) in [(104, 36, true), (103, 36, false), (104, 35, false), (1, 1, false)] {
            let mut image = white(width_px, height_px);
            draw_legend(&mut image, &[scale()]);
            assert_eq!(image != white(width_px, height_px), fits, "{width_px} x {height_px}");
        }
    }
}
