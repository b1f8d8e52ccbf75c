//! The making of mip levels: smaller copies of an image, each about half as wide and high as the one before, from
//! which back-ends read textures that are far away. A texel of a level is the mean of the area that it covers, in
//! linear light.
//!
//! Colours are weighted by alpha, so that the colour of transparent texels does not bleed into
//! their neighbours.

use crate::limits::{Deadline, Stopped};
use crate::texture::cut_out;
use crate::texture::decode::{LookupTable, Pixels};
use half::f16;
use rayon::prelude::*;

/// Rows that a thread does at least, so that small levels are not shared.
const ROWS_MIN: usize = 32;

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

/// Memory that [`fill`] takes beside its result, bytes: levels 1 and 2 as f32, the rows of
/// all pieces, and the lookup tables, of f32 and of halves.
pub fn working_bytes(width: u32, height: u32) -> u64 {
    let texels = |level| u64::from(side(width, level)) * u64::from(side(height, level));
    let pieces = u64::from(side(height, 1)).div_ceil(ROWS_MIN as u64);
    (texels(1) + texels(2)).saturating_mul(16).saturating_add(64 * pieces * u64::from(width) + (6 << 16))
}

/// The ways in which an image is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reading {
    /// Texels are colours, as sRGB, and not numbers.
    pub is_color: bool,
    /// The bits of the alpha below which texels are left out; 0 if none are.
    cutoff_bits: u32,
}

impl Reading {
    /// As colours, or as numbers.
    pub fn plain(is_color: bool) -> Self {
        Self { is_color, cutoff_bits: 0 }
    }

    /// As colours of which those below an alpha are left out.
    pub fn cut_out(cutoff: f32) -> Self {
        let is_cut = cutoff > 0.0 && cutoff <= 1.0;
        Self { is_color: true, cutoff_bits: if is_cut { cutoff.to_bits() } else { 0 } }
    }

    /// True if texels below an alpha are left out.
    pub fn is_cut_out(self) -> bool {
        self.cutoff_bits != 0
    }

    /// Memory that reading so takes beside [`working_bytes`], bytes.
    pub fn working_bytes(self, width: u32, height: u32) -> u64 {
        if self.cutoff_bits == 0 { 0 } else { cut_out::bytes(width, height) }
    }

    fn cutoff(self) -> Option<f32> {
        (self.cutoff_bits != 0).then(|| f32::from_bits(self.cutoff_bits))
    }
}

/// Writes the levels from `first` on to `out`, as half floats. In place of alpha, levels of a cut-out texture hold the
/// distance from the border of what is drawn, in texels, at level 0; and half less than the share that is drawn at
/// others.
pub fn fill(
    pixels: &Pixels,
    reading: Reading,
    first: u32,
    mut out: &mut [[u16; 4]],
    deadline: &Deadline,
) -> Result<(), Stopped> {
    let (width, height, is_color) = (pixels.width, pixels.height, reading.is_color);
    // The alpha channel of a normal map or a metallic map has no meaning.
    let by_alpha = is_color && pixels.has_alpha();
    let lookup: LookupTable<f32> = pixels.lookup_table(is_color, |v| v);
    let distances = match reading.cutoff().filter(|_| by_alpha) {
        Some(cutoff) => Some(cut_out::distances(pixels, &lookup, cutoff, deadline)?),
        None => None,
    };
    let distances_of = |y: usize| distances.as_ref().map(|all| &all[y * width as usize..][..width as usize]);
    if first == 0 {
        let table = pixels.lookup_table(is_color, half);
        let level = take(&mut out, [width, height]);
        let rows = level.par_chunks_exact_mut(width as usize).enumerate().with_min_len(ROWS_MIN);
        rows.try_for_each(|(y, row)| {
            deadline.check()?;
            pixels.row(y as u32, &table, row);
            let distances = distances_of(y).into_iter().flatten();
            row.iter_mut().zip(distances).for_each(|(texel, &distance)| texel[3] = half(distance));
            Ok(())
        })?;
    }
    if count(width, height) == 1 {
        return Ok(());
    }
    let read = |y, row: &mut [[f32; 4]]| {
        pixels.row(y, &lookup, row);
        let distances = distances_of(y as usize).into_iter().flatten();
        row.iter_mut().zip(distances).for_each(|(texel, &distance)| texel[3] = cut_out::share(distance));
    };
    let steps = if by_alpha { 0 } else { square_steps([width, height]).min(first) };
    let (mut level, reached) = if steps > 1 {
        (shrink_often([width, height], steps, deadline, read)?, steps)
    } else {
        (shrink([width, height], by_alpha, deadline, read)?, 1)
    };
    for k in reached.. {
        let size = [side(width, k), side(height, k)];
        if k >= first {
            let out = take(&mut out, size).par_iter_mut().with_min_len(ROWS_MIN << 10);
            let less = if distances.is_some() { 0.5 } else { 0.0 };
            out.zip(&level).for_each(|(out, &[r, g, b, a])| *out = [r, g, b, a - less].map(half));
        }
        if k + 1 == count(width, height) {
            break;
        }
        let stride = size[0] as usize;
        level =
            shrink(size, by_alpha, deadline, |y, row| row.copy_from_slice(&level[y as usize * stride..][..stride]))?;
    }
    Ok(())
}

/// Cuts a level off the front of `out`.
fn take<'a>(out: &mut &'a mut [[u16; 4]], size: [u32; 2]) -> &'a mut [[u16; 4]] {
    let (level, rest) = std::mem::take(out).split_at_mut(size[0] as usize * size[1] as usize);
    *out = rest;
    level
}

/// The level after one of `size` texels, whose rows `read` writes.
fn shrink(
    size: [u32; 2],
    by_alpha: bool,
    deadline: &Deadline,
    read: impl Fn(u32, &mut [[f32; 4]]) + Sync,
) -> Result<Vec<[f32; 4]>, Stopped> {
    let to = size.map(|s| side(s, 1));
    let columns: Vec<Taps> = (0..to[0]).map(|x| Taps::of(size[0], x)).collect();
    let has_even_sides = !by_alpha && size.iter().all(|s| s.is_multiple_of(2));
    let mut out = vec![[0.0; 4]; to[0] as usize * to[1] as usize];
    let rows = out.par_chunks_exact_mut(to[0] as usize).enumerate().with_min_len(ROWS_MIN);
    let buffer = || (vec![[0.0; 4]; 2 * size[0] as usize], vec![Sum::default(); to[0] as usize]);
    rows.try_for_each_init(buffer, |(lines, sums), (y, out)| {
        deadline.check()?;
        if has_even_sides {
            let (upper, lower) = lines.split_at_mut(size[0] as usize);
            read(2 * y as u32, upper);
            read(2 * y as u32 + 1, lower);
            mean_of_squares(upper, lower, out);
            return Ok(());
        }
        let line = &mut lines[..size[0] as usize];
        sums.fill(Sum::default());
        let rows = Taps::of(size[1], y as u32);
        for (row, down) in (rows.first..).zip(rows.weights()) {
            read(row, line);
            for (sum, taps) in sums.iter_mut().zip(&columns) {
                for (texel, across) in line[taps.first as usize..].iter().zip(taps.weights()) {
                    sum.add(texel, down * across, by_alpha);
                }
            }
        }
        for (out, sum) in out.iter_mut().zip(sums) {
            *out = sum.mean(by_alpha);
        }
        Ok(())
    })?;
    Ok(out)
}

/// The number of levels in a row that are means of squares of 2 x 2 texels.
fn square_steps(size: [u32; 2]) -> u32 {
    size[0].trailing_zeros().min(size[1].trailing_zeros())
}

/// The level `steps` after one of `size` texels, all of whose steps are [`square_steps`]. No level in
/// between is kept: memory that is touched for the first time costs more than the means.
fn shrink_often(
    size: [u32; 2],
    steps: u32,
    deadline: &Deadline,
    read: impl Fn(u32, &mut [[f32; 4]]) + Sync,
) -> Result<Vec<[f32; 4]>, Stopped> {
    let to = size.map(|s| side(s, steps));
    let mut out = vec![[0.0; 4]; to[0] as usize * to[1] as usize];
    let rows = out.par_chunks_exact_mut(to[0] as usize).enumerate().with_min_len((2 * ROWS_MIN) >> steps.min(6));
    // Two rows of each finer level.
    let lines = || (0..steps).map(|k| vec![[0.0; 4]; 2 * side(size[0], k) as usize]).collect::<Vec<_>>();
    rows.try_for_each_init(lines, |lines, (y, out)| {
        deadline.check()?;
        mean_row(y as u32, lines, &read, out);
        Ok(())
    })?;
    Ok(out)
}

/// Row `y` of the level after the last one in `lines`.
fn mean_row(y: u32, lines: &mut [Vec<[f32; 4]>], read: &impl Fn(u32, &mut [[f32; 4]]), out: &mut [[f32; 4]]) {
    let Some((last, finer)) = lines.split_last_mut() else { return read(y, out) };
    let (upper, lower) = last.split_at_mut(2 * out.len());
    mean_row(2 * y, finer, read, upper);
    mean_row(2 * y + 1, finer, read, lower);
    mean_of_squares(upper, lower, out);
}

/// The result of [`Sum`], by the same order of additions, for the usual texture: even sides, and
/// alpha that does not count.
fn mean_of_squares(upper: &[[f32; 4]], lower: &[[f32; 4]], out: &mut [[f32; 4]]) {
    let squares = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
    for (out, ([a, b], [c, d])) in out.iter_mut().zip(squares) {
        *out = std::array::from_fn(|k| 0.25 * a[k] + 0.25 * b[k] + 0.25 * c[k] + 0.25 * d[k]);
    }
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
/// Neither way uses a processor's own instruction, so it has the same bits everywhere.
#[inline]
fn half(v: f32) -> u16 {
    let bits = v.to_bits();
    // Positive, and neither subnormal nor too large as a half: all but the smallest texels.
    if (SMALLEST_NORMAL..LARGEST).contains(&bits) {
        let rounded = bits + 0xfff + (bits >> 13 & 1);
        ((rounded - EXPONENT_SHIFT) >> 13) as u16
    } else {
        f16::from_f32_const(v).to_bits()
    }
}

/// The bits of 2^-14 and of 65504 as f32, and the difference between the two formats' exponents.
const SMALLEST_NORMAL: u32 = 113 << 23;
const LARGEST: u32 = 0x477f_e000;
const EXPONENT_SHIFT: u32 = 112 << 23;

#[cfg(test)]
mod tests {
    use super::{Sum, half, mean_of_squares, shrink, shrink_often, side, square_steps};
    use crate::limits::Deadline;

    #[test]
    fn several_steps_at_once_have_the_bits_of_one_after_the_other() {
        let (size, deadline) = ([192, 64], Deadline::default());
        let read = |y: u32, row: &mut [[f32; 4]]| {
            for (x, texel) in row.iter_mut().enumerate() {
                *texel = [1, 3, 5, 7].map(|k| ((y * 31 + x as u32 * k) % 251) as f32 / 253.0);
            }
        };
        assert_eq!((square_steps(size), square_steps([3, 4]), square_steps([4, 6])), (6, 0, 1));
        let mut level = shrink(size, false, &deadline, read).unwrap();
        for steps in 2..=6 {
            let from = size.map(|s| side(s, steps - 1));
            let finer =
                |y: u32, row: &mut [[f32; 4]]| row.copy_from_slice(&level[(y * from[0]) as usize..][..row.len()]);
            level = shrink(from, false, &deadline, finer).unwrap();
            assert_eq!(shrink_often(size, steps, &deadline, read).unwrap(), level, "{steps}");
        }
    }

    #[test]
    fn the_mean_of_squares_has_the_bits_of_the_general_way() {
        // Thirds of many sizes, so that each addition rounds.
        let texel = |i: u32| [0, 1, 2, 3].map(|k| ((i * 7 + k * 13) % 256) as f32 / (3 << (i % 5)) as f32);
        let [upper, lower] = [0, 1000].map(|from| (from..from + 512).map(texel).collect::<Vec<_>>());
        let mut means = vec![[0.0; 4]; 256];
        mean_of_squares(&upper, &lower, &mut means);
        for (x, mean) in means.iter().enumerate() {
            let mut sum = Sum::default();
            for texel in [upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]] {
                sum.add(&texel, 0.5 * 0.5, false);
            }
            assert_eq!(mean.map(f32::to_bits), sum.mean(false).map(f32::to_bits), "{x}");
        }
    }

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
