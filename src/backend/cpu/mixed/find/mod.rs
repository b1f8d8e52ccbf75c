//! Stage mixed, per pixel: finds the mixed pixels, and knows where they are.
//!
//! A pixel is mixed if its samples and those of its four neighbours show several faces (or a face and
//! nothing) and colours break off from one to the next ([`Pairs::step`]). Where an edge goes through a pixel
//! without parting its samples, it parts those of neighbours. Pixels of thin triangles are mixed, too, which no
//! sample need see ([`thin`]).

pub mod look;
pub mod thin;

use std::ops::{ControlFlow, Range};

use self::look::{Pairs, Step};
use self::thin::mark_thin;
use super::band_triangles::BandTriangles;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::isa::dispatch;

/// The mixed pixels of a band, row by row, and what finds them.
#[derive(Default)]
pub struct MixedPixels {
    /// The column of each.
    pub columns: Vec<u16>,
    /// True for each that few points are enough for.
    pub needs_few: Vec<bool>,
    /// By pixel of the shown rows, and after the last: the number of mixed pixels before it.
    pub starts: Vec<u32>,
    /// The number of mixed pixels above and left of each corner of a pixel, row by row.
    pub sums: Vec<u32>,
    /// By row modulo 3: the places where colours do not go on, as bits of [`breaks`].
    breaks: [Row; 3],
    /// Of one row.
    is_mixed: Vec<u8>,
    /// By pixel of the shown rows: [`breaks::THIN`].
    thin: Vec<u8>,
}

/// Places where colours break off from sample to sample, slightly or more.
pub mod breaks {
    /// From the pixel's first sample to its others, one after the other.
    pub const OWN: u8 = 1;
    /// From the first sample of the pixel on the left to this one's.
    pub const LEFT: u8 = 2;
    /// The same from the pixel above.
    pub const UPPER: u8 = 4;
    /// To a thin triangle in the pixel that no sample need see.
    pub const THIN: u8 = 8;
    /// From the bits above to those of the same places where colours break off more than slightly.
    pub const HARD: u32 = 4;
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
        self.needs_few.clear();
        self.starts.clear();
        self.columns.reserve_exact(width * rows);
        self.needs_few.reserve_exact(width * rows);
        self.starts.reserve_exact(width * rows + 1);
        self.starts.resize(width * rows + 1, 0);
        self.sums.clear();
        self.sums.reserve_exact((width + 1) * (rows + 1));
        self.sums.resize((width + 1) * (rows + 1), 0);
        for row in &mut self.breaks {
            row.reset(width);
        }
        self.is_mixed.clear();
        self.is_mixed.resize(width, 0);
        self.thin.clear();
        self.thin.reserve_exact(width * rows);
        self.thin.resize(width * rows, 0);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.columns.capacity() * size_of::<u16>()
            + self.needs_few.capacity()
            + (self.starts.capacity() + self.sums.capacity()) * size_of::<u32>()
            + self.breaks.iter().map(Row::bytes).sum::<usize>()
            + self.is_mixed.capacity()
            + self.thin.capacity()
    }

    /// The [`bytes`](Self::bytes) of a band, at most.
    pub const fn bytes_of([width, rows]: [usize; 2]) -> usize {
        let pixel = size_of::<u16>() + size_of::<bool>() + size_of::<u32>() + size_of::<u8>();
        let corners = (width + 1) * (rows + 1) * size_of::<u32>();
        width * rows * pixel + size_of::<u32>() + corners + 3 * (width + 2) + width
    }
}

dispatch! {
    /// Finds the mixed pixels of a band's shown rows.
    pub fn find(
        context: &RasterContext<'_>,
        triangles: &BandTriangles<'_>,
        band: &SampleBand,
        mixed: &mut MixedPixels,
    ) = find_kernel
}

#[inline(always)]
fn find_kernel(context: &RasterContext<'_>, triangles: &BandTriangles<'_>, band: &SampleBand, mixed: &mut MixedPixels) {
    let [first, end] = band.shown.map(|row| row as i32);
    let width = band.size_px[0] as usize;
    mixed.reset([width, (end - first) as usize]);
    let mut pairs = Pairs::new();
    let mut poll = DeadlinePoll::new(context.deadline);
    // A picture whose deadline has passed is thrown away.
    let _ = triangles.for_each_thin(|triangle| {
        let looked_at = mark_thin(context, band, &triangle, &mut pairs, mixed);
        if poll.is_expired(looked_at as u64) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    for y in first..end {
        for y in y - 1..=y + 1 {
            let row = &mut mixed.breaks[y.rem_euclid(3) as usize];
            if row.y != Some(y) {
                row.y = Some(y);
                find_breaks(context, band, y, &mut pairs, &mut row.values);
            }
        }
        let row = (y - first) as usize;
        mixed.join(y, row);
        mixed.list(row);
    }
    if let Some(last) = mixed.starts.last_mut() {
        *last = mixed.columns.len() as u32;
    }
}

impl MixedPixels {
    /// Number of the mixed pixels up to the end of a shown row.
    fn end_of(&self, row: u32, samples: &SampleBand) -> usize {
        let rows = (row + 1 - samples.shown[0]) as usize;
        self.starts[rows * samples.size_px[0] as usize] as usize
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

    /// True if none of the pixels from the first to the last column and row is mixed; rows are counted from the first
    /// shown one.
    #[inline(always)]
    pub fn are_none_in(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2], width: usize) -> bool {
        let at = |x: usize, y: usize| self.sums[y * (width + 1) + x];
        let [above, below] = [top, bottom + 1].map(|y| at(right + 1, y) - at(left, y));
        below == above
    }

    /// Marks the mixed pixels of a row: those where colours break off in the pixel, in one beside, above or below it,
    /// or on the way from its first sample to theirs. `row` is its number among the shown ones.
    #[inline(always)]
    fn join(&mut self, y: i32, row: usize) {
        const OWN: u8 = breaks::OWN | breaks::OWN << breaks::HARD;
        const LEFT: u8 = breaks::LEFT | breaks::LEFT << breaks::HARD;
        const UPPER: u8 = breaks::UPPER | breaks::UPPER << breaks::HARD;
        let [above, own, below] = [y - 1, y, y + 1].map(|y| &self.breaks[y.rem_euclid(3) as usize].values[..]);
        let thin = &self.thin[row * self.is_mixed.len()..];
        for (x, out) in self.is_mixed.iter_mut().enumerate() {
            let beside = own[x] & OWN | own[x + 1] | own[x + 2] & (OWN | LEFT);
            *out = beside | above[x + 1] & OWN | below[x + 1] & (OWN | UPPER) | thin[x];
        }
    }

    /// Adds the marked pixels of a row to the lists. `row` is its number among the shown ones.
    #[inline(always)]
    fn list(&mut self, row: usize) {
        let width = self.is_mixed.len();
        let before = self.columns.len() as u32;
        let starts = &mut self.starts[row * width..][..width];
        let (above, own) = self.sums[row * (width + 1)..][..2 * (width + 1)].split_at_mut(width + 1);
        let mut any = 0;
        for bits in &self.is_mixed {
            any |= bits;
        }
        if any == 0 {
            starts.fill(before);
            own.copy_from_slice(above);
            return;
        }
        let mut count = 0;
        let corners = above[1..].iter().zip(&mut own[1..]);
        for (x, ((bits, start), (above, own))) in self.is_mixed.iter().zip(starts).zip(corners).enumerate() {
            *start = before + count;
            if *bits != 0 {
                self.columns.push(x as u16);
                self.needs_few.push(bits >> breaks::HARD == 0);
                count += 1;
            }
            *own = above + count;
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
        found |= pairs.step(context, ids[s - 1], ids[s]).breaks(breaks::OWN);
    }
    found |= pairs.step(context, ids_of(x - 1, y)[0], ids[0]).breaks(breaks::LEFT);
    found | pairs.step(context, ids_of(x, y - 1)[0], ids[0]).breaks(breaks::UPPER)
}

impl Step {
    /// The bits of this step, given that of its place.
    #[inline(always)]
    fn breaks(self, place: u8) -> u8 {
        match self {
            Self::None => 0,
            Self::Slight => place,
            Self::Hard => place | place << breaks::HARD,
        }
    }
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
