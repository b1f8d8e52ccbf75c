//! What is dispatched for a plan, in order: pure arithmetic, no device.
//!
//! The picture is cut into horizontal bands whose sample buffer stays small, triangles into chunks whose work list does.
//! After each chunk of a large mesh, and each band, the commands go to the device, so that no single submission takes
//! long and the deadline is looked at in between.

use super::params::{Batch, edge_lists, faces_code, line_flags};
use super::passes::Pass;
use super::sizes::{DeviceTraits, band_rows, has_visibility, margin_rows};
use super::stages::{Into, Stage, Write};
use super::step::{Band, Goal, Step};
use super::tiles::{Tiles, edges_per_group, slices};
use crate::backend::DrawError;
use crate::plan::{DrawPlan, roles};

/// Triangles a dispatch, where none needs clipping; each may leave one item in the work list.
const CHUNK: u32 = 1 << 20;

/// Triangles a dispatch where all may need clipping, into at most six pieces each.
const CHUNK_CLIP: u32 = 1 << 17;
const PIECES_MAX: u32 = 6;

/// Edges a dispatch.
const EDGE_CHUNK: u32 = 1 << 20;

/// Different numbers that dispatches may have, each 256 bytes on the GPU: 128 MiB.
///
/// The most that a job within all other limits takes: of 4096 rows at 4 samples, 64 line passes make 66 bands of 63 rows. In
/// each, 10 million triangles that may need clipping are 77 chunks, for the surface and 16 layers, filled and hull, in two
/// phases: 17 * 77 * 2 * 2 = 5236. 64 passes of 30 million edges are 29 chunks each, 1856. That makes 0.47 million.
const BATCHES_MAX: usize = 1 << 19;

/// Threads of a workgroup, in every kernel.
pub const WORKGROUP: u32 = 64;

/// All commands for a plan.
#[derive(Debug)]
pub struct Schedule {
    pub steps: Vec<Step>,
    pub batches: Vec<Batch>,
    /// Rows of the largest band.
    pub band_rows: u32,
    /// Items that the work list must hold.
    pub work_items: u32,
    /// Layers that are looked for in each band.
    pub layers: u32,
    /// How the tile kernel is run.
    pub tiles: Tiles,
    /// Where each line pass's edges begin.
    edge_starts: Vec<u32>,
}

impl Schedule {
    /// The commands for what is wanted of `plan`.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, goal: Goal) -> Result<Self, DrawError> {
        let band_rows = band_rows(plan, device);
        let tiles = Tiles::new(plan, device, band_rows);
        let edge_starts = edge_lists(&plan.lines).1;
        let (steps, batches) = (Vec::new(), Vec::new());
        let mut schedule = Self { steps, batches, band_rows, work_items: 0, layers: 0, tiles, edge_starts };
        schedule.transform(plan, device)?;
        let margin = margin_rows(plan, band_rows, goal);
        for first in (0..plan.height_px).step_by((band_rows - 2 * margin) as usize) {
            let end = plan.height_px.min(first + band_rows - 2 * margin);
            let rows = [first.saturating_sub(margin), plan.height_px.min(end + margin)];
            schedule.steps.push(Step::ClearBand);
            if has_visibility(plan) {
                schedule.visibility(plan, device, rows)?;
                schedule.layers(plan, device, rows, goal)?;
            }
            if goal == Goal::Picture {
                schedule.picture_stages(plan, device, rows)?;
            }
            schedule.steps.push(Step::EndBand(Band { rows: [first, end], buffer_first: rows[0] }));
        }
        Ok(schedule)
    }

    fn transform(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits) -> Result<(), DrawError> {
        let count = plan.positions.len() as u32;
        if has_visibility(plan) || !plan.lines.is_empty() {
            self.dispatch(device, Stage::Transform, count, Batch { count, ..Batch::default() })?;
        }
        Ok(())
    }

    fn visibility(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, rows: [u32; 2]) -> Result<(), DrawError> {
        self.triangles(device, rows, (Into::Surface, 0), Pass::of_surface(plan))
    }

    /// One round a layer; a round does nothing where the one before has left nothing to find.
    fn layers(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        rows: [u32; 2],
        goal: Goal,
    ) -> Result<(), DrawError> {
        let Some(pass) = plan.layers() else { return Ok(()) };
        let rounds = match goal {
            Goal::Picture => pass.count_max,
            Goal::Samples => 0,
            Goal::Layer(layer) => layer + 1,
        };
        self.layers = rounds;
        let count = plan.width_px * (rows[1] - rows[0]);
        // A layer that is wanted for itself is not shaded: then no sample is done before its last triangle.
        let role = if goal == Goal::Picture { u32::from(roles::LAYER) } else { 0 };
        let mut ends = Vec::new();
        for layer in 0..rounds {
            self.steps.push(Step::ClearLayer);
            self.triangles(device, rows, (Into::Layer, layer), Pass::of_layers(plan))?;
            let batch = Batch { count, row_first: rows[0], row_end: rows[1], role, layer, ..Batch::default() };
            self.dispatch(device, Stage::Layers, count, batch)?;
            self.steps.push(Step::Submit);
            if self.tiles.in_rounds && goal == Goal::Picture {
                ends.push(self.steps.len());
                self.steps.push(Step::EndLayer { layer, end: 0 });
            }
        }
        let last = self.steps.len();
        for at in ends {
            if let Some(Step::EndLayer { end, .. }) = self.steps.get_mut(at) {
                *end = last;
            }
        }
        Ok(())
    }

    fn triangles(
        &mut self,
        device: &DeviceTraits,
        rows: [u32; 2],
        (into, layer): (Into, u32),
        passes: [Option<Pass>; 2],
    ) -> Result<(), DrawError> {
        let writes: &[Write] = if device.int64_atomics { &[Write::Both] } else { &[Write::Depth, Write::Id] };
        // Every depth must be known before the first id is compared with it.
        for &write in writes {
            for Pass { ids, clip, faces, role } in passes.iter().flatten().cloned() {
                let (chunk, pieces) = if clip { (CHUNK_CLIP, PIECES_MAX) } else { (CHUNK, 1) };
                for first in ids.clone().step_by(chunk as usize) {
                    let in_chunk = chunk.min(ids.end - first);
                    let capacity = in_chunk * pieces;
                    self.work_items = self.work_items.max(capacity);
                    let batch = Batch {
                        first,
                        count: in_chunk,
                        faces: faces_code(faces),
                        row_first: rows[0],
                        row_end: rows[1],
                        capacity,
                        large_end: u32::MAX,
                        huge_end: u32::MAX,
                        role: u32::from(role),
                        layer,
                        ..Batch::default()
                    };
                    self.steps.push(Step::ClearWork);
                    self.dispatch(device, Stage::Visibility { write, into }, in_chunk, batch)?;
                    if clip {
                        self.dispatch(device, Stage::Clip, in_chunk, batch)?;
                    }
                    let stage = Stage::VisibilityTile { write, into };
                    self.steps.push(Step::Tiles { stage, batch: self.batches.len() - 1 });
                    if ids.len() > chunk as usize {
                        self.steps.push(Step::Submit);
                    }
                }
            }
        }
        Ok(())
    }

    /// What follows visibility, for a band.
    fn picture_stages(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, rows: [u32; 2]) -> Result<(), DrawError> {
        let count = plan.width_px * (rows[1] - rows[0]);
        let pixels = Batch { count, row_first: rows[0], row_end: rows[1], ..Batch::default() };
        if plan.is_shaded() {
            self.dispatch(device, Stage::Shade, count, pixels)?;
        }
        for (pass, (lines, edges_first)) in (0..).zip(plan.lines.iter().zip(self.edge_starts.clone())) {
            let lined = Batch {
                line_exponent: lines.square_exponent(),
                line_windows: 1.0 / lines.window_px(),
                line_slices: slices(lines, device),
                line_peak: lines.peak(),
                line_width: lines.width_px,
                line_smoothing: lines.smoothing_px,
                line_flags: line_flags(lines, has_visibility(plan), plan.lights_lines()),
                ink_at: pass * count,
                owners_at: plan.lines.len() as u32 * count,
                ..pixels
            };
            let edges = lines.edges.len() as u32;
            for first in (0..edges).step_by(EDGE_CHUNK as usize) {
                let count = EDGE_CHUNK.min(edges - first);
                let batch = Batch { first: edges_first.saturating_add(first), count, ..lined };
                for (flag, edges_per_group, turns) in edges_per_group(plan, lines, device) {
                    for line_turn in 0..turns {
                        let line_flags = batch.line_flags | flag;
                        let batch = Batch { line_flags, edges_per_group, line_turns: turns, line_turn, ..batch };
                        self.dispatch_groups(device, Stage::Lines, count.div_ceil(edges_per_group), batch)?;
                    }
                }
                if edges > EDGE_CHUNK {
                    self.steps.push(Step::Submit);
                }
            }
            self.dispatch(
                device,
                Stage::Ink,
                count,
                Batch { ink_at: lined.ink_at, line_peak: lined.line_peak, ..pixels },
            )?;
        }
        if plan.lights_lines() {
            self.dispatch(device, Stage::LineLight, count, pixels)?;
        }
        self.dispatch(device, Stage::Resolve, count, pixels)
    }

    fn dispatch(&mut self, device: &DeviceTraits, stage: Stage, threads: u32, batch: Batch) -> Result<(), DrawError> {
        self.dispatch_groups(device, stage, threads.div_ceil(WORKGROUP), batch)
    }

    fn dispatch_groups(
        &mut self,
        device: &DeviceTraits,
        stage: Stage,
        workgroups: u32,
        batch: Batch,
    ) -> Result<(), DrawError> {
        if workgroups == 0 {
            return Ok(());
        }
        // Neighbours may share theirs: triangles are drawn and clipped by the same numbers.
        if self.batches.last() != Some(&batch) {
            if self.batches.len() == BATCHES_MAX {
                return Err(DrawError::Device(format!("it takes more than {BATCHES_MAX} dispatches")));
            }
            self.batches.push(batch);
        }
        let x = workgroups.min(device.workgroups_max);
        let batch = self.batches.len() - 1;
        self.steps.push(Step::Dispatch { stage, batch, workgroups: [x, workgroups.div_ceil(x)] });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::plan::{Edge, Faces, LayersPass, LinePass, Projection, Shown, SurfacePass};

    const DEVICE: DeviceTraits = DeviceTraits {
        binding_bytes_max: 128 << 20,
        workgroups_max: 65_535,
        tile_workgroups: 64,
        int64_atomics: false,
        loops_are_limited: true,
    };

    /// The largest picture of that many triangles, all clipped, under `lines` passes of one list of edges.
    fn schedule(triangles: &[[u32; 3]], lines: usize) -> Result<Schedule, DrawError> {
        let row = [0.0; 4];
        let [x, y, z, w] = [row; 4];
        let axes = [[0.0; 3]; 3];
        let [to_viewer, screen_up, screen_right] = axes;
        let clip = Projection { x, y, z, w, near_w: 0.1, clip: true, to_viewer, screen_up, screen_right };
        let mut plan = DrawPlan::new([4096, 4096], &[[0.0; 3]], triangles, clip);
        plan.samples = 4;
        plan.surface = Some(SurfacePass::new(Faces::Both, Vec::new()));
        plan.roles = vec![roles::SURFACE | roles::LAYER; triangles.len()].into();
        plan.layers = Some(LayersPass { count_max: 16, behind_surface: false, wires_only: false, fade: 1.0 });
        let line = LinePass {
            edges: Arc::new([Edge { vertices: [0; 2], faces: [Edge::NO_FACE; 2] }; 3]),
            width_px: 1.0,
            smoothing_px: 1.0,
            color: [1.0; 4],
            shown: Shown::All,
            skip_back_edges: false,
            contour: false,
            lit: false,
        };
        plan.lines = vec![line; lines];
        Schedule::new(&plan, &DEVICE, Goal::Picture)
    }

    #[test]
    fn the_largest_job_is_scheduled_and_what_goes_beyond_is_refused() {
        let triangles = vec![[0; 3]; 10_000_000];
        let all = schedule(&triangles, 64).unwrap();
        assert!(all.batches.len() > BATCHES_MAX / 4, "{}: the limit is far too high", all.batches.len());
        assert!(all.steps.len() < 8 * BATCHES_MAX);
        // As many passes mean as many bands.
        let few = &triangles[..1];
        assert!(schedule(few, 256).is_ok());
        let refused = schedule(few, 4096).unwrap_err();
        assert!(matches!(&refused, DrawError::Device(reason) if reason.contains("dispatches")), "{refused}");
    }
}
