//! Stage resolve, per pixel: surface over background, where no line has composited both, to sRGB
//! bytes. Twin of `shaders/resolve.wgsl`.

use crate::backend::cpu::geometry::transform::recip;
use crate::image::srgb8_thresholds;
use crate::plan::DrawPlan;

/// Linear light to sRGB bytes by the 255 thresholds, with a first guess from a small table.
pub struct SrgbEncoder {
    thresholds: [f32; 256],
    /// Largest byte whose threshold is not above `i / 4096`.
    guess: Vec<u8>,
}

impl SrgbEncoder {
    /// Builds the tables.
    pub fn new() -> Self {
        let mut thresholds = [f32::INFINITY; 256];
        thresholds[..255].copy_from_slice(&srgb8_thresholds());
        let below = |v: f32| thresholds.partition_point(|&t| t <= v) as u8;
        let guess = (0..4096).map(|i| below(i as f32 / 4096.0)).collect();
        Self { thresholds, guess }
    }

    /// The byte for a linear value; out of range is clamped, NaN is 0.
    #[inline(always)]
    pub fn encode(&self, v: f32) -> u8 {
        let v = if v > 0.0 { v.min(1.0) } else { 0.0 };
        let mut byte = self.guess[((v * 4096.0) as usize).min(4095)];
        while byte < 255 && self.thresholds[byte as usize] <= v {
            byte += 1;
        }
        byte
    }
}

/// True if alpha is negative: lines have already blended the background into this colour. Otherwise
/// the colour is premultiplied and without background.
#[inline(always)]
pub fn is_composited(color: &[f32; 4]) -> bool {
    color[3].is_sign_negative()
}

/// The surface's colour over the background.
#[inline(always)]
pub fn over_background(surface: [f32; 4], background: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|k| surface[k] + background[k] * (1.0 - surface[3]))
}

/// Composites the surface over the background wherever no line has done so.
pub fn composite_background(plan: &DrawPlan<'_>, colors: &mut [[f32; 4]]) {
    for color in colors {
        if is_composited(color) {
            color[3] = -color[3];
        } else {
            *color = over_background(*color, plan.background);
        }
    }
}

/// Writes a band's colours as sRGB bytes.
pub fn encode(srgb: &SrgbEncoder, colors: &[[f32; 4]], rgba: &mut [u8]) {
    let mut last = ([f32::NAN; 4], [0; 4]);
    for (&c, out) in colors.iter().zip(rgba.chunks_exact_mut(4)) {
        // Neighbours are often the same colour to the bit: flat faces, background.
        if c != last.0 {
            last = (c, encode_pixel(srgb, c));
        }
        out.copy_from_slice(&last.1);
    }
}

#[inline(always)]
fn encode_pixel(srgb: &SrgbEncoder, c: [f32; 4]) -> [u8; 4] {
    let alpha = c[3];
    if alpha >= 1.0 {
        return [srgb.encode(c[0]), srgb.encode(c[1]), srgb.encode(c[2]), 255];
    }
    if alpha <= 0.0 {
        return [0; 4];
    }
    // The bound keeps recip in its range: fainter colours leave no bit.
    let inverse = recip(alpha.max(1e-30));
    let a = (alpha * 255.0 + 0.5) as u8;
    [srgb.encode(c[0] * inverse), srgb.encode(c[1] * inverse), srgb.encode(c[2] * inverse), a]
}
