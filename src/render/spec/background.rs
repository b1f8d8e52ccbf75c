//! The background of a picture, behind the mesh: one colour, or a vertical gradient between two.

use super::color::Rgba;

/// What is between the two colours of a gradient in its notation.
pub const BETWEEN: &str = "..";

/// The colours of the picture's upper and lower edge, equal where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// At the upper edge.
    pub top: Rgba,
    /// At the lower edge.
    pub bottom: Rgba,
}

impl Background {
    /// Parses a colour, or `top..bottom`.
    pub fn parse(text: &str) -> Option<Self> {
        match text.split_once(BETWEEN) {
            None => Rgba::parse(text).map(Self::from),
            Some((top, bottom)) => Some(Self { top: Rgba::parse(top)?, bottom: Rgba::parse(bottom)? }),
        }
    }

    /// True if nothing shows through.
    pub fn is_opaque(self) -> bool {
        self.top.0[3] >= 1.0 && self.bottom.0[3] >= 1.0
    }

    /// Over a white page, in linear light.
    #[must_use]
    pub fn over_white(self) -> Self {
        let over_white = |color: Rgba| {
            let [r, g, b, a] = color.premultiplied();
            Rgba([r + (1.0 - a), g + (1.0 - a), b + (1.0 - a), 1.0])
        };
        Self { top: over_white(self.top), bottom: over_white(self.bottom) }
    }

    /// The premultiplied colour at the upper edge, and what each of so many rows adds to it.
    ///
    /// Premultiplied colours are blended, so a gradient to `transparent` does not go through grey.
    pub fn rows(self, height_px: u32) -> ([f32; 4], [f32; 4]) {
        let (top, bottom) = (self.top.premultiplied(), self.bottom.premultiplied());
        let step = |k: usize| ((f64::from(bottom[k]) - f64::from(top[k])) / f64::from(height_px)) as f32;
        (top, std::array::from_fn(step))
    }
}

impl From<Rgba> for Background {
    fn from(color: Rgba) -> Self {
        Self { top: color, bottom: color }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_colours_are_a_gradient_and_one_is_none() {
        let of =
            |top, bottom| Rgba::parse(top).zip(Rgba::parse(bottom)).map(|(top, bottom)| Background { top, bottom });
        assert_eq!(Background::parse("#fff..#dde"), of("fff", "dde"));
        assert_eq!(Background::parse("102030..transparent"), of("102030", "transparent"));
        assert_eq!(Background::parse("#fff"), of("fff", "fff"));
        for bad in ["", "..", "#fff..", "..#fff", "#fff..#ddd..#ccc", "#fff...#ddd", "#fff.. #ddd", "#fff.#ddd", "a..b"]
        {
            assert_eq!(Background::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn rows_go_from_the_upper_colour_to_the_lower() {
        let (top, step) = Background::from(Rgba::WHITE).rows(7);
        assert_eq!((top, step), ([1.0; 4], [0.0; 4]), "no colour changes by a bit");
        let (top, step) = Background { top: Rgba::TRANSPARENT, bottom: Rgba::WHITE }.rows(4);
        assert_eq!((top, step), ([0.0; 4], [0.25; 4]));
    }
}
