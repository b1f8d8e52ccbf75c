//! Holes: the area of each pixel that lines leave free if all edges of a surface are drawn (stage lines). Where lines
//! are dense, these areas are easier to find than what the lines cover. Twin of `shaders/lines/holes/holes.wgsl`.
//!
//! If each side of each face is a line, then a face is free only in its [inset]: the part that is at least half a
//! line's width from all three sides. Insets of faces side by side do not overlap. So the free area of a pixel is the
//! sum of the insets' areas in it, and no line has to be drawn.
//!
//! This fails in some pixels. They are marked, and get their coverage in one of two other ways.
//!
//! [Points](free_points), of which a pixel has 256, are tested one by one where the surface ends:
//!
//! - a sample of the pixel shows nothing;
//! - a visible part of a rim is within half a line's width. A rim is an edge at which the surface ends on screen or
//!   turns away, or that has more than two faces. The line of a rim also covers what lies behind the surface;
//! - a face that counts in the pixel or close to it (see below) is partly hidden by a face well in front of it.
//!
//! In the other marked pixels all edges are drawn one by one, as strokes (a stroke is the area within half a line's
//! width of an edge):
//!
//! - a sample of the pixel shows the outline mesh, or a sample in or next to it shows a clipped
//!   face (no insets are computed for these);
//! - a [tip](tips) is close, which is a visible corner whose face no sample of its pixel shows;
//! - a face that counts in the pixel or close to it is partly hidden by the outline mesh, or by a face that may
//!   intersect it nearby.
//!
//! With one sample per pixel, all marked pixels get strokes: a rim that no sample shows may
//! count as hidden, and the strokes of the edges beside it make up for it.
//!
//! A face counts in a pixel if a sample of the pixel, or of one of the eight pixels around it, shows the face. A face
//! that nothing hides is not missed: each point of its inset is the centre of a disc that shows the face and is as
//! wide as the line, and `LinePass::holes_width_px` admits only lines so wide that such a disc contains a sample.

#[cfg(target_arch = "x86_64")]
mod avx2;
pub(crate) mod dig;
pub(crate) mod free_points;
pub(crate) mod inset;
pub(crate) mod tips;

use self::inset::{HOLE_UNIT, Inset};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand, for_samples};
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility::Setup;
use crate::backend::cpu::isa::dispatch;
use crate::plan::{LinePass, sample_offsets};

/// Bit of a pixel in which areas do not tell what is free.
pub const MARKED: u32 = 1 << 31;

/// Bit of a marked pixel that gets the strokes of all edges, because points do not tell either.
pub const STROKED: u32 = 1 << 30;

/// Faces pass through each other where their planes meet within this distance of a sample, pixels.
pub const CROSSING_PX: f32 = 6.0;

/// Faces that count in a pixel, at most: one for each of 16 samples in it and in the eight around it.
/// The sum of their areas stays below [`STROKED`].
pub const FACES_MAX: u32 = 9 * 16;
const _: () = assert!(FACES_MAX as f32 * HOLE_UNIT < STROKED as f32);

/// Per pixel of a band, the area of holes, and its marks.
#[derive(Default)]
pub struct Holes {
    /// Areas in [`HOLE_UNIT`]s, and the marks. Empty where the pass has no holes.
    words: Vec<u32>,
    /// See [`point_marks`].
    point_marks: u32,
    width_px: usize,
    /// First and last row, the last excluded.
    rows: [i32; 2],
    /// A bit per pixel that gets strokes, `row_words` words per row.
    stroked: Vec<u64>,
    /// The bits of [`COARSE_ROWS`] rows together.
    stroked_coarse: Vec<u64>,
    row_words: usize,
}

/// Rows of pixels that are first looked at together.
const COARSE_ROWS: usize = 8;

impl Holes {
    /// Allocated bytes.
    pub fn bytes(&self) -> usize {
        let bits = self.stroked.capacity() + self.stroked_coarse.capacity();
        self.words.capacity() * size_of::<u32>() + bits * size_of::<u64>()
    }

    /// Bytes of a row.
    pub fn row_bytes(width_px: u32) -> usize {
        width_px as usize * size_of::<u32>() + 2 * (width_px as usize).div_ceil(64) * size_of::<u64>()
    }

    /// No holes: every pixel gets strokes.
    pub fn clear(&mut self) {
        self.words.clear();
    }

    /// Takes on the size of a band's shown rows, without any area or mark.
    pub fn reset(&mut self, band: &SampleBand) {
        self.width_px = band.size_px[0] as usize;
        self.rows = band.shown.map(|row| row as i32);
        self.point_marks = point_marks(band.samples);
        let rows = band.shown[0].abs_diff(band.shown[1]) as usize;
        self.words.clear();
        self.words.reserve_exact(self.width_px * rows);
        self.words.resize(self.width_px * rows, 0);
        self.row_words = self.width_px.div_ceil(64);
        self.stroked.clear();
        self.stroked.reserve_exact(self.row_words * rows);
        self.stroked.resize(self.row_words * rows, 0);
        // As much, for a simple sum. What is not touched takes no memory.
        self.stroked_coarse.clear();
        self.stroked_coarse.reserve_exact(self.row_words * rows);
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

    /// Marks a pixel that a rim reaches, by its index among the shown ones.
    #[inline(always)]
    pub fn mark(&mut self, at: usize) {
        self.words[at] |= self.point_marks;
    }

    /// Adds to the area of holes in a pixel, by its index. Of [`FACES_MAX`] faces, the sum stays
    /// below the marks.
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

    /// True if the pixel with this index gets the strokes of all edges.
    #[inline(always)]
    pub fn is_stroked(&self, at: usize) -> bool {
        self.words.get(at).is_none_or(|word| word & STROKED != 0)
    }

    /// The pixels of the picture in which points tell what is free.
    pub(super) fn marked(&self) -> impl Iterator<Item = [i32; 2]> {
        let width_px = self.width_px.max(1);
        let is_of_points = |word: &u32| word & (MARKED | STROKED) == MARKED;
        let rows = (self.rows[0]..).zip(self.words.chunks(width_px));
        rows.flat_map(move |(y, words)| {
            (0..).zip(words).filter(move |(_, word)| is_of_points(word)).map(move |(x, _)| [x, y])
        })
    }

    /// The share of a pixel that lines cover; None where strokes or points tell.
    #[inline(always)]
    pub fn covered_share(&self, at: usize) -> Option<f32> {
        let &word = self.words.get(at)?;
        let free = (word & (STROKED - 1)).min(HOLE_UNIT as u32);
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

    /// True if any pixel between these columns and rows, the last included, gets the strokes of all
    /// edges. To be asked when these pixels have been [collected](Self::collect_stroked).
    #[inline(always)]
    pub fn any_stroked(&self, columns: [i32; 2], rows: [i32; 2]) -> bool {
        if self.is_empty() {
            return true;
        }
        let columns = columns.map(|x| x.clamp(0, self.width_px as i32 - 1) as usize);
        let (first, last) = (rows[0].max(self.rows[0]) - self.rows[0], rows[1].min(self.rows[1] - 1) - self.rows[0]);
        if first > last {
            return false;
        }
        let (first, last) = (first as usize, last as usize);
        let any = |bits: &[u64], first: usize, last: usize| {
            (first..=last).any(|row| any_between(&bits[row * self.row_words..], columns))
        };
        any(&self.stroked_coarse, first / COARSE_ROWS, last / COARSE_ROWS) && any(&self.stroked, first, last)
    }

    /// Collects the pixels for [`Self::any_stroked`] when all rims are drawn. False if there are none.
    pub fn collect_stroked(&mut self) -> bool {
        let mut any = self.is_empty();
        for (row, bits) in self.words.chunks(self.width_px.max(1)).zip(self.stroked.chunks_mut(self.row_words.max(1))) {
            for (pixels, bits) in row.chunks(64).zip(bits) {
                *bits = pixels.iter().zip(0..).fold(0, |all, (word, i)| all | u64::from(word & STROKED != 0) << i);
                any |= *bits != 0;
            }
        }
        self.stroked_coarse.clear();
        for rows in self.stroked.chunks(COARSE_ROWS * self.row_words.max(1)) {
            let word = |i: usize| rows.iter().skip(i).step_by(self.row_words).fold(0, |all, bits| all | bits);
            self.stroked_coarse.extend((0..self.row_words).map(word));
        }
        any
    }

    /// Marks the pixels around one of the picture's, or beyond it, up to `radius` away.
    #[inline(always)]
    pub(super) fn mark_around(&mut self, [x, y]: [i32; 2], radius: i32, marks: u32) {
        let [left, right] = [(x - radius).max(0), (x + radius + 1).min(self.width_px as i32)];
        for y in (y - radius).max(self.rows[0])..(y + radius + 1).min(self.rows[1]) {
            let row = (y - self.rows[0]) as usize * self.width_px;
            for x in left..right {
                self.words[row + x as usize] |= marks;
            }
        }
    }
}

/// True if a row has a bit between two columns, the last included.
#[inline(always)]
fn any_between(bits: &[u64], [left, right]: [usize; 2]) -> bool {
    (left / 64..=right / 64).any(|word| {
        let from = if word == left / 64 { left % 64 } else { 0 };
        let to = if word == right / 64 { right % 64 } else { 63 };
        bits[word] >> from << from << (63 - to) != 0
    })
}

/// The marks of a pixel in which points tell. With one sample per pixel strokes do instead: a rim that
/// no sample shows may count as hidden, and the strokes of the edges beside it make up for it.
fn point_marks(samples: u32) -> u32 {
    if samples == 1 { MARKED | STROKED } else { MARKED }
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

dispatch! {
    /// Gives strokes to the pixels around what is clipped and to those that show a hull, and marks
    /// those that show nothing.
    pub fn mark_odd_samples(context: &RasterContext<'_>, band: &SampleBand, holes: &mut Holes) = odd_samples_kernel
}

#[inline(always)]
fn odd_samples_kernel(context: &RasterContext<'_>, band: &SampleBand, holes: &mut Holes) {
    for_samples!(band.samples, mark_without_face(context, band, holes));
    if context.plan.projection.clip {
        mark_around_clipped(context, band, holes);
    }
}

/// Marks pixels that show nothing or a hull.
#[inline(always)]
fn mark_without_face<const S: usize>(context: &RasterContext<'_>, band: &SampleBand, holes: &mut Holes) {
    let count = context.plan.triangles.len() as u32;
    let point_marks = holes.point_marks;
    for (y, words) in (holes.rows[0]..).zip(holes.words.chunks_mut(holes.width_px.max(1))) {
        let first = band.index(0, y, 0);
        let ids = &band.ids[first..first + words.len() * S];
        for (word, ids) in words.iter_mut().zip(ids.as_chunks::<S>().0) {
            let (mut is_marked, mut is_stroked) = (0, 0);
            for s in 0..S {
                // All bits where it is true.
                let is_odd = 0_u32.wrapping_sub(u32::from(ids[s] >= count));
                is_marked |= is_odd & point_marks;
                is_stroked |= is_odd & u32::from(ids[s] != NOTHING);
            }
            *word |= is_marked | (is_stroked * STROKED);
        }
    }
}

/// Gives strokes to the pixels around those that show a clipped face.
fn mark_around_clipped(context: &RasterContext<'_>, band: &SampleBand, holes: &mut Holes) {
    let count = context.plan.triangles.len() as u32;
    let is_clipped = |id: u32| id < count && context.screen_triangle(id).iter().any(ScreenVertex::is_outside);
    let [columns, rows] = looked_at(band, 1);
    for y in rows[0]..rows[1] {
        for x in columns[0]..columns[1] {
            if band.pixel(x, y).0.iter().any(|&id| is_clipped(id)) {
                holes.mark_around([x, y], 1, MARKED | STROKED);
            }
        }
    }
}

/// Marks for the pixels around one: 0 unless something else than the face shows in a sample of the
/// pixel that lies well inside it.
#[inline(always)]
pub(super) fn marks_of_hidden(
    context: &RasterContext<'_>,
    band: &SampleBand,
    half: [i32; 2],
    (inset, id): (&Inset, u32),
    [x, y]: [i32; 2],
) -> u32 {
    let corner = [x * 256 - half[0], y * 256 - half[1]];
    let (ids, depths) = band.pixel(x, y);
    let mut marks = 0;
    for ((&other, &depth), offset) in ids.iter().zip(depths).zip(sample_offsets(band.samples)) {
        let at = [corner[0] + offset[0], corner[1] + offset[1]];
        if other != id && inset.contains(at.map(|v| v as f32)) {
            let is_crossing = may_cross(context, [id, other], at, depth);
            marks |= if is_crossing { MARKED | STROKED } else { point_marks(band.samples) };
        }
    }
    marks
}

/// False if the planes of a face and of one that hides it at a sample, where it has this depth, meet
/// far from there.
fn may_cross(context: &RasterContext<'_>, [behind, before]: [u32; 2], [x, y]: [i32; 2], depth: f32) -> bool {
    let is_face = |id: u32| (id as usize) < context.plan.triangles.len();
    if !is_face(before) {
        return true;
    }
    let corners = [behind, before].map(|id| context.screen_triangle(id));
    if corners.iter().flatten().any(ScreenVertex::is_outside) {
        return true;
    }
    let [Some(behind), Some(before)] = corners.map(|corners| Setup::new(&corners)) else { return true };
    let [z, right, down] = behind.depth;
    let depth_behind = (z + right * (x - behind.x[0]) as f32) + down * (y - behind.y[0]) as f32;
    let gap = depth - depth_behind;
    let slope = [right - before.depth[1], down - before.depth[2]];
    let reach = CROSSING_PX * 256.0;
    // Squares of depths may be too small for f32.
    let scale = 1.0 / f32::EPSILON;
    let (gap, slope) = (gap * scale, slope.map(|v| v * scale * reach));
    gap * gap <= slope[0] * slope[0] + slope[1] * slope[1]
}
