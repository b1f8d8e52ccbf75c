//! Lists of the triangles that may be visible in each mixed pixel (stage mixed). Mixed pixels are
//! drawn a second time, from 64 or 256 points each. To bound their memory, lists are made for at
//! most 4096 of these pixels at a time, and for fewer where lists are long.

use std::ops::Range;

use super::band_triangles::BandTriangles;
use super::find::MixedPixels;
use super::spans::Spans;
use crate::backend::cpu::bands::lists::{BoxedFace, unpair};
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::isa::dispatch;
use crate::backend::sample_partition::POINTS;

/// Pixels that have lists at a time, at most.
pub const PIXELS_MAX: usize = 4096;

/// Triangles of all lists together, at most.
const TRIANGLES_MAX: usize = 1 << 18;

/// Columns and rows of a box, less one, from which on the triangle is followed row by row.
const LARGE: i32 = 2;

/// Lists of triangles by mixed pixel.
#[derive(Default)]
pub struct PixelLists {
    /// The mixed pixels that have a list, as indices into those of the band.
    pub pixels: Range<usize>,
    /// Number of a pixel, from the first on, and one of its triangles.
    pairs: Vec<(u32, Listed)>,
    /// By pixel, and after the last: where its triangles begin.
    starts: Vec<u32>,
    triangles: Vec<Listed>,
    /// The end of the last attempt to fill them.
    pub end: ListsEnd,
}

/// A triangle of a list.
#[derive(Clone, Copy, Debug, Default)]
pub struct Listed {
    /// Its item, for [`BandTriangles::get`].
    pub item: u32,
    /// The nearest depth of its corners.
    pub nearest: f32,
}

/// The end of an attempt to fill lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ListsEnd {
    /// They have all.
    #[default]
    Whole,
    /// There was no room.
    Full,
    /// The deadline has passed.
    Expired,
}

impl PixelLists {
    /// Memory of the lists, at most, bytes.
    pub const BYTES_MAX: usize =
        TRIANGLES_MAX * (size_of::<(u32, Listed)>() + size_of::<Listed>()) + (PIXELS_MAX + 1) * size_of::<u32>();

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.pairs.capacity() * size_of::<(u32, Listed)>()
            + self.starts.capacity() * size_of::<u32>()
            + self.triangles.capacity() * size_of::<Listed>()
    }

    /// The triangles of pixel number `i`, from the first on.
    #[inline(always)]
    pub fn of(&self, i: usize) -> &[Listed] {
        &self.triangles[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Adds a triangle to those of the pixels that it may touch in these rows; how many they are.
    #[inline(always)]
    fn add(
        &mut self,
        triangles: &BandTriangles<'_>,
        triangle: &BoxedFace,
        pixels: &MixedPixels,
        samples: &SampleBand,
        rows: [i32; 2],
        is_plain: bool,
    ) -> Option<usize> {
        let width = samples.size_px[0] as i32;
        let [[left, right], [top, bottom]] = [triangle.columns, triangle.rows].map(unpair);
        let [left, right] = [left.max(0), right.min(width - 1)];
        let [top, bottom] = [top.max(rows[0]), bottom.min(rows[1] - 1)];
        if left > right || top > bottom {
            return Some(0);
        }
        let first = samples.shown[0] as i32;
        let columns = [left as usize, right as usize];
        if pixels.are_none_in(columns, [(top - first) as usize, (bottom - first) as usize]) {
            return Some(0);
        }
        let is_large = !is_plain & (right - left >= LARGE) & (bottom - top >= LARGE);
        // Not in a closure, which would be compiled for the baseline.
        let spans = match is_large {
            true => Some(Spans::new(&triangles.get(triangle.id).corners, samples.size_px)),
            false => None,
        };
        let before = self.pairs.len();
        let listed = Listed { item: triangle.id, nearest: triangle.depth_max };
        for y in top..=bottom {
            let row = (y - first) as usize;
            let mut numbers = pixels.numbers_in(row, columns);
            if numbers.is_empty() {
                continue;
            }
            if let Some(spans) = &spans {
                let [from, to] = spans.columns(y);
                let [from, to] = [from.max(left), to.min(right)];
                if from > to {
                    continue;
                }
                numbers = pixels.numbers_in(row, [from as usize, to as usize]);
            }
            let (from, to) = (numbers.start.max(self.pixels.start), numbers.end.min(self.pixels.end));
            if from >= to {
                continue;
            }
            if self.pairs.len() + (to - from) > TRIANGLES_MAX {
                return None;
            }
            for i in from..to {
                self.pairs.push(((i - self.pixels.start) as u32, listed));
            }
        }
        Some(self.pairs.len() - before)
    }

    /// Sorts the pairs by pixel. Each pixel's triangles keep their order.
    #[inline(always)]
    fn sort(&mut self) {
        self.starts.clear();
        self.starts.reserve_exact((PIXELS_MAX + 1).saturating_sub(self.starts.capacity()));
        self.starts.resize(self.pixels.len() + 1, 0);
        for (i, _) in &self.pairs {
            self.starts[*i as usize + 1] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.triangles.clear();
        self.triangles.reserve_exact(self.pairs.len());
        self.triangles.resize(self.pairs.len(), Listed::default());
        // From the last on, each takes the last free place of its pixel; so the ends become the starts.
        for (i, triangle) in self.pairs.iter().rev() {
            let place = &mut self.starts[*i as usize + 1];
            *place -= 1;
            self.triangles[*place as usize] = *triangle;
        }
        self.starts.rotate_left(1);
        if let Some(last) = self.starts.last_mut() {
            *last = self.pairs.len() as u32;
        }
    }
}

dispatch! {
    /// Fills the lists of some mixed pixels: of `lists.pixels`.
    pub fn fill(
        context: &RasterContext<'_>,
        triangles: &BandTriangles<'_>,
        pixels: &MixedPixels,
        samples: &SampleBand,
        lists: &mut PixelLists,
    ) = fill_kernel
}

#[inline(always)]
fn fill_kernel(
    context: &RasterContext<'_>,
    triangles: &BandTriangles<'_>,
    pixels: &MixedPixels,
    samples: &SampleBand,
    lists: &mut PixelLists,
) {
    lists.pairs.clear();
    lists.end = ListsEnd::Whole;
    let rows = pixels.rows(&lists.pixels, samples);
    let mut poll = DeadlinePoll::new(context.deadline);
    'all: for list in triangles.boxed() {
        for triangle in list.iter() {
            let Some(added) = lists.add(triangles, triangle, pixels, samples, rows, context.is_plain()) else {
                lists.end = ListsEnd::Full;
                break 'all;
            };
            if poll.is_expired((added * POINTS) as u64) {
                lists.end = ListsEnd::Expired;
                break 'all;
            }
        }
    }
    if lists.end == ListsEnd::Whole {
        lists.sort();
    }
}
