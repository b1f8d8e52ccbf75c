//! Stage mixed, per band: draws the mixed pixels of a band once more.

use super::color::color;
use super::crowd::Crowd;
use super::faces::PixelFaces;
use super::find::{MixedPixels, find};
use super::points::POINT_GRID;
use super::triangle::PointTriangle;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::isa::dispatch;
use crate::backend::sample_partition::POINTS;

/// Pixels whose faces are in memory at a time: less than 1 MiB, half of a common second-level cache.
const AT_ONCE: usize = 512;

/// Buffers of the stage.
#[derive(Default)]
pub struct MixedScratch {
    /// The band's mixed pixels.
    pub pixels: MixedPixels,
    /// What the points of some of them see.
    seen: Seen,
}

/// What the points of some pixels see.
#[derive(Default)]
pub struct Seen {
    /// By pixel: its faces.
    pub faces: Vec<PixelFaces>,
    /// By pixel: one more than the index of its crowd; 0 for a pixel of few faces.
    pub crowd_of: Vec<u16>,
    /// Pixels of many faces.
    pub crowds: Vec<Crowd>,
    /// By pixel: premultiplied linear RGBA, nothing behind it.
    pub colors: Vec<[f32; 4]>,
}

impl MixedScratch {
    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        let Seen { faces, crowd_of, crowds, colors } = &self.seen;
        self.pixels.bytes()
            + faces.capacity() * size_of::<PixelFaces>()
            + crowd_of.capacity() * size_of::<u16>()
            + crowds.capacity() * size_of::<Crowd>()
            + colors.capacity() * size_of::<[f32; 4]>()
    }

    /// The [`bytes`](Self::bytes) of a band of so many columns and rows, at most.
    pub const fn bytes_of(size: [usize; 2]) -> usize {
        let of_pixel = size_of::<PixelFaces>() + size_of::<u16>() + size_of::<Crowd>() + size_of::<[f32; 4]>();
        MixedPixels::bytes_of(size) + AT_ONCE * of_pixel
    }
}

impl Seen {
    /// Makes place for so many pixels, which see nothing.
    fn reset(&mut self, count: usize) {
        // Places are made once: a place has more than 1 KiB.
        if self.faces.len() < AT_ONCE {
            self.faces.reserve_exact(AT_ONCE - self.faces.len());
            self.faces.resize_with(AT_ONCE, || PixelFaces::EMPTY);
        }
        self.faces.iter_mut().take(count).for_each(PixelFaces::clear);
        self.crowd_of.reserve_exact(AT_ONCE.saturating_sub(self.crowd_of.len()));
        self.crowd_of.clear();
        self.crowd_of.resize(count, 0);
        self.crowds.clear();
        self.colors.reserve_exact(AT_ONCE.saturating_sub(self.colors.len()));
        self.colors.clear();
        self.colors.resize(count, [0.0; 4]);
    }

    /// Makes a crowd of a pixel.
    #[inline(never)]
    fn crowd(&mut self, i: usize) -> Option<&mut Crowd> {
        if self.crowd_of[i] == 0 {
            self.crowds.push(Crowd::of(&self.faces[i]));
            self.crowd_of[i] = self.crowds.len() as u16;
        }
        self.crowds.get_mut(usize::from(self.crowd_of[i]) - 1)
    }
}

/// Draws the mixed pixels of a band: calls `each` with the column, the row and the colour of each
/// (premultiplied linear RGBA, nothing behind it).
pub fn draw_mixed(
    context: &RasterContext<'_>,
    (bins, band): (&[TriangleBin], usize),
    samples: &SampleBand,
    scratch: &mut MixedScratch,
    mut each: impl FnMut(u32, u32, [f32; 4]),
) {
    let MixedScratch { pixels, seen } = scratch;
    find(context.isa, context, samples, pixels);
    context.watch.count_mixed(pixels.columns.len());
    for first in (0..pixels.columns.len()).step_by(AT_ONCE) {
        if context.deadline.check().is_err() {
            return;
        }
        let count = AT_ONCE.min(pixels.columns.len() - first);
        seen.reset(count);
        let some = &mut SomePixels { pixels, first, count, seen, samples };
        see(context.isa, context, (bins, band), some);
        color(context.isa, context, some);
        let mut row = some.first_row();
        for i in 0..count {
            let [x, y] = some.place(i, &mut row);
            each(x, y, some.seen.colors[i]);
        }
    }
}

impl MixedPixels {
    /// Number of the mixed pixels up to the end of a shown row.
    fn end_of(&self, row: u32, samples: &SampleBand) -> usize {
        let rows = (row + 1 - samples.shown[0]) as usize;
        self.starts[rows * samples.size_px[0] as usize] as usize
    }

    /// The row of a mixed pixel.
    fn row_of(&self, i: usize, samples: &SampleBand) -> u32 {
        let [first, end] = samples.shown;
        (first..end).find(|&row| i < self.end_of(row, samples)).unwrap_or(first)
    }
}

/// Mixed pixels of a band whose points are drawn together.
pub struct SomePixels<'a> {
    pixels: &'a MixedPixels,
    /// The first of them.
    first: usize,
    count: usize,
    seen: &'a mut Seen,
    /// The band.
    pub samples: &'a SampleBand,
}

dispatch! {
    /// Finds what the points of some mixed pixels see.
    pub fn see(context: &RasterContext<'_>, bins: (&[TriangleBin], usize), some: &mut SomePixels<'_>) = see_kernel
}

#[inline(always)]
fn see_kernel(context: &RasterContext<'_>, (bins, band): (&[TriangleBin], usize), some: &mut SomePixels<'_>) {
    let rows = [some.first, some.first + some.count - 1].map(|i| some.pixels.row_of(i, some.samples) as i32);
    let rows = [rows[0], rows[1] + 1];
    let mut poll = DeadlinePoll::new(context.deadline);
    for bin in bins {
        for (id, piece) in bin.pieces_in(band) {
            let pixels = some.offer(context, id, piece, rows);
            if poll.is_expired(pixels * POINTS as u64) {
                return;
            }
        }
    }
    // What faces away is mostly hidden by then.
    for is_front in [true, false] {
        for bin in bins {
            let (listed, others) = if is_front { &bin.fronts } else { &bin.backs }.items_in(band);
            for ids in [listed, &others] {
                for &id in ids {
                    let pixels = some.offer(context, id, &context.screen_triangle(id), rows);
                    if poll.is_expired(pixels * POINTS as u64) {
                        return;
                    }
                }
            }
        }
    }
}

impl SomePixels<'_> {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.count
    }

    /// The row of the first.
    pub fn first_row(&self) -> u32 {
        self.pixels.row_of(self.first, self.samples)
    }

    /// Column and row of pixel number `i`. `row` is that of the pixel before it.
    #[inline(always)]
    pub fn place(&self, i: usize, row: &mut u32) -> [u32; 2] {
        while self.first + i >= self.pixels.end_of(*row, self.samples) {
            *row += 1;
        }
        [u32::from(self.pixels.columns[self.first + i]), *row]
    }

    /// What they see.
    pub fn seen(&self) -> &Seen {
        self.seen
    }

    /// Their colours.
    pub fn colors_mut(&mut self) -> &mut [[f32; 4]] {
        &mut self.seen.colors
    }

    /// Offers a triangle to the pixels that it may touch in these rows; how many they are.
    #[inline(always)]
    fn offer(&mut self, context: &RasterContext<'_>, id: u32, corners: &[ScreenVertex; 3], rows: [i32; 2]) -> u64 {
        let [width, height] = self.samples.size_px.map(|size| size as i32);
        let [a, b, c] = corners;
        let [low, high] = [a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x)];
        let [left, right] = POINT_GRID.pixels([low + 128 * width, high + 128 * width], [0, width]);
        let [low, high] = [a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y)];
        let [top, bottom] = POINT_GRID.pixels([low + 128 * height, high + 128 * height], rows);
        if left > right || top > bottom {
            return 0;
        }
        let end = self.first + self.count;
        let (mut triangle, mut offered) = (None, 0);
        for y in top..=bottom {
            let row = (y - self.samples.shown[0] as i32) as usize * width as usize;
            let from = self.pixels.starts[row + left as usize] as usize;
            let to = self.pixels.starts[row + right as usize + 1] as usize;
            for i in from.max(self.first)..to.min(end) {
                if triangle.is_none() {
                    triangle = PointTriangle::new(corners);
                }
                let Some(triangle) = &mut triangle else { return offered };
                let x = i32::from(self.pixels.columns[i]);
                let corner = [256 * x - 128 * width, 256 * y - 128 * height];
                let i = i - self.first;
                let is_crowd = self.seen.crowd_of[i] != 0 || context.is_plain;
                if (is_crowd || !self.seen.faces[i].offer(context.isa, triangle, id, corner))
                    && let Some(crowd) = self.seen.crowd(i)
                {
                    crowd.offer(context.isa, triangle, id, corner);
                }
                offered += 1;
            }
        }
        offered
    }
}
