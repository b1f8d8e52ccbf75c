//! The areas that lines leave free on small faces, those at most 7 px wide and high (stage lines).
//! The area of such a face's inset (the part that the lines along its sides leave free) is computed
//! only in groups of pixels that may touch the inset, because it is certainly 0 elsewhere: four
//! pixels of each of two rows at a time, or eight of one row.

use super::Digger;
use crate::backend::cpu::isa::LANES;
use crate::backend::cpu::lines::holes::Holes;
use crate::backend::cpu::lines::holes::inset::{Inset, SMALL_PIXELS};

/// Columns in which areas are found at once.
const COLUMNS: usize = LANES / 2;

impl<const S: usize> Digger<'_, S> {
    /// As [`dig`](Digger::dig), of a small face that touches these columns and rows.
    #[inline(always)]
    pub(super) fn dig_small(&self, inset: &Inset, id: u32, [columns, rows]: [[i32; 2]; 2], holes: &mut Holes) {
        let count = |[first, last]: [i32; 2]| ((last - first + 1) as usize).min(SMALL_PIXELS);
        let (width, height) = (count(columns), count(rows));
        // Per row, from the one above the first on, the pixels that show the face, from the one before the
        // first column on.
        let mut shown = [0; SMALL_PIXELS + 2];
        for (y, shown) in (rows[0] - 1..).zip(&mut shown[..height + 2]) {
            *shown = self.shown(id, columns[0], y, width);
        }
        // Per row, the pixels in which the face counts; one row more, in which it does not.
        let mut close = [0; SMALL_PIXELS + 1];
        for i in 0..height {
            let around = shown[i] | shown[i + 1] | shown[i + 2];
            close[i] = (around | around >> 1 | around >> 2) & ((1 << width) - 1);
            if close[i] != 0 {
                self.mark_hidden((inset, id), [columns[0], rows[0] + i as i32], (close[i], width), holes);
            }
        }
        let open = inset.open_pixels();
        let range = |k: usize, [first, last]: [i32; 2]| open[k][0].max(first)..open[k][1].min(last) + 1;
        if range(0, columns).len() > COLUMNS {
            for y in range(1, rows) {
                let close = close[(y - rows[0]) as usize % SMALL_PIXELS];
                if close != 0 {
                    let areas = masked(inset.areas(self.context.isa, columns[0], y), close);
                    add_areas::<LANES>([columns[0], y], &areas, holes);
                }
            }
            return;
        }
        for y in range(1, rows).step_by(2) {
            let row = (y - rows[0]) as usize;
            for x in range(0, columns).step_by(COLUMNS) {
                let pixels = |row: usize| close[row.min(SMALL_PIXELS)] >> (x - columns[0]) & ((1 << COLUMNS) - 1);
                let close = pixels(row) | pixels(row + 1) << COLUMNS;
                if close != 0 {
                    let areas = masked(inset.areas_in_two_rows(self.context.isa, x, y), close);
                    let (upper, lower) = areas.split_at(COLUMNS);
                    add_areas::<COLUMNS>([x, y], upper, holes);
                    add_areas::<COLUMNS>([x, y + 1], lower, holes);
                }
            }
        }
    }
}

/// The areas of the pixels whose bits are set, and 0.
#[inline(always)]
pub fn masked(mut areas: [u32; LANES], bits: u32) -> [u32; LANES] {
    for l in 0..LANES {
        areas[l] &= 0_u32.wrapping_sub(bits >> l & 1);
    }
    areas
}

/// Adds areas to the pixels of a row, from one on, as far as they are shown. There are `N`.
#[inline(always)]
pub fn add_areas<const N: usize>([x, y]: [i32; 2], areas: &[u32], holes: &mut Holes) {
    if let Some(words) = holes.words_mut::<N>([x, y]) {
        // As `Holes::add`.
        for (word, area) in words.iter_mut().zip(areas) {
            *word = word.wrapping_add(*area);
        }
        return;
    }
    for (x, &area) in (x..).zip(areas) {
        if let Some(at) = holes.index([x, y]) {
            holes.add(at, area);
        }
    }
}
