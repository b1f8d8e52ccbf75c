//! The sRGB transfer function, from sRGB to linear light. Colours are computed in linear light;
//! requests, colour textures and 8-bit pictures have them as sRGB. The way back is `srgb8_thresholds`
//! in `image`.

/// The linear value of an sRGB component (IEC 61966-2-1): 0 to 1 becomes 0 to 1, and the same curve
/// goes on beyond 1.
///
/// `libm::pow` has the same bits on every machine, which the platform's own does not promise.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}
