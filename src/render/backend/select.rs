//! The choice of the back-end that draws a job, and the second attempts when a GPU fails. If the device was lost, the
//! job is drawn once more on a new one. What the GPU could not draw is drawn by the CPU if the choice was `auto`.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use super::costs::PlanSize;
use super::device::{GpuDevice, GpuKind, drop_catching_panics};
#[cfg(feature = "gpu")]
use super::gpu;
use super::host::GpuHost;
use super::{BackendKind, DrawError, DrawStage, DrawTimes, Renderer, cpu};
use crate::image::{Image, RowSink};
use crate::limits::Deadline;
use crate::plan::DrawPlan;
use crate::spec::BackendChoice;

/// A worker's renderers. Stays on its thread.
pub struct Backends {
    cpu: cpu::CpuRenderer,
    host: Arc<GpuHost>,
    /// Made with the first picture that the GPU draws here, and the device it is on.
    gpu: Option<(Box<dyn Renderer>, Arc<dyn GpuDevice>)>,
}

/// A picture and the back-end that drew it.
#[derive(Debug)]
pub struct Chosen<I = Image> {
    /// The picture.
    pub image: I,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// The durations of its stages, as far as the back-end times them.
    pub draw_times: DrawTimes,
    /// True if the CPU drew it because a GPU that was chosen could not.
    pub is_substitute: bool,
}

/// Draws on a back-end.
type Draw<'a, I> = &'a mut dyn FnMut(&mut dyn Renderer) -> Result<I, DrawError>;

impl Backends {
    /// Renderers for one worker. The CPU path uses up to `threads` threads; no GPU is touched yet.
    pub fn new(host: Arc<GpuHost>, threads: usize) -> Self {
        Self::sharing(host, Arc::new(cpu::DrawingThreads::new(threads)))
    }

    /// Renderers for one of several workers, whose CPU renderers share threads.
    pub fn sharing(host: Arc<GpuHost>, threads: Arc<cpu::DrawingThreads>) -> Self {
        Self { cpu: cpu::CpuRenderer::on(threads), host, gpu: None }
    }

    /// True if `auto` may choose a GPU here now. Opens none, so there may turn out to be none.
    pub fn has_gpu(&self) -> bool {
        self.host.is_eligible()
    }

    /// The renderer on the CPU.
    pub fn on_cpu(&mut self) -> &mut cpu::CpuRenderer {
        &mut self.cpu
    }

    /// Draws the plan on the back-end that `choice` means here and now. Gives rows to `sink` as
    /// [`Renderer::draw_rows`] does.
    pub fn draw(
        &mut self,
        choice: BackendChoice,
        plan: &DrawPlan<'_>,
        mut sink: Option<&mut dyn RowSink>,
        deadline: &Deadline,
    ) -> Result<Chosen, DrawError> {
        self.draw_by(choice, plan, &mut |renderer| match sink.as_deref_mut() {
            Some(sink) => renderer.draw_rows(plan, sink, deadline),
            None => renderer.draw(plan, deadline),
        })
    }

    /// Has the back-end that `choice` means here and now draw the plan: calls `draw` with it, and again with another where
    /// that fails.
    pub fn draw_by<I>(
        &mut self,
        choice: BackendChoice,
        plan: &DrawPlan<'_>,
        draw: Draw<'_, I>,
    ) -> Result<Chosen<I>, DrawError> {
        match choice {
            BackendChoice::Cpu => self.draw_on_cpu(plan, draw),
            BackendChoice::Gpu => self.draw_on_gpu(GpuKind::Any, plan, draw),
            BackendChoice::Auto if self.has_gpu() && self.host.costs().prefers_cpu(PlanSize::of(plan)) => {
                self.draw_on_cpu(plan, draw)
            }
            BackendChoice::Auto => match self.draw_on_gpu(GpuKind::Hardware, plan, draw) {
                Ok(chosen) => Ok(chosen),
                Err(DrawError::Stopped(stopped)) => Err(stopped.into()),
                Err(error) => {
                    // Without a GPU the CPU is no substitute for one. The host has logged the reason.
                    let is_substitute = !matches!(error, DrawError::NoGpu(_));
                    if is_substitute {
                        tracing::warn!(%error, "the CPU draws this job");
                    }
                    Ok(Chosen { is_substitute, ..self.draw_on_cpu(plan, draw)? })
                }
            },
        }
    }

    /// Memory that drawing the plan takes beside what grows with its mesh, bytes. What a real GPU
    /// holds is its own.
    pub fn bands_bytes(&self, choice: BackendChoice, plan: &DrawPlan<'_>) -> u64 {
        match choice {
            BackendChoice::Cpu | BackendChoice::Auto => self.cpu.bands_bytes(plan),
            #[cfg(feature = "gpu")]
            BackendChoice::Gpu => gpu::bands_bytes(plan),
            // Nothing is drawn then.
            #[cfg(not(feature = "gpu"))]
            BackendChoice::Gpu => 0,
        }
    }

    fn draw_on_cpu<I>(&mut self, plan: &DrawPlan<'_>, draw: Draw<'_, I>) -> Result<Chosen<I>, DrawError> {
        let draw = || {
            let image = draw(&mut self.cpu)?;
            let draw_times = self.cpu.draw_times();
            Ok::<_, DrawError>(((image, draw_times), draw_times.of(DrawStage::EncodeRows)))
        };
        let (image, draw_times) = self.host.costs().timed(BackendKind::Cpu, PlanSize::of(plan), draw)?;
        Ok(Chosen { image, backend: self.cpu.kind(), draw_times, is_substitute: false })
    }

    /// Draws on the GPU; where that is lost, once more on a fresh one.
    fn draw_on_gpu<I>(
        &mut self,
        kind: GpuKind,
        plan: &DrawPlan<'_>,
        draw: Draw<'_, I>,
    ) -> Result<Chosen<I>, DrawError> {
        let (image, draw_times) = match self.try_gpu(kind, plan, draw, Attempt::First) {
            Err(DrawError::DeviceLost(_)) => self.try_gpu(kind, plan, draw, Attempt::Second)?,
            result => {
                let drawn = result?;
                self.host.count_success();
                drawn
            }
        };
        Ok(Chosen { image, backend: BackendKind::Gpu, draw_times, is_substitute: false })
    }

    fn try_gpu<I>(
        &mut self,
        kind: GpuKind,
        plan: &DrawPlan<'_>,
        draw: Draw<'_, I>,
        attempt: Attempt,
    ) -> Result<(I, DrawTimes), DrawError> {
        if self.gpu.as_ref().is_some_and(|(_, device)| device.lost().is_some()) {
            // The old renderer would keep a lost device alive.
            drop_catching_panics(self.gpu.take());
        }
        let found = self.find_device(kind, plan);
        if let (Err(DrawError::DeviceLost(reason)), Attempt::First) = (&found, attempt) {
            self.host.count_loss(reason);
        }
        if let Err(DrawError::NoGpu(_)) = &found {
            // The device failed a probe: the old renderer would keep it alive.
            drop_catching_panics(self.gpu.take());
        }
        let device = found?;
        let host = self.host.clone();
        let draw = || Ok((self.draw_on(&device, draw)?, Duration::ZERO));
        let result = host.costs().timed(BackendKind::Gpu, PlanSize::of(plan), draw);
        if let Err(DrawError::DeviceLost(reason)) = &result {
            // Workers that share a device lose it together, which counts as one loss.
            if self.host.note_lost(&device, reason) && attempt == Attempt::First {
                self.host.count_loss(reason);
            }
        }
        result
    }

    /// The host's device. If it is being opened, the plan's pipelines are made while it draws its probe. Their
    /// end is waited for even if the probe fails: a compiling driver cannot be stopped.
    fn find_device(&self, kind: GpuKind, plan: &DrawPlan<'_>) -> Result<Arc<dyn GpuDevice>, DrawError> {
        thread::scope(|scope| {
            let making = RefCell::new(Vec::new());
            let found = self.host.device(kind, plan.samples, &|device| {
                let device = device.clone();
                // If this fails, drawing makes them again, and reports the error.
                let make_ready = move || {
                    let _ = catch_unwind(AssertUnwindSafe(|| device.make_ready(plan)));
                    drop_catching_panics(device);
                };
                making
                    .borrow_mut()
                    .extend(thread::Builder::new().name("make-ready".into()).spawn_scoped(scope, make_ready));
            });
            // Their panics are caught. A scope by itself does not wait for the very end of a thread, and drivers need that: see
            // `DrawingThreads`.
            for thread in making.take() {
                let _ = thread.join();
            }
            found
        })
    }

    fn draw_on<I>(&mut self, device: &Arc<dyn GpuDevice>, draw: Draw<'_, I>) -> Result<(I, DrawTimes), DrawError> {
        let (mut renderer, device) = match self.gpu.take() {
            Some((renderer, own)) if Arc::ptr_eq(&own, device) => (renderer, own),
            old => {
                drop_catching_panics(old);
                (device.clone().renderer(), device.clone())
            }
        };
        // wgpu may panic on a lost device.
        let drawn = catch_unwind(AssertUnwindSafe(|| Ok((draw(&mut *renderer)?, renderer.draw_times()))));
        let result = match (drawn, device.lost()) {
            (Ok(result), _) => result,
            (Err(_), Some(reason)) => Err(DrawError::DeviceLost(reason.to_owned())),
            (Err(panic), None) => {
                drop_catching_panics(renderer);
                resume_unwind(panic);
            }
        };
        match result {
            Err(DrawError::DeviceLost(_)) => drop_catching_panics(renderer),
            _ => self.gpu = Some((renderer, device)),
        }
        result
    }
}

/// A job draws on the GPU at most twice, and counts as lost at most once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Attempt {
    First,
    Second,
}
