//! Alpha of cut-out textures at coarser levels: of each level, as large a share is drawn as of the image.
//!
//! The mean of texels has lower contrast than the texels, so leaves and lattices would vanish, or close up,
//! when seen from afar. The alpha of each level is scaled instead so that the share of texels above the
//! cutoff stays (Castano, "Computing alpha mipmaps", 2010).

use crate::limits::{Deadline, Stopped};
use crate::texture::decode::{LookupTable, Pixels};

/// Largest factor of alpha, and the inverse of the smallest.
const FACTOR_MAX: f32 = 64.0;

/// Rows between two looks at the deadline.
const CHECK_EVERY: u32 = 256;

/// The share of an image's texels whose alpha is at least the cutoff.
pub fn share(pixels: &Pixels, table: &LookupTable<f32>, cutoff: f32, deadline: &Deadline) -> Result<f64, Stopped> {
    let mut row = vec![[0.0; 4]; pixels.width as usize];
    let mut count = 0_u64;
    for y in 0..pixels.height {
        if y.is_multiple_of(CHECK_EVERY) {
            deadline.check()?;
        }
        pixels.row(y, table, &mut row);
        count += row.iter().filter(|texel| texel[3] >= cutoff).count() as u64;
    }
    Ok(count as f64 / (f64::from(pixels.width) * f64::from(pixels.height)).max(1.0))
}

/// The factor of a level's alpha for which this share of its area reaches the cutoff. A level is sampled
/// between its texels, so four places in each texel count, a quarter of its side from the middle.
pub fn factor(level: &[[f32; 4]], size: [u32; 2], share: f64, cutoff: f32) -> f32 {
    let [width, height] = size.map(|side| side as usize);
    let count = (share * 4.0 * level.len() as f64 + 0.5) as usize;
    if count == 0 || count > 4 * level.len() || level.len() != width * height {
        return 1.0;
    }
    let alpha = |x: usize, y: usize| level[y * width + x][3];
    let mut alphas = Vec::with_capacity(4 * level.len());
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        for beside_y in [y.saturating_sub(1), (y + 1).min(height - 1)] {
            for beside_x in [x.saturating_sub(1), (x + 1).min(width - 1)] {
                let near = 0.75 * alpha(x, y) + 0.25 * alpha(beside_x, y);
                let far = 0.75 * alpha(x, beside_y) + 0.25 * alpha(beside_x, beside_y);
                alphas.push(0.75 * near + 0.25 * far);
            }
        }
    }
    let (_, last, _) = alphas.select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a));
    // A little more, so that the last one reaches the cutoff after rounding.
    if *last > 0.0 { (cutoff / *last * 1.001).clamp(1.0 / FACTOR_MAX, FACTOR_MAX) } else { 1.0 }
}

/// Memory that [`factor`] takes for the largest level of an image that is scaled, bytes.
pub fn bytes(width: u32, height: u32) -> u64 {
    u64::from((width / 2).max(1)).saturating_mul(u64::from((height / 2).max(1))).saturating_mul(16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of many places between texels whose alpha reaches the cutoff.
    fn covered(level: &[[f32; 4]], side: usize, factor: f32, cutoff: f32) -> f64 {
        let (steps, mut count) = (8, 0);
        let at = |x: i64, y: i64| {
            let [x, y] = [x, y].map(|v| v.clamp(0, side as i64 - 1) as usize);
            f64::from(level[y * side + x][3])
        };
        for (j, i) in (0..side * steps).flat_map(|j| (0..side * steps).map(move |i| (j, i))) {
            let [u, v] = [i, j].map(|k| (k as f64 + 0.5) / steps as f64 - 0.5);
            let ([x, y], [fx, fy]) = ([u.floor() as i64, v.floor() as i64], [u - u.floor(), v - v.floor()]);
            let row = |y: i64| at(x, y) * (1.0 - fx) + at(x + 1, y) * fx;
            count += usize::from((row(y) * (1.0 - fy) + row(y + 1) * fy) * f64::from(factor) >= f64::from(cutoff));
        }
        count as f64 / (side * steps * side * steps) as f64
    }

    #[test]
    fn the_share_above_the_cutoff_is_kept() {
        let side = 32;
        let mut cases = 0;
        for cutoff in [0.25_f32, 0.5, 0.75, 1.0] {
            for share in [0.1, 0.3, 0.5, 0.8] {
                // Hills of many heights.
                let height =
                    |i: usize| 0.3 + 0.2 * libm::sinf(i as f32 * 0.61) + 0.1 * libm::cosf((i / side) as f32 * 0.9);
                let level: Vec<[f32; 4]> = (0..side * side).map(|i| [0.0, 0.0, 0.0, height(i)]).collect();
                let factor = factor(&level, [side as u32; 2], share, cutoff);
                let found = covered(&level, side, factor, cutoff);
                assert!((found - share).abs() < 0.04, "{cutoff} {share}: {found}");
                cases += 1;
            }
        }
        assert_eq!(cases, 16);
        let clear = [[0.0; 4]; 16];
        let none = [factor(&clear, [4; 2], 0.5, 0.5), factor(&clear, [4; 2], 0.0, 0.5), factor(&[], [0; 2], 0.5, 0.5)];
        assert_eq!(none, [1.0; 3]);
    }
}
