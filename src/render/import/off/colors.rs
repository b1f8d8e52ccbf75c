//! The colours of OFF files, converted to linear light. Components go up to 255 or up to 1: the
//! largest one in the file decides, separately for colours in whole numbers and for all others.

use super::Number;
use crate::srgb::srgb_to_linear;

/// The colour of elements without one, where others have one.
pub const WHITE: [f32; 4] = [1.0; 4];

/// Colours of vertices or of faces, as read. A value above 1 means a scale of 0 to 255, either for
/// all colours in whole numbers or for all others.
#[derive(Debug, Default)]
pub struct Colors {
    /// Components as read. Alpha is negative where the file has none.
    stored: Vec<[f32; 4]>,
    /// True if all components are written as whole numbers.
    whole: Vec<bool>,
    whole_max: f32,
    fraction_max: f32,
}

/// Bytes per colour.
pub const COLOR_BYTES: u64 = 16 + 1;

impl Colors {
    /// Room for `count`.
    pub fn reserve(&mut self, count: usize) {
        self.stored.reserve_exact(count);
        self.whole.reserve_exact(count);
    }

    /// Their number.
    pub fn len(&self) -> usize {
        self.stored.len()
    }

    /// True if two colours are equal; false for indices out of range.
    pub fn are_same(&self, a: u32, b: u32) -> bool {
        let of = |number: u32| self.stored.get(number as usize).zip(self.whole.get(number as usize));
        // White is stored as NaN, and equals itself.
        let bits = |number: u32| of(number).map(|(color, whole)| (color.map(f32::to_bits), whole));
        bits(a).is_some() && bits(a) == bits(b)
    }

    /// Appends a colour of three or four components. Any other number gives white: a single one
    /// would be an index into a table outside the file.
    pub fn push(&mut self, components: &[Number]) {
        let mut color = [0.0, 0.0, 0.0, -1.0];
        if !(3..=4).contains(&components.len()) {
            return self.push_white();
        }
        for (place, number) in color.iter_mut().zip(components) {
            *place = number.value as f32;
        }
        let is_whole = components.iter().all(|number| number.is_whole);
        let largest = color.into_iter().filter(|c| c.is_finite()).fold(0.0, f32::max);
        let max = if is_whole { &mut self.whole_max } else { &mut self.fraction_max };
        *max = max.max(largest);
        self.stored.push(color);
        self.whole.push(is_whole);
    }

    /// Appends white for an element without a colour.
    pub fn push_white(&mut self) {
        self.stored.push([f32::NAN, 1.0, 1.0, -1.0]);
        self.whole.push(false);
    }

    /// Linear RGBA of each colour, 0 to 1.
    pub fn linear(self) -> impl ExactSizeIterator<Item = [f32; 4]> {
        let scale = |max: f32| if max > 1.0 { 255.0 } else { 1.0 };
        let scales = [scale(self.fraction_max), scale(self.whole_max)];
        self.stored.into_iter().zip(self.whole).map(move |([r, g, b, alpha], is_whole)| {
            let scale = scales[usize::from(is_whole)];
            if r.is_nan() {
                return WHITE;
            }
            let [r, g, b] = [r, g, b].map(|c| srgb_to_linear(f64::from(c.clamp(0.0, scale)) / f64::from(scale)) as f32);
            [r, g, b, if alpha < 0.0 { 1.0 } else { alpha / scale }]
        })
    }
}
