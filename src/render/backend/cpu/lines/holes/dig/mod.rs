//! The sum of the areas that lines leave free in each pixel of a band, a range of pixel rows (stage
//! lines). If all edges of a surface are lines, each of its faces is free only in its
//! [inset](super::inset), the part that the lines along its sides leave free. So each face adds the
//! area of its inset to the pixels in or beside which a sample shows the face. Where something
//! hides a part of the face, or a [tip](super::tips) is close, the sum is not reliable: such pixels
//! are marked here.
//!
//! The insets of eight faces are computed at once. Then each face is rasterized by itself, eight
//! pixels at a time. `add_holes_plainly` in `lines/plain.rs` does the same pixel by pixel. Tests
//! compare the two.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod small;

use self::small::{add_areas, masked};
use super::inset::{Inset, Insets};
use super::tips::{RecentVertices, TipRange};
use super::{Holes, half_width, looked_at, marks_of_hidden};
use crate::backend::cpu::bands::lists::BoxedFace;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::batch::boxes;
use crate::backend::cpu::geometry::samples::{SampleBand, for_samples};
use crate::backend::cpu::geometry::setups::Boxes;
use crate::backend::cpu::geometry::tiles::Tiles;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::{LinePass, sample_offsets};

dispatch! {
    /// Adds the holes of a band's faces.
    pub fn add_holes(context: &RasterContext<'_>, pass: &LinePass, lists: (&[TriangleBin], usize), band: &SampleBand, holes: &mut Holes) = holes_kernel
}

#[inline(always)]
fn holes_kernel(
    context: &RasterContext<'_>,
    pass: &LinePass,
    lists: (&[TriangleBin], usize),
    band: &SampleBand,
    holes: &mut Holes,
) {
    for_samples!(band.samples, holes_sampled(context, pass, lists, band, holes));
}

#[inline(always)]
fn holes_sampled<const S: usize>(
    context: &RasterContext<'_>,
    pass: &LinePass,
    (bins, number): (&[TriangleBin], usize),
    band: &SampleBand,
    holes: &mut Holes,
) {
    let mut digger = Digger::<S>::new(context, pass, band);
    let tiles = Tiles::with_border(band, TIPS_PX);
    // A band has more rows than are looked at. What counts in a row shows a sample in it or beside it.
    let rows = [digger.looked_at[1][0] - 1, digger.looked_at[1][1] + 1];
    let [first, end] = band.range()[1];
    let rows = [rows[0].max(first), rows[1].min(end)];
    let mut poll = DeadlinePoll::new(context.deadline);
    let mut waiting = Waiting { ids: [0; 2 * LANES], len: 0 };
    for bin in bins {
        let (listed, tall) = bin.fronts.items_in(number);
        for ids in listed.chunks(LANES).chain(tall.chunks(LANES)) {
            waiting.push_seen::<S>(context, (band, rows), &tiles, ids);
            if digger.are_dug(&mut waiting, ids.len(), &mut poll, holes) {
                return;
            }
        }
        let (listed, tall) = bin.backs.boxed_in(number);
        for faces in listed.chunks(LANES).chain(tall.chunks(LANES)) {
            waiting.push_boxed(context, rows, &tiles, faces);
            if digger.are_dug(&mut waiting, faces.len(), &mut poll, holes) {
                return;
            }
        }
    }
    if waiting.len > 0 {
        digger.dig_all(&waiting.take(), holes);
    }
}

/// Pixels that a face's box grows by: its [tips](super::tips) lie up to a pixel beyond its samples, and
/// are compared with samples another pixel away.
const TIPS_PX: usize = 2;

/// Eight samples: their columns, their rows and their ids.
type Samples<'s> = (&'s [f32; LANES], &'s [f32; LANES], &'s [u32; LANES]);

/// Faces that may be visible, collected until there are eight.
struct Waiting {
    ids: [u32; 2 * LANES],
    len: usize,
}

impl Waiting {
    /// Adds those of up to eight faces that touch samples and are not hidden by all tiles there.
    #[inline(always)]
    fn push_seen<const S: usize>(
        &mut self,
        context: &RasterContext<'_>,
        (band, [first, end]): (&SampleBand, [i32; 2]),
        tiles: &Tiles,
        ids: &[u32],
    ) {
        let Boxes { bounds: [columns, rows], depth_max } = boxes::<S>(context, &padded(ids), band);
        for l in 0..ids.len().min(LANES) {
            let (columns, rows) = ([columns[0][l], columns[1][l]], [rows[0][l], rows[1][l]]);
            let is_empty = (columns[0] > columns[1]) | (rows[0] > rows[1]) | (rows[1] < first) | (rows[0] >= end);
            let is_surface = (ids[l] as usize) < context.plan.triangles.len();
            // Written in any case, kept by the count.
            self.ids[self.len % (2 * LANES)] = ids[l];
            self.len += usize::from(is_surface && !is_empty && !tiles.hide(columns, rows, depth_max[l]));
        }
    }

    /// As `push_seen`, for faces whose boxes are known.
    #[inline(always)]
    fn push_boxed(&mut self, context: &RasterContext<'_>, rows: [i32; 2], tiles: &Tiles, faces: &[BoxedFace]) {
        let mut seen = tiles.seen(context.isa, faces, rows);
        while seen != 0 {
            let id = faces[seen.trailing_zeros() as usize % faces.len()].id;
            self.ids[self.len % (2 * LANES)] = id;
            self.len += usize::from((id as usize) < context.plan.triangles.len());
            seen &= seen - 1;
        }
    }

    /// Removes the first eight, or all if there are fewer.
    #[inline(always)]
    fn take(&mut self) -> Taken {
        let len = self.len.min(LANES);
        let taken = Taken { ids: padded(&self.ids[..len]), len };
        self.ids.copy_within(LANES.., 0);
        self.len -= len;
        taken
    }
}

/// Up to eight faces.
struct Taken {
    /// Ids after `len` repeat the first.
    ids: [u32; LANES],
    len: usize,
}

/// Up to eight ids, of which the first is repeated after the last.
#[inline(always)]
pub fn padded(ids: &[u32]) -> [u32; LANES] {
    let mut lanes = [ids.first().map_or(0, |&id| id); LANES];
    for (lane, &id) in lanes.iter_mut().zip(ids) {
        *lane = id;
    }
    lanes
}

/// Adds faces' holes to pixels, `S` samples each.
struct Digger<'a, const S: usize> {
    context: &'a RasterContext<'a>,
    band: &'a SampleBand,
    half: [i32; 2],
    half_width: f32,
    looked_at: [[i32; 2]; 2],
    reach: i32,
    tips: TipRange,
    recent: RecentVertices,
    /// Places of the samples of eight pixels of a row, 1/256 px from the corner of the first.
    offsets: [[[f32; S]; LANES]; 2],
    /// Pixels looked at since the last poll of the deadline.
    pixels: u64,
}

impl<'a, const S: usize> Digger<'a, S> {
    #[inline(always)]
    fn new(context: &'a RasterContext<'a>, pass: &LinePass, band: &'a SampleBand) -> Self {
        let plan = context.plan;
        let reach = pass.hidden_reach_px() as i32;
        let samples = sample_offsets(S as u32);
        let place = |axis: usize, pixel: usize, s: usize| {
            let step = if axis == 0 { 256 * pixel as i32 } else { 0 };
            (samples[s % samples.len()][axis] + step) as f32
        };
        Self {
            context,
            band,
            half: [plan.width_px as i32 * 128, plan.height_px as i32 * 128],
            half_width: half_width(pass),
            looked_at: looked_at(band, reach),
            reach,
            tips: TipRange::new(plan, pass, band),
            recent: RecentVertices::new(),
            offsets: std::array::from_fn(|axis| {
                std::array::from_fn(|pixel| std::array::from_fn(|s| place(axis, pixel, s)))
            }),
            pixels: 0,
        }
    }

    /// Adds the holes of the waiting faces if there are eight. True if the deadline has passed.
    /// `looked_at` is the number of faces that were tested before, for the poll.
    #[inline(always)]
    fn are_dug(
        &mut self,
        waiting: &mut Waiting,
        looked_at: usize,
        poll: &mut DeadlinePoll<'_>,
        holes: &mut Holes,
    ) -> bool {
        if waiting.len >= LANES {
            self.dig_all(&waiting.take(), holes);
        }
        poll.is_expired_after(looked_at as u64, std::mem::take(&mut self.pixels) * S as u64)
    }

    /// Adds the holes of some faces.
    #[inline(always)]
    fn dig_all(&mut self, faces: &Taken, holes: &mut Holes) {
        let insets = Insets::of(self.context, &faces.ids, self.half, self.half_width);
        for (l, &id) in faces.ids.iter().enumerate().take(faces.len) {
            if insets.is_open[l] != 0 {
                self.tips.mark_new(self.context, self.band, (id, &mut self.recent), holes);
                self.dig(&insets.get(l, self.half), id, holes);
            }
        }
    }

    /// Adds a face's hole.
    #[inline(always)]
    fn dig(&mut self, inset: &Inset, id: u32, holes: &mut Holes) {
        let [columns, rows]: [[i32; 2]; 2] = std::array::from_fn(|k| {
            let [low, high] = inset.bounds[k];
            [(low >> 8).max(self.looked_at[k][0]), (high >> 8).min(self.looked_at[k][1] - 1)]
        });
        if columns[0] > columns[1] || rows[0] > rows[1] {
            return;
        }
        self.pixels += u64::from((columns[0].abs_diff(columns[1]) + 1) * (rows[0].abs_diff(rows[1]) + 1));
        if inset.is_small() {
            self.dig_small(inset, id, [columns, rows], holes);
            return;
        }
        for first in (columns[0]..=columns[1]).step_by(LANES) {
            let (mut above, mut here) =
                (self.shown(id, first, rows[0] - 1, LANES), self.shown(id, first, rows[0], LANES));
            for y in rows[0]..=rows[1] {
                let below = self.shown(id, first, y + 1, LANES);
                let shown = above | here | below;
                let close = (shown | shown >> 1 | shown >> 2) & ((2 << (columns[1] - first).min(LANES as i32 - 1)) - 1);
                if close != 0 {
                    self.mark_hidden((inset, id), [first, y], (close, LANES), holes);
                    let areas = masked(inset.areas(self.context.isa, first, y), close);
                    add_areas::<LANES>([first, y], &areas, holes);
                }
                (above, here) = (here, below);
            }
        }
    }

    /// Bits of the pixels that show the face, from the one before `first` to the one after `count` of
    /// them.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn shown(&self, id: u32, first: i32, y: i32, count: usize) -> u32 {
        let [columns, rows] = self.band.range();
        if y < rows[0] || y >= rows[1] {
            return 0;
        }
        if first > columns[0] && first + (count as i32) < columns[1] {
            let at = self.band.index(first - 1, y, 0);
            let ids = self.band.ids.get(at..at + (count + 2) * S).unwrap_or_default();
            #[cfg(target_arch = "x86_64")]
            if self.context.isa.has_avx2() {
                // SAFETY: the processor has AVX2, as `isa` says.
                return unsafe { avx2::shown::<S>(ids, id) };
            }
            return shown_plainly::<S>(ids, id);
        }
        let mut shown = 0;
        for x in (first - 1).max(columns[0])..(first + count as i32 + 1).min(columns[1]) {
            shown |= u32::from(self.band.pixel(x, y).0.contains(&id)) << (x - (first - 1));
        }
        shown
    }

    /// Marks the pixels around those of `count` pixels of a row in which something hides the face. Only
    /// pixels whose bits are set in `close` are tested: the face counts in these.
    #[inline(always)]
    fn mark_hidden(&self, face: (&Inset, u32), [first, y]: [i32; 2], (close, count): (u32, usize), holes: &mut Holes) {
        if !self.may_hide(face, [first, y], count) {
            return;
        }
        for l in (0..count as i32).filter(|l| close >> l & 1 != 0) {
            let marks = marks_of_hidden(self.context, self.band, self.half, face, [first + l, y]);
            if marks != 0 {
                holes.mark_around([first + l, y], self.reach, marks);
            }
        }
    }

    /// False if [`marks_of_hidden`] is certainly 0 in `count` pixels of a row, at most eight.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn may_hide(&self, (inset, id): (&Inset, u32), [first, y]: [i32; 2], count: usize) -> bool {
        let columns = self.band.range()[0];
        if first < columns[0] || first + count as i32 > columns[1] {
            return true;
        }
        let (at, samples) = (self.band.index(first, y, 0), (count * S).next_multiple_of(LANES));
        // Beyond the row lies room for a vector.
        let Some(ids) = self.band.ids.get(at..at + samples) else { return true };
        let corner = [(first * 256 - self.half[0]) as f32, (y * 256 - self.half[1]) as f32];
        let (right, down) = (self.offsets[0].as_flattened(), self.offsets[1].as_flattened());
        let places = right.as_chunks::<LANES>().0.iter().zip(down.as_chunks::<LANES>().0);
        let samples = places.zip(ids.as_chunks::<LANES>().0).map(|((right, down), ids)| (right, down, ids));
        #[cfg(target_arch = "x86_64")]
        if self.context.isa.has_avx2() {
            // SAFETY: the processor has AVX2, as `isa` says.
            return unsafe { avx2::hides(inset, id, corner, samples) };
        }
        hides_plainly(inset, id, corner, samples)
    }
}

/// Bits of the pixels of which a sample shows a face.
#[inline(always)]
fn shown_plainly<const S: usize>(ids: &[u32], id: u32) -> u32 {
    let mut shown = 0;
    for (i, ids) in ids.as_chunks::<S>().0.iter().enumerate() {
        let mut any = false;
        for s in 0..S {
            any |= ids[s] == id;
        }
        shown |= u32::from(any) << i;
    }
    shown
}

/// True if a sample well inside a face shows something else. The places of samples are relative to
/// `corner`.
#[inline(always)]
fn hides_plainly<'s>(inset: &Inset, id: u32, corner: [f32; 2], samples: impl Iterator<Item = Samples<'s>>) -> bool {
    let mut hides = [0_u32; LANES];
    for (right, down, ids) in samples {
        for l in 0..LANES {
            let is_inside = inset.contains([corner[0] + right[l], corner[1] + down[l]]);
            hides[l] |= u32::from(is_inside & (ids[l] != id));
        }
    }
    hides.iter().fold(0, |any, hides| any | hides) != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::isa::Isa;

    /// xorshift32
    fn random(state: &mut u32) -> u32 {
        *state ^= *state << 13;
        *state ^= *state >> 17;
        *state ^= *state << 5;
        *state
    }

    #[cfg(target_arch = "x86_64")]
    #[allow(unsafe_code)]
    fn are_shown_alike<const S: usize>(state: &mut u32) -> u32 {
        let mut found = 0;
        for case in 0..4000 {
            let pixels = 3 + case % 8;
            // Two ids in three.
            let ids: Vec<u32> = (0..pixels * S).map(|_| random(state) % [3, 40][case / 8 % 2]).collect();
            let want = shown_plainly::<S>(&ids, 2);
            if Isa::detect().has_avx2() {
                // SAFETY: the processor has AVX2, as `isa` says.
                assert_eq!(unsafe { avx2::shown::<S>(&ids, 2) }, want, "{S} samples: {ids:?}");
            }
            assert_eq!(want >> pixels, 0);
            found += want.count_ones();
        }
        found
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_instruction_set_finds_the_same_pixels_of_a_face() {
        let mut state = 1;
        let state = &mut state;
        let found = [
            are_shown_alike::<1>(state),
            are_shown_alike::<4>(state),
            are_shown_alike::<8>(state),
            are_shown_alike::<16>(state),
        ];
        assert!(found.iter().all(|&found| (3000..25_900).contains(&found)), "{found:?}");
    }
}
