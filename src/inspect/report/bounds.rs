//! The bounding box of a mesh in a report, in the file's own units. Also rounds figures to their
//! significant digits: positions have 24 bits, about 7 digits.

use meshsnap_render::mesh::Mesh;
use serde::Serialize;

/// An axis-aligned box, file units.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Bounds {
    /// The lower corner.
    pub min: [f64; 3],
    /// The upper corner.
    pub max: [f64; 3],
    /// The lengths of the sides.
    pub size: [f64; 3],
}

impl Bounds {
    /// The box of a mesh. Numbers that an f64 cannot hold become the largest that it can.
    pub fn of(mesh: &Mesh) -> Self {
        let to_file = |unit: [f32; 3]| {
            let at = |axis: usize| mesh.to_file.centre[axis] + mesh.to_file.scale * f64::from(unit[axis]);
            std::array::from_fn(|axis| at(axis).clamp(f64::MIN, f64::MAX))
        };
        let [min, max]: [[f64; 3]; 2] = mesh.bounds.map(to_file);
        let size: [f64; 3] = std::array::from_fn(|axis| (max[axis] - min[axis]).min(f64::MAX));
        let largest = size.into_iter().fold(0.0, f64::max);
        let tidy = |point: [f64; 3]| point.map(|v| without_rounding(v, largest));
        Self { min: tidy(min), max: tidy(max), size: tidy(size) }
    }
}

/// Rounds `value` to the digits that are significant in a mesh of size `largest`: positions have 24
/// bits, about 7 digits.
pub fn without_rounding(value: f64, largest: f64) -> f64 {
    let magnitude = |v: f64| libm::floor(libm::log10(v.abs()));
    let digits = magnitude(value) - magnitude(largest) + 6.0;
    if !digits.is_finite() || digits > 16.0 {
        return value;
    }
    if digits < 0.0 { 0.0 } else { format!("{value:.*e}", digits as usize).parse().unwrap_or(value) }
}

/// Rounds `value` to so many digits, where an f64 can hold that.
pub fn significant(value: f64, digits: usize) -> f64 {
    let rounded = format!("{value:.*e}", digits.saturating_sub(1)).parse().ok();
    rounded.filter(|rounded: &f64| rounded.is_finite()).unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_that_are_rounding_are_not_shown() {
        let cases = [
            (-2.779_299_906_158_447, 6.5, -2.7793),
            (0.1 + 1e-9, 1.0, 0.1),
            (1e9 + 0.25, 1e9, 1e9),
            (5.0, 0.0, 5.0),
            (0.0, 1.0, 0.0),
            (1e-9, 1.0, 0.0),
            (1e-31, 1e-30, 1e-31),
            (f64::MAX, 1.0, f64::MAX),
        ];
        for (value, largest, expected) in cases {
            assert_eq!(without_rounding(value, largest), expected, "{value} {largest}");
        }
    }

    #[test]
    fn digits_are_as_many_as_asked_for() {
        let cases =
            [(1234.567, 2, 1200.0), (0.012_34, 3, 0.0123), (-9.99, 2, -10.0), (0.0, 3, 0.0), (f64::MAX, 1, f64::MAX)];
        for (value, digits, expected) in cases {
            assert_eq!(significant(value, digits), expected, "{value} {digits}");
        }
        assert!(significant(f64::NAN, 2).is_nan());
    }
}
