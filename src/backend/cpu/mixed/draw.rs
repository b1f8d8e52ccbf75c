//! Stage mixed, per band: draws the mixed pixels of a band once more.

use super::color::color;
use super::find::{MixedPixels, find};
use super::pixels::{AT_ONCE, Seen, SomePixels};
use crate::backend::cpu::RasterContext;
use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::SampleBand;
use crate::backend::cpu::isa::dispatch;
use crate::backend::sample_partition::POINTS;

/// Buffers of the stage.
#[derive(Default)]
pub struct MixedScratch {
    /// The band's mixed pixels.
    pub pixels: MixedPixels,
    /// The faces that the points of some of them see.
    seen: Seen,
}

impl MixedScratch {
    /// Allocated memory, bytes.
    pub fn bytes(&self) -> usize {
        self.pixels.bytes() + self.seen.bytes()
    }

    /// The [`bytes`](Self::bytes) of a band of so many columns and rows, at most.
    pub const fn bytes_of(size: [usize; 2]) -> usize {
        MixedPixels::bytes_of(size) + Seen::BYTES_MAX
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
        let some = &mut SomePixels::new((pixels, first, count), seen, samples);
        see(context.isa, context, (bins, band), some);
        color(context.isa, context, some);
        let mut row = some.first_row();
        for i in 0..count {
            let [x, y] = some.place(i, &mut row);
            each(x, y, some.seen().colors[i]);
        }
    }
}

dispatch! {
    /// Finds what the points of some mixed pixels see.
    pub fn see(context: &RasterContext<'_>, bins: (&[TriangleBin], usize), some: &mut SomePixels<'_>) = see_kernel
}

#[inline(always)]
fn see_kernel(context: &RasterContext<'_>, (bins, band): (&[TriangleBin], usize), some: &mut SomePixels<'_>) {
    let rows = some.rows();
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
