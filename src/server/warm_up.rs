//! The warm-up of a hardware GPU: right after the start, unless the CPU is the default back-end, a thread opens it
//! and makes the pipelines (compiled shaders) of every style of picture, so that the first pictures need not wait for
//! that. It covers plain meshes: textures, colours, several materials and other numbers of samples need more
//! pipelines.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use meshsnap_render::backend::{Backends, DrawError, GpuDevice, GpuHost, GpuKind};
use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::{self, Context, Model};
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::request::{self, Rules, Style};
use meshsnap_render::spec::words::Words as _;
use meshsnap_render::spec::{BackendChoice, Samples, Spec};

/// One triangle. The looks of a plain mesh of few triangles need no other pipelines; textures, colours, several
/// materials and samples that a request gives do.
const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Samples per pixel of pictures that leave them open: of large ones, and of small ones.
const SAMPLES: [u32; 2] = [4, 16];

/// Triangles of a mesh that the kernels for many triangles draw.
const MANY: usize = 5000;

/// A thread that warms a GPU up.
pub struct WarmUp {
    deadline: Arc<Deadline>,
    thread: Option<thread::JoinHandle<()>>,
}

impl WarmUp {
    /// Starts the thread, unless there is no hardware to warm up, or no request of this default back-end
    /// would use it. A software GPU is not warmed up: it would take the cores from the requests.
    pub fn start(gpu: &Arc<GpuHost>, backend: BackendChoice) -> Self {
        let deadline = Arc::new(Deadline::default());
        let mut warm_up = Self { deadline: Arc::clone(&deadline), thread: None };
        if backend != BackendChoice::Cpu && gpu.may_have_hardware() {
            let gpu = Arc::clone(gpu);
            match thread::Builder::new().name("warm-up".into()).spawn(move || warm(gpu, &deadline)) {
                Ok(thread) => warm_up.thread = Some(thread),
                Err(error) => tracing::warn!(%error, "the GPU is not warmed up"),
            }
        }
        warm_up
    }

    /// Begins no further style from now on.
    pub fn stop(&self) {
        self.deadline.stop();
    }

    /// Waits until the thread has ended, no longer than `time_max`: a driver may crash if the process ends
    /// while a thread uses its device, and it may also hang. True if it has ended.
    pub fn wait(self, time_max: Duration) -> bool {
        let began = Instant::now();
        let Some(thread) = self.thread else { return true };
        while !thread.is_finished() && began.elapsed() < time_max {
            thread::sleep(Duration::from_millis(2));
        }
        let has_ended = thread.is_finished();
        if has_ended {
            // Its panic, if there was one, is in the log. What is left of it is a call of the driver, which is short.
            let _ = thread.join();
        }
        has_ended
    }
}

fn warm(gpu: Arc<GpuHost>, deadline: &Deadline) {
    let began = Instant::now();
    let limits = Limits::default();
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
    let read =
        |obj: String| Model::read(&Bundle::of_one(obj.into_bytes()), None, &limits, Budget::new(&limits), deadline);
    let (model, large) = match (read(MESH.to_owned()), read([MESH, &"f 1 2 3\n".repeat(MANY)].concat())) {
        (Ok(model), Ok(large)) => (model, large),
        (Err(error), _) | (_, Err(error)) => return tracing::debug!(%error, "the GPU is not warmed up"),
    };
    let mut backends = Backends::new(gpu.clone(), 1);
    let specs = specs(&rules);
    if let Err(error) = make_ready(&gpu, &model, &specs, &limits, deadline) {
        if deadline.check().is_ok() {
            tracing::debug!(%error, "the GPU is not warmed up");
        }
        return;
    }
    tracing::debug!(ms = began.elapsed().as_millis(), "the GPU is open");
    // The number of triangles makes no difference but to the first kernels, which all styles of as many samples share.
    let without_wires = |samples| {
        specs.iter().find(|(_, spec)| spec.layers.wire.is_none() && spec.image.samples == Samples::Fixed(samples))
    };
    let plain = SAMPLES.into_iter().filter_map(without_wires).map(|styled| (&large, styled));
    for (model, (style, spec)) in specs.iter().map(|styled| (&model, styled)).chain(plain) {
        if deadline.check().is_err() || !gpu.may_have_hardware() {
            return;
        }
        let budget = Budget::new(&limits);
        let context = Context { backends: &mut backends, budget, deadline, ended: &mut |_| () };
        if let Err(error) = pipeline::draw(model, spec, context) {
            tracing::debug!(style, %error, "a style was not warmed up");
        }
    }
    tracing::info!(ms = began.elapsed().as_millis(), "the GPU is warm");
    prepare_for_load(&gpu, &[model, large], &specs, &limits, deadline);
}

/// Every style as large pictures have it, and then those that small pictures have with other samples.
fn specs(rules: &Rules) -> Vec<(&'static str, Spec)> {
    let [of_large, of_small] = SAMPLES;
    let styled = |samples: u32| {
        Style::ALL.iter().filter_map(move |&(style, _)| {
            let keys = [("style", style), ("size", "64"), ("samples", &samples.to_string())];
            let keys = keys.map(|(key, value)| (key.to_owned(), value.to_owned()));
            Some((style, request::read(None, &keys, rules).ok()?))
        })
    };
    let has_wires = |spec: &Spec| spec.layers.wire.is_some();
    styled(of_large).chain(styled(of_small).filter(|(_, spec)| !has_wires(spec))).collect()
}

/// Makes what pictures need that are drawn together with others. Nobody waits for that while there is little to do.
fn prepare_for_load(gpu: &GpuHost, models: &[Model], specs: &[(&str, Spec)], limits: &Limits, deadline: &Deadline) {
    let samples = specs.first().map_or(1, |(_, spec)| spec.image.samples.per_pixel());
    let Ok(device) = gpu.device(GpuKind::Hardware, samples, &|_| ()) else { return };
    for (model, (style, spec)) in models.iter().flat_map(|model| specs.iter().map(move |styled| (model, styled))) {
        if deadline.check().is_err() || device.lost().is_some() {
            break;
        }
        let made = || {
            let make = |plan: &DrawPlan<'_>| device.make_ready_for_load(plan);
            pipeline::with_plan(model, spec, &mut Budget::new(limits), deadline, make)
        };
        // wgpu may panic on a lost device.
        if let Ok(Err(error)) = catch_unwind(AssertUnwindSafe(made)) {
            tracing::debug!(style, %error, "a style's pipelines for load were not made ahead");
        }
    }
    // Dropping the device may panic, too.
    let _ = catch_unwind(AssertUnwindSafe(move || drop(device)));
}

/// Opens the device and, while it draws its probe, begins to make the pipelines of all styles. The driver
/// takes the longest for lines, so the styles with lines come first. One style comes after the other: the
/// driver takes longer for each pipeline if it makes many at a time.
fn make_ready(
    gpu: &GpuHost,
    model: &Model,
    specs: &[(&str, Spec)],
    limits: &Limits,
    deadline: &Deadline,
) -> Result<(), DrawError> {
    let samples = specs.first().map_or(1, |(_, spec)| spec.image.samples.per_pixel());
    let make = &|device: &Arc<dyn GpuDevice>, style: &str, spec: &Spec| {
        let made = || {
            let make = |plan: &DrawPlan<'_>| device.make_ready(plan);
            pipeline::with_plan(model, spec, &mut Budget::new(limits), deadline, make)
        };
        // wgpu may panic on a lost device.
        if let Ok(Err(error)) = catch_unwind(AssertUnwindSafe(made)) {
            tracing::debug!(style, %error, "a style's pipelines were not made ahead");
        }
    };
    let is_usable = &AtomicBool::new(true);
    thread::scope(|scope| {
        let making = RefCell::new(Vec::new());
        let opened = |device: &Arc<dyn GpuDevice>| {
            let device = Arc::clone(device);
            let make_all = move || {
                let (lines, others): (Vec<_>, Vec<_>) = specs.iter().partition(|(_, spec)| spec.layers.wire.is_some());
                for (style, spec) in lines.into_iter().chain(others) {
                    if deadline.check().is_ok() && is_usable.load(Ordering::Relaxed) && device.lost().is_none() {
                        make(&device, style, spec);
                    }
                }
            };
            // Dropping the device may panic, too.
            let make_all = move || drop(catch_unwind(AssertUnwindSafe(make_all)));
            making.borrow_mut().extend(thread::Builder::new().name("warm-up".into()).spawn_scoped(scope, make_all));
        };
        let device = gpu.device(GpuKind::Hardware, samples, &opened);
        is_usable.store(device.is_ok(), Ordering::Relaxed);
        // Their panics are caught. A scope by itself does not wait for the very end of a thread.
        for thread in making.take() {
            let _ = thread.join();
        }
        device.map(drop)
    })
}
