//! Values of XML attributes in 3MF files: transforms (twelve numbers) and colours (`#RRGGBB` or
//! `#RRGGBBAA`).

use crate::import::affine::Affine;
use crate::srgb::srgb_to_linear;

/// Parses twelve numbers: the images of the three axes, and the translation.
pub fn transform(text: &str) -> Option<Affine> {
    let mut numbers = [0.0; 12];
    let mut words = text.split_ascii_whitespace();
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    let linear = std::array::from_fn(|row| std::array::from_fn(|column| numbers[3 * column + row]));
    words.next().is_none().then_some(Affine { linear, translation: [numbers[9], numbers[10], numbers[11]] })
}

/// Parses sRGB with six hex digits, or with alpha and eight.
pub fn color(text: &str) -> Option<[f32; 4]> {
    let digits = text.trim_ascii().strip_prefix('#').filter(|digits| matches!(digits.len(), 6 | 8))?;
    let byte = |at: usize| u8::from_str_radix(digits.get(at..at + 2)?, 16).ok();
    let channel = |at: usize| byte(at).map(|byte| srgb_to_linear(f64::from(byte) / 255.0) as f32);
    let alpha = if digits.len() == 8 { f32::from(byte(6)?) / 255.0 } else { 1.0 };
    Some([channel(0)?, channel(2)?, channel(4)?, alpha])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_transforms() {
        assert_eq!(color("#FF0000"), Some([1.0, 0.0, 0.0, 1.0]));
        assert_eq!(color(" #00ff0033 "), Some([0.0, 1.0, 0.0, 0.2]));
        for bad in ["", "#", "FF0000", "#FF000", "#FF00000", "#GG0000", "#ünïc"] {
            assert_eq!(color(bad), None, "{bad}");
        }
        let map = transform("1 2 3  4 5 6  7 8 9  10 11 12").unwrap();
        assert_eq!(map.point([1.0, 0.0, 0.0]), [11.0, 13.0, 15.0]);
        assert_eq!(map.point([0.0, 0.0, 1.0]), [17.0, 19.0, 21.0]);
        assert!(transform("1 2 3").is_none() && transform("1 2 3 4 5 6 7 8 9 10 11 12 13").is_none());
    }
}
