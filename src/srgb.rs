//! The sRGB transfer function, for everything that turns displayed colours into linear light.

/// Encoded to linear (IEC 61966-2-1). It maps 0..1 to 0..1 and continues beyond 1.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}
