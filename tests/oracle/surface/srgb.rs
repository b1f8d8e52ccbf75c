//! The sRGB transfer function (IEC 61966-2-1), for reading pictures and for saying what their bytes
//! should be.

/// 0 to 1, encoded to linear.
pub fn to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// 0 to 1, linear to encoded.
pub fn from_linear(v: f64) -> f64 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}
