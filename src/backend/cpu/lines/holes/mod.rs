//! Stage lines, per face and pixel: what the lines along all edges of a surface leave free of it.
//! Twin of `shaders/lines/holes.wgsl`.
//!
//! Lines cover all of a sheet of faces but the faces' [insets](inset), if each side of each face is a
//! line. Insets do not overlap, so their areas add up. Pixels in which that may not hold are marked,
//! and get strokes:
//!
//! - a sample shows no face, or one that is clipped or belongs to a hull;
//! - a visible part of a rim is within a line's reach: a rim is an edge at which the sheet ends on
//!   screen or turns back, so that its line covers what lies behind the sheet too;
//! - a face that is seen close by is hidden in part, as where two surfaces pass through each other.
//!
//! A face counts in a pixel if it shows a sample there or in one of the eight pixels around. What is
//! left of a visible face around a point of its inset holds a disc as wide as the line, and
//! `LinePass::holes_width_px` sees to it that no such disc lies between samples.

pub(crate) mod dig;
pub(crate) mod inset;

use self::inset::{HOLE_UNIT, Inset};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::plan::{LinePass, sample_offsets};

/// Bit of a pixel that gets strokes.
pub const MARKED: u32 = 1 << 31;

/// Faces that count in a pixel, at most: one for each of 16 samples in it and in the eight around it.
/// The sum of their areas stays below [`MARKED`].
pub const FACES_MAX: u32 = 9 * 16;
const _: () = assert!(FACES_MAX as f32 * HOLE_UNIT < MARKED as f32);

/// Per pixel of a band, the area of holes, and whether it is marked.
#[derive(Default)]
pub struct Holes {
    /// Areas in [`HOLE_UNIT`]s, and [`MARKED`]. Empty where the pass has no holes.
    words: Vec<u32>,
    width_px: usize,
    /// First and last row, the last excluded.
    rows: [i32; 2],
    /// A bit per pixel that is marked, `row_words` words a row.
    marked: Vec<u64>,
    row_words: usize,
}

impl Holes {
    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        self.words.capacity() * size_of::<u32>() + self.marked.capacity() * size_of::<u64>()
    }

    /// Bytes of a row.
    pub fn row_bytes(width_px: u32) -> usize {
        width_px as usize * size_of::<u32>() + (width_px as usize).div_ceil(64) * size_of::<u64>()
    }

    /// No holes: every pixel gets strokes.
    pub fn clear(&mut self) {
        self.words.clear();
    }

    /// Takes on the size of a band's shown rows, without any area or mark.
    pub fn reset(&mut self, band: &SampleBand) {
        self.width_px = band.size_px[0] as usize;
        self.rows = band.shown.map(|row| row as i32);
        let rows = band.shown[0].abs_diff(band.shown[1]) as usize;
        self.words.clear();
        self.words.reserve_exact(self.width_px * rows);
        self.words.resize(self.width_px * rows, 0);
        self.row_words = self.width_px.div_ceil(64);
        self.marked.clear();
        self.marked.reserve_exact(self.row_words * rows);
        self.marked.resize(self.row_words * rows, 0);
    }

    /// The index of a pixel that is shown.
    #[inline(always)]
    pub fn index(&self, [x, y]: [i32; 2]) -> Option<usize> {
        let is_shown = x >= 0 && x < self.width_px as i32 && y >= self.rows[0] && y < self.rows[1];
        is_shown.then(|| (y - self.rows[0]) as usize * self.width_px + x as usize)
    }

    /// True if the pass has none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Marks a pixel by its index among the shown ones.
    #[inline(always)]
    pub fn mark(&mut self, at: usize) {
        self.words[at] |= MARKED;
    }

    /// Adds to the area of holes in a pixel, by its index. Of [`FACES_MAX`] faces, the sum stays
    /// below the mark.
    #[inline(always)]
    pub fn add(&mut self, at: usize, area: u32) {
        self.words[at] += area;
    }

    /// The words of pixels of a row, from a shown one on; None past the row's end.
    #[inline(always)]
    pub(super) fn words_mut<const N: usize>(&mut self, [x, y]: [i32; 2]) -> Option<&mut [u32; N]> {
        let at = self.index([x, y])?;
        if x as usize + N > self.width_px { None } else { self.words.get_mut(at..)?.first_chunk_mut() }
    }

    /// True if the pixel with this index gets strokes.
    #[inline(always)]
    pub fn is_marked(&self, at: usize) -> bool {
        self.words.get(at).is_none_or(|word| word & MARKED != 0)
    }

    /// The share of a pixel that lines cover; None where strokes tell.
    #[inline(always)]
    pub fn covered_share(&self, at: usize) -> Option<f32> {
        let &word = self.words.get(at)?;
        let free = (word & !MARKED).min(HOLE_UNIT as u32);
        (word & MARKED == 0).then(|| (HOLE_UNIT as u32 - free) as f32 * (1.0 / HOLE_UNIT))
    }

    /// Gives an owner to the pixels whose lines are known by holes. Their light is that of their
    /// samples, so that any face will do.
    pub fn own(&self, owners: &mut [u32]) {
        for (at, owner) in owners.iter_mut().enumerate() {
            if self.covered_share(at).is_some_and(|share| share > 0.0) {
                *owner = 1;
            }
        }
    }

    /// True if any pixel between these columns and rows, the last included, gets strokes. To be
    /// asked when all marks have been [collected](Self::collect_marks).
    #[inline(always)]
    pub fn any_marked(&self, columns: [i32; 2], rows: [i32; 2]) -> bool {
        if self.is_empty() {
            return true;
        }
        let [left, right] = columns.map(|x| x.clamp(0, self.width_px as i32 - 1) as usize);
        for y in rows[0].max(self.rows[0])..=rows[1].min(self.rows[1] - 1) {
            let row = (y - self.rows[0]) as usize * self.row_words;
            for word in left / 64..=right / 64 {
                let from = if word == left / 64 { left % 64 } else { 0 };
                let to = if word == right / 64 { right % 64 } else { 63 };
                if self.marked[row + word] >> from << from << (63 - to) != 0 {
                    return true;
                }
            }
        }
        false
    }

    /// Collects the marks for [`Self::any_marked`].
    pub fn collect_marks(&mut self) {
        for (row, bits) in self.words.chunks(self.width_px.max(1)).zip(self.marked.chunks_mut(self.row_words.max(1))) {
            for (pixels, bits) in row.chunks(64).zip(bits) {
                *bits = pixels.iter().zip(0..).fold(0, |all, (word, i)| all | u64::from(word >> 31) << i);
            }
        }
    }

    /// Marks the pixels around one of the picture's, or beyond it, up to `radius` away.
    #[inline(always)]
    pub(super) fn mark_around(&mut self, [x, y]: [i32; 2], radius: i32) {
        let [left, right] = [(x - radius).max(0), (x + radius + 1).min(self.width_px as i32)];
        for y in (y - radius).max(self.rows[0])..(y + radius + 1).min(self.rows[1]) {
            let row = (y - self.rows[0]) as usize * self.width_px;
            for x in left..right {
                self.words[row + x as usize] |= MARKED;
            }
        }
    }
}

/// Half the width of a pass's lines, 1/256 px.
pub(super) fn half_width(pass: &LinePass) -> f32 {
    pass.width_px * 128.0
}

/// Columns and rows whose pixels may mark one that is shown.
pub(super) fn looked_at(band: &SampleBand, beyond: i32) -> [[i32; 2]; 2] {
    let [columns, rows] = band.range();
    let [first, end] = band.shown.map(|row| row as i32);
    let width_px = band.size_px[0] as i32;
    [
        [columns[0].max(-beyond), columns[1].min(width_px + beyond)],
        [rows[0].max(first - beyond), rows[1].min(end + beyond)],
    ]
}

/// Marks the pixels around what is clipped, and those that show no face or a hull's.
pub fn mark_odd_samples(context: &RasterContext<'_>, band: &SampleBand, holes: &mut Holes) {
    let count = context.plan.triangles.len() as u32;
    let samples = band.samples as usize;
    for (y, words) in (holes.rows[0]..).zip(holes.words.chunks_mut(holes.width_px.max(1))) {
        let first = band.index(0, y, 0);
        let ids = &band.ids[first..first + words.len() * samples];
        for (word, ids) in words.iter_mut().zip(ids.chunks_exact(samples)) {
            let last = ids.iter().fold(0, |last, &id| last.max(id));
            *word |= u32::from(last >= count) * MARKED;
        }
    }
    if !context.plan.projection.clip {
        return;
    }
    let is_clipped = |id: u32| id < count && context.screen_triangle(id).iter().any(ScreenVertex::is_outside);
    let [columns, rows] = looked_at(band, 1);
    for y in rows[0]..rows[1] {
        for x in columns[0]..columns[1] {
            if band.pixel(x, y).0.iter().any(|&id| is_clipped(id)) {
                holes.mark_around([x, y], 1);
            }
        }
    }
}

/// True if something else than the face shows in a sample of the pixel that lies well inside it.
#[inline(always)]
pub(super) fn is_hidden(band: &SampleBand, half: [i32; 2], inset: &Inset, id: u32, [x, y]: [i32; 2]) -> bool {
    let corner = [x * 256 - half[0], y * 256 - half[1]];
    let is_inside =
        |offset: &[i32; 2]| inset.contains([(corner[0] + offset[0]) as f32, (corner[1] + offset[1]) as f32]);
    band.pixel(x, y).0.iter().zip(sample_offsets(band.samples)).any(|(&other, at)| other != id && is_inside(at))
}
