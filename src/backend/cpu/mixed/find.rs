//! Stage mixed, per pixel: finds the mixed pixels.
//!
//! A pixel is mixed if its samples and those of its four neighbours show several faces (or a face and
//! nothing) and colours do not go on from one to the next ([`Pairs::goes_on`]). Where an edge goes through a pixel
//! without parting its samples, it parts those of neighbours.

use super::look::Pairs;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::isa::dispatch;

/// The mixed pixels of a band, row by row, and what finds them.
#[derive(Default)]
pub struct MixedPixels {
    /// The column of each.
    pub columns: Vec<u16>,
    /// By pixel of the shown rows, and after the last: the number of mixed pixels before it.
    pub starts: Vec<u32>,
    /// By row modulo 3: the places where colours do not go on, as bits of [`breaks`].
    breaks: [Row; 3],
    /// Of one row.
    is_mixed: Vec<u8>,
}

/// Places where colours do not go on from sample to sample.
mod breaks {
    /// From the pixel's first sample to its others, one after the other.
    pub const OWN: u8 = 1;
    /// From the first sample of the pixel on the left to this one's.
    pub const LEFT: u8 = 2;
    /// The same from the pixel above.
    pub const UPPER: u8 = 4;
}

/// Values of a row's pixels, and of one more on each side.
#[derive(Default)]
struct Row {
    /// Its number.
    y: Option<i32>,
    /// The first lies left of the picture.
    values: Vec<u8>,
}

impl Row {
    fn reset(&mut self, width: usize) {
        self.y = None;
        self.values.clear();
        self.values.reserve_exact(width + 2);
        self.values.resize(width + 2, 0);
    }

    fn bytes(&self) -> usize {
        self.values.capacity()
    }
}

impl MixedPixels {
    /// Empties the lists, which have room for a band of so many columns and rows from then on.
    pub fn reset(&mut self, [width, rows]: [usize; 2]) {
        self.columns.clear();
        self.starts.clear();
        self.columns.reserve_exact(width * rows);
        self.starts.reserve_exact(width * rows + 1);
        for row in &mut self.breaks {
            row.reset(width);
        }
        self.is_mixed.clear();
        self.is_mixed.resize(width, 0);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.columns.capacity() * size_of::<u16>()
            + self.starts.capacity() * size_of::<u32>()
            + self.breaks.iter().map(Row::bytes).sum::<usize>()
            + self.is_mixed.capacity()
    }

    /// The [`bytes`](Self::bytes) of a band, at most.
    pub const fn bytes_of([width, rows]: [usize; 2]) -> usize {
        let pixel = size_of::<u16>() + size_of::<u32>();
        width * rows * pixel + size_of::<u32>() + 3 * (width + 2) + width
    }
}

dispatch! {
    /// Finds the mixed pixels of a band's shown rows.
    pub fn find(context: &RasterContext<'_>, band: &SampleBand, mixed: &mut MixedPixels) = find_kernel
}

#[inline(always)]
fn find_kernel(context: &RasterContext<'_>, band: &SampleBand, mixed: &mut MixedPixels) {
    let [first, end] = band.shown.map(|row| row as i32);
    let width = band.size_px[0] as usize;
    mixed.reset([width, (end - first) as usize]);
    let mut pairs = Pairs::new();
    for y in first..end {
        for y in y - 1..=y + 1 {
            let row = &mut mixed.breaks[y.rem_euclid(3) as usize];
            if row.y != Some(y) {
                row.y = Some(y);
                find_breaks(context, band, y, &mut pairs, &mut row.values);
            }
        }
        mixed.join(y);
        for x in 0..width {
            mixed.starts.push(mixed.columns.len() as u32);
            if mixed.is_mixed[x] != 0 {
                mixed.columns.push(x as u16);
            }
        }
    }
    mixed.starts.push(mixed.columns.len() as u32);
}

impl MixedPixels {
    /// Marks the mixed pixels of a row: those where colours break off in the pixel, in one beside, above or below it, or
    /// on the way from its first sample to theirs.
    #[inline(always)]
    fn join(&mut self, y: i32) {
        use breaks::{LEFT, OWN, UPPER};
        let [above, own, below] = [y - 1, y, y + 1].map(|y| &self.breaks[y.rem_euclid(3) as usize].values[..]);
        for (x, out) in self.is_mixed.iter_mut().enumerate() {
            let beside = own[x] & OWN | own[x + 1] | own[x + 2] & (OWN | LEFT);
            *out = beside | above[x + 1] & OWN | below[x + 1] & (OWN | UPPER);
        }
    }
}

/// Finds where colours break off in a row of pixels, from the one left of the picture to the one right of it.
#[inline(always)]
fn find_breaks(context: &RasterContext<'_>, band: &SampleBand, y: i32, pairs: &mut Pairs, out: &mut [u8]) {
    mark_differing(band, y, out);
    for (x, out) in (-1..).zip(out) {
        if *out != 0 || context.is_plain {
            *out = breaks_at(context, band, [x, y], pairs);
        }
    }
}

/// The places where colours break off in a pixel, and on the way to it.
#[inline(always)]
fn breaks_at(context: &RasterContext<'_>, band: &SampleBand, [x, y]: [i32; 2], pairs: &mut Pairs) -> u8 {
    let ids_of = |x: i32, y: i32| if band.has(x, y) { band.pixel(x, y).0 } else { &[NOTHING] };
    let ids = ids_of(x, y);
    let mut found = 0;
    for s in 1..ids.len() {
        if !pairs.goes_on(context, ids[s - 1], ids[s]) {
            found |= breaks::OWN;
            break;
        }
    }
    if !pairs.goes_on(context, ids_of(x - 1, y)[0], ids[0]) {
        found |= breaks::LEFT;
    }
    if !pairs.goes_on(context, ids_of(x, y - 1)[0], ids[0]) {
        found |= breaks::UPPER;
    }
    found
}

/// Marks the pixels of a row, from the one left of the picture to the one right of it, whose samples
/// differ from each other, or from the first one of the pixel to the left or above.
#[inline(always)]
fn mark_differing(band: &SampleBand, y: i32, out: &mut [u8]) {
    let width = band.size_px[0] as i32;
    let first_of = |x: i32, y: i32| if band.has(x, y) { band.pixel(x, y).0[0] } else { NOTHING };
    let is_several = |x: i32, y: i32| band.has(x, y) && band.pixel(x, y).0.iter().any(|&id| id != first_of(x, y));
    let differs =
        |x: i32| is_several(x, y) | (first_of(x, y) != first_of(x - 1, y)) | (first_of(x, y) != first_of(x, y - 1));
    let row = |y: i32| {
        let at = band.has(0, y).then(|| band.index(0, y, 0))?;
        Some(band.ids[at..at + band.size_px[0] as usize * band.samples as usize].as_chunks::<4>().0)
    };
    let (Some(own), Some(upper), 4) = (row(y), row(y - 1), band.samples) else {
        for (x, out) in (-1..).zip(out) {
            *out = u8::from(differs(x));
        }
        return;
    };
    for x in [-1, 0, width] {
        out[(x + 1) as usize] = u8::from(differs(x));
    }
    for x in 1..own.len() {
        let [a, b, c, d] = own[x];
        let difference = (a ^ b) | (a ^ c) | (a ^ d) | (a ^ own[x - 1][0]) | (a ^ upper[x][0]);
        out[x + 1] = u8::from(difference != 0);
    }
}
