//! The search for the next transparent layer of each sample, which is the nearest triangle behind the previous layer
//! (stage peeling). Each round of depth peeling runs it once. Twin of `shaders/peeling/emit_layer.wgsl`.

use crate::backend::cpu::bands::triangle_bins::TriangleBin;
use crate::backend::cpu::context::RasterContext;
use crate::backend::cpu::deadline_poll::DeadlinePoll;
use crate::backend::cpu::geometry::samples::{SampleBand, for_samples};
use crate::backend::cpu::geometry::transform::ScreenVertex;
use crate::backend::cpu::geometry::visibility;
use crate::backend::cpu::geometry::visibility::{Setup, Target};
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::backend::cpu::peeling::state::PeelBand;

dispatch! {
    /// Finds the next layer of a band.
    pub fn peel_layer(context: &RasterContext<'_>, bins: (&[TriangleBin], usize), peel: &mut PeelBand) = peel_layer_kernel
}

/// Target that keeps the nearest triangle behind the previous layer.
struct Behind<'a> {
    found: &'a mut SampleBand,
    previous: &'a SampleBand,
    /// Not 0 if the triangle is behind the previous layer at some sample.
    pending: [u32; LANES],
}

impl Target for Behind<'_> {
    #[inline(always)]
    fn band(&self) -> &SampleBand {
        self.found
    }

    #[inline(always)]
    fn offer(&mut self, at: usize, outside: &[i32; LANES], z: &[f32; LANES], id: u32) {
        let lanes = (
            self.found.depth.get_mut(at..).and_then(|d| d.first_chunk_mut::<LANES>()),
            self.found.ids.get_mut(at..).and_then(|d| d.first_chunk_mut::<LANES>()),
            self.previous.depth.get(at..).and_then(|d| d.first_chunk::<LANES>()),
            self.previous.ids.get(at..).and_then(|d| d.first_chunk::<LANES>()),
        );
        let (Some(depths), Some(ids), Some(last_depths), Some(last_ids)) = lanes else { return };
        let (old_depths, old_ids, last_depths, last_ids) = (*depths, *ids, *last_depths, *last_ids);
        // All ones where the triangle is not seen behind the previous layer, and where the old sample stays. Whole-array
        // steps without branches are what compilers turn into vector instructions.
        let (mut closed, mut keep) = ([0_u32; LANES], [0_u32; LANES]);
        for l in 0..LANES {
            let behind = (z[l] < last_depths[l]) | ((z[l] == last_depths[l]) & (id > last_ids[l]));
            closed[l] = ((outside[l] >> 31) as u32) | u32::from(behind & (z[l] > 0.0)).wrapping_sub(1);
        }
        if closed == [u32::MAX; LANES] {
            return;
        }
        for l in 0..LANES {
            let nearer = (z[l] > old_depths[l]) | ((z[l] == old_depths[l]) & (id < old_ids[l]));
            keep[l] = closed[l] | u32::from(nearer).wrapping_sub(1);
            self.pending[l] |= !closed[l];
        }
        for l in 0..LANES {
            depths[l] = f32::from_bits((old_depths[l].to_bits() & keep[l]) | (z[l].to_bits() & !keep[l]));
            ids[l] = (old_ids[l] & keep[l]) | (id & !keep[l]);
        }
    }
}

#[inline(always)]
fn peel_layer_kernel(context: &RasterContext<'_>, bins: (&[TriangleBin], usize), peel: &mut PeelBand) {
    for_samples!(peel.found.samples, peel_sampled(context, bins, peel));
}

#[inline(always)]
fn peel_sampled<const S: usize>(
    context: &RasterContext<'_>,
    (bins, band): (&[TriangleBin], usize),
    peel: &mut PeelBand,
) {
    let PeelBand { found, previous, pending, .. } = peel;
    let mut poll = DeadlinePoll::new(context.deadline);
    let items = bins.iter().flat_map(|chunk| {
        let pieces = chunk.pieces_in(band).map(|(id, piece)| (id, Some(piece)));
        pieces.chain(chunk.whole_in(band).map(|id| (id, None)))
    });
    for (item, (id, piece)) in items.enumerate() {
        // An earlier round has found all of its samples.
        let is_done = pending.get(item) == Some(&false);
        let looked_at = match piece {
            _ if is_done => 0,
            Some(piece) => offer::<S>(item, (id, *piece), found, previous, pending),
            None => offer::<S>(item, (id, context.screen_triangle(id)), found, previous, pending),
        };
        if poll.is_expired(looked_at) {
            return;
        }
    }
}

/// Draws the band's triangle number `item`. Returns the number of samples tested.
#[inline(always)]
fn offer<const S: usize>(
    item: usize,
    (id, corners): (u32, [ScreenVertex; 3]),
    found: &mut SampleBand,
    previous: &SampleBand,
    pending: &mut Vec<bool>,
) -> u64 {
    let mut target = Behind { found, previous, pending: [0; LANES] };
    // Not in a closure, which would be compiled for the baseline.
    let looked_at = match Setup::new(&corners) {
        Some(setup) => visibility::draw::<S>(&setup, id, &mut target),
        None => 0,
    };
    let is_pending = target.pending != [0; LANES];
    match pending.get_mut(item) {
        Some(kept) => *kept = is_pending,
        None => pending.push(is_pending),
    }
    looked_at
}
