//! Stage mixed, per band: draws the mixed pixels of a band once more.

use super::find::{MixedPixels, find};
use super::points::{POINT_GRID, PixelPoints, PointTriangle, Share, for_each_share};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::geometry::transform::{ScreenVertex, recip};
use crate::backend::cpu::geometry::visibility::Setup;
use crate::backend::cpu::isa::dispatch;
use crate::backend::cpu::surface::shade::Shader;
use crate::backend::sample_partition::POINTS;

/// Pixels whose points are in memory at a time: 1 MiB, half of a common second-level cache.
const AT_ONCE: usize = 512;

/// Buffers of the stage.
#[derive(Default)]
pub struct MixedScratch {
    /// The band's mixed pixels.
    pub pixels: MixedPixels,
    /// The faces that the points of some of them see.
    points: Vec<PixelPoints>,
}

impl MixedScratch {
    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.pixels.bytes() + self.points.capacity() * size_of::<PixelPoints>()
    }

    /// The [`bytes`](Self::bytes) of a band of so many columns and rows, at most.
    pub const fn bytes_of(size: [usize; 2]) -> usize {
        MixedPixels::bytes_of(size) + AT_ONCE * size_of::<PixelPoints>()
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
    let MixedScratch { pixels, points } = scratch;
    find(context.isa, context, samples, pixels);
    context.watch.count_mixed(pixels.columns.len());
    points.clear();
    points.reserve_exact(AT_ONCE);
    points.resize_with(AT_ONCE.min(pixels.columns.len()), || PixelPoints::EMPTY);
    let mut shader = Shader::new(context);
    for first in (0..pixels.columns.len()).step_by(AT_ONCE) {
        if context.deadline.check().is_err() {
            return;
        }
        let end = (first + AT_ONCE).min(pixels.columns.len());
        let some = &mut SomePixels { pixels, first, points: &mut points[..end - first], samples };
        see(context.isa, context, (bins, band), some);
        let mut row = pixels.row_of(first, samples);
        for (i, points) in (first..end).zip(&*some.points) {
            while i >= pixels.end_of(row, samples) {
                row += 1;
            }
            let x = u32::from(pixels.columns[i]);
            each(x, row, color(&mut shader, samples, [x, row], points));
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
    points: &'a mut [PixelPoints],
    samples: &'a SampleBand,
}

dispatch! {
    /// Finds what the points of some mixed pixels see.
    pub fn see(context: &RasterContext<'_>, bins: (&[TriangleBin], usize), some: &mut SomePixels<'_>) = see_kernel
}

#[inline(always)]
fn see_kernel(context: &RasterContext<'_>, (bins, band): (&[TriangleBin], usize), some: &mut SomePixels<'_>) {
    some.points.fill_with(|| PixelPoints::EMPTY);
    let end = some.first + some.points.len() - 1;
    let rows = [some.first, end].map(|i| some.pixels.row_of(i, some.samples) as i32);
    let mut poll = DeadlinePoll::new(context.deadline);
    for bin in bins {
        let pieces = bin.pieces_in(band).map(|(id, piece)| (id, *piece));
        let whole = bin.whole_in(band).map(|id| (id, context.screen_triangle(id)));
        for (id, corners) in pieces.chain(whole) {
            let pixels = some.offer(id, &corners, [rows[0], rows[1] + 1]);
            if poll.is_expired(pixels * POINTS as u64) {
                return;
            }
        }
    }
}

impl SomePixels<'_> {
    /// Offers a triangle to the pixels that it may touch in these rows; how many they are.
    #[inline(always)]
    fn offer(&mut self, id: u32, corners: &[ScreenVertex; 3], rows: [i32; 2]) -> u64 {
        let [width, height] = self.samples.size_px.map(|size| size as i32);
        let range = |v: [i32; 3], size: i32, pixels: [i32; 2]| {
            let ends = [v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2])];
            POINT_GRID.pixels(ends.map(|v| v + 128 * size), pixels)
        };
        let [left, right] = range(corners.map(|v| v.x), width, [0, width]);
        let [top, bottom] = range(corners.map(|v| v.y), height, rows);
        if left > right || top > bottom {
            return 0;
        }
        let end = self.first + self.points.len();
        let (mut triangle, mut offered) = (None, 0);
        for y in top..=bottom {
            let row = (y - self.samples.shown[0] as i32) as usize * width as usize;
            let [from, to] = [left, right + 1].map(|x| self.pixels.starts[row + x as usize] as usize);
            for i in from.max(self.first)..to.min(end) {
                if triangle.is_none() {
                    triangle = Setup::new(corners).map(PointTriangle::new);
                }
                let Some(triangle) = &triangle else { return offered };
                let x = i32::from(self.pixels.columns[i]);
                let corner = [256 * x - 128 * width, 256 * y - 128 * height];
                triangle.offer(id, corner, &mut self.points[i - self.first]);
                offered += 1;
            }
        }
        offered
    }
}

/// The colour of a pixel by what its points see: each triangle is shaded once, at the mean of its points.
fn color(shader: &mut Shader<'_>, samples: &SampleBand, [x, y]: [u32; 2], points: &PixelPoints) -> [f32; 4] {
    let own_z = samples.depth[samples.index(x as i32, y as i32, 0)];
    let corner = [0, 1].map(|k| [x, y][k] as i32 * 256 - samples.size_px[k] as i32 * 128);
    let mut sum = [0.0; 4];
    for_each_share(&points.ids, |Share { id, first, count, place_sum }| {
        let scale = recip((2 * count) as f32);
        let at = [0, 1].map(|k| corner[k] as f32 + place_sum[k] as f32 * scale);
        let color = shader.at_point(id, at, [x, y], [points.depth[first], own_z]);
        let weight = count as f32 / POINTS as f32;
        for k in 0..4 {
            sum[k] += weight * color[k];
        }
    });
    sum
}
