//! What is dispatched for a plan, in order: pure arithmetic, no device.
//!
//! The picture is cut into horizontal bands whose sample buffer stays small, triangles into chunks whose work list does.
//! After each chunk of a large mesh, and each band, the commands go to the device, so that no single submission takes
//! long and the deadline is looked at in between.

use super::params::{Batch, faces_code, line_flags};
use super::passes::Pass;
use super::stages::{Into, Stage, Write};
use super::tiles::{Tiles, edges_per_group};
use crate::plan::{DrawPlan, roles};

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

/// Bytes of what layers make of a sample.
pub const LAYERED_BYTES: u64 = 32;

/// Edges a dispatch.
const EDGE_CHUNK: u32 = 1 << 20;

/// Threads of a workgroup, in every kernel.
pub const WORKGROUP: u32 = 64;

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

/// One command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Fills a band's samples (and ink) with zeros.
    ClearBand,
    /// Empties the work list.
    ClearWork,
    /// Empties the layer that is looked for.
    ClearLayer,
    /// Where the device must be waited for anyway, asks whether there is another layer behind this one, and if not, goes on
    /// at step `end`.
    EndLayer {
        /// Which.
        layer: u32,
        /// Index of the step after the last layer.
        end: usize,
    },
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

/// What is wanted of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// The picture.
    Picture,
    /// The visibility buffer alone.
    Samples,
    /// One layer alone.
    Layer(u32),
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
    /// Layers that are looked for in each band.
    pub layers: u32,
    /// How the tile kernel is run.
    pub tiles: Tiles,
}

/// Whether a plan needs the sample buffer at all.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

impl Schedule {
    /// The commands for what is wanted of `plan`.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits, goal: Goal) -> Self {
        let row_bytes = u64::from(plan.width_px) * pixel_bytes(plan);
        let band_bytes = BAND_BYTES.min(device.binding_bytes_max);
        let band_rows = (band_bytes / row_bytes.max(1)).clamp(1, u64::from(plan.height_px.max(1))) as u32;
        let tiles = Tiles::new(plan, device, band_rows);
        let mut schedule = Self { steps: Vec::new(), batches: Vec::new(), band_rows, work_items: 0, layers: 0, tiles };
        schedule.transform(plan, device);
        for row_first in (0..plan.height_px).step_by(band_rows as usize) {
            let rows = [row_first, plan.height_px.min(row_first + band_rows)];
            schedule.steps.push(Step::ClearBand);
            if has_visibility(plan) {
                schedule.visibility(plan, device, rows);
                schedule.layers(plan, device, rows, goal);
            }
            if goal == Goal::Picture {
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
        self.triangles(plan, device, rows, (Into::Surface, 0), Pass::of_surface(plan));
    }

    /// One round a layer; a round does nothing where the one before has left nothing to find.
    fn layers(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits, rows: [u32; 2], goal: Goal) {
        let Some(pass) = plan.layers() else { return };
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
            self.triangles(plan, device, rows, (Into::Layer, layer), Pass::of_layers(plan));
            let batch = Batch { count, row_first: rows[0], row_end: rows[1], role, layer, ..Batch::default() };
            self.dispatch(device, Stage::Layers, count, batch);
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
    }

    fn triangles(
        &mut self,
        plan: &DrawPlan<'_>,
        device: &DeviceTraits,
        rows: [u32; 2],
        (into, layer): (Into, u32),
        passes: [Option<Pass>; 2],
    ) {
        let clip = plan.projection.clip;
        let writes: &[Write] = if device.int64_atomics { &[Write::Both] } else { &[Write::Depth, Write::Id] };
        let count = plan.triangles.len() as u32;
        let (chunk, pieces) = if clip { (CHUNK_CLIP, PIECES_MAX) } else { (CHUNK, 1) };
        // Every depth must be known before the first id is compared with it.
        for &write in writes {
            for Pass { id_base, vertex_base, faces, role } in passes.into_iter().flatten() {
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
                        role: u32::from(role),
                        layer,
                        ..Batch::default()
                    };
                    self.steps.push(Step::ClearWork);
                    self.dispatch(device, Stage::Visibility { write, into }, in_chunk, batch);
                    if clip {
                        self.dispatch(device, Stage::Clip, in_chunk, batch);
                    }
                    let stage = Stage::VisibilityTile { write, into };
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
                line_flags: line_flags(lines, has_visibility(plan)),
                ink_at: pass * count,
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

/// Bytes a pixel of the largest buffer that holds a band.
fn pixel_bytes(plan: &DrawPlan<'_>) -> u64 {
    let sample = if plan.layers().is_some() { LAYERED_BYTES } else { 8 };
    (u64::from(plan.samples) * sample).max(16).max(4 * plan.lines.len() as u64)
}
