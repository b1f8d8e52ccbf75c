//! The stage mixed for one band (a range of pixel rows): it finds the band's mixed pixels and computes their colours.
//!
//! A mixed pixel is one in which, or beside which, faces of different colours meet, and in which no transparent layer
//! is visible. The few samples that all pixels have are not enough there. So its colour is computed once more, from
//! 64 or 256 points.

use super::band_triangles::BandTriangles;
use super::color::{MixedColors, color};
use super::find::{Finder, MixedPixels, find};
use super::lists::{ListsEnd, PIXELS_MAX, PixelLists, fill};
use super::recent::Recent;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::lines::coverage::BorderPoints;
use crate::backend::cpu::peeling::state::PeelBand;

/// Buffers of the stage.
#[derive(Default)]
pub struct MixedScratch {
    /// The band's mixed pixels.
    pub pixels: MixedPixels,
    finder: Finder,
    /// The triangles that each mixed pixel of the current batch may show.
    lists: PixelLists,
    recent: Recent,
    /// The colours of that batch.
    found: MixedColors,
    /// The points that see something, for pixels in which others see nothing. Lines need them.
    pub border: BorderPoints,
}

impl MixedScratch {
    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.pixels.bytes()
            + self.finder.bytes()
            + self.lists.bytes()
            + self.recent.bytes()
            + self.found.bytes()
            + self.border.bytes()
    }

    /// The [`bytes`](Self::bytes) of a band of so many columns and rows, at most.
    pub const fn bytes_of(size: [usize; 2]) -> usize {
        let border = size[0] * size[1] * BorderPoints::PIXEL_BYTES;
        MixedPixels::bytes_of(size)
            + Finder::bytes_of(size)
            + PixelLists::BYTES_MAX
            + Recent::BYTES_MAX
            + MixedColors::BYTES_MAX
            + border
    }
}

/// Draws the mixed pixels of a band in which no layer is seen: calls `each` with the column, the row and the colour of
/// each (premultiplied linear RGBA, nothing behind it).
pub fn draw_mixed(
    context: &RasterContext<'_>,
    bins: (&[TriangleBin], usize),
    (samples, layers): (&SampleBand, Option<&PeelBand>),
    scratch: &mut MixedScratch,
    mut each: impl FnMut(u32, u32, [f32; 4]),
) {
    let MixedScratch { pixels, finder, lists, recent, found, border } = scratch;
    let triangles = BandTriangles::new(context, bins);
    find(context.isa, context, &triangles, (samples, layers), finder, pixels);
    let all = pixels.columns.len();
    context.watch.count_mixed(all);
    recent.clear();
    let width = samples.size_px[0] as usize;
    border.reset(if context.plan.lines.is_empty() {
        0
    } else {
        width * (samples.shown[1] - samples.shown[0]) as usize
    });
    let (mut first, mut at_once) = (0, PIXELS_MAX);
    while first < all && context.deadline.check().is_ok() {
        let end = all.min(first + at_once);
        lists.pixels = first..end;
        fill(context.isa, context, &triangles, pixels, samples, lists);
        match lists.end {
            ListsEnd::Expired => return,
            // Fewer pixels fit. A single one whose list is too long is drawn without a list.
            ListsEnd::Full if end - first > 1 => {
                at_once = (end - first).div_ceil(4);
                continue;
            }
            ListsEnd::Full | ListsEnd::Whole => {}
        }
        color(context.isa, context, (&triangles, lists, recent), pixels, samples, found);
        let mut row = pixels.row_of(first, samples);
        let mut borders = found.borders.iter().peekable();
        for (i, color) in found.colors.iter().enumerate() {
            let [x, y] = pixels.place(first + i, samples, &mut row);
            each(x, y, *color);
            if let Some((_, points)) = borders.next_if(|(at, _)| *at == i as u32) {
                border.set((y - samples.shown[0]) as usize * width + x as usize, points.0);
            }
        }
        first = end;
        // Pixels after one with many triangles may have few.
        at_once = (2 * at_once).min(PIXELS_MAX);
    }
}
