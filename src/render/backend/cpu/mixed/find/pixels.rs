//! The mixed pixels of a band (a range of pixel rows), as a list row by row and as a bit mask
//! (stage mixed). Mixed pixels are drawn a second time, from 64 or 256 points each. By the mask,
//! the part of the list is found that lies in a range of columns of a row.

use std::ops::Range;

use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::mixed::find::breaks;
use crate::backend::cpu::mixed::find::differing::WORD;

/// The mixed pixels of a band's shown rows.
#[derive(Default)]
pub struct MixedPixels {
    /// The column of each.
    pub columns: Vec<u16>,
    /// True for each that few points are enough for.
    pub needs_few: Vec<bool>,
    /// Words of a row. The place after the last column has a word, too, which [`numbers_in`](Self::numbers_in) reads.
    words_in_row: usize,
    /// A bit for each mixed pixel, row by row.
    words: Vec<u64>,
    /// By word, and after the last: the number of mixed pixels before it.
    before: Vec<u32>,
}

impl MixedPixels {
    /// Empties the lists, which have room for a band of so many columns and rows from then on.
    pub fn reset(&mut self, [width, rows]: [usize; 2]) {
        self.words_in_row = words_in_row(width);
        self.columns.clear();
        self.needs_few.clear();
        self.words.clear();
        self.before.clear();
        self.columns.reserve_exact(width * rows);
        self.needs_few.reserve_exact(width * rows);
        self.words.reserve_exact(self.words_in_row * rows);
        self.before.reserve_exact(self.words_in_row * rows + 1);
        self.before.push(0);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.columns.capacity() * size_of::<u16>()
            + self.needs_few.capacity() * size_of::<bool>()
            + self.words.capacity() * size_of::<u64>()
            + self.before.capacity() * size_of::<u32>()
    }

    /// The [`bytes`](Self::bytes) of a band, at most.
    pub const fn bytes_of([width, rows]: [usize; 2]) -> usize {
        let word = size_of::<u64>() + size_of::<u32>();
        width * rows * (size_of::<u16>() + size_of::<bool>()) + words_in_row(width) * rows * word + size_of::<u32>()
    }

    /// Adds the next row: a byte of [`breaks`] per pixel, 0 for those that are not mixed.
    #[inline(always)]
    pub fn push_row(&mut self, marks: &[u8]) {
        for first in (0..self.words_in_row * WORD).step_by(WORD) {
            let marks = marks.get(first..).unwrap_or_default();
            let marks = marks.get(..WORD).unwrap_or(marks);
            let mut any = 0;
            for mark in marks {
                any |= mark;
            }
            let mut word = 0;
            if any != 0 {
                for (bit, mark) in marks.iter().enumerate().filter(|(_, mark)| **mark != 0) {
                    word |= 1 << bit;
                    self.columns.push((first + bit) as u16);
                    self.needs_few.push(mark >> breaks::HARD == 0);
                }
            }
            self.words.push(word);
            self.before.push(self.columns.len() as u32);
        }
    }

    /// True if no pixel from the first to the last column and row is mixed. Rows are counted from the first shown one.
    #[inline(always)]
    pub fn are_none_in(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> bool {
        let (first, last) = (left / WORD, right / WORD);
        let mut found = 0;
        for row in top..=bottom {
            for word in first..=last {
                let from = if word == first { !0 << (left % WORD) } else { !0 };
                let to = if word == last { !0 >> (WORD - 1 - right % WORD) } else { !0 };
                found |= self.words[row * self.words_in_row + word] & from & to;
            }
        }
        found == 0
    }

    /// Numbers of the mixed pixels from the first to the last column of a row, which is counted from the first shown
    /// one.
    #[inline(always)]
    pub fn numbers_in(&self, row: usize, [left, right]: [usize; 2]) -> Range<usize> {
        let words = row * self.words_in_row;
        let before = |x: usize| {
            let at = words + x / WORD;
            (self.before[at] + (self.words[at] & ((1 << (x % WORD)) - 1)).count_ones()) as usize
        };
        before(left)..before(right + 1)
    }

    /// Number of the mixed pixels up to the end of a shown row.
    fn end_of(&self, row: u32, samples: &SampleBand) -> usize {
        let rows = (row + 1 - samples.shown[0]) as usize;
        self.before[rows * self.words_in_row] as usize
    }

    /// The row of a mixed pixel.
    pub fn row_of(&self, i: usize, samples: &SampleBand) -> u32 {
        let [first, end] = samples.shown;
        (first..end).find(|&row| i < self.end_of(row, samples)).unwrap_or(first)
    }

    /// The first row of some mixed pixels, and the one after their last.
    pub fn rows(&self, pixels: &Range<usize>, samples: &SampleBand) -> [i32; 2] {
        let last = self.row_of(pixels.end.saturating_sub(1), samples);
        [self.row_of(pixels.start, samples) as i32, last as i32 + 1]
    }

    /// Column and row of a mixed pixel. `row` is that of the one before it.
    #[inline(always)]
    pub fn place(&self, i: usize, samples: &SampleBand, row: &mut u32) -> [u32; 2] {
        while i >= self.end_of(*row, samples) {
            *row += 1;
        }
        [u32::from(self.columns[i]), *row]
    }
}

const fn words_in_row(width: usize) -> usize {
    width / WORD + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_numbered_row_by_row() {
        for width in [1, 63, 64, 65, 200] {
            let mut pixels = MixedPixels::default();
            pixels.reset([width, 3]);
            let mark = |x: usize, row: usize| [0, 1, 0, 1 << breaks::HARD, 0, 0, 0][(x * x + 5 * row + width) % 7];
            let mut want = Vec::new();
            for row in 0..3 {
                let marks: Vec<u8> = (0..width).map(|x| mark(x, row)).collect();
                pixels.push_row(&marks);
                want.extend((0..width).filter(|&x| marks[x] != 0).map(|x| (row, x, marks[x] == 1)));
            }
            let mut samples = SampleBand::new([width as u32, 9], 0, 3, 1);
            samples.shown = [4, 7];
            let mut place_row = 4;
            assert_eq!(pixels.columns.len(), want.len());
            for (i, (row, x, needs_few)) in want.iter().enumerate() {
                assert_eq!(pixels.place(i, &samples, &mut place_row), [*x as u32, *row as u32 + 4]);
                assert_eq!(pixels.row_of(i, &samples), *row as u32 + 4);
                assert_eq!(pixels.needs_few[i], *needs_few);
            }
            for (row, left) in (0..3).flat_map(|row| (0..width).map(move |left| (row, left))) {
                for right in left..width {
                    let is_before = |end: usize| want.iter().filter(|(r, x, _)| (*r, *x) < (row, end)).count();
                    assert_eq!(pixels.numbers_in(row, [left, right]), is_before(left)..is_before(right + 1));
                    for top in 0..=row {
                        let is_in =
                            |(r, x, _): &(usize, usize, bool)| (top..=row).contains(r) && (left..=right).contains(x);
                        assert_eq!(pixels.are_none_in([left, right], [top, row]), !want.iter().any(is_in));
                    }
                }
            }
            assert!(pixels.bytes() <= MixedPixels::bytes_of([width, 3]));
        }
    }
}
