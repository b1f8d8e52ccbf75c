//! Stage occlusion, per pixel: a weighted mean of what a pixel and its neighbours of the same surface
//! found. Twin of `shaders/occlusion/spread.wgsl`.

use super::grid::{Grid, NOWHERE, lanes};
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
        for parity in 0..2 {
            for x in (parity..grid.width_px).step_by(2 * LANES) {
                let means = means(pass, grid, gathered, [x, y]);
                for (out, mean) in row[x as usize..].iter_mut().step_by(2).zip(means) {
                    *out = mean;
                }
            }
        }
    }
}

/// The means of eight pixels of one parity.
#[inline(always)]
fn means(pass: &OcclusionPass, grid: &Grid, gathered: &[f32], pixel: [u32; 2]) -> [u8; LANES] {
    let own = lanes(grid.depths(), grid.index(pixel, [0, 0]));
    if own.iter().fold(true, |all, depth| all & (*depth == NOWHERE)) {
        return [0; LANES];
    }
    // Small integers: exact.
    let (mut sums, mut weights) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    for down in -1..=1 {
        for across in -1..=1 {
            let weight = ((2 - i32::abs(across)) * (2 - i32::abs(down))) as f32;
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
        // The nearest integer, halves up: what is rounded lies at least 1/64 from a half.
        let mean = ((2.0 * sums[l] + weights[l]) + 0.5) / (2.0 * weights[l]) - 0.5;
        // Beside the picture, `gathered` may still hold what an earlier one left.
        means[l] = if own[l] == NOWHERE { 0 } else { round_to_i32(mean) as u8 };
    }
    means
}
