//! Stage resolve, per pixel: surface over background, where no line has composited both, to sRGB
//! bytes. Twin of `shaders/resolve.wgsl`.

use crate::backend::cpu::geometry::transform::recip;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::image::srgb8_thresholds;
use crate::plan::DrawPlan;

/// Cells of the table of bytes: so many that none holds two thresholds.
const CELLS: usize = 4096;

/// Indices that a cell may have before it is known to be below [`CELLS`].
const INDICES: usize = 2 * CELLS;

/// Linear light to sRGB bytes by the 255 thresholds: the cell that a value lies in leaves two bytes
/// to choose from, and one comparison decides. Both tables fit the first-level cache beside others.
pub struct SrgbEncoder {
    /// By cell, which is `v * CELLS` rounded to the nearest: the byte at its start.
    bytes: Box<[u8; INDICES]>,
    /// By byte, the value from which it is one more.
    thresholds: [f32; 256],
}

impl SrgbEncoder {
    /// Builds the tables.
    pub fn new() -> Self {
        let all = srgb8_thresholds();
        let mut bytes = Box::new([u8::MAX; INDICES]);
        for (i, byte) in bytes.iter_mut().enumerate().take(CELLS + 1) {
            *byte = all.partition_point(|&t| t <= (i as f32 - 0.5) / CELLS as f32) as u8;
        }
        let mut thresholds = [f32::INFINITY; 256];
        thresholds[..255].copy_from_slice(&all);
        Self { bytes, thresholds }
    }

    /// The byte for a linear value; out of range is clamped, NaN is 0.
    #[inline(always)]
    pub fn encode(&self, v: f32) -> u8 {
        let v = if v > 0.0 { v } else { 0.0 };
        let v = if v < 1.0 { v } else { 1.0 };
        // Adding 2^23 leaves the nearest integer in the low bits.
        let cell = (v * CELLS as f32 + 8_388_608.0).to_bits() as usize % INDICES;
        let byte = self.bytes[cell];
        byte + u8::from(self.thresholds[usize::from(byte)] <= v)
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

dispatch! {
    /// Writes a band's colours as sRGB bytes, over the background wherever no line has composited
    /// both.
    pub fn resolve(plan: &DrawPlan<'_>, srgb: &SrgbEncoder, colors: &[[f32; 4]], rgba: &mut [u8]) = resolve_kernel
}

#[inline(always)]
fn resolve_kernel(plan: &DrawPlan<'_>, srgb: &SrgbEncoder, colors: &[[f32; 4]], rgba: &mut [u8]) {
    let mut last = Last::of([0.0; 4], plan, srgb);
    let (groups, rest) = colors.as_chunks::<LANES>();
    let (pixels, _) = rgba.as_chunks_mut::<4>();
    let (outs, rest_out) = pixels.split_at_mut(groups.len() * LANES);
    for (group, out) in groups.iter().zip(outs.chunks_exact_mut(LANES)) {
        // Neighbours are often the same colour to the bit: large flat faces, the background.
        if last.is_all(group) {
            out.fill(last.pixel);
            continue;
        }
        if are_opaque(group) {
            for (&[r, g, b, _], out) in group.iter().zip(&mut *out) {
                *out = [srgb.encode(r), srgb.encode(g), srgb.encode(b), 255];
            }
            last = Last { bits: group[LANES - 1].map(f32::to_bits), pixel: out[LANES - 1] };
            continue;
        }
        for (&c, out) in group.iter().zip(&mut *out) {
            *out = resolve_pixel(plan, srgb, c);
        }
        last = Last { bits: group[LANES - 1].map(f32::to_bits), pixel: out[LANES - 1] };
    }
    for (&c, out) in rest.iter().zip(rest_out) {
        *out = resolve_pixel(plan, srgb, c);
    }
}

/// True if no colour of a group lets any background through.
#[inline(always)]
fn are_opaque(group: &[[f32; 4]; LANES]) -> bool {
    group.iter().fold(0, |difference, c| difference | (c[3].to_bits() ^ 1.0_f32.to_bits())) == 0
}

/// A colour, by its bits because a zero's sign matters, and its pixel.
struct Last {
    bits: [u32; 4],
    pixel: [u8; 4],
}

impl Last {
    fn of(c: [f32; 4], plan: &DrawPlan<'_>, srgb: &SrgbEncoder) -> Self {
        Self { bits: c.map(f32::to_bits), pixel: resolve_pixel(plan, srgb, c) }
    }

    /// True if a group has no other colour.
    #[inline(always)]
    fn is_all(&self, group: &[[f32; 4]; LANES]) -> bool {
        let mut difference = [0; 4];
        for c in group {
            for k in 0..4 {
                difference[k] |= c[k].to_bits() ^ self.bits[k];
            }
        }
        difference == [0; 4]
    }
}

#[inline(always)]
fn resolve_pixel(plan: &DrawPlan<'_>, srgb: &SrgbEncoder, c: [f32; 4]) -> [u8; 4] {
    let c = if is_composited(&c) { [c[0], c[1], c[2], -c[3]] } else { over_background(c, plan.background) };
    encode_pixel(srgb, c)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_the_thresholds_in_every_cell() {
        let (encoder, thresholds) = (SrgbEncoder::new(), srgb8_thresholds());
        for (k, &threshold) in thresholds.iter().enumerate() {
            let below = f32::from_bits(threshold.to_bits() - 1);
            assert_eq!([encoder.encode(below), encoder.encode(threshold)], [k as u8, k as u8 + 1]);
        }
        for i in 0..=8 * CELLS {
            let v = i as f32 / (8 * CELLS) as f32;
            assert_eq!(encoder.encode(v), thresholds.partition_point(|&t| t <= v) as u8, "{v}");
        }
        let odd = [-1.0, -0.0, f32::NAN, f32::NEG_INFINITY, 1.0, 7.0, f32::INFINITY];
        assert_eq!(odd.map(|v| encoder.encode(v)), [0, 0, 0, 0, 255, 255, 255]);
    }
}
