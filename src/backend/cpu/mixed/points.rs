//! Stage mixed: the coverage points of a pixel, and sets of them.

use crate::backend::cpu::geometry::samples::SampleGrid;
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Columns and rows of points in a pixel: some in each.
pub const POINT_GRID: SampleGrid = SampleGrid { shift: 8, border: 1 };

/// Column and row of each point in its pixel, 1/256 px, without the half.
pub const PLACES: [[i32; POINTS]; 2] = {
    let mut places = [[0; POINTS]; 2];
    let mut i = 0;
    while i < POINTS {
        places[0][i] = (i * GENERATORS[0] % POINTS) as i32;
        places[1][i] = (i * GENERATORS[1] % POINTS) as i32;
        i += 1;
    }
    places
};

/// Largest of [`PLACES`].
pub const PLACE_MAX: i32 = POINTS as i32 - 1;

/// Bits of a word.
const WORD: usize = u64::BITS as usize;

/// Words of a set.
const WORDS: usize = POINTS / WORD;

/// Binary digits of a place.
const DIGITS: usize = 8;

/// By axis and digit: the points whose place has that digit.
const DIGIT_SETS: [[PointSet; DIGITS]; 2] = {
    let mut sets = [[PointSet::NONE; DIGITS]; 2];
    let mut i = 0;
    while i < POINTS {
        let mut digit = 0;
        while digit < DIGITS {
            sets[0][digit].0[i / WORD] |= ((PLACES[0][i] >> digit & 1) as u64) << (i % WORD);
            sets[1][digit].0[i / WORD] |= ((PLACES[1][i] >> digit & 1) as u64) << (i % WORD);
            digit += 1;
        }
        i += 1;
    }
    sets
};

/// Some points of a pixel: bit i of the words, from the lowest, is point i.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointSet(pub [u64; WORDS]);

impl PointSet {
    /// None.
    pub const NONE: Self = Self([0; WORDS]);
    /// All.
    pub const ALL: Self = Self([!0; WORDS]);

    /// The points of this set and the other.
    #[inline(always)]
    pub fn and(mut self, other: Self) -> Self {
        for w in 0..WORDS {
            self.0[w] &= other.0[w];
        }
        self
    }

    /// The points of this set or the other.
    #[inline(always)]
    pub fn or(mut self, other: Self) -> Self {
        for w in 0..WORDS {
            self.0[w] |= other.0[w];
        }
        self
    }

    /// The points of this set that the other has not.
    #[inline(always)]
    pub fn without(mut self, other: Self) -> Self {
        for w in 0..WORDS {
            self.0[w] &= !other.0[w];
        }
        self
    }

    /// True if it has no point.
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        let mut any = 0;
        for w in 0..WORDS {
            any |= self.0[w];
        }
        any == 0
    }

    /// Adds point `i`.
    #[inline(always)]
    pub fn add(&mut self, i: usize) {
        self.0[i / WORD] |= 1 << (i % WORD);
    }

    /// True if it has point `i`.
    #[cfg(test)]
    pub fn has(self, i: usize) -> bool {
        self.0[i / WORD] >> (i % WORD) & 1 != 0
    }

    /// Number of its points.
    #[inline(always)]
    pub fn count(self) -> i32 {
        let mut count = 0;
        for w in 0..WORDS {
            count += self.0[w].count_ones() as i32;
        }
        count
    }

    /// Number of its first point; [`POINTS`] if it has none.
    #[inline(always)]
    pub fn first(self) -> usize {
        let mut first = POINTS;
        for w in (0..WORDS).rev() {
            first = if self.0[w] == 0 { first } else { WORD * w + self.0[w].trailing_zeros() as usize };
        }
        first
    }

    /// Sum of its points' columns and rows, 1/512 px from the pixel's corner.
    #[inline(always)]
    pub fn place_sum(self) -> [i32; 2] {
        let mut sums = [self.count(); 2];
        for (axis, sum) in sums.iter_mut().enumerate() {
            for (digit, set) in DIGIT_SETS[axis].iter().enumerate() {
                *sum += 2 * (self.and(*set).count() << digit);
            }
        }
        sums
    }

    /// Calls `each` with the number of each point.
    #[inline(always)]
    pub fn for_each(self, mut each: impl FnMut(usize)) {
        self.filter(|i| {
            each(i);
            true
        });
    }

    /// Its points for which `stays` is true.
    #[inline(always)]
    pub fn filter(mut self, mut stays: impl FnMut(usize) -> bool) -> Self {
        for w in 0..WORDS {
            let mut left = self.0[w];
            while left != 0 {
                let bit = left.trailing_zeros();
                left &= left - 1;
                if !stays(WORD * w + bit as usize) {
                    self.0[w] ^= 1 << bit;
                }
            }
        }
        self
    }

    /// The points for which `is_in` is true.
    #[inline(always)]
    pub fn of(mut is_in: impl FnMut(usize) -> bool) -> Self {
        let mut set = Self::NONE;
        for w in 0..WORDS {
            for bit in 0..WORD {
                set.0[w] |= u64::from(is_in(WORD * w + bit)) << bit;
            }
        }
        set
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_know_their_points() {
        let sets = [
            PointSet::NONE,
            PointSet::ALL,
            PointSet::of(|i| i == 0),
            PointSet::of(|i| i == 255),
            PointSet::of(|i| i * i % 7 == 2),
            PointSet::of(|i| i > 100 && i % 64 < 3),
        ];
        for set in sets {
            let points: Vec<usize> = (0..POINTS).filter(|&i| set.has(i)).collect();
            assert_eq!(set.count() as usize, points.len());
            assert_eq!(set.first(), points.first().copied().unwrap_or(POINTS));
            assert_eq!(set.is_empty(), points.is_empty());
            assert_eq!(set, PointSet::of(|i| points.contains(&i)));
            assert_eq!(set.filter(|i| i % 3 == 1), PointSet::of(|i| set.has(i) && i % 3 == 1));
            assert_eq!(
                set.place_sum(),
                [0, 1].map(|axis| points.iter().map(|&i| 2 * PLACES[axis][i] + 1).sum::<i32>())
            );
            for other in sets {
                assert_eq!(set.and(other), PointSet::of(|i| set.has(i) && other.has(i)));
                assert_eq!(set.or(other), PointSet::of(|i| set.has(i) || other.has(i)));
                assert_eq!(set.without(other), PointSet::of(|i| set.has(i) && !other.has(i)));
            }
        }
    }
}
