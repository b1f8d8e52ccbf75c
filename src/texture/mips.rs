//! Smaller versions of a texture: each texel of the next level is the mean of the area it covers, in linear light, colours
//! weighted by alpha, so that what is transparent does not bleed.

use crate::limits::{Deadline, Stopped};
use crate::texture::decode::{Pixels, Table};
use crate::texture::half::half;

/// How many levels an image has, down to a single texel.
pub fn count(width: u32, height: u32) -> u32 {
    32 - width.max(height).leading_zeros()
}

/// Texels of the levels from `first` on.
pub fn texels(width: u32, height: u32, first: u32) -> u64 {
    (first..count(width, height)).map(|k| u64::from(side(width, k)) * u64::from(side(height, k))).sum()
}

/// The size of a side at a level.
pub fn side(px: u32, level: u32) -> u32 {
    (px >> level).max(1)
}

/// Memory that [`append`] takes beside its result: the first smaller level and the next one.
pub fn working_bytes(width: u32, height: u32) -> u64 {
    let px = |level| u64::from(side(width, level)) * u64::from(side(height, level));
    (px(1) + px(2)).saturating_mul(16).saturating_add(64 * u64::from(width) + (4 << 16))
}

/// Appends the levels from `first` on as half floats.
pub fn append(
    pixels: &Pixels,
    is_color: bool,
    first: u32,
    out: &mut Vec<[u16; 4]>,
    deadline: &Deadline,
) -> Result<(), Stopped> {
    let (width, height) = (pixels.width, pixels.height);
    if first == 0 {
        let table = pixels.table(is_color, half);
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
    // In a normal or a metallic map, alpha means nothing.
    let weigh = is_color && pixels.has_alpha();
    let table: Table<f32> = pixels.table(is_color, |v| v);
    let mut level = shrink([width, height], weigh, deadline, |y, row| pixels.row(y, &table, row))?;
    for k in 1.. {
        if k >= first {
            out.extend(level.iter().map(|texel| texel.map(half)));
        }
        if k + 1 == count(width, height) {
            break;
        }
        let size = [side(width, k), side(height, k)];
        let stride = size[0] as usize;
        level = shrink(size, weigh, deadline, |y, row| row.copy_from_slice(&level[y as usize * stride..][..stride]))?;
    }
    Ok(())
}

/// The next level of an image whose rows `read` gives.
fn shrink(
    size: [u32; 2],
    weigh: bool,
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
                    sum.add(texel, down * across, weigh);
                }
            }
        }
        out.extend(sums.iter().map(|sum| sum.mean(weigh)));
    }
    Ok(out)
}

/// The texels that one of the next level covers, and how much of each; the weights add up to 1.
struct Taps {
    first: u32,
    count: usize,
    weights: [f32; 3],
}

impl Taps {
    /// Of texel `at` of the next level of a side of `from` texels. An odd side 2 m + 1 becomes m: each covers 2 + 1/m.
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

#[derive(Clone, Copy, Default)]
struct Sum {
    /// Colour times alpha, and alpha.
    weighted: [f32; 4],
    plain: [f32; 3],
}

impl Sum {
    #[inline(always)]
    fn add(&mut self, texel: &[f32; 4], weight: f32, weigh: bool) {
        let [r, g, b, a] = *texel;
        for (sum, v) in self.plain.iter_mut().zip([r, g, b]) {
            *sum += weight * v;
        }
        self.weighted[3] += weight * a;
        if weigh {
            for (sum, v) in self.weighted.iter_mut().zip([r, g, b]) {
                *sum += weight * a * v;
            }
        }
    }

    fn mean(&self, weigh: bool) -> [f32; 4] {
        let [r, g, b] = self.plain;
        let [wr, wg, wb, a] = self.weighted;
        if weigh && a > 0.0 { [wr / a, wg / a, wb / a, a] } else { [r, g, b, a] }
    }
}
