//! A grid of square cells over the picture, and marks of some of its cells. They shorten the search for
//! faces that hide an outline: `visible_parts` marks the cells along silhouette edges and beside them,
//! and `grid` leaves out the faces that are near no marked cell.

use crate::plan::PX;

/// The fewest and the most cells.
const CELLS: [f64; 2] = [256.0, 1_048_576.0];

/// A grid over the picture. What lies beside the picture belongs to the cells at its border.
#[derive(Clone, Copy, Debug)]
pub struct Cells {
    /// Half the picture's size, 1/256 px.
    half: [f64; 2],
    /// Cells per 1/256 px.
    per_unit: f64,
    /// Columns and rows.
    size: [usize; 2],
}

impl Cells {
    /// Cells for so many faces in a picture of this size. They are a power of two pixels wide.
    pub fn new(half: [f64; 2], faces: usize) -> Self {
        let count = (faces as f64).clamp(CELLS[0], CELLS[1]);
        let mut width = PX;
        while 4.0 * half[0] * half[1] > count * width * width {
            width *= 2.0;
        }
        let size = half.map(|half| (2.0 * half / width) as usize + 1);
        Self { half, per_unit: 1.0 / width, size }
    }

    /// The number of cells.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The column (axis 0) or row (1) of a coordinate.
    #[inline]
    pub fn along(&self, axis: usize, v: f64) -> usize {
        let at = ((v + self.half[axis]) * self.per_unit) as i32;
        (at.max(0) as usize).min(self.size[axis] - 1)
    }

    /// The cell of a point.
    pub fn at(&self, [x, y]: [f64; 2]) -> usize {
        self.along(1, y) * self.size[0] + self.along(0, x)
    }

    /// Calls `each` with the cells that a line or a triangle with these corners may touch.
    pub fn each<const N: usize>(&self, corners: &[[f64; 2]; N], mut each: impl FnMut(usize)) {
        self.each_row(corners, |row, from, to| (from..=to).for_each(|column| each(row * self.size[0] + column)));
    }

    /// Calls `each` with the rows of these cells, and the first and the last column in each.
    #[inline]
    pub fn each_row<const N: usize>(&self, corners: &[[f64; 2]; N], mut each: impl FnMut(usize, usize, usize)) {
        let [[left, top], [right, bottom]] = self.around(corners);
        for row in top..=bottom {
            let (from, to) = if right <= left + 1 || top == bottom { (left, right) } else { self.across(corners, row) };
            each(row, from, to);
        }
    }

    /// The first and the last column and row of some points.
    #[inline]
    pub fn around<const N: usize>(&self, points: &[[f64; 2]; N]) -> [[usize; 2]; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for axis in 0..2 {
                // Not `f64::min` and `max`, which look for NaN.
                low[axis] = if point[axis] < low[axis] { point[axis] } else { low[axis] };
                high[axis] = if point[axis] > high[axis] { point[axis] } else { high[axis] };
            }
        }
        [[self.along(0, low[0]), self.along(1, low[1])], [self.along(0, high[0]), self.along(1, high[1])]]
    }

    /// The first and the last column of what lies in a row.
    fn across<const N: usize>(&self, corners: &[[f64; 2]; N], row: usize) -> (usize, usize) {
        let border = |row: usize| row as f64 / self.per_unit - self.half[1];
        let upper = if row == 0 { f64::NEG_INFINITY } else { border(row) - 1.0 };
        let lower = if row + 1 == self.size[1] { f64::INFINITY } else { border(row + 1) + 1.0 };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % N];
            let (first, last) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            if first[1] > lower || last[1] < upper {
                continue;
            }
            let at = |y: f64| first[0] + (last[0] - first[0]) * ((y - first[1]) / (last[1] - first[1]));
            for x in
                [if first[1] < upper { at(upper) } else { first[0] }, if last[1] > lower { at(lower) } else { last[0] }]
            {
                (low, high) = (low.min(x), high.max(x));
            }
        }
        (self.along(0, low - 1.0), self.along(0, high + 1.0))
    }
}

/// The cells that are asked about.
pub struct Marks {
    /// The grid.
    pub cells: Cells,
    /// Words of each row.
    row_words: usize,
    words: Vec<u64>,
}

impl Marks {
    /// No cell of a grid. The caller has spent [`Marks::bytes`].
    pub fn new(cells: Cells) -> Self {
        let row_words = cells.size[0].div_ceil(64);
        Self { cells, row_words, words: vec![0; row_words * cells.size[1]] }
    }

    /// Memory for this grid.
    pub fn bytes(cells: &Cells) -> u64 {
        (cells.size[0].div_ceil(64) * cells.size[1]) as u64 * 8
    }

    /// Marks the cells that a line touches.
    pub fn line(&mut self, ends: &[[f64; 2]; 2]) {
        let (words, row_words) = (&mut self.words, self.row_words);
        self.cells.each_row(ends, |row, from, to| {
            (from..=to).for_each(|column| words[row * row_words + column / 64] |= 1 << (column % 64));
        });
    }

    /// Marks the cell of a point.
    pub fn point(&mut self, [x, y]: [f64; 2]) {
        let (column, row) = (self.cells.along(0, x), self.cells.along(1, y));
        self.words[row * self.row_words + column / 64] |= 1 << (column % 64);
    }

    /// Calls `each` with the first cell of 64 in a row, and the bits of those that are marked, from a column
    /// to another.
    #[inline]
    fn each_word(&self, row: usize, [from, to]: [usize; 2], mut each: impl FnMut(usize, u64)) {
        for word in from / 64..=to / 64 {
            let mut bits = self.words[row * self.row_words + word];
            if word == from / 64 {
                bits &= u64::MAX << (from % 64);
            }
            if word == to / 64 {
                bits &= u64::MAX >> (63 - to % 64);
            }
            if bits != 0 {
                each(row * self.cells.size[0] + word * 64, bits);
            }
        }
    }

    /// True if any cell around some points is marked.
    #[inline]
    pub fn meet<const N: usize>(&self, points: &[[f64; 2]; N]) -> bool {
        let [[left, top], [right, bottom]] = self.cells.around(points);
        (top..=bottom).any(|row| {
            let mut is_met = false;
            self.each_word(row, [left, right], |_, _| is_met = true);
            is_met
        })
    }

    /// Calls `each` with the marked cells that a triangle may touch.
    #[inline]
    pub fn each_marked(&self, corners: &[[f64; 2]; 3], mut each: impl FnMut(usize)) {
        self.cells.each_row(corners, |row, from, to| {
            if from <= to {
                self.each_word(row, [from, to], |first, mut bits| {
                    while bits != 0 {
                        each(first + bits.trailing_zeros() as usize);
                        bits &= bits - 1;
                    }
                });
            }
        });
    }
}
