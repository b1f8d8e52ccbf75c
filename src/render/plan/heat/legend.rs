//! The legend of a diagnostic picture as data: the name of what its colours measure, the numbers of the
//! first and the last colour, and the colours. `caption` draws it.

use super::color_map::ColorMap;
use crate::image::srgb8_thresholds;

/// A diagnostic's scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// The name of the measured quantity.
    pub title: &'static str,
    /// The numbers of the first and the last colour.
    pub ends: [f64; 2],
    /// sRGB colours, from the lowest number to the highest.
    pub colors: Vec<[u8; 3]>,
}

impl Legend {
    /// The scale of a colour map between two numbers.
    pub fn new(title: &'static str, ends: [f64; 2], map: &ColorMap) -> Self {
        let thresholds = srgb8_thresholds();
        let byte = |v: f32| thresholds.partition_point(|&threshold| threshold <= v) as u8;
        let colors = map.iter().map(|&[r, g, b, _]| [r, g, b].map(byte)).collect();
        Self { title, ends, colors }
    }
}
