//! The conversion of PLY colours to linear light, and of PLY texture coordinates from v up to v
//! down.

use super::header::Kind;
use crate::srgb::srgb_to_linear;

/// The colour of elements without one, where others have one.
pub const WHITE: [f32; 4] = [1.0; 4];

/// Converts colours of vertices or faces, as read, to linear light from 0 to 1. `kinds` are the
/// types of red, green, blue and alpha. A missing alpha must be given as 1.
///
/// Scanners, MeshLab and Blender store sRGB in bytes, which may be declared as wider types. Floats
/// are 0 to 1 or, from some exporters, 0 to 255, as in OBJ.
pub fn linearise(colors: &mut [[f32; 4]], kinds: &[Option<Kind>]) {
    if colors.is_empty() {
        return;
    }
    let is_float = |channel: usize| matches!(kinds[channel], Some(Kind::F32 | Kind::F64));
    let is_above_1 =
        |c: &[f32; 4]| (0..4).any(|channel| is_float(channel) && c[channel] > 1.0 && c[channel].is_finite());
    let float_scale = if colors.iter().any(is_above_1) { 255.0 } else { 1.0 };
    let scales: [f32; 4] = std::array::from_fn(|channel| match kinds[channel] {
        Some(Kind::I8 | Kind::U8 | Kind::I32 | Kind::U32) => 255.0,
        Some(Kind::I16 | Kind::U16) => 65535.0,
        Some(Kind::F32 | Kind::F64) => float_scale,
        None => 1.0,
    });
    let bytes: [f32; 256] = std::array::from_fn(|byte| srgb_to_linear(byte as f64 / 255.0) as f32);
    for color in colors {
        for (component, &scale) in color[..3].iter_mut().zip(&scales) {
            let byte = *component as u8;
            *component = if scale == 255.0 && f32::from(byte) == *component {
                bytes[usize::from(byte)]
            } else {
                srgb_to_linear(f64::from(*component) / f64::from(scale)) as f32
            };
        }
        color[3] /= scales[3];
    }
}

/// Turns v around: in PLY as in OBJ it runs up from the image's lower edge, in a mesh down from the
/// upper one.
pub fn upright([u, v]: [f64; 2]) -> [f32; 2] {
    [u as f32, (1.0 - v) as f32]
}
