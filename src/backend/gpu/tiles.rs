//! How much a thread is given at a time: how often the kernel that draws large triangles is run, and how many edges one that
//! draws lines takes.

use super::params::{LONG_ONLY, SHORT_ONLY};
use super::schedule::WORKGROUP;
use super::sizes::DeviceTraits;
use crate::plan::{DrawPlan, LinePass};

/// Sample tests that may be handed to the device without looking at how many it really is: a second or so of work.
const BLIND_TESTS_MAX: u64 = 1 << 38;

/// Loop iterations a thread of the tile kernel may run in a dispatch of known extent.
///
/// llvmpipe (Mesa 22) leaves all loops of a thread after 65,535 iterations, silently; and on real devices a dispatch
/// should end in time for the deadline.
const ITERATIONS_MAX: u64 = 40_000;

/// How the tile kernel is run: at once over whatever is in the work list, or, where that might take too long, in rounds
/// whose number follows from the list's length, which is read back first.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    /// Whether to run in rounds.
    pub in_rounds: bool,
    /// Workgroups a dispatch.
    pub workgroups: u32,
    tile_iterations: u64,
    band_tiles: u64,
}

impl Tiles {
    /// For the bands of a plan.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, band_rows: u32) -> Self {
        let pixels = u64::from(plan.width_px) * u64::from(plan.height_px);
        let tests = (plan.triangles.len() as u64).saturating_mul(pixels * u64::from(plan.samples));
        Self {
            in_rounds: device.loops_are_limited || tests > BLIND_TESTS_MAX,
            workgroups: device.tile_workgroups.min(device.workgroups_max),
            // 64 blocks, in each the samples; and as much again for the way there.
            tile_iterations: 64 * (u64::from(plan.samples) + 1) + 64,
            band_tiles: u64::from(plan.width_px / 64 + 2) * u64::from(band_rows / 64 + 2),
        }
    }

    /// The ranges of large and of huge items to draw in each round.
    pub fn rounds(&self, large: u32, huge: u32) -> Vec<[std::ops::Range<u32>; 2]> {
        // A large triangle is at most 128 pixels, three tiles, wide and high, and one workgroup's.
        let large_step = (ITERATIONS_MAX / (9 * self.tile_iterations)).max(1) * u64::from(self.workgroups);
        let huge_iterations = self.band_tiles.div_ceil(u64::from(self.workgroups)) * self.tile_iterations;
        let huge_step = (ITERATIONS_MAX / huge_iterations).max(1);
        let ranges = |count: u32, step: u64| {
            (0..u64::from(count)).step_by(step as usize).map(move |i| i as u32..(i + step).min(u64::from(count)) as u32)
        };
        ranges(large, large_step)
            .map(|range| [range, 0..0])
            .chain(ranges(huge, huge_step).map(|range| [0..0, range]))
            .collect()
    }
}

/// Threads that share a window of an edge, where the line is so wide that it has many pixels.
pub fn slices(lines: &LinePass, device: &DeviceTraits) -> u32 {
    let side = lines.window_px() + 2.0 * lines.reach_px();
    // Few edges leave most of a GPU idle, so threads may look along them twice; a processor has nothing to spare.
    let is_idle = !device.loops_are_limited && lines.edges.len() < BUSY_EDGES;
    let pixels = if is_idle { 64.0 } else { 400.0 };
    (side * 2.0 * lines.reach_px() / pixels).ceil().clamp(1.0, 64.0) as u32
}

/// Edges that keep all of a GPU busy.
const BUSY_EDGES: usize = 1 << 15;

/// How often the kernel that draws lines is run over its edges: with which flag, and with how many edges a workgroup.
///
/// Where a thread's loops are limited, edges that a workgroup shares come by themselves, few at a time.
pub fn edges_per_group(plan: &DrawPlan<'_>, lines: &LinePass, device: &DeviceTraits) -> Vec<(u32, u32)> {
    if !device.loops_are_limited {
        let edges = (lines.edges.len() as u32).div_ceil(BUSY_GROUPS).clamp(1, WORKGROUP);
        return vec![(0, edges)];
    }
    let (reach, window, slices) = (lines.reach_px(), lines.window_px(), slices(lines, device) as f32);
    let side = plan.width_px.max(plan.height_px) as f32;
    let shares = ((1.5 * side / window + 2.0) * slices / WORKGROUP as f32).ceil();
    let length = window + 2.0 * (reach + 1.0);
    // Steps of half a pixel, and at each pixel the samples of three; then a loop over a mask's words for each pixel.
    let look = 2.0 * length + 1.5 * 3.0 * plan.samples as f32 * length;
    let draw = (window + 2.0 * reach) / slices * (2.0 + 10.0 * (2.0 * reach + 1.0));
    let iterations = shares * (LOOKS * look + LOOKS / 4.0 * draw);
    let shared = (ITERATIONS_MAX as f32 / iterations).clamp(1.0, WORKGROUP as f32) as u32;
    vec![(SHORT_ONLY, WORKGROUP), (LONG_ONLY, shared)]
}

/// Workgroups that keep all of a GPU busy.
const BUSY_GROUPS: u32 = 1024;

/// Looks along an edge in a window that are made room for: a few for each part, and between letters or leaves there are many.
const LOOKS: f32 = 16.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_cover_every_item_once() {
        let tiles = Tiles { in_rounds: true, workgroups: 32, tile_iterations: 384, band_tiles: 200 };
        let mut cases = 0;
        for (large, huge) in [(0, 0), (1, 0), (0, 1), (351, 14), (352, 15), (353, 16), (100_000, 1000)] {
            let mut next = [0, 0];
            for round in tiles.rounds(large, huge) {
                for (range, next) in round.iter().zip(&mut next) {
                    assert!(range.is_empty() || range.start == *next);
                    *next = range.end.max(*next);
                }
            }
            assert_eq!(next, [large, huge]);
            cases += 1;
        }
        assert_eq!(cases, 7);
    }
}
