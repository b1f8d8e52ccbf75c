//! The time that each stage of a picture takes on the GPU, measured by the GPU's own clock (timestamp queries).
//!
//! Only jobs that find the device idle are timed: to take the time between two stages takes time itself, for which
//! other jobs would wait (docs/gpu-notes.md).

use std::time::Duration;

use super::buffers::Buffers;
use super::device::Gpu;
use crate::backend::{DrawStage, DrawTimes};

/// Passes of one job that are timed. A job of more passes has no times.
const PASSES_MAX: usize = 128;

/// Bytes of a time.
const TIME_BYTES: usize = size_of::<u64>();

/// The times at which passes begin and end.
pub struct StageClock {
    queries: wgpu::QuerySet,
    times: wgpu::Buffer,
    step_ns: f32,
    /// By pass.
    stages: Vec<DrawStage>,
    /// True if some passes were not timed.
    is_full: bool,
}

impl StageClock {
    /// Bytes of all times.
    pub const BYTES: u64 = (2 * PASSES_MAX * TIME_BYTES) as u64;

    /// A clock for one job; None if the device has none.
    pub fn new(gpu: &Gpu, buffers: &mut Buffers) -> Option<Self> {
        let step_ns = gpu.clock_step_ns?;
        let (queries, times) = buffers.queries(&gpu.handles, 2 * PASSES_MAX as u32, Self::BYTES);
        Some(Self { queries, times, step_ns, stages: Vec::new(), is_full: false })
    }

    /// The places for the times of a pass of this stage, if there is room.
    pub fn begin(&mut self, stage: DrawStage) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let first = 2 * self.stages.len() as u32;
        self.is_full |= self.stages.len() == PASSES_MAX;
        if self.is_full {
            return None;
        }
        self.stages.push(stage);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Copies the times so far to a place in a buffer.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder, to: &wgpu::Buffer, offset: u64) {
        let count = 2 * self.stages.len();
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count as u32, &self.times, 0);
            encoder.copy_buffer_to_buffer(&self.times, 0, to, offset, Some((count * TIME_BYTES) as u64));
        }
    }

    /// The durations of the stages, given the copied bytes.
    pub fn times(&self, bytes: &[u8]) -> DrawTimes {
        let mut times = DrawTimes::default();
        if self.is_full {
            return times;
        }
        let (steps, _) = bytes.as_chunks::<TIME_BYTES>();
        for (stage, pass) in self.stages.iter().zip(steps.chunks_exact(2)) {
            let [begin, end] = [pass[0], pass[1]].map(u64::from_le_bytes);
            let nanoseconds = end.saturating_sub(begin) as f64 * f64::from(self.step_ns);
            // A clock that jumps must not make a time that nothing could have taken.
            times.add(*stage, Duration::from_nanos(nanoseconds as u64).min(Duration::from_hours(1)));
        }
        times
    }
}
