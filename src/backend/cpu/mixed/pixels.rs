//! Stage mixed: mixed pixels that are drawn together, and the faces that their points see.

use super::crowd::Crowd;
use super::faces::PixelFaces;
use super::find::MixedPixels;
use super::points::POINT_GRID;
use super::triangle::PointTriangle;
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::ScreenVertex;

/// Pixels whose faces are in memory at a time: less than 1 MiB, half of a common second-level cache.
pub const AT_ONCE: usize = 512;

/// The faces that the points of some pixels see, and the colours that these make.
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

impl Seen {
    /// Memory of all places, bytes.
    pub const BYTES_MAX: usize =
        AT_ONCE * (size_of::<PixelFaces>() + size_of::<u16>() + size_of::<Crowd>() + size_of::<[f32; 4]>());

    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.faces.capacity() * size_of::<PixelFaces>()
            + self.crowd_of.capacity() * size_of::<u16>()
            + self.crowds.capacity() * size_of::<Crowd>()
            + self.colors.capacity() * size_of::<[f32; 4]>()
    }

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

impl<'a> SomePixels<'a> {
    /// So many pixels from the `first` on, which see nothing.
    pub fn new(
        (pixels, first, count): (&'a MixedPixels, usize, usize),
        seen: &'a mut Seen,
        samples: &'a SampleBand,
    ) -> Self {
        seen.reset(count);
        Self { pixels, first, count, seen, samples }
    }

    /// Their first row, and the one after their last.
    pub fn rows(&self) -> [i32; 2] {
        let last = self.pixels.row_of(self.first + self.count - 1, self.samples);
        [self.first_row() as i32, last as i32 + 1]
    }

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

    /// The faces that they see, and their colours.
    pub fn seen(&self) -> &Seen {
        self.seen
    }

    /// Their colours.
    pub fn colors_mut(&mut self) -> &mut [[f32; 4]] {
        &mut self.seen.colors
    }

    /// Offers a triangle to the pixels that it may touch in these rows; how many they are.
    #[inline(always)]
    pub fn offer(&mut self, context: &RasterContext<'_>, id: u32, corners: &[ScreenVertex; 3], rows: [i32; 2]) -> u64 {
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
