//! The division of a pixel's 256 coverage points among its samples: each sample gets the same number of points, those
//! closest to it as far as possible.
//!
//! The points are a rank-1 lattice. They are finer than samples, of which a pixel has at most 16. The stage lines
//! counts the points that a line covers, and finds by this division how much that is of what each sample shows.

use std::sync::OnceLock;

use crate::plan::sample_offsets;

/// Points in a pixel.
pub const POINTS: usize = 256;

/// Their positions: point i is the `g i`-th of as many columns (the first) and rows (the second),
/// modulo their number. A rank-1 lattice (Korobov's), no two of whose points share a row or a
/// column: on a square grid, lines along its rows would be off by half a row. The generator is the
/// one whose counts of half planes are closest to their areas.
pub const GENERATORS: [usize; 2] = [1, 181];

/// Index of the assigned sample per point.
pub type SamplePartition = [u8; POINTS];

/// The partition for `samples` samples. Its parts are equally large, because samples weigh the
/// same, and as close to their samples as that allows.
pub fn sample_partition(samples: u32) -> &'static SamplePartition {
    static PARTITIONS: [OnceLock<SamplePartition>; 4] = [const { OnceLock::new() }; 4];
    let [one, four, eight, sixteen] = &PARTITIONS;
    let made = match samples {
        1 => one,
        4 => four,
        8 => eight,
        _ => sixteen,
    };
    made.get_or_init(|| divide(sample_offsets(samples)))
}

/// Gives each point to the nearest sample that has room, nearest first; then two points change
/// places for as long as that brings them closer to their samples. All in integers, so that it is
/// the same everywhere.
fn divide(samples: &[[i32; 2]]) -> SamplePartition {
    let away = |point: usize, sample: u8| away(point, samples[usize::from(sample)]);
    let numbers = 0..samples.len() as u8;
    let mut pairs: Vec<(usize, u8)> = (0..POINTS).flat_map(|p| numbers.clone().map(move |s| (p, s))).collect();
    pairs.sort_by_key(|&(p, s)| (away(p, s), p, s));
    let mut partition: [Option<u8>; POINTS] = [None; POINTS];
    let mut room = vec![POINTS / samples.len(); samples.len()];
    for (p, s) in pairs {
        let room = &mut room[usize::from(s)];
        if partition[p].is_none() && *room > 0 {
            partition[p] = Some(s);
            *room -= 1;
        }
    }
    let mut partition = partition.map(Option::unwrap_or_default);
    let mut has_changed = true;
    while has_changed {
        has_changed = false;
        for p in 0..POINTS {
            for q in 0..p {
                let (a, b) = (partition[p], partition[q]);
                if away(p, b) + away(q, a) < away(p, a) + away(q, b) {
                    (partition[p], partition[q]) = (b, a);
                    has_changed = true;
                }
            }
        }
    }
    partition
}

/// The square of a point's distance from a sample, which is in 1/256 px: in 1/512 px, where points
/// lie in the middle of theirs.
fn away(point: usize, sample: [i32; 2]) -> i32 {
    let along = |k: usize| 2 * ((point * GENERATORS[k]) % POINTS) as i32 + 1 - 2 * sample[k];
    along(0) * along(0) + along(1) * along(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PX: i32 = 512;

    #[test]
    fn parts_are_equally_large_and_around_their_samples() {
        // Largest distance of a point from its sample, in 1/100 px.
        for (samples, farthest) in [(1, 71), (4, 41), (8, 37), (16, 26)] {
            let (partition, offsets) = (sample_partition(samples), sample_offsets(samples));
            let mut counts = vec![0; samples as usize];
            let (mut moved, mut most) = (0, 0);
            for (p, &s) in partition.iter().enumerate() {
                counts[usize::from(s)] += 1;
                let own = away(p, offsets[usize::from(s)]);
                let nearest = offsets.iter().map(|&at| away(p, at)).min().unwrap();
                moved += usize::from(own > nearest);
                most = most.max(own);
            }
            assert_eq!(counts, vec![POINTS as i32 / samples as i32; samples as usize], "{samples}");
            let limit = farthest * PX / 100;
            assert!(most <= limit * limit, "{samples}: {} px", f64::from(most).sqrt() / f64::from(PX));
            // Symmetric samples have equally many nearest points, except for the lattice's own
            // grain.
            assert!(moved <= if samples <= 4 { 6 } else { 32 }, "{samples}: {moved} points have a nearer sample");
        }
    }

    #[test]
    fn no_two_points_share_a_place() {
        for generator in GENERATORS {
            let mut places: Vec<usize> = (0..POINTS).map(|i| i * generator % POINTS).collect();
            places.sort_unstable();
            assert_eq!(places, (0..POINTS).collect::<Vec<_>>());
        }
    }
}
