//! The points from which a mixed pixel is drawn, and sets of these points as bits (stage mixed). The points are a
//! rank-1 lattice of 256 points, or every fourth of them. Mixed pixels are drawn a second time, because faces of
//! different colours meet in or near them.

use crate::backend::cpu::geometry::samples::SampleGrid;
use crate::backend::sample_partition::{GENERATORS, POINTS};

/// Columns and rows of points in a pixel: some in each.
pub const POINT_GRID: SampleGrid = SampleGrid { shift: 8, border: 1 };

/// Bits of a word.
const WORD: usize = u64::BITS as usize;

/// Words of a set of all [`POINTS`].
pub const ALL_WORDS: usize = POINTS / WORD;

/// Binary digits of a place.
const DIGITS: usize = 8;

/// The points of a pixel of which sets have `W` words: all, or evenly spaced ones of them.
pub struct Lattice<const W: usize>;

impl<const W: usize> Lattice<W> {
    /// Number of points.
    pub const POINTS: usize = W * WORD;

    /// Of so many points of the whole lattice, one is a point of this one.
    pub const STEP: usize = ALL_WORDS / W;

    /// The first of them. The second of four is the one whose counts of half planes are closest to their areas.
    pub const FIRST: usize = Self::STEP / 4;

    /// Column and row of each point in its pixel, 1/256 px, without the half; by word and bit.
    pub const PLACES: [[[i32; WORD]; W]; 2] = {
        let mut places = [[[0; WORD]; W]; 2];
        let mut i = 0;
        while i < Self::POINTS {
            let whole = Self::STEP * i + Self::FIRST;
            places[0][i / WORD][i % WORD] = (whole * GENERATORS[0] % POINTS) as i32;
            places[1][i / WORD][i % WORD] = (whole * GENERATORS[1] % POINTS) as i32;
            i += 1;
        }
        places
    };

    /// By axis and digit: the points whose place has that digit.
    const DIGIT_SETS: [[PointSet<W>; DIGITS]; 2] = {
        let mut sets = [[PointSet::NONE; DIGITS]; 2];
        let mut i = 0;
        while i < Self::POINTS {
            let mut digit = 0;
            while digit < DIGITS {
                let mut axis = 0;
                while axis < 2 {
                    let bit = Self::PLACES[axis][i / WORD][i % WORD] >> digit & 1;
                    sets[axis][digit].0[i / WORD] |= (bit as u64) << (i % WORD);
                    axis += 1;
                }
                digit += 1;
            }
            i += 1;
        }
        sets
    };

    /// The column and row of point `i`.
    #[inline(always)]
    pub fn place(i: usize) -> [i32; 2] {
        [Self::PLACES[0].as_flattened()[i], Self::PLACES[1].as_flattened()[i]]
    }
}

/// Largest number of a column or row, of whatever lattice.
pub const PLACE_MAX: i32 = POINTS as i32 - 1;

/// Some points of a pixel: bit i of the words, from the lowest, is point i.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointSet<const W: usize>(pub [u64; W]);

impl<const W: usize> PointSet<W> {
    /// None.
    pub const NONE: Self = Self([0; W]);
    /// All.
    pub const ALL: Self = Self([!0; W]);

    /// The points of this set and the other.
    #[inline(always)]
    pub fn and(mut self, other: Self) -> Self {
        for w in 0..W {
            self.0[w] &= other.0[w];
        }
        self
    }

    /// The points of this set or the other.
    #[inline(always)]
    pub fn or(mut self, other: Self) -> Self {
        for w in 0..W {
            self.0[w] |= other.0[w];
        }
        self
    }

    /// The points of this set that the other has not.
    #[inline(always)]
    pub fn without(mut self, other: Self) -> Self {
        for w in 0..W {
            self.0[w] &= !other.0[w];
        }
        self
    }

    /// True if it has no point.
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        let mut any = 0;
        for w in 0..W {
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
        for w in 0..W {
            count += self.0[w].count_ones() as i32;
        }
        count
    }

    /// Number of its first point; that of all points if it has none.
    #[inline(always)]
    pub fn first(self) -> usize {
        let mut first = Lattice::<W>::POINTS;
        for w in (0..W).rev() {
            first = if self.0[w] == 0 { first } else { WORD * w + self.0[w].trailing_zeros() as usize };
        }
        first
    }

    /// Sum of its points' columns and rows, 1/512 px from the pixel's corner.
    #[inline(always)]
    pub fn place_sum(self) -> [i32; 2] {
        let mut sums = [self.count(); 2];
        for (axis, sum) in sums.iter_mut().enumerate() {
            for (digit, set) in Lattice::<W>::DIGIT_SETS[axis].iter().enumerate() {
                *sum += 2 * (self.and(*set).count() << digit);
            }
        }
        sums
    }

    /// Its points in each quarter of the pixel.
    #[inline(always)]
    pub fn quarters(self) -> [Self; 4] {
        let [right, lower] = [0, 1].map(|axis| Lattice::<W>::DIGIT_SETS[axis][DIGITS - 1]);
        let (left, right) = (self.without(right), self.and(right));
        [left.without(lower), right.without(lower), left.and(lower), right.and(lower)]
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
        for w in 0..W {
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
        for w in 0..W {
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

    fn sets_of<const W: usize>() {
        let sets: [PointSet<W>; 6] = [
            PointSet::NONE,
            PointSet::ALL,
            PointSet::of(|i| i == 0),
            PointSet::of(|i| i == Lattice::<W>::POINTS - 1),
            PointSet::of(|i| i * i % 7 == 2),
            PointSet::of(|i| i > 25 * W && i % 16 < 3),
        ];
        for set in sets {
            let points: Vec<usize> = (0..Lattice::<W>::POINTS).filter(|&i| set.has(i)).collect();
            assert_eq!(set.count() as usize, points.len());
            assert_eq!(set.first(), points.first().copied().unwrap_or(Lattice::<W>::POINTS));
            assert_eq!(set.is_empty(), points.is_empty());
            assert_eq!(set, PointSet::of(|i| points.contains(&i)));
            assert_eq!(set.filter(|i| i % 3 == 1), PointSet::of(|i| set.has(i) && i % 3 == 1));
            let sum = |axis: usize| points.iter().map(|&i| 2 * Lattice::<W>::place(i)[axis] + 1).sum::<i32>();
            assert_eq!(set.place_sum(), [0, 1].map(sum));
            for other in sets {
                assert_eq!(set.and(other), PointSet::of(|i| set.has(i) && other.has(i)));
                assert_eq!(set.or(other), PointSet::of(|i| set.has(i) || other.has(i)));
                assert_eq!(set.without(other), PointSet::of(|i| set.has(i) && !other.has(i)));
            }
        }
    }

    #[test]
    fn sets_know_their_points() {
        sets_of::<1>();
        sets_of::<ALL_WORDS>();
    }

    /// As many columns and rows as there are points have one of them, at equal distances.
    #[test]
    fn few_points_are_spread_as_all_are() {
        for axis in 0..2 {
            for (places, step) in [(&Lattice::<1>::PLACES[axis][..], 4), (&Lattice::<ALL_WORDS>::PLACES[axis][..], 1)] {
                let mut places = places.as_flattened().to_vec();
                places.sort_unstable();
                assert!(places.windows(2).all(|pair| pair[1] - pair[0] == step), "{places:?}");
            }
        }
    }
}
