//! What is dispatched for a plan, in order: pure arithmetic, no device.
//!
//! The picture is cut into horizontal bands whose sample buffer stays small, triangles into chunks whose work list does.
//! After each chunk of a large mesh, and each band, the commands go to the device, so that no single submission takes
//! long and the deadline is looked at in between.

use super::params::{Batch, faces_code, line_flags};
use super::stages::{Stage, Write};
use crate::plan::{DrawPlan, Faces, LinePass};

/// Largest buffer that depends on the picture's size, bytes.
const BAND_BYTES: u64 = 64 << 20;

/// Triangles a dispatch, where none needs clipping; each may leave one item in the work list.
const CHUNK: u32 = 1 << 20;

/// Triangles a dispatch where all may need clipping, into at most six pieces each.
const CHUNK_CLIP: u32 = 1 << 17;
const PIECES_MAX: u32 = 6;

/// Bytes of the work list before its items, and of each.
pub const WORK_HEAD_BYTES: u64 = 16;
/// See [`WORK_HEAD_BYTES`].
pub const WORK_ITEM_BYTES: u64 = 48;

/// Edges a dispatch.
const EDGE_CHUNK: u32 = 1 << 20;

/// Threads of a workgroup, in every kernel.
const WORKGROUP: u32 = 64;

/// What a device allows, and which way it goes.
#[derive(Clone, Copy, Debug)]
pub struct DeviceTraits {
    /// Largest buffer that can be bound, bytes.
    pub binding_bytes_max: u64,
    /// Workgroups in one direction.
    pub workgroups_max: u32,
    /// Workgroups that share the large triangles.
    pub tile_workgroups: u32,
    /// 64-bit atomics.
    pub int64_atomics: bool,
    /// Whether a thread's loops are cut off after a while: see [`Tiles`].
    pub loops_are_limited: bool,
}

/// Sample tests that may be handed to the device without looking at how many it really is: a second or so of work.
const BLIND_TESTS_MAX: u64 = 1 << 38;

/// Loop iterations a thread of the tile kernel may run in a dispatch of known extent.
///
/// llvmpipe (Mesa 22) leaves all loops of a thread after 65,535 iterations, silently; and on real devices a dispatch
/// should end in time for the deadline.
const ITERATIONS_MAX: u64 = 40_000;

/// One command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Fills a band's samples (and ink) with zeros.
    ClearBand,
    /// Empties the work list.
    ClearWork,
    /// Runs a kernel over `threads` threads with the batch at `batch`.
    Dispatch {
        /// Which.
        stage: Stage,
        /// Index of its numbers.
        batch: usize,
        /// How often.
        workgroups: [u32; 2],
    },
    /// Draws the large triangles of the batch.
    Tiles {
        /// The kernel.
        stage: Stage,
        /// Index of its numbers.
        batch: usize,
    },
    /// Hands what was recorded to the device.
    Submit,
    /// The band is finished: its rows are copied out.
    EndBand {
        /// First row.
        row_first: u32,
        /// Past its last row.
        row_end: u32,
    },
}

/// All commands for a plan.
#[derive(Debug)]
pub struct Schedule {
    pub steps: Vec<Step>,
    pub batches: Vec<Batch>,
    /// Rows of the largest band.
    pub band_rows: u32,
    /// Items that the work list must hold.
    pub work_items: u32,
    /// How the tile kernel is run.
    pub tiles: Tiles,
}

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
    fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, band_rows: u32) -> Self {
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

/// Whether a plan needs the sample buffer at all.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

impl Schedule {
    /// The commands for a picture of `plan`.
    pub fn picture(plan: &DrawPlan<'_>, device: &DeviceTraits) -> Self {
        Self::new(plan, device, true)
    }

    /// The commands for the visibility buffer of `plan` alone.
    pub fn samples(plan: &DrawPlan<'_>, device: &DeviceTraits) -> Self {
        Self::new(plan, device, false)
    }

    fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, picture: bool) -> Self {
        let row_bytes = u64::from(plan.width_px) * pixel_bytes(plan);
        let band_bytes = BAND_BYTES.min(device.binding_bytes_max);
        let band_rows = (band_bytes / row_bytes.max(1)).clamp(1, u64::from(plan.height_px.max(1))) as u32;
        let tiles = Tiles::new(plan, device, band_rows);
        let mut schedule = Self { steps: Vec::new(), batches: Vec::new(), band_rows, work_items: 0, tiles };
        schedule.transform(plan, device);
        for row_first in (0..plan.height_px).step_by(band_rows as usize) {
            let rows = [row_first, plan.height_px.min(row_first + band_rows)];
            schedule.steps.push(Step::ClearBand);
            if has_visibility(plan) {
                schedule.visibility(plan, device, rows);
            }
            if picture {
                schedule.picture_stages(plan, device, rows);
            }
            schedule.steps.push(Step::EndBand { row_first, row_end: rows[1] });
        }
        schedule
    }

    fn transform(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits) {
        let count = plan.positions.len() as u32;
        if plan.surface.is_some() || !plan.lines.is_empty() {
            self.dispatch(device, Stage::Transform, count, Batch { count, ..Batch::default() });
        }
        if plan.hull.is_some() {
            self.dispatch(device, Stage::Transform, count, Batch { count, vertex_base: count, ..Batch::default() });
        }
    }

    fn visibility(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, rows: [u32; 2]) {
        let clip = plan.projection.clip;
        let writes: &[Write] = if device.int64_atomics { &[Write::Both] } else { &[Write::Depth, Write::Id] };
        let (count, vertices) = (plan.triangles.len() as u32, plan.positions.len() as u32);
        let surface = plan.surface.as_ref().map(|s| (0, 0, s.faces));
        let hull = plan.hull.as_ref().map(|_| (count, vertices, Faces::Back));
        let (chunk, pieces) = if clip { (CHUNK_CLIP, PIECES_MAX) } else { (CHUNK, 1) };
        // Every depth must be known before the first id is compared with it.
        for &write in writes {
            for (id_base, vertex_base, faces) in [surface, hull].into_iter().flatten() {
                for first in (0..count).step_by(chunk as usize) {
                    let in_chunk = chunk.min(count - first);
                    let capacity = in_chunk * pieces;
                    self.work_items = self.work_items.max(capacity);
                    let batch = Batch {
                        first,
                        count: in_chunk,
                        id_base,
                        vertex_base,
                        faces: faces_code(faces),
                        row_first: rows[0],
                        row_end: rows[1],
                        capacity,
                        large_end: u32::MAX,
                        huge_end: u32::MAX,
                        ..Batch::default()
                    };
                    self.steps.push(Step::ClearWork);
                    self.dispatch(device, Stage::Visibility { write }, in_chunk, batch);
                    if clip {
                        self.dispatch(device, Stage::Clip, in_chunk, batch);
                    }
                    let stage = Stage::VisibilityTile { write };
                    self.steps.push(Step::Tiles { stage, batch: self.batches.len() - 1 });
                    if count > chunk {
                        self.steps.push(Step::Submit);
                    }
                }
            }
        }
    }

    /// What follows visibility, for a band.
    fn picture_stages(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, rows: [u32; 2]) {
        let count = plan.width_px * (rows[1] - rows[0]);
        let pixels = Batch { count, row_first: rows[0], row_end: rows[1], ..Batch::default() };
        if plan.is_shaded() {
            self.dispatch(device, Stage::Shade, count, pixels);
        }
        let mut edges_first = 0;
        for (pass, lines) in (0..).zip(&plan.lines) {
            let lined = Batch {
                edges_per_group: edges_per_group(plan, lines, device),
                line_width: lines.width_px,
                line_smoothing: lines.smoothing_px,
                line_flags: line_flags(lines, has_visibility(plan), plan.lights_lines()),
                ink_at: pass * count,
                owners_at: plan.lines.len() as u32 * count,
                ..pixels
            };
            let edges_per_group = lined.edges_per_group;
            let edges = lines.edges.len() as u32;
            for first in (0..edges).step_by(EDGE_CHUNK as usize) {
                let count = EDGE_CHUNK.min(edges - first);
                let batch = Batch { first: edges_first + first, count, ..lined };
                self.dispatch_groups(device, Stage::Lines, count.div_ceil(edges_per_group), batch);
                if edges > EDGE_CHUNK {
                    self.steps.push(Step::Submit);
                }
            }
            edges_first += edges;
        }
        if plan.lights_lines() {
            self.dispatch(device, Stage::Lit, count, pixels);
        }
        self.dispatch(device, Stage::Resolve, count, pixels);
    }

    fn dispatch(&mut self, device: &DeviceTraits, stage: Stage, threads: u32, batch: Batch) {
        self.dispatch_groups(device, stage, threads.div_ceil(WORKGROUP), batch);
    }

    fn dispatch_groups(&mut self, device: &DeviceTraits, stage: Stage, workgroups: u32, batch: Batch) {
        if workgroups > 0 {
            let x = workgroups.min(device.workgroups_max);
            self.steps.push(Step::Dispatch {
                stage,
                batch: self.batches.len(),
                workgroups: [x, workgroups.div_ceil(x)],
            });
            self.batches.push(batch);
        }
    }
}

/// Edges that a workgroup draws: all its threads draw the long ones together, each one's share of which is bounded.
fn edges_per_group(plan: &DrawPlan<'_>, lines: &LinePass, device: &DeviceTraits) -> u32 {
    if !device.loops_are_limited {
        return WORKGROUP;
    }
    let reach = f64::from(0.5 * lines.width_px + 0.5 * lines.smoothing_px + 1.0);
    let side = f64::from(plan.width_px.max(plan.height_px));
    // In every eighth row, every eighth column of what is in reach, and the samples of each pixel.
    let pixels = (side + 2.0 * reach) / 8.0 * (2.0 * reach / 8.0 + 2.0) + side / 8.0;
    let iterations = pixels * f64::from(plan.samples + 2);
    (ITERATIONS_MAX as f64 / iterations).clamp(1.0, f64::from(WORKGROUP)) as u32
}

/// Bytes a pixel of the largest buffer that holds a band.
fn pixel_bytes(plan: &DrawPlan<'_>) -> u64 {
    (u64::from(plan.samples) * 8).max(color_bytes(plan)).max(ink_bytes(plan))
}

/// Bytes a pixel of colours: the surface's, and the light on lines where they are lit.
pub fn color_bytes(plan: &DrawPlan<'_>) -> u64 {
    if plan.lights_lines() { 32 } else { 16 }
}

/// Bytes a pixel of ink: of each line pass, and whose light falls on lines where they are lit.
pub fn ink_bytes(plan: &DrawPlan<'_>) -> u64 {
    4 * (plan.lines.len() as u64 + u64::from(plan.lights_lines()))
}

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
