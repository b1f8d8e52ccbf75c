//! Stage mixed, per band: the triangles that each of some mixed pixels may show.

use std::ops::{ControlFlow, Range};

use super::band_triangles::{BandTriangles, ScreenTriangle};
use super::find::MixedPixels;
use super::points::POINT_GRID;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::isa::dispatch;
use crate::backend::sample_partition::POINTS;

/// Pixels that have lists at a time, at most.
pub const PIXELS_MAX: usize = 4096;

/// Items of all lists together, at most.
const ITEMS_MAX: usize = 1 << 18;

/// Lists of triangles by mixed pixel.
#[derive(Default)]
pub struct PixelLists {
    /// The mixed pixels that have a list, as indices into those of the band.
    pub pixels: Range<usize>,
    /// Number of a pixel, from the first on, and one of its items.
    pairs: Vec<[u32; 2]>,
    /// By pixel, and after the last: where its items begin.
    starts: Vec<u32>,
    items: Vec<u32>,
    /// The end of the last attempt to fill them.
    pub end: ListsEnd,
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
        ITEMS_MAX * (size_of::<[u32; 2]>() + size_of::<u32>()) + (PIXELS_MAX + 1) * size_of::<u32>();

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.pairs.capacity() * size_of::<[u32; 2]>()
            + (self.starts.capacity() + self.items.capacity()) * size_of::<u32>()
    }

    /// The items of pixel number `i`, from the first on.
    #[inline(always)]
    pub fn of(&self, i: usize) -> &[u32] {
        &self.items[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    /// Adds a triangle to those of the pixels that it may touch in these rows; how many they are.
    #[inline(always)]
    fn add(
        &mut self,
        triangle: &ScreenTriangle,
        pixels: &MixedPixels,
        samples: &SampleBand,
        rows: [i32; 2],
    ) -> Option<usize> {
        let [width, height] = samples.size_px.map(|size| size as i32);
        let [a, b, c] = &triangle.corners;
        let [low, high] = [a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y)];
        let [top, bottom] = POINT_GRID.pixels([low + 128 * height, high + 128 * height], rows);
        let [low, high] = [a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x)];
        let [left, right] = POINT_GRID.pixels([low + 128 * width, high + 128 * width], [0, width]);
        if left > right || top > bottom {
            return Some(0);
        }
        let first = samples.shown[0] as i32;
        let from_first = [top - first, bottom - first].map(|row| row as usize);
        if pixels.are_none_in([left as usize, right as usize], from_first, width as usize) {
            return Some(0);
        }
        let before = self.pairs.len();
        for y in top..=bottom {
            let row = (y - first) as usize * width as usize;
            let from = (pixels.starts[row + left as usize] as usize).max(self.pixels.start);
            let to = (pixels.starts[row + right as usize + 1] as usize).min(self.pixels.end);
            if from >= to {
                continue;
            }
            if self.pairs.len() + (to - from) > ITEMS_MAX {
                return None;
            }
            for i in from..to {
                self.pairs.push([(i - self.pixels.start) as u32, triangle.item]);
            }
        }
        Some(self.pairs.len() - before)
    }

    /// Sorts the pairs by pixel. Each pixel's items keep their order.
    #[inline(always)]
    fn sort(&mut self) {
        self.starts.clear();
        self.starts.reserve_exact((PIXELS_MAX + 1).saturating_sub(self.starts.capacity()));
        self.starts.resize(self.pixels.len() + 1, 0);
        for [i, _] in &self.pairs {
            self.starts[*i as usize + 1] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.items.clear();
        self.items.reserve_exact(self.pairs.len());
        self.items.resize(self.pairs.len(), 0);
        // From the last on, each takes the last free place of its pixel; so the ends become the starts.
        for [i, item] in self.pairs.iter().rev() {
            let place = &mut self.starts[*i as usize + 1];
            *place -= 1;
            self.items[*place as usize] = *item;
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
    let _ = triangles.for_each(|triangle| {
        let Some(added) = lists.add(&triangle, pixels, samples, rows) else {
            lists.end = ListsEnd::Full;
            return ControlFlow::Break(());
        };
        if poll.is_expired((added * POINTS) as u64) {
            lists.end = ListsEnd::Expired;
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    });
    if lists.end == ListsEnd::Whole {
        lists.sort();
    }
}
