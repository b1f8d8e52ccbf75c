//! The finest mip level that is kept of each texture, so that all textures of a picture fit into one buffer
//! of at most [`TEXELS_MAX`] texels.
//!
//! Levels finer than the picture can show go first. If those that it shows are still too many, the largest
//! texture loses its finest level, again and again until all fit.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::texture::mips;

/// 96 MiB of half floats. Every GPU allows bindings of 128 MiB, and the smallest limit counts.
pub const TEXELS_MAX: u64 = (96 << 20) / 8;

/// The first level to keep of each texture, given its size and the finest level that the picture
/// can show.
///
/// `drops_finer` says whether levels finer than `finest` are dropped. Either way the picture is the
/// same: what the cap takes from visible levels does not depend on it.
pub fn first_levels(sizes: &[[u32; 2]], finest: &[u32], drops_finer: bool) -> Vec<u32> {
    let mut shown = finest.to_vec();
    fit(sizes, &mut shown, |_| u32::MAX);
    if drops_finer {
        return shown;
    }
    let mut kept: Vec<u32> = shown.iter().zip(finest).map(|(&s, &f)| if s > f { s } else { 0 }).collect();
    fit(sizes, &mut kept, |i| shown[i]);
    kept
}

/// Raises the first level of the largest texture, the first one of equals, until all fit; of
/// texture `i` not beyond `last(i)`.
fn fit(sizes: &[[u32; 2]], first: &mut [u32], last: impl Fn(usize) -> u32) {
    let texels = |i: usize, first: u32| mips::texels(sizes[i][0], sizes[i][1], first);
    let mut total: u64 = (0..sizes.len()).map(|i| texels(i, first[i])).sum();
    let mut heap: BinaryHeap<(u64, Reverse<usize>)> =
        (0..sizes.len()).map(|i| (texels(i, first[i]), Reverse(i))).collect();
    while total > TEXELS_MAX {
        let Some((before, Reverse(i))) = heap.pop() else { return };
        if first[i] < last(i) && first[i] + 1 < mips::count(sizes[i][0], sizes[i][1]) {
            first[i] += 1;
            let after = texels(i, first[i]);
            total -= before - after;
            heap.push((after, Reverse(i)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_are_halved_until_all_fit() {
        let sizes = [[4096, 4096], [2048, 2048], [64, 64], [4096, 4096]];
        // With their smaller levels 22.4 + 5.6 + 22.4 million texels; 12.6 are allowed.
        assert_eq!(first_levels(&sizes, &[0; 4], true), [2, 1, 0, 1]);
        assert_eq!(first_levels(&sizes, &[0; 4], false), [2, 1, 0, 1]);
        // Levels that are not shown do not count, and keeping them takes nothing from those that
        // are.
        assert_eq!(first_levels(&sizes, &[2, 0, 3, 2], true), [2, 0, 3, 2]);
        let kept = first_levels(&sizes, &[2, 0, 3, 2], false);
        assert_eq!(kept, [2, 0, 0, 2]);
        let total: u64 = sizes.iter().zip(&kept).map(|(s, &k)| mips::texels(s[0], s[1], k)).sum();
        assert!(total <= TEXELS_MAX);
    }
}
