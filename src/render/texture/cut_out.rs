//! Cut-out textures: the distance of each texel from the border between what is drawn and what is
//! left out.
//!
//! Only texels whose alpha reaches the material's cutoff are drawn, such as those of a leaf. A pixel's
//! coverage is the share of it that is drawn. If texels are larger than pixels, this share follows from
//! the distance to the border and the size of the pixel. If texels are smaller, it is the mean of the
//! texels' coverages, which the coarser mip levels hold.
//!
//! These levels do not hold the mean of alpha, because its contrast falls from level to level: leaves
//! and lattices would vanish, or close up.

use rayon::prelude::*;

use crate::limits::{Deadline, Stopped};
use crate::texture::decode::{LookupTable, Pixels};

/// The distance of each texel's middle from the border of what is drawn, in texels: positive where alpha reaches the
/// cutoff. At most 1 and at least -1. It is the difference from the cutoff over the steepest change of alpha to the
/// texels beside it.
pub fn distances(
    pixels: &Pixels,
    table: &LookupTable<f32>,
    cutoff: f32,
    deadline: &Deadline,
) -> Result<Vec<f32>, Stopped> {
    let [width, height] = [pixels.width, pixels.height].map(|side| side as usize);
    let mut alphas = vec![0.0; width * height];
    let line = || vec![[0.0; 4]; width];
    alphas.par_chunks_exact_mut(width).enumerate().try_for_each_init(line, |line, (y, alphas)| {
        deadline.check()?;
        pixels.row(y as u32, table, line);
        alphas.iter_mut().zip(line).for_each(|(alpha, texel)| *alpha = texel[3]);
        Ok::<_, Stopped>(())
    })?;
    let mut distances = vec![0.0; width * height];
    distances.par_chunks_exact_mut(width).enumerate().try_for_each(|(y, row)| {
        deadline.check()?;
        let [above, own, below] =
            [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &alphas[y * width..][..width]);
        for (x, distance) in row.iter_mut().enumerate() {
            let [left, right] = [x.saturating_sub(1), (x + 1).min(width - 1)].map(|x| own[x]);
            let steepest = |before: f32, after: f32| (own[x] - before).abs().max((after - own[x]).abs());
            *distance = distance_of(own[x] - cutoff, [steepest(left, right), steepest(above[x], below[x])]);
        }
        Ok::<_, Stopped>(())
    })?;
    Ok(distances)
}

/// The distance where alpha exceeds the cutoff by so much, and changes so much from texel to texel.
fn distance_of(excess: f32, [across, down]: [f32; 2]) -> f32 {
    let change = (across * across + down * down).sqrt();
    // There is no border nearby if alpha does not change.
    if excess.abs() < change {
        excess / change
    } else if excess >= 0.0 {
        1.0
    } else {
        -1.0
    }
}

/// The share of a texel that is drawn, by its distance from the border.
pub fn share(distance: f32) -> f32 {
    (distance + 0.5).clamp(0.0, 1.0)
}

/// Memory of [`distances`], bytes.
pub fn bytes(width: u32, height: u32) -> u64 {
    u64::from(width).saturating_mul(u64::from(height)).saturating_mul(8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_in_texels_and_have_bounds() {
        // A border between two texels, one along the diagonal of a ramp, and none.
        for (excess, change, want) in [
            (0.5, [1.0, 0.0], 0.5),
            (-0.5, [1.0, 0.0], -0.5),
            (0.03, [0.3, 0.4], 0.06),
            (-0.6, [0.1, 0.1], -1.0),
            (0.2, [0.0, 0.0], 1.0),
            (0.0, [0.0, 0.0], 1.0),
            (-0.2, [0.0, 0.0], -1.0),
        ] {
            assert!((distance_of(excess, change) - want).abs() < 1e-6, "{excess} {change:?}");
        }
        assert_eq!([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0].map(share), [0.0, 0.0, 0.5, 0.75, 1.0, 1.0]);
    }
}
