//! The depth test of the stage visibility: of all triangles at a sample, the one nearest to the viewer is kept. Of
//! equal depths the lower id is kept, so that the order of drawing does not matter.

use super::samples::SampleBand;
use super::visibility::Target;
use crate::backend::cpu::isa::LANES;

/// Keeps the nearest; of equal depths the lowest id, whatever the order of drawing.
pub struct Nearest<'a>(pub &'a mut SampleBand);

impl Target for Nearest<'_> {
    #[inline(always)]
    fn band(&self) -> &SampleBand {
        self.0
    }

    #[inline(always)]
    fn offer(&mut self, at: usize, outside: &[i32; LANES], z: &[f32; LANES], id: u32) {
        if let Some((depths, ids)) = self.0.lanes_mut(at) {
            update(outside, z, id, depths, ids);
        }
    }
}

/// Keeps, lane by lane, the nearer of what is there and triangle `id`. Written as whole-array steps
/// without branches, which is the form that compilers turn into vector instructions.
#[inline(always)]
pub fn update(outside: &[i32; LANES], z: &[f32; LANES], id: u32, depths: &mut [f32; LANES], ids: &mut [u32; LANES]) {
    let (old_depths, old_ids) = (*depths, *ids);
    let mut keep = [0_u32; LANES];
    for l in 0..LANES {
        let nearer = z[l] > old_depths[l];
        let tied = (z[l] == old_depths[l]) & (z[l] > 0.0) & (id < old_ids[l]);
        // All ones where the old sample stays.
        keep[l] = ((outside[l] >> 31) as u32) | u32::from(nearer | tied).wrapping_sub(1);
    }
    for l in 0..LANES {
        depths[l] = f32::from_bits((old_depths[l].to_bits() & keep[l]) | (z[l].to_bits() & !keep[l]));
        ids[l] = (old_ids[l] & keep[l]) | (id & !keep[l]);
    }
}
