//! The two back-ends that draw the picture of a [`DrawPlan`], which says in slices and numbers what to draw: [`cpu`],
//! our own rasterizer, and [`gpu`], which uses wgpu. Both have the same stages in the same order:
//! transform -> visibility -> occlusion -> peeling -> shade -> mixed -> lines -> resolve.
//!
//! - transform moves vertices to the screen, visibility finds the nearest triangle of each sample (both in
//!   `geometry`). A sample is one of the 1 to 16 places in a pixel at which the picture is computed.
//! - occlusion finds how much less light hollows get (screen-space ambient occlusion).
//! - peeling finds the transparent layers at each sample, from front to back (depth peeling).
//! - shade computes colours (in `surface`).
//! - mixed draws mixed pixels, such as those in which faces of different colours meet, once more from many points
//!   each, if samples are adaptive.
//! - lines draws edges over the colours.
//! - resolve lays the colours over the background and makes bytes of them.
//!
//! A plan that has no use for a stage leaves it out.
//!
//! Each stage is written twice, in twins, mostly of the same name: `shaders/FOLDER/NAME.wgsl` and
//! `src/render/backend/cpu/FOLDER/NAME.rs`. The module's tests compare the constants and structs that the two
//! share. `select` chooses the back-end of a job, by `costs` while the GPU is busy. `host` owns the process's
//! GPU, and [`probe`] checks a GPU before it is used.
//!
//! **Invariant:** nothing here imports a mesh or a scene, and the two back-ends do not import each other.

mod costs;
pub mod cpu;
mod device;
mod draw_times;
#[cfg(feature = "gpu")]
pub mod gpu;
mod host;
mod linear;
pub mod probe;
mod recovery;
pub(crate) mod sample_partition;
mod select;

pub use costs::CostModel;
pub use device::{GpuDevice, GpuInfo, GpuKind, GpuState, GpuStatus, HardwareHint, Opener};
pub use draw_times::{DrawStage, DrawTimes};
pub use host::GpuHost;
pub use select::{Backends, Chosen};

use crate::image::{Image, LinearImage, RowSink};
use crate::limits::{Deadline, Stopped};
use crate::plan::DrawPlan;

/// Draws plans. A worker owns one; it keeps its buffers from job to job.
pub trait Renderer {
    /// Fills the plan's picture.
    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError>;

    /// As [`Renderer::draw`], and gives rows to `sink` as soon as they and those above them are done: all rows, or
    /// none where the back-end finishes a picture at once.
    fn draw_rows(
        &mut self,
        plan: &DrawPlan<'_>,
        sink: &mut dyn RowSink,
        deadline: &Deadline,
    ) -> Result<Image, DrawError> {
        let _ = sink;
        self.draw(plan, deadline)
    }

    /// The same picture in linear light.
    fn draw_linear(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<LinearImage, DrawError>;

    /// Fills the visibility buffer alone.
    ///
    /// One word a sample at `(y * width + x) * samples + s`: depth bits in the upper half, the
    /// complement of the triangle id in the lower (so that of equal depths the lowest id wins), 0
    /// where there is nothing.
    fn draw_visibility(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Vec<u64>, DrawError>;

    /// The durations of the last picture's stages, as far as this back-end times them.
    fn draw_times(&self) -> DrawTimes {
        DrawTimes::default()
    }

    /// `cpu` or `gpu`.
    fn kind(&self) -> BackendKind;
}

/// A back-end, as reports name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BackendKind {
    /// Our own rasterizer.
    Cpu,
    /// wgpu.
    Gpu,
}

impl BackendKind {
    /// The word used in headers and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
        }
    }
}

/// Errors of drawing a plan. Never the client's fault, except for an exceeded deadline.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrawError {
    /// The deadline has passed.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// There is no GPU here to draw on.
    #[error("there is no GPU to draw on: {0}")]
    NoGpu(String),
    /// The device is lost; a new one may work.
    #[error("the GPU was lost: {0}")]
    DeviceLost(String),
    /// The plan is beyond the device's limits; trying again is of no use.
    #[error("the GPU cannot draw this: {0}")]
    BeyondGpu(String),
    /// The device refused the work, perhaps for lack of memory.
    #[error("the GPU cannot draw this: {0}")]
    Device(String),
}

// These tests compare constants, structs and bindings with the shaders.
#[cfg(test)]
#[cfg(feature = "gpu")]
mod tests;
