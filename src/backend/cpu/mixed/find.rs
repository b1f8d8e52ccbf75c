//! Stage mixed, per pixel: finds the mixed pixels.
//!
//! A pixel is mixed if the samples of it and of its eight neighbours show several faces (or a face and
//! nothing) whose colours may differ, by their [`Look`], and do not go on from one to the other
//! ([`are_linked`]). Where an edge goes through a pixel without parting its samples, it parts those of
//! neighbours.

use super::look::{Look, are_linked};
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
    /// By row modulo 3: which pixels show several ids.
    differing: [Row<u8>; 3],
    /// By row modulo 3, as far as they are known.
    looks: [Row<Option<PixelLook>>; 3],
    /// Of one row.
    may_be_mixed: Vec<u8>,
}

/// The look of the faces that a pixel's samples see.
#[derive(Clone, Copy, Debug)]
struct PixelLook {
    look: Look,
    links: Links,
}

/// True where colours go on from face to face.
#[derive(Clone, Copy, Debug)]
struct Links {
    /// From the pixel's first sample to each of its others, one after the other.
    own: bool,
    /// From the first sample of the pixel on the left to this one's.
    left: bool,
    /// The same from the pixel above.
    upper: bool,
}

/// Values of a row's pixels, and of one more on each side.
#[derive(Default)]
struct Row<T> {
    /// Its number.
    y: Option<i32>,
    /// The first lies left of the picture.
    values: Vec<T>,
}

impl<T: Copy> Row<T> {
    fn reset(&mut self, width: usize, value: T) {
        self.y = None;
        self.values.clear();
        self.values.reserve_exact(width + 2);
        self.values.resize(width + 2, value);
    }

    fn bytes(&self) -> usize {
        self.values.capacity() * size_of::<T>()
    }
}

impl MixedPixels {
    /// Empties the lists, which have room for a band of so many columns and rows from then on.
    pub fn reset(&mut self, [width, rows]: [usize; 2]) {
        self.columns.clear();
        self.starts.clear();
        self.columns.reserve_exact(width * rows);
        self.starts.reserve_exact(width * rows + 1);
        for row in &mut self.differing {
            row.reset(width, 0);
        }
        for row in &mut self.looks {
            row.reset(width, None);
        }
        self.may_be_mixed.clear();
        self.may_be_mixed.resize(width, 1);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        let rows = self.differing.iter().map(Row::bytes).chain(self.looks.iter().map(Row::bytes));
        self.columns.capacity() * size_of::<u16>()
            + self.starts.capacity() * size_of::<u32>()
            + rows.sum::<usize>()
            + self.may_be_mixed.capacity()
    }

    /// The [`bytes`](Self::bytes) of a band, at most.
    pub const fn bytes_of([width, rows]: [usize; 2]) -> usize {
        let pixel = size_of::<u16>() + size_of::<u32>();
        let of_rows = 3 * (width + 2) * (size_of::<u8>() + size_of::<Option<PixelLook>>());
        width * rows * pixel + size_of::<u32>() + of_rows + width
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
    for y in first..end {
        if !context.is_plain {
            mixed.mark_candidates(band, y);
        }
        for x in 0..width {
            mixed.starts.push(mixed.columns.len() as u32);
            if mixed.may_be_mixed[x] != 0 && mixed.is_mixed(context, band, [x as i32, y]) {
                mixed.columns.push(x as u16);
            }
        }
    }
    mixed.starts.push(mixed.columns.len() as u32);
}

impl MixedPixels {
    /// Marks the pixels of a row that show several ids, or whose neighbours do.
    #[inline(always)]
    fn mark_candidates(&mut self, band: &SampleBand, y: i32) {
        for y in y - 1..=y + 1 {
            let row = &mut self.differing[y.rem_euclid(3) as usize];
            if row.y != Some(y) {
                row.y = Some(y);
                mark_differing(band, y, &mut row.values);
            }
        }
        let [a, b, c] = self.differing.each_ref().map(|row| &row.values[..]);
        for (x, out) in self.may_be_mixed.iter_mut().enumerate() {
            *out = (a[x] | a[x + 1] | a[x + 2]) | (b[x] | b[x + 1] | b[x + 2]) | (c[x] | c[x + 1] | c[x + 2]);
        }
    }

    /// True if a pixel is mixed.
    #[inline(always)]
    fn is_mixed(&mut self, context: &RasterContext<'_>, band: &SampleBand, [x, y]: [i32; 2]) -> bool {
        let (mut all, mut are_linked): (Option<Look>, _) = (None, true);
        for row_y in y - 1..=y + 1 {
            let row = &mut self.looks[row_y.rem_euclid(3) as usize];
            if row.y != Some(row_y) {
                row.y = Some(row_y);
                row.values.fill(None);
            }
            for (column, pixel) in (x - 1..).zip(&mut row.values[x as usize..x as usize + 3]) {
                let pixel = pixel.get_or_insert_with(|| pixel_look(context, band, [column, row_y]));
                all = Some(all.map_or(pixel.look, |all| all.and(&pixel.look)));
                // The links between these nine pixels, in a comb.
                are_linked &= pixel.links.own;
                are_linked &= pixel.links.left | (column < x);
                are_linked &= pixel.links.upper | (column != x) | (row_y < y);
            }
        }
        !are_linked && all.is_some_and(|all| all.is_mixed())
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

/// The faces that a pixel's samples see, and the way in which they go on from its neighbours.
#[inline(always)]
fn pixel_look(context: &RasterContext<'_>, band: &SampleBand, [x, y]: [i32; 2]) -> PixelLook {
    let ids_of = |x: i32, y: i32| if band.has(x, y) { band.pixel(x, y).0 } else { &[NOTHING] };
    let ids = ids_of(x, y);
    let mut look = Look::of(context, ids[0]);
    let mut own = true;
    for s in 1..ids.len() {
        if ids[s] != ids[s - 1] {
            look = look.and(&Look::of(context, ids[s]));
            own = own && are_linked(context, ids[s - 1], ids[s]);
        }
    }
    let from = |x: i32, y: i32| are_linked(context, ids_of(x, y)[0], ids[0]);
    PixelLook { look, links: Links { own, left: from(x - 1, y), upper: from(x, y - 1) } }
}
