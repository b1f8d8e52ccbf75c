//! The colours of a request. Documents have them in sRGB, such as `#f00`; [`Rgba`] holds them in linear
//! light, in which the program computes.

use crate::srgb::srgb_to_linear;

/// A linear-light colour with straight alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgba(pub [f32; 4]);

impl Rgba {
    /// Fully transparent.
    pub const TRANSPARENT: Self = Self([0.0; 4]);
    /// Opaque black.
    pub const BLACK: Self = Self([0.0, 0.0, 0.0, 1.0]);
    /// Opaque white.
    pub const WHITE: Self = Self([1.0; 4]);

    /// From 8-bit sRGB with straight alpha.
    pub fn from_srgb8(rgba: [u8; 4]) -> Self {
        let c = |v: u8| srgb_to_linear(f64::from(v) / 255.0) as f32;
        Self([c(rgba[0]), c(rgba[1]), c(rgba[2]), f32::from(rgba[3]) / 255.0])
    }

    /// Parses `#rgb`, `#rgba`, `#rrggbb`, `#rrggbbaa` (the `#` may be missing) or `transparent`.
    pub fn parse(text: &str) -> Option<Self> {
        if text == "transparent" {
            return Some(Self::TRANSPARENT);
        }
        let hex = text.strip_prefix('#').unwrap_or(text);
        if !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
            return None;
        }
        let digit = |i: usize| u8::from_str_radix(&hex[i..=i], 16).ok();
        let pair = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).ok();
        let mut rgba = [255_u8; 4];
        match hex.len() {
            3 | 4 => (0..hex.len()).try_for_each(|i| digit(i).map(|v| rgba[i] = v * 17))?,
            6 | 8 => (0..hex.len() / 2).try_for_each(|i| pair(2 * i).map(|v| rgba[i] = v))?,
            _ => return None,
        }
        Some(Self::from_srgb8(rgba))
    }

    /// Colour times alpha: the form in which layers blend.
    pub fn premultiplied(self) -> [f32; 4] {
        let [r, g, b, a] = self.0;
        [r * a, g * a, b * a, a]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_the_css_forms() {
        assert_eq!(Rgba::parse("#fff"), Some(Rgba::WHITE));
        assert_eq!(Rgba::parse("000000ff"), Some(Rgba::BLACK));
        assert_eq!(Rgba::parse("#f00"), Rgba::parse("#ff0000"));
        for bad in ["", "#", "#ff", "#fffff", "#ggg", "white", "#é12"] {
            assert_eq!(Rgba::parse(bad), None, "{bad}");
        }
    }
}
