//! Red dots and lines that are drawn over a finished picture to show places, such as edges of the mesh
//! with a fault. Each mark has a white rim, which sets it off from what is under it.

use crate::image::Image;

/// Half the width of a line, and the radius of a dot, in pixels of a picture whose shorter side has 200.
const LINE_PX: f64 = 0.8;
const DOT_PX: f64 = 2.4;

/// The width of the rim around a mark, which sets it off from what is under it.
const RIM_PX: f64 = 1.0;

/// The marks and their rims, sRGB.
const MARK: [u8; 3] = [0xe0, 0x1b, 0x24];
const RIM: [u8; 3] = [0xff, 0xff, 0xff];

/// A mark, in pixels from the upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    /// A point.
    Dot([f64; 2]),
    /// The ends of a line.
    Line([[f64; 2]; 2]),
}

/// Draws marks over a picture: all rims first, so that none covers a mark.
pub fn draw_marks(image: &mut Image, marks: &[Mark]) {
    let scale = (f64::from(image.width_px.min(image.height_px)) / 200.0).max(1.0);
    for (rim, color) in [(RIM_PX, RIM), (0.0, MARK)] {
        for mark in marks {
            let (ends, radius) = match mark {
                Mark::Dot(at) => ([*at; 2], DOT_PX * scale),
                Mark::Line(ends) => (*ends, LINE_PX * scale),
            };
            draw(image, ends, radius + rim * scale, color);
        }
    }
}

/// Draws all that is nearer than `radius` to a line.
fn draw(image: &mut Image, [a, b]: [[f64; 2]; 2], radius: f64, color: [u8; 3]) {
    let size = [image.width_px, image.height_px];
    let limits = |k: usize| {
        let low = (a[k].min(b[k]) - radius - 1.0).clamp(0.0, f64::from(size[k]));
        let high = (a[k].max(b[k]) + radius + 1.0).clamp(0.0, f64::from(size[k]));
        low as u32..high as u32
    };
    let along = [b[0] - a[0], b[1] - a[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    if !length.is_finite() {
        return;
    }
    for y in limits(1) {
        for x in limits(0) {
            let from_a = [f64::from(x) + 0.5 - a[0], f64::from(y) + 0.5 - a[1]];
            let share = if length > 0.0 { (from_a[0] * along[0] + from_a[1] * along[1]) / length } else { 0.0 };
            let share = share.clamp(0.0, 1.0);
            let away = [from_a[0] - share * along[0], from_a[1] - share * along[1]];
            let distance = (away[0] * away[0] + away[1] * away[1]).sqrt();
            // The part of the pixel that is covered, about.
            let coverage = (radius - distance + 0.5).clamp(0.0, 1.0);
            if coverage > 0.0 {
                blend(image, [x, y], color, coverage);
            }
        }
    }
}

fn blend(image: &mut Image, [x, y]: [u32; 2], color: [u8; 3], coverage: f64) {
    let first = 4 * (y as usize * image.width_px as usize + x as usize);
    let Some(pixel) = image.rgba.get_mut(first..first + 4) else { return };
    let mix =
        |before: u8, after: u8| (f64::from(before) + coverage * (f64::from(after) - f64::from(before))).round() as u8;
    for (before, after) in pixel.iter_mut().zip([color[0], color[1], color[2], 255]) {
        *before = mix(*before, after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_where_they_are_said_to_be_and_stay_within_the_picture() {
        let grey =
            |side: u32| Image { width_px: side, height_px: side, rgba: vec![128; 4 * (side * side) as usize].into() };
        let mut image = grey(64);
        draw_marks(&mut image, &[Mark::Line([[10.5, 20.0], [40.5, 20.0]]), Mark::Dot([50.5, 50.5])]);
        for (at, expected) in
            [([25, 20], MARK), ([50, 50], MARK), ([25, 21], RIM), ([54, 50], [128; 3]), ([25, 40], [128; 3])]
        {
            let [r, g, b, _] = image.pixel(at[0], at[1]);
            let is_near = [r, g, b].iter().zip(expected).all(|(found, wanted)| found.abs_diff(wanted) < 64);
            assert!(is_near, "{at:?}: {:?}", [r, g, b]);
        }
        // Far beyond the picture, across it, and nowhere.
        let mut image = grey(8);
        let marks = [
            Mark::Line([[-1e12, 4.0], [1e12, 4.0]]),
            Mark::Dot([1e300, -1e300]),
            Mark::Dot([f64::NAN; 2]),
            Mark::Line([[f64::INFINITY, 0.0], [0.0, 0.0]]),
        ];
        draw_marks(&mut image, &marks);
        assert_eq!(image.rgba.len(), 4 * 64);
        assert_eq!(image.pixel(3, 3)[1], image.pixel(4, 3)[1]);
    }
}
