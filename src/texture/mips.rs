//! Mip levels. A texel of the next level is the mean of the area that it covers, in linear light.
//!
//! Colours are weighted by alpha, so that the colour of transparent texels does not bleed into
//! their neighbours.

use crate::limits::{Deadline, Stopped};
use crate::texture::decode::{LookupTable, Pixels};
use half::f16;

/// The number of levels of an image, down to a single texel.
pub fn count(width: u32, height: u32) -> u32 {
    32 - width.max(height).leading_zeros()
}

/// The number of texels in all levels from `first` on.
pub fn texels(width: u32, height: u32, first: u32) -> u64 {
    (first..count(width, height)).map(|k| u64::from(side(width, k)) * u64::from(side(height, k))).sum()
}

/// The length of a side at a level, given its length at level 0.
pub fn side(texels: u32, level: u32) -> u32 {
    (texels >> level).max(1)
}

/// Memory that [`append`] takes beside its result, bytes: levels 1 and 2 as f32, a row, and the
/// lookup tables.
pub fn working_bytes(width: u32, height: u32) -> u64 {
    let texels = |level| u64::from(side(width, level)) * u64::from(side(height, level));
    (texels(1) + texels(2)).saturating_mul(16).saturating_add(64 * u64::from(width) + (4 << 16))
}

/// Appends the levels from `first` on to `out`, as half floats.
pub fn append(
    pixels: &Pixels,
    is_color: bool,
    first: u32,
    out: &mut Vec<[u16; 4]>,
    deadline: &Deadline,
) -> Result<(), Stopped> {
    let (width, height) = (pixels.width, pixels.height);
    if first == 0 {
        let table = pixels.lookup_table(is_color, half);
        let start = out.len();
        out.resize(start + width as usize * height as usize, [0; 4]);
        for (y, row) in (0..height).zip(out[start..].chunks_exact_mut(width as usize)) {
            deadline.check()?;
            pixels.row(y, &table, row);
        }
    }
    if count(width, height) == 1 {
        return Ok(());
    }
    // The alpha channel of a normal map or a metallic map has no meaning.
    let by_alpha = is_color && pixels.has_alpha();
    let table: LookupTable<f32> = pixels.lookup_table(is_color, |v| v);
    let mut level = shrink([width, height], by_alpha, deadline, |y, row| pixels.row(y, &table, row))?;
    for k in 1.. {
        if k >= first {
            out.extend(level.iter().map(|texel| texel.map(half)));
        }
        if k + 1 == count(width, height) {
            break;
        }
        let size = [side(width, k), side(height, k)];
        let stride = size[0] as usize;
        level =
            shrink(size, by_alpha, deadline, |y, row| row.copy_from_slice(&level[y as usize * stride..][..stride]))?;
    }
    Ok(())
}

/// The level after one of `size` texels, whose rows `read` writes.
fn shrink(
    size: [u32; 2],
    by_alpha: bool,
    deadline: &Deadline,
    mut read: impl FnMut(u32, &mut [[f32; 4]]),
) -> Result<Vec<[f32; 4]>, Stopped> {
    let to = size.map(|s| side(s, 1));
    let columns: Vec<Taps> = (0..to[0]).map(|x| Taps::of(size[0], x)).collect();
    let mut line = vec![[0.0; 4]; size[0] as usize];
    let mut sums = vec![Sum::default(); to[0] as usize];
    let mut out = Vec::with_capacity(to[0] as usize * to[1] as usize);
    for y in 0..to[1] {
        deadline.check()?;
        sums.fill(Sum::default());
        let rows = Taps::of(size[1], y);
        for (row, down) in (rows.first..).zip(rows.weights()) {
            read(row, &mut line);
            for (sum, taps) in sums.iter_mut().zip(&columns) {
                for (texel, across) in line[taps.first as usize..].iter().zip(taps.weights()) {
                    sum.add(texel, down * across, by_alpha);
                }
            }
        }
        out.extend(sums.iter().map(|sum| sum.mean(by_alpha)));
    }
    Ok(out)
}

/// Filter taps in one direction: the texels that a texel of the next level covers, with weights
/// that add up to 1.
struct Taps {
    first: u32,
    count: usize,
    weights: [f32; 3],
}

impl Taps {
    /// The taps of texel `at` of the next level, where this level has `from` texels. An odd side of
    /// 2 m + 1 texels becomes m, so that each covers 2 + 1/m.
    fn of(from: u32, at: u32) -> Self {
        if from == 1 {
            return Self { first: 0, count: 1, weights: [1.0, 0.0, 0.0] };
        }
        let (m, x) = (f64::from(from / 2), f64::from(at));
        if from.is_multiple_of(2) {
            return Self { first: 2 * at, count: 2, weights: [0.5, 0.5, 0.0] };
        }
        let all = 2.0 * m + 1.0;
        Self { first: 2 * at, count: 3, weights: [m - x, m, x + 1.0].map(|w| (w / all) as f32) }
    }

    fn weights(&self) -> impl Iterator<Item = f32> {
        self.weights.into_iter().take(self.count)
    }
}

/// A weighted sum of texels.
#[derive(Clone, Copy, Default)]
struct Sum {
    /// Colour times alpha, and alpha.
    weighted: [f32; 4],
    /// Colour alone, for texels whose alpha does not count or adds up to 0.
    plain: [f32; 3],
}

impl Sum {
    #[inline(always)]
    fn add(&mut self, texel: &[f32; 4], weight: f32, by_alpha: bool) {
        let [r, g, b, a] = *texel;
        for (sum, v) in self.plain.iter_mut().zip([r, g, b]) {
            *sum += weight * v;
        }
        self.weighted[3] += weight * a;
        if by_alpha {
            for (sum, v) in self.weighted.iter_mut().zip([r, g, b]) {
                *sum += weight * a * v;
            }
        }
    }

    fn mean(&self, by_alpha: bool) -> [f32; 4] {
        let [r, g, b] = self.plain;
        let [wr, wg, wb, a] = self.weighted;
        if by_alpha && a > 0.0 { [wr / a, wg / a, wb / a, a] } else { [r, g, b, a] }
    }
}

/// The nearest IEEE 754 half float, ties to even. Too large values become infinite.
///
/// The `const` conversion never uses a processor's own instruction, so it has the same bits
/// everywhere.
fn half(v: f32) -> u16 {
    f16::from_f32_const(v).to_bits()
}

#[cfg(test)]
mod tests {
    use super::half;

    /// The value of a half float, by the definition of the format.
    fn value(half: u16) -> f64 {
        let (exponent, fraction) = (i32::from(half >> 10 & 31), f64::from(half & 1023));
        let magnitude = match exponent {
            0 => fraction * 2.0_f64.powi(-24),
            31 => f64::INFINITY,
            e => (1.0 + fraction / 1024.0) * 2.0_f64.powi(e - 15),
        };
        if half & 0x8000 == 0 { magnitude } else { -magnitude }
    }

    #[test]
    fn every_half_and_every_midpoint_rounds_as_it_should() {
        let mut checked = 0;
        for sign in [0, 0x8000] {
            for low in 0..0x7c00_u16 {
                let next = low + 1;
                let (a, b) = (value(low), if next == 0x7c00 { 65536.0 } else { value(next) });
                let signed = |v: f64| if sign == 0 { v as f32 } else { -v as f32 };
                let middle = signed((a + b) / 2.0);
                assert_eq!(f64::from(middle).abs(), (a + b) / 2.0, "a midpoint is an f32");
                let even = if low % 2 == 0 { low } else { next };
                assert_eq!(half(signed(a)), low | sign);
                assert_eq!(half(middle), even | sign, "midpoint above {low:#06x}");
                assert_eq!(half(f32::from_bits(middle.to_bits() - 1)), low | sign);
                assert_eq!(half(f32::from_bits(middle.to_bits() + 1)), next | sign);
                checked += 4;
            }
        }
        assert_eq!(checked, 2 * 4 * 0x7c00);
        assert_eq!(half(f32::INFINITY), 0x7c00);
        assert_eq!(half(f32::NEG_INFINITY), 0xfc00);
        assert_eq!(half(f32::MAX), 0x7c00);
        assert_eq!(half(f32::NAN) & 0x7fff, 0x7e00);
        assert_eq!(half(f32::MIN_POSITIVE), 0);
    }
}
