//! The visibility buffer of a band (a range of pixel rows): the id and the depth of the nearest triangle at every
//! sample. A pixel has 1, 4, 8 or 16 samples.

use crate::backend::cpu::isa::LANES;

/// Calls `f::<S>` for `S` samples per pixel, so that its loops over them have a constant length.
macro_rules! for_samples {
    ($samples:expr, $($f:ident).+ ($($argument:expr),* $(,)?)) => {
        match $samples {
            1 => $($f).+::<1>($($argument),*),
            4 => $($f).+::<4>($($argument),*),
            8 => $($f).+::<8>($($argument),*),
            _ => $($f).+::<16>($($argument),*),
        }
    };
}
pub(crate) use for_samples;

/// Samples beyond a row's last pixel, so that a vector may hang over: as many as the widest vector has.
pub const HANGOVER: usize = 2 * LANES;

/// No triangle.
pub const NOTHING: u32 = u32::MAX;

/// Columns, and rows, in which samples lie: as many in a pixel as it has samples, at equal
/// distances.
#[derive(Clone, Copy)]
pub struct SampleGrid {
    /// Binary logarithm of the number in a pixel.
    pub shift: i32,
    /// Distance from the pixel's border to the first, 1/256 px.
    pub border: i32,
}

impl SampleGrid {
    /// The grid of pixels with 1, 4, 8 or 16 samples.
    #[inline(always)]
    pub fn new(samples: u32) -> Self {
        Self { shift: samples.trailing_zeros() as i32, border: 128 / samples as i32 }
    }

    /// First and last pixel from `from` to before `to` whose samples may lie between two
    /// coordinates, in 1/256 px from the picture's corner; the first is beyond the last if there
    /// are none.
    #[inline(always)]
    pub fn pixels(&self, [low, high]: [i32; 2], [from, to]: [i32; 2]) -> [i32; 2] {
        let first = (low.wrapping_add(self.border - 1)) >> (8 - self.shift);
        let last = (high.wrapping_sub(self.border)) >> (8 - self.shift);
        // Between two columns of samples the first is the last's successor, perhaps of one pixel.
        let last = if first <= last { last >> self.shift } else { i32::MIN };
        [(first >> self.shift).max(from), last.min(to - 1)]
    }
}

/// Rows of samples of one horizontal band of the picture.
pub struct SampleBand {
    /// Picture size, pixels.
    pub size_px: [u32; 2],
    /// Columns beyond the picture, left and right of it.
    pub margin: u32,
    /// First row of the band; negative above the picture.
    pub first_row: i32,
    /// Rows in the band.
    pub rows: u32,
    /// First row that is shown, and the row after the last; what lies beyond them in the band hides
    /// lines that reach into it.
    pub shown: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Samples in a row, padded so that a vector may hang over the right edge.
    pub stride: usize,
    /// Reversed depth at `row * stride + x * samples + s`; 0 where there is nothing.
    pub depth: Vec<f32>,
    /// Triangle id, laid out likewise.
    pub ids: Vec<u32>,
}

impl SampleBand {
    /// An empty band at the top of a picture, with so many columns beyond it on each side.
    pub fn new(size_px: [u32; 2], margin: u32, rows: u32, samples: u32) -> Self {
        let stride = (size_px[0] + 2 * margin) as usize * samples as usize + HANGOVER;
        let len = stride * rows as usize;
        let (depth, ids) = (vec![0.0; len], vec![NOTHING; len]);
        Self { size_px, margin, first_row: 0, rows, shown: [0, rows], samples, stride, depth, ids }
    }

    /// Empties the band.
    pub fn clear(&mut self) {
        self.depth.fill(0.0);
        self.ids.fill(NOTHING);
    }

    /// Columns, and rows, from the first to before the last, counted as the picture's are.
    #[inline(always)]
    pub fn range(&self) -> [[i32; 2]; 2] {
        let margin = self.margin as i32;
        [[-margin, self.size_px[0] as i32 + margin], [self.first_row, self.first_row + self.rows as i32]]
    }

    /// Index of sample `s` of the pixel at column `x`, row `y` of the picture, or beyond it.
    #[inline(always)]
    pub fn index(&self, x: i32, y: i32, s: u32) -> usize {
        let column = (x + self.margin as i32) as u32;
        (y - self.first_row) as usize * self.stride + (column * self.samples + s) as usize
    }

    /// Depths and ids of the samples from `at` on.
    #[inline(always)]
    pub fn lanes_mut(&mut self, at: usize) -> Option<(&mut [f32; LANES], &mut [u32; LANES])> {
        let depths = self.depth.get_mut(at..)?.first_chunk_mut::<LANES>()?;
        let ids = self.ids.get_mut(at..)?.first_chunk_mut::<LANES>()?;
        Some((depths, ids))
    }

    /// Depth and id of a sample in one number: nearer is larger; of equal depths the lower id is.
    #[inline(always)]
    pub fn word(&self, at: usize) -> u64 {
        let id = self.ids[at];
        if id == NOTHING { 0 } else { u64::from(self.depth[at].to_bits()) << 32 | u64::from(!id) }
    }

    /// True if the band holds a pixel of the picture or beyond.
    #[inline(always)]
    pub fn has(&self, x: i32, y: i32) -> bool {
        let [columns, rows] = self.range();
        (x >= columns[0]) & (x < columns[1]) & (y >= rows[0]) & (y < rows[1])
    }

    /// Ids and depths of a pixel's samples.
    #[inline(always)]
    pub fn pixel(&self, x: i32, y: i32) -> (&[u32], &[f32]) {
        let first = self.index(x, y, 0);
        let samples = first..first + self.samples as usize;
        (&self.ids[samples.clone()], &self.depth[samples])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::sample_offsets;

    /// Every interval in two pixels, against the places of the samples themselves.
    #[test]
    fn pixels_are_those_with_a_sample_in_the_interval() {
        let mut intervals = 0;
        for samples in [1, 4, 8, 16] {
            let grid = SampleGrid::new(samples);
            for axis in [0, 1] {
                let place = |pixel: i32, s: usize| 256 * pixel + sample_offsets(samples)[s][axis];
                for low in 0..512 {
                    for high in low..512 {
                        let is_in =
                            |pixel: &i32| (0..samples as usize).any(|s| (low..=high).contains(&place(*pixel, s)));
                        let [first, last] = grid.pixels([low, high], [-10, 10]);
                        let found: Vec<i32> = (first..=last).collect();
                        assert_eq!(
                            found,
                            (0..2).filter(is_in).collect::<Vec<_>>(),
                            "{samples} samples, {low} to {high}"
                        );
                        intervals += 1;
                    }
                }
            }
        }
        assert_eq!(intervals, 4 * 2 * 512 * 513 / 2);
    }
}
