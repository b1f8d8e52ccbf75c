//! The search for mixed pixels (stage mixed). These are pixels in which, or beside which, faces of different colours
//! meet; they are drawn a second time, from 64 or 256 points each.
//!
//! Samples are compared in pairs: those of a pixel one after the other, and across each of its four sides the two
//! samples closest to the side, one in each pixel. A pair is a break if its samples show different faces, or a face
//! and nothing, whose colours do not go on from one to the other ([`Pairs::step`]). Breaks are slight or hard. A
//! pixel is mixed if any of its pairs is a break.
//!
//! An edge may cut off a corner of a pixel and yet lie between none of these samples. It then lies between those of
//! a neighbour. So a pixel is mixed, too, if one of the four pixels beside, above and below it has a hard break
//! inside.
//!
//! A thin triangle in a pixel may be a break even if no sample shows it ([`thin`]). A mixed pixel is drawn from 256
//! points if one of the breaks that make it mixed is hard, and otherwise from 64. Pixels in which a transparent layer
//! is visible are not mixed: layers are composited sample by sample.
//!
//! With four samples per pixel, most pixels are passed over quickly: all their samples show one face ([`differing`]),
//! or faces that look alike ([`coarse`]).

mod coarse;
mod differing;
pub mod look;
mod pairs;
mod pixels;
pub mod thin;

pub use self::pixels::MixedPixels;

use self::coarse::CoarseLooks;
use self::differing::{OUTERMOST, WORD, find_differing};
use self::look::Step;
use self::pairs::Pairs;
use self::thin::{mark_thin, may_mark};
use super::band_triangles::BandTriangles;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::{NOTHING, SampleBand};
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::peeling::state::PeelBand;
use crate::plan::OutermostSamples;

/// Places where colours break off from sample to sample, slightly or more.
pub mod breaks {
    /// From the pixel's first sample to its others, one after the other.
    pub const OWN: u8 = 1;
    /// From the rightmost sample of the pixel on the left to the leftmost of this one.
    pub const LEFT: u8 = 2;
    /// From the lowest sample of the pixel above to the topmost of this one.
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

/// Buffers of the search.
#[derive(Default)]
pub struct Finder {
    /// By row modulo 3: the places where colours do not go on, as bits of [`breaks`].
    breaks: [Row; 3],
    /// Of one row: the pixels to be looked at.
    differing: Vec<u64>,
    /// By pixel of the shown rows: 0 for those that are not mixed.
    marks: Vec<u8>,
    looks: Option<CoarseLooks>,
}

impl Finder {
    fn reset(&mut self, [width, rows]: [usize; 2]) {
        for row in &mut self.breaks {
            row.reset(width);
        }
        self.differing.clear();
        self.differing.reserve_exact(width.div_ceil(WORD));
        self.marks.clear();
        self.marks.reserve_exact(width * rows);
        self.marks.resize(width * rows, 0);
    }

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.breaks.iter().map(Row::bytes).sum::<usize>()
            + self.differing.capacity() * size_of::<u64>()
            + self.marks.capacity()
            + self.looks.as_ref().map_or(0, |_| CoarseLooks::BYTES)
    }

    /// The [`bytes`](Self::bytes) of a band, at most.
    pub const fn bytes_of([width, rows]: [usize; 2]) -> usize {
        width * rows + 3 * (width + 2) + width.div_ceil(WORD) * size_of::<u64>() + CoarseLooks::BYTES
    }
}

dispatch! {
    /// Finds the mixed pixels of a band's shown rows, given its samples and the layers over them.
    pub fn find(
        context: &RasterContext<'_>,
        triangles: &BandTriangles<'_>,
        band: (&SampleBand, Option<&PeelBand>),
        finder: &mut Finder,
        mixed: &mut MixedPixels,
    ) = find_kernel
}

#[inline(always)]
fn find_kernel(
    context: &RasterContext<'_>,
    triangles: &BandTriangles<'_>,
    (band, layers): (&SampleBand, Option<&PeelBand>),
    finder: &mut Finder,
    mixed: &mut MixedPixels,
) {
    let [first, end] = band.shown.map(|row| row as i32);
    let size = [band.size_px[0] as usize, (end - first) as usize];
    mixed.reset(size);
    finder.reset(size);
    let Finder { breaks, differing, marks, looks } = finder;
    let mut pairs = Pairs::new(looks.get_or_insert_default());
    for (y, marks) in (first..end).zip(marks.chunks_exact_mut(size[0])) {
        for y in y - 1..=y + 1 {
            let row = &mut breaks[y.rem_euclid(3) as usize];
            if row.y != Some(y) {
                row.y = Some(y);
                find_breaks(context, band, y, &mut pairs, (&mut *differing, &mut row.values));
            }
        }
        join([y - 1, y, y + 1].map(|y| &breaks[y.rem_euclid(3) as usize].values[..]), marks);
    }
    let mut poll = DeadlinePoll::new(context.deadline);
    for list in triangles.thin() {
        for face in list.iter() {
            let mut looked_at = 0;
            if context.is_plain() || may_mark(band, face, marks) {
                looked_at = mark_thin(context, band, &triangles.get(face.id), &mut pairs, marks);
            }
            // A picture whose deadline has passed is thrown away.
            if poll.is_expired(looked_at as u64) {
                return;
            }
        }
    }
    for (y, marks) in (band.shown[0]..).zip(marks.chunks_exact_mut(size[0])) {
        if let Some(layers) = layers {
            leave_layers(layers, y, marks);
        }
        mixed.push_row(marks);
    }
}

/// Clears the marks of those pixels of a row in which a layer is seen.
fn leave_layers(layers: &PeelBand, y: u32, marks: &mut [u8]) {
    for (x, mark) in (0..).zip(marks) {
        if *mark != 0 && layers.has_layer(x, y) {
            *mark = 0;
        }
    }
}

/// Marks the mixed pixels of a row: those where colours break off in the pixel, or on the way from its samples to those
/// beside, above or below it; or more than slightly in such a neighbour. Given are the breaks of the row above, of its
/// own and of the one below.
#[inline(always)]
fn join([above, own, below]: [&[u8]; 3], marks: &mut [u8]) {
    const OWN: u8 = breaks::OWN << breaks::HARD;
    const LEFT: u8 = breaks::LEFT | breaks::LEFT << breaks::HARD;
    const UPPER: u8 = breaks::UPPER | breaks::UPPER << breaks::HARD;
    for (x, out) in marks.iter_mut().enumerate() {
        let beside = own[x] & OWN | own[x + 1] | own[x + 2] & (OWN | LEFT);
        *out = beside | above[x + 1] & OWN | below[x + 1] & (OWN | UPPER);
    }
}

/// Finds where colours break off in a row of pixels, from the one left of the picture to the one right of it.
#[inline(always)]
fn find_breaks(
    context: &RasterContext<'_>,
    band: &SampleBand,
    y: i32,
    pairs: &mut Pairs<'_>,
    (differing, out): (&mut Vec<u64>, &mut [u8]),
) {
    let width = band.size_px[0] as i32;
    let row = |y: i32| {
        let at = band.has(0, y).then(|| band.index(0, y, 0))?;
        Some(band.ids[at..at + band.size_px[0] as usize * band.samples as usize].as_chunks().0)
    };
    let (Some(own), Some(above), 4, false) = (row(y), row(y - 1), band.samples, context.is_plain()) else {
        for (x, out) in (-1..).zip(out) {
            *out = breaks_at(context, band, [x, y], pairs);
        }
        return;
    };
    out.fill(0);
    // Some neighbours of these lie beyond the picture.
    for x in [-1, 0, width] {
        out[(x + 1) as usize] = breaks_at(context, band, [x, y], pairs);
    }
    find_differing(context.isa, own, above, differing);
    for (i, word) in differing.iter().enumerate() {
        let mut left = if i == 0 { word & !1 } else { *word };
        while left != 0 {
            let x = i * WORD + left.trailing_zeros() as usize;
            left &= left - 1;
            let [a, b, c, d] = own[x];
            let beside = [own[x - 1][OUTERMOST.right], above[x][OUTERMOST.bottom]];
            if !pairs.coarse.are_alike([a, b, c, d, beside[0], beside[1]]) {
                out[x + 1] = breaks_of(context, &own[x], beside, (pairs, OUTERMOST));
            }
        }
    }
}

/// The places where colours break off in a pixel, and on the way to it.
#[inline(always)]
fn breaks_at(context: &RasterContext<'_>, band: &SampleBand, [x, y]: [i32; 2], pairs: &mut Pairs<'_>) -> u8 {
    const BEYOND: &[u32] = &[NOTHING; 16];
    let outermost = OutermostSamples::of(band.samples);
    let ids_of = |x: i32, y: i32| if band.has(x, y) { band.pixel(x, y).0 } else { BEYOND };
    let beside = [ids_of(x - 1, y)[outermost.right], ids_of(x, y - 1)[outermost.bottom]];
    breaks_of(context, ids_of(x, y), beside, (pairs, outermost))
}

/// The same, given the ids of the pixel's samples, of the rightmost sample of the pixel on the left, and of the
/// lowest one of the pixel above.
#[inline(always)]
fn breaks_of(
    context: &RasterContext<'_>,
    ids: &[u32],
    [left, upper]: [u32; 2],
    (pairs, outermost): (&mut Pairs<'_>, OutermostSamples),
) -> u8 {
    let others = (left ^ ids[0]) | (upper ^ ids[0]);
    if ids.iter().fold(others, |difference, id| difference | (id ^ ids[0])) == 0 {
        return 0;
    }
    let mut found = 0;
    for id in ids {
        pairs.remember(context, *id);
    }
    for s in 1..ids.len() {
        found |= pairs.step(context, ids[s - 1], ids[s]).breaks(breaks::OWN);
    }
    found |= pairs.step(context, left, ids[outermost.left]).breaks(breaks::LEFT);
    found | pairs.step(context, upper, ids[outermost.top]).breaks(breaks::UPPER)
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
