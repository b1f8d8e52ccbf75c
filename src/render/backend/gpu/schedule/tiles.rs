//! The division of triangles among threads and workgroups of the GPU. A small triangle is drawn by one thread. A
//! large one, or a piece that clipping has left of one, goes to a work list, and is drawn in tiles of 64 x 64 pixels
//! by one workgroup; a huge one by all workgroups. Where a hardware GPU has few triangles to draw, each may get
//! workgroups of its own, whatever its size, without a list.
//!
//! This file decides from which size a triangle is large, whether triangles are few, and whether the work list is
//! drawn in one run of its kernel or in several. There are several where one run might take so long that the device
//! cuts loops off (llvmpipe does), or that the deadline passes.

use super::PIECES_MAX;
use super::sizes::{ALONE_SIZE, Banding, DeviceTraits};
use crate::backend::gpu::pipelines::SampleTarget;
use crate::plan::DrawPlan;

/// Sample tests that may be handed to the device without looking at how many it really is: a second
/// or so of work.
const BLIND_TESTS_MAX: u64 = 1 << 38;

/// Pixels along a side of a tile, which a workgroup draws together.
pub const TILE_PX: u32 = 64;

/// Triangles more than this many pixels wide or high, in the picture, are shared out over all workgroups.
pub const HUGE_PX: u32 = 128;

/// Fewer triangles than this in a dispatch leave most of a large GPU idle if each is drawn by one thread.
const FEW_TRIANGLES: u32 = 1 << 15;

/// The size of the largest triangle that a thread of a real GPU offers to mixed pixels by itself where there are few,
/// 1/256 px: each pixel has up to 256 points.
const ALONE_SIZE_OF_POINTS: i32 = 256;

/// No more triangles than this in a dispatch are drawn by workgroups alone, without a work list.
const FEWEST_TRIANGLES: u32 = 1 << 12;

/// Workgroups for so few triangles, in numbers of those that share the large triangles.
const SHARES_OF_FEW: u32 = 4;

/// Tiles of a large triangle, at most. The first begins at the corner of its box.
const LARGE_TILES_MAX: u64 = (HUGE_PX as u64 / TILE_PX as u64).pow(2);

/// Loop iterations a thread of the tile kernel may run in a dispatch of known extent.
///
/// llvmpipe (Mesa 22) leaves all loops of a thread after 65,535 iterations, silently; and on real
/// devices a dispatch should end in time for the deadline.
const ITERATIONS_MAX: u64 = 40_000;

/// Runs of the tile kernel: one over the whole work list, or, where that might take too long, in
/// rounds whose number follows from the list's length, which is read back first.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    /// True if the kernel runs in rounds.
    pub in_rounds: bool,
    /// Workgroups a dispatch.
    pub workgroups: u32,
    tile_iterations: u64,
    band_tiles: u64,
    /// True if triangles that one thread would draw are better drawn by a workgroup, where there are few.
    shares_few: bool,
}

impl Tiles {
    /// For the bands of a plan, and so many iterations of a thread's loop per pixel: one for each sample, or for four
    /// points.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, banding: Banding, tests_each: u64) -> Self {
        let seen = [banding.seen_columns(plan), banding.seen_rows(plan)];
        let pixels = u64::from(seen[0]) * u64::from(seen[1].max(plan.height_px));
        let hull = plan.hull.as_ref().map_or(0, |hull| hull.triangles.len());
        let triangles = (plan.triangles.len() + hull) as u64;
        let tests = triangles.saturating_mul(pixels * tests_each);
        let mut tiles = Self {
            in_rounds: false,
            workgroups: device.tile_workgroups.min(device.workgroups_max),
            // 64 blocks, in each the samples or points; and as much again for the way there.
            tile_iterations: 64 * (tests_each + 1) + 64,
            band_tiles: u64::from(seen[0] / TILE_PX + 2) * u64::from(seen[1] / TILE_PX + 2),
            shares_few: device.alone_size_of_few < ALONE_SIZE,
        };
        // No list of so few items is too long for one round.
        let fits_one_round =
            triangles.saturating_mul(u64::from(PIECES_MAX)) <= tiles.items_of_a_round().into_iter().min().unwrap_or(0);
        tiles.in_rounds = device.loops_are_limited && !fits_one_round || tests > BLIND_TESTS_MAX;
        tiles
    }

    /// Workgroups that share each of so many triangles, if they are so few that no work list is needed.
    pub fn groups_each(&self, count: u32) -> Option<u32> {
        let each = (SHARES_OF_FEW * self.workgroups / count.max(1)).max(1);
        let iterations = self.band_tiles.div_ceil(u64::from(each)) * self.tile_iterations;
        (self.shares_few && count <= FEWEST_TRIANGLES && iterations <= ITERATIONS_MAX).then_some(each)
    }

    /// Large items, and huge ones, for which there is time in one round.
    fn items_of_a_round(&self) -> [u64; 2] {
        let workgroups = u64::from(self.workgroups);
        // A large triangle is drawn by one workgroup.
        let large = ITERATIONS_MAX / (LARGE_TILES_MAX * self.tile_iterations) * workgroups;
        let huge_iterations = self.band_tiles.div_ceil(workgroups) * self.tile_iterations;
        [large, ITERATIONS_MAX / huge_iterations]
    }

    /// The ranges of large and of huge items to draw in each round.
    pub fn rounds(&self, large: u32, huge: u32) -> Vec<[std::ops::Range<u32>; 2]> {
        let [large_step, huge_step] = self.items_of_a_round().map(|items| items.max(1));
        let ranges = |count: u32, step: u64| {
            (0..u64::from(count)).step_by(step as usize).map(move |i| i as u32..(i + step).min(u64::from(count)) as u32)
        };
        ranges(large, large_step)
            .map(|range| [range, 0..0])
            .chain(ranges(huge, huge_step).map(|range| [0..0, range]))
            .collect()
    }
}

/// The size of the largest triangle of so many that a thread draws by itself, 1/256 px.
pub fn alone_size(count: u32, target: SampleTarget, device: &DeviceTraits) -> i32 {
    let is_hardware = device.alone_size_of_few < ALONE_SIZE;
    match target {
        _ if count >= FEW_TRIANGLES => ALONE_SIZE,
        SampleTarget::Points if is_hardware => ALONE_SIZE_OF_POINTS,
        _ => device.alone_size_of_few,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::schedule::test_plans::{Case, DEVICE, LARGEST, plan};

    #[test]
    fn few_triangles_keep_a_real_gpu_busy() {
        let real = DeviceTraits { alone_size_of_few: 1024, ..DEVICE };
        let sizes = |target: SampleTarget| {
            [(968, &real), (1 << 20, &real), (968, &DEVICE)].map(|(count, device)| alone_size(count, target, device))
        };
        assert_eq!(sizes(SampleTarget::Visibility), [1024, 4096, 4096]);
        assert_eq!(sizes(SampleTarget::Points), [256, 4096, 4096]);
    }

    #[test]
    fn few_triangles_are_shared_unless_a_workgroup_would_take_long() {
        let tiles = |band_tiles, shares_few| Tiles {
            in_rounds: false,
            workgroups: 1024,
            tile_iterations: 384,
            band_tiles,
            shares_few,
        };
        let each = [1, 968, 4096, 4097].map(|count| tiles(36, true).groups_each(count));
        assert_eq!(each, [Some(4096), Some(4), Some(1), None]);
        assert_eq!([tiles(36, false).groups_each(12), tiles(660, true).groups_each(968)], [None, None]);
    }

    #[test]
    fn a_list_that_is_short_for_sure_is_drawn_in_one_round() {
        let software = DeviceTraits { loops_are_limited: true, tile_workgroups: 64, ..DEVICE };
        let case = Case { size_px: [256; 2], is_peeled: false, passes: 0, ..LARGEST };
        let mut cases = 0;
        for triangles in [1, 12, 17, 18, 100, 5000] {
            let triangles = vec![[0; 3]; triangles];
            let mut plan = plan(&triangles, case);
            plan.hull = None;
            let banding = Banding { rows: 256, margin: 0, beyond: 0, has_pixel_lists: false };
            let tiles = Tiles::new(&plan, &software, banding, u64::from(plan.samples));
            let all = PIECES_MAX * triangles.len() as u32;
            let rounds = tiles.rounds(all, all);
            assert_eq!(tiles.in_rounds, rounds.len() > 2, "{} triangles: {rounds:?}", triangles.len());
            cases += usize::from(tiles.in_rounds);
        }
        assert_eq!(cases, 3);
    }

    #[test]
    fn rounds_cover_every_item_once() {
        let tiles = Tiles { in_rounds: true, workgroups: 32, tile_iterations: 384, band_tiles: 200, shares_few: false };
        let mut cases = 0;
        for (large, huge) in [(0, 0), (1, 0), (0, 1), (831, 14), (832, 15), (833, 16), (100_000, 1000)] {
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
