//! What is dispatched for a plan, in order: pure arithmetic, no device.
//!
//! The picture is cut into horizontal bands whose sample buffer stays small, triangles into chunks whose work list does.
//! After each chunk of a large mesh, and each band, the commands go to the device, so that no single submission takes
//! long and the deadline is looked at in between.

use super::params::{Batch, faces_code};
use super::stages::{Stage, Write};
use crate::plan::{DrawPlan, Faces};

/// Largest buffer that depends on the picture's size, bytes.
const BAND_BYTES: u64 = 64 << 20;

/// Triangles a dispatch, where none needs clipping; each may leave one item in the work list.
const CHUNK: u32 = 1 << 20;

/// Triangles a dispatch where all may need clipping, into at most six pieces each.
const CHUNK_CLIP: u32 = 1 << 18;
const PIECES_MAX: u32 = 6;

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
}

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
}

/// Whether a plan needs the sample buffer at all.
pub fn has_visibility(plan: &DrawPlan<'_>) -> bool {
    plan.surface.is_some() || plan.hull.is_some()
}

impl Schedule {
    /// The commands for `plan`.
    pub fn new(plan: &DrawPlan<'_>, device: &DeviceTraits) -> Self {
        let row_bytes = u64::from(plan.width_px) * pixel_bytes(plan);
        let band_bytes = BAND_BYTES.min(device.binding_bytes_max);
        let band_rows = (band_bytes / row_bytes.max(1)).clamp(1, u64::from(plan.height_px.max(1))) as u32;
        let mut schedule = Self { steps: Vec::new(), batches: Vec::new(), band_rows, work_items: 0 };
        schedule.transform(plan, device);
        for row_first in (0..plan.height_px).step_by(band_rows as usize) {
            let rows = [row_first, plan.height_px.min(row_first + band_rows)];
            schedule.steps.push(Step::ClearBand);
            schedule.visibility(plan, device, rows);
            schedule.steps.push(Step::EndBand { row_first, row_end: rows[1] });
        }
        schedule
    }

    fn transform(&mut self, plan: &DrawPlan<'_>, device: &DeviceTraits) {
        let count = plan.positions.len() as u32;
        if plan.surface.is_some() || plan.lines.is_some() {
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
                    };
                    self.steps.push(Step::ClearWork);
                    self.dispatch(device, Stage::Visibility { clip, write }, in_chunk, batch);
                    let workgroups = [device.tile_workgroups.min(device.workgroups_max), 1];
                    let stage = Stage::VisibilityTile { clip, write };
                    self.steps.push(Step::Dispatch { stage, batch: self.batches.len() - 1, workgroups });
                    if count > chunk {
                        self.steps.push(Step::Submit);
                    }
                }
            }
        }
    }

    fn dispatch(&mut self, device: &DeviceTraits, stage: Stage, threads: u32, batch: Batch) {
        let workgroups = threads.div_ceil(64);
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
    (u64::from(plan.samples) * 8).max(16)
}
