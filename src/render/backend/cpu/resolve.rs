//! The last stage (resolve), per pixel: it lays the surface's colour over the background, unless lines have been
//! drawn over both already, and makes sRGB bytes of it. Twin of `shaders/resolve.wgsl`.

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

    /// As [`encode`](Self::encode) of three channels each, with 255 for alpha.
    #[inline(always)]
    fn encode_opaque(&self, colors: &[[f32; 4]; LANES], out: &mut [[u8; 4]; LANES]) {
        let (mut values, mut cells) = ([[0.0; 4]; LANES], [[0; 4]; LANES]);
        for l in 0..LANES {
            for k in 0..4 {
                let v = colors[l][k];
                let v = if v > 0.0 { v } else { 0.0 };
                let v = if v < 1.0 { v } else { 1.0 };
                values[l][k] = v;
                cells[l][k] = (v * CELLS as f32 + 8_388_608.0).to_bits() % INDICES as u32;
            }
        }
        for l in 0..LANES {
            let mut pixel = [u8::MAX; 4];
            for k in 0..3 {
                let byte = self.bytes[cells[l][k] as usize];
                pixel[k] = byte + u8::from(self.thresholds[usize::from(byte)] <= values[l][k]);
            }
            out[l] = pixel;
        }
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
    /// Writes the colours of rows, from `first_row` on, as sRGB bytes, over the background wherever
    /// no line has composited both.
    pub fn resolve(
        plan: &DrawPlan<'_>,
        srgb: &SrgbEncoder,
        first_row: u32,
        colors: &[[f32; 4]],
        rgba: &mut [u8],
    ) = resolve_kernel
}

#[inline(always)]
fn resolve_kernel(plan: &DrawPlan<'_>, srgb: &SrgbEncoder, first_row: u32, colors: &[[f32; 4]], rgba: &mut [u8]) {
    let (pixels, _) = rgba.as_chunks_mut::<4>();
    // One colour is the same in all rows.
    let row_len = if plan.has_gradient() { plan.width_px as usize } else { colors.len().max(1) };
    for (row, (colors, pixels)) in (first_row..).zip(colors.chunks(row_len).zip(pixels.chunks_mut(row_len))) {
        let mut resolver = Resolver::new(plan.background_at(row), srgb);
        for (group, out) in colors.chunks(LANES).zip(pixels.chunks_mut(LANES)) {
            resolver.resolve(group, out);
        }
    }
}

/// Resolves groups of pixels over one colour.
pub struct Resolver<'a> {
    background: [f32; 4],
    srgb: &'a SrgbEncoder,
    last: Last,
}

impl<'a> Resolver<'a> {
    /// One over a background.
    #[inline(always)]
    pub fn new(background: [f32; 4], srgb: &'a SrgbEncoder) -> Self {
        Self { background, srgb, last: Last::of([0.0; 4], background, srgb) }
    }

    /// The bytes of a colour.
    #[inline(always)]
    pub fn pixel(&self, color: [f32; 4]) -> [u8; 4] {
        resolve_pixel(self.background, self.srgb, color)
    }

    /// Resolves up to [`LANES`] neighbours of which some differ.
    #[inline(always)]
    pub fn mixed(&self, colors: &[[f32; 4]; LANES], out: &mut [[u8; 4]]) {
        match out.first_chunk_mut() {
            Some(out) if are_opaque(colors) => self.srgb.encode_opaque(colors, out),
            _ => {
                for (&c, out) in colors.iter().zip(out) {
                    *out = resolve_pixel(self.background, self.srgb, c);
                }
            }
        }
    }

    /// Resolves up to [`LANES`] neighbours.
    #[inline(always)]
    pub fn resolve(&mut self, colors: &[[f32; 4]], out: &mut [[u8; 4]]) {
        let (Some(group), Some(pixels)) = (colors.first_chunk(), out.first_chunk_mut()) else {
            for (&c, out) in colors.iter().zip(out) {
                *out = resolve_pixel(self.background, self.srgb, c);
            }
            return;
        };
        // Neighbours are often the same colour to the bit: large flat faces, the background.
        if self.last.is_all(group) {
            pixels.fill(self.last.pixel);
            return;
        }
        if are_opaque(group) {
            self.srgb.encode_opaque(group, pixels);
        } else {
            for (&c, out) in group.iter().zip(&mut *pixels) {
                *out = resolve_pixel(self.background, self.srgb, c);
            }
        }
        self.last = Last { bits: group[LANES - 1].map(f32::to_bits), pixel: pixels[LANES - 1] };
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
    fn of(c: [f32; 4], background: [f32; 4], srgb: &SrgbEncoder) -> Self {
        Self { bits: c.map(f32::to_bits), pixel: resolve_pixel(background, srgb, c) }
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
fn resolve_pixel(background: [f32; 4], srgb: &SrgbEncoder, c: [f32; 4]) -> [u8; 4] {
    let c = if is_composited(&c) { [c[0], c[1], c[2], -c[3]] } else { over_background(c, background) };
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
        let group: [[f32; 4]; LANES] = std::array::from_fn(|l| [0, 1, 2, 3].map(|k| thresholds[8 * (4 * l + k) % 255]));
        let mut pixels = [[0; 4]; LANES];
        encoder.encode_opaque(&group, &mut pixels);
        let want = group.map(|[r, g, b, _]| [encoder.encode(r), encoder.encode(g), encoder.encode(b), 255]);
        assert_eq!(pixels, want);
        let odd = [-1.0, -0.0, f32::NAN, f32::NEG_INFINITY, 1.0, 7.0, f32::INFINITY];
        assert_eq!(odd.map(|v| encoder.encode(v)), [0, 0, 0, 0, 255, 255, 255]);
    }
}
