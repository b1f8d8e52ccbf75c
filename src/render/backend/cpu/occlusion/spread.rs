//! The smoothing of the darkness of hollows, by a weighted mean over the neighbours at about the
//! same depth (stage occlusion, screen-space ambient occlusion). Neighbours looked at different
//! places in `gather`, so their values differ even on a smooth surface. The mean also gives a value
//! to the pixels between those that `gather` computes. Twin of `shaders/occlusion/spread.wgsl`.

use super::grid::{Grid, NOWHERE, PHASES, lanes};
use crate::backend::cpu::geometry::transform::round_to_i32;
use crate::backend::cpu::isa::{LANES, dispatch};
use crate::plan::OcclusionPass;

dispatch! {
    /// Fills rows of the picture, from row `first` on.
    pub fn spread_rows(pass: &OcclusionPass, grid: &Grid, gathered: &[f32], first: u32, out: &mut [u8]) = spread_kernel
}

#[inline(always)]
fn spread_kernel(pass: &OcclusionPass, grid: &Grid, gathered: &[f32], first: u32, out: &mut [u8]) {
    for (y, row) in (first..).zip(out.chunks_exact_mut(grid.width_px as usize)) {
        for phase in 0..PHASES as u32 {
            for x in (phase..grid.width_px).step_by(PHASES * LANES) {
                let means = means(pass, grid, gathered, [x, y]);
                for (out, mean) in row[x as usize..].iter_mut().step_by(PHASES).zip(means) {
                    *out = mean;
                }
            }
        }
    }
}

/// The means of eight pixels, [`PHASES`] columns apart.
#[inline(always)]
fn means(pass: &OcclusionPass, grid: &Grid, gathered: &[f32], pixel: [u32; 2]) -> [u8; LANES] {
    let own = lanes(grid.depths(), grid.index(pixel, [0, 0]));
    if own.iter().fold(true, |all, depth| all & (*depth == NOWHERE)) {
        return [0; LANES];
    }
    // Small integers: exact.
    let (mut sums, mut weights) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    // To the columns and rows of pixels that have looked around: -2, 0 and 2 from even ones, -3 to 3 from odd ones.
    let steps = |at: u32| {
        let farthest = 2 + (at & 1) as i32;
        (-farthest..=farthest).step_by(2)
    };
    for down in steps(pixel[1]) {
        for across in steps(pixel[0]) {
            let weight = ((4 - i32::abs(across)) * (4 - i32::abs(down))) as f32;
            let at = grid.index(pixel, [across, down]);
            let (depths, found) = (lanes(grid.depths(), at), lanes(gathered, at));
            for l in 0..LANES {
                let weight = if (depths[l] - own[l]).abs() <= pass.near { weight } else { 0.0 };
                sums[l] += weight * found[l];
                weights[l] += weight;
            }
        }
    }
    let mut means = [0; LANES];
    for l in 0..LANES {
        // The nearest integer, halves up: what is rounded lies at least 1/256 from a half.
        let mean = ((2.0 * sums[l] + weights[l]) + 0.5) / (2.0 * weights[l].max(1.0)) - 0.5;
        // Where none of them shows the surface, nothing is taken. Beside the picture, `gathered` may still hold what
        // an earlier one left.
        means[l] = if own[l] == NOWHERE || weights[l] == 0.0 { 0 } else { round_to_i32(mean) as u8 };
    }
    means
}
