//! One opened GPU, shared by all threads that draw on it: the wgpu device and queue, the features that it has, its
//! compiled pipelines, and the memory that it keeps for the next pictures.
//!
//! This file chooses and opens the adapter, makes the pipelines that a picture needs, waits for the GPU, and turns
//! its errors, and the loss of the device, into errors of the job.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, TryLockError, mpsc};
use std::thread;
use std::time::Duration;

use super::buffers::SpareBuffers;
use super::gang::Gangs;
use super::handles::Handles;
use super::residents::ResidentBuffers;
use super::schedule::sizes::ALONE_SIZE;
use crate::backend::gpu::pipelines::file::PipelineFile;
use crate::backend::gpu::pipelines::{Kernel, Pipelines};
use crate::backend::{DrawError, GpuDevice, GpuInfo, GpuKind, Renderer};
use crate::limits::Deadline;
use crate::plan::DrawPlan;

/// Atomics that write visibility samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtomicsChoice {
    /// 64-bit atomics where the device has them.
    Best,
    /// Two passes of 32-bit atomics, as on a device without; for tests. A software device then shares few
    /// triangles among its threads, and dispatches among jobs, as hardware does.
    Force32,
}

/// An opened GPU.
pub struct Gpu {
    pub(super) handles: Handles,
    pub(super) pipelines: Pipelines,
    pub(super) spare_buffers: SpareBuffers,
    pub(super) residents: ResidentBuffers<wgpu::Buffer>,
    pub(super) gangs: Gangs,
    pub(super) int64_atomics: bool,
    /// Size of the largest triangle that a thread draws by itself where there are few, 1/256 px.
    pub(super) alone_size_of_few: i32,
    /// Nanoseconds of a step of its clock, if it has one.
    pub(super) clock_step_ns: Option<f32>,
    info: GpuInfo,
    lost: Lost,
    /// Held by the thread that polls.
    polling: Mutex<()>,
    /// Renderers that draw on it.
    renderers: AtomicUsize,
    /// Jobs that it is drawing.
    jobs: AtomicUsize,
    /// Jobs that it has drawn together with others.
    jobs_shared: AtomicUsize,
    pictures_drawn_again: AtomicUsize,
}

/// A job that a device draws, until this is dropped.
pub(super) struct Drawing<'a> {
    jobs: &'a AtomicUsize,
    /// True if no other job was being drawn when this one began.
    pub is_alone: bool,
}

/// Memory for what stays on a device, bytes; and on a software one, whose memory is the process's.
const RESIDENT_BYTES: u64 = 1 << 30;
const RESIDENT_BYTES_SOFTWARE: u64 = 64 << 20;

/// Memory for the buffers of jobs, kept for the next ones, bytes. A device with memory of its own keeps more: with
/// too little, jobs at once of large meshes or pictures allocate theirs anew (docs/gpu-notes.md).
const SPARE_BYTES: u64 = 512 << 20;
const SPARE_BYTES_DISCRETE: u64 = 1 << 30;

/// [`Gpu::alone_size_of_few`] of hardware: 4 px for samples (1 px for points of mixed pixels). Larger triangles are
/// drawn by a workgroup each.
const ALONE_SIZE_OF_FEW: i32 = 1024;

/// The reason once the device is lost.
type Lost = Arc<OnceLock<String>>;

/// Storage buffers that a kernel binds, at most; two of them hold a software device's uniforms.
const STORAGE_BUFFERS: u32 = 19;

/// Polls without a pause: a small picture takes a fraction of a millisecond.
const EAGER_POLLS: u32 = 64;

/// Shortest and longest pause between two polls.
const PAUSE_MIN: Duration = Duration::from_micros(20);
const PAUSE_MAX: Duration = Duration::from_millis(2);

/// Pauses, added up, after which a GPU that finishes nothing counts as hung.
const HUNG_AFTER: Duration = Duration::from_secs(120);

impl Gpu {
    /// Opens the best adapter of the given kind. Its pipelines are kept in the folder `cache`, for the
    /// next process.
    pub fn open(kind: GpuKind, atomics_choice: AtomicsChoice, cache: Option<&Path>) -> Result<Self, DrawError> {
        let adapter = find_adapter(kind)?;
        let info = adapter.get_info();
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            let has = limits.max_storage_buffers_per_shader_stage;
            return Err(no_gpu(format!("{} binds {has} storage buffers, and {STORAGE_BUFFERS} are needed", info.name)));
        }
        let int64 = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX;
        let int64_atomics = atomics_choice == AtomicsChoice::Best && adapter.features().contains(int64);
        let wanted =
            wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::PIPELINE_CACHE | wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
        let atomics = if int64_atomics { int64 } else { wgpu::Features::empty() };
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("meshsnap"),
            required_features: adapter.features() & wanted | atomics,
            required_limits: limits.clone(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            trace: wgpu::Trace::Off,
        });
        let (device, queue) = pollster::block_on(request).map_err(|e| no_gpu(format!("{}: {e}", info.name)))?;

        let lost = Lost::default();
        let slot = lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            // Dropping the device reports "destroyed" here too; the slot is not read any more then.
            let _ = slot.set(format!("{reason:?}: {message}"));
        });
        // Without a handler wgpu panics. Errors that a job causes go to that job's error scope; the
        // others come here.
        device
            .on_uncaptured_error(Arc::new(|error| tracing::error!(%error, "the GPU reported an error outside a job")));

        let file = cache.and_then(|folder| PipelineFile::open(folder, &info, &device));
        let maps_storage = device.features().contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS);
        let has_clock = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let clock_step_ns = has_clock.then(|| queue.get_timestamp_period());
        tracing::debug!(name = info.name, "opened a device");
        let features = if int64_atomics { vec!["int64-atomics"] } else { vec![] };
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        let uniforms = if is_software {
            wgpu::BufferBindingType::Storage { read_only: true }
        } else {
            wgpu::BufferBindingType::Uniform
        };
        let is_discrete = info.device_type == wgpu::DeviceType::DiscreteGpu;
        let driver = format!("{} {}", info.driver, info.driver_info).trim().to_owned();
        let info = GpuInfo { name: info.name, driver, device_type: type_name(info.device_type), features };
        Ok(Self {
            handles: Handles { device, queue, limits, maps_storage, uniforms, readbacks: Arc::default() },
            pipelines: Pipelines::kept_in(file),
            spare_buffers: SpareBuffers::new(if is_discrete { SPARE_BYTES_DISCRETE } else { SPARE_BYTES }),
            residents: ResidentBuffers::new(if is_software { RESIDENT_BYTES_SOFTWARE } else { RESIDENT_BYTES }),
            gangs: Gangs::default(),
            int64_atomics,
            alone_size_of_few: if is_software && atomics_choice == AtomicsChoice::Best {
                ALONE_SIZE
            } else {
                ALONE_SIZE_OF_FEW
            },
            clock_step_ns,
            info,
            lost,
            polling: Mutex::new(()),
            renderers: AtomicUsize::new(0),
            jobs: AtomicUsize::new(0),
            jobs_shared: AtomicUsize::new(0),
            pictures_drawn_again: AtomicUsize::new(0),
        })
    }

    /// The opened device.
    pub fn info(&self) -> &GpuInfo {
        &self.info
    }

    /// Memory on the device for what meshes bring, kept for the next pictures, bytes.
    pub fn resident_bytes(&self) -> u64 {
        self.residents.bytes()
    }

    /// Memory of the buffers of jobs, on the device or where both sides reach it, kept for the next ones, bytes. None
    /// is kept without a renderer.
    pub fn spare_bytes(&self) -> u64 {
        self.spare_buffers.bytes() + self.handles.readbacks.bytes()
    }

    /// Frees what is kept for the next jobs. False if there was nothing.
    pub(super) fn free_spare_memory(&self) -> bool {
        self.residents.clear() | self.handles.readbacks.clear() | self.spare_buffers.clear()
    }

    /// Counts a job.
    pub(super) fn begin_job(&self) -> Drawing<'_> {
        Drawing { jobs: &self.jobs, is_alone: self.jobs.fetch_add(1, Ordering::Relaxed) == 0 }
    }

    /// Jobs so far that shared their dispatches with others.
    pub fn jobs_shared(&self) -> usize {
        self.jobs_shared.load(Ordering::Relaxed)
    }

    /// Pictures so far that were drawn once more, because the lists of mixed pixels had no room.
    pub fn pictures_drawn_again(&self) -> usize {
        self.pictures_drawn_again.load(Ordering::Relaxed)
    }

    /// To be called before such a picture is drawn once more. Frees the room of its lists, so that it does not stay
    /// beside that of points.
    pub(super) fn picture_overflowed(&self) {
        self.pictures_drawn_again.fetch_add(1, Ordering::Relaxed);
        self.spare_buffers.clear();
    }

    /// True if jobs that come while it is busy may share dispatches. A software device gains nothing by that, and does
    /// so only where it behaves as hardware, for tests.
    pub(super) fn draws_gangs(&self) -> bool {
        self.handles.maps_storage && self.alone_size_of_few < ALONE_SIZE
    }

    /// To be called for each gang, with its number of jobs.
    pub(super) fn gang_drawn(&self, jobs: usize) {
        if jobs > 1 {
            self.jobs_shared.fetch_add(jobs, Ordering::Relaxed);
        }
    }

    /// To be called for each new renderer.
    pub(super) fn renderer_made(&self) {
        self.renderers.fetch_add(1, Ordering::Relaxed);
    }

    /// To be called when a renderer is dropped.
    pub(super) fn renderer_dropped(&self) {
        if self.renderers.fetch_sub(1, Ordering::AcqRel) == 1 {
            self.spare_buffers.clear();
            self.handles.readbacks.close();
        }
    }

    /// The reason if the device is lost.
    pub fn lost(&self) -> Option<&str> {
        self.lost.get().map(String::as_str)
    }

    /// Fails if the device is gone.
    pub(super) fn check(&self) -> Result<(), DrawError> {
        self.lost().map_or(Ok(()), |reason| Err(DrawError::DeviceLost(reason.to_owned())))
    }

    /// True for a software implementation on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == type_name(wgpu::DeviceType::Cpu)
    }

    /// Makes the pipelines of kernels that have none for this key: on all cores, or for a software device
    /// on this thread alone. Its compiler leaves much memory to each thread that it has run on.
    pub(super) fn make_pipelines(&self, kernels: &[Kernel], key: u32) -> Result<(), DrawError> {
        let missing = self.pipelines.missing(kernels, key);
        if missing.is_empty() {
            return Ok(());
        }
        let next = AtomicUsize::new(0);
        let make = || {
            self.scoped(|| {
                while let Some(&kernel) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                    self.pipelines.get(&self.handles, kernel, key);
                }
                Ok(())
            })
        };
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads = if self.is_software() { 1 } else { cores.min(missing.len()) };
        let result = thread::scope(|scope| {
            // Where the system gives no more threads, the others do all.
            let spawn = |_| thread::Builder::new().name("pipelines".into()).spawn_scoped(scope, make).ok();
            let others: Vec<_> = (1..threads).filter_map(spawn).collect();
            let own = make();
            let others = others.into_iter().map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
            others.chain([own]).collect::<Result<(), DrawError>>()
        });
        if result.is_err() {
            // One that could not be made stays among them.
            self.pipelines.clear();
            return result;
        }
        tracing::debug!(pipelines = missing.len(), "made pipelines");
        self.pipelines.save();
        Ok(())
    }

    /// Runs `work` and turns the device's errors on this thread into an error.
    pub(super) fn scoped<T>(&self, work: impl FnOnce() -> Result<T, DrawError>) -> Result<T, DrawError> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let [a, b, c] = [Internal, OutOfMemory, Validation].map(|filter| self.handles.device.push_error_scope(filter));
        let result = work();
        // Innermost first. On wgpu's own back-ends these futures are ready at once.
        let errors = [c, b, a].map(|scope| pollster::block_on(scope.pop()));
        self.check()?;
        // Whatever went wrong first on the device is the cause of what `work` saw.
        match (errors.into_iter().flatten().next(), result) {
            (_, Err(DrawError::Stopped(stopped))) => Err(DrawError::Stopped(stopped)),
            (Some(error), _) => Err(DrawError::Device(error.to_string())),
            (None, result) => result,
        }
    }

    /// Waits until a callback of the device has sent a value, and polls the deadline meanwhile.
    ///
    /// It never blocks in a poll. In wgpu-core 30.0.1 a wait with a timeout panics if the timeout
    /// ends at the moment at which another thread's poll or submit finds the queue empty
    /// (device/resource.rs:948). The callbacks of other jobs are then lost too. A wait without a
    /// timeout could hang for ever.
    pub(super) fn wait<T>(&self, news: &mpsc::Receiver<T>, deadline: &Deadline) -> Result<T, DrawError> {
        let (mut polls, mut waited) = (0_u32, Duration::ZERO);
        while waited < HUNG_AFTER {
            deadline.check()?;
            self.check()?;
            self.poll()?;
            polls += 1;
            let pause = if polls <= EAGER_POLLS { Duration::ZERO } else { (waited / 8).clamp(PAUSE_MIN, PAUSE_MAX) };
            // Another worker's poll may run our callback: then this wakes up at once.
            match news.recv_timeout(pause) {
                Ok(news) => return Ok(news),
                Err(mpsc::RecvTimeoutError::Timeout) if pause.is_zero() => thread::yield_now(),
                Err(mpsc::RecvTimeoutError::Timeout) => waited += pause,
                Err(mpsc::RecvTimeoutError::Disconnected) => return Err(self.declare_lost("it forgot a job")),
            }
        }
        Err(self.declare_lost("it did not answer for two minutes"))
    }

    /// Waits until the device has written to a buffer, and maps the first `size` bytes of it.
    pub(super) fn map(
        &self,
        buffer: &wgpu::Buffer,
        size: u64,
        deadline: &Deadline,
    ) -> Result<wgpu::BufferView, DrawError> {
        let (sender, mapped) = mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, 0..size, move |result| {
            // A job that has given up has dropped the receiver.
            let _ = sender.send(result);
        });
        let mapped = self.wait(&mapped, deadline)?;
        mapped.map_err(|error| DrawError::Device(format!("reading the picture back failed: {error}")))?;
        buffer.get_mapped_range(0..size).map_err(|e| DrawError::Device(e.to_string()))
    }

    /// Runs the callbacks that are due, unless another thread is at it: its polls run ours too, and many
    /// that poll at once hold up those that submit.
    fn poll(&self) -> Result<(), DrawError> {
        let _polling = match self.polling.try_lock() {
            Err(TryLockError::WouldBlock) => return Ok(()),
            Err(TryLockError::Poisoned(polling)) => polling.into_inner(),
            Ok(polling) => polling,
        };
        // A poll of a lost device frees its buffers, and encoders may be reading some.
        self.check()?;
        // Real device loss panics inside poll, whatever handlers are set.
        match catch_unwind(AssertUnwindSafe(|| self.handles.device.poll(wgpu::PollType::Poll))) {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(DrawError::Device(error.to_string())),
            Err(_) => Err(self.declare_lost("polling it failed")),
        }
    }

    /// Marks the device as lost.
    pub(super) fn declare_lost(&self, reason: &str) -> DrawError {
        DrawError::DeviceLost(self.lost.get_or_init(|| reason.to_owned()).clone())
    }
}

impl Drop for Drawing<'_> {
    fn drop(&mut self) {
        self.jobs.fetch_sub(1, Ordering::Relaxed);
    }
}

fn no_gpu(reason: String) -> DrawError {
    DrawError::NoGpu(reason)
}

fn find_adapter(kind: GpuKind) -> Result<wgpu::Adapter, DrawError> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    // Refuse to allocate before the system begins to swap GPU memory: a refused job is better than
    // a lost device. wgpu is not to give a device up by itself: it would free what encoders read.
    descriptor.memory_budget_thresholds =
        wgpu::MemoryBudgetThresholds { for_resource_creation: Some(90), for_device_loss: None };
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    if adapters.is_empty() {
        return Err(no_gpu(
            "Vulkan lists no adapter; install a driver, or mesa-vulkan-drivers for a software one".to_owned(),
        ));
    }
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let names: Vec<_> = adapters.iter().map(|a| a.get_info().name).collect();
    let wanted = |adapter: &wgpu::Adapter| kind == GpuKind::Any || rank(adapter) < 4;
    adapters
        .into_iter()
        .filter(wanted)
        .min_by_key(rank)
        .ok_or_else(|| no_gpu(format!("there is software Vulkan alone ({})", names.join(", "))))
}

fn type_name(device_type: wgpu::DeviceType) -> &'static str {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

impl GpuDevice for Gpu {
    fn info(&self) -> &GpuInfo {
        Self::info(self)
    }

    fn is_software(&self) -> bool {
        Self::info(self).device_type == "software"
    }

    fn lost(&self) -> Option<&str> {
        Self::lost(self)
    }

    fn renderer(self: Arc<Self>) -> Box<dyn Renderer> {
        Box::new(super::GpuRenderer::new(self))
    }

    /// Makes the pipelines. A software device makes none ahead: it would take the cores from others, and
    /// memory for each thread.
    fn make_ready(&self, plan: &DrawPlan<'_>) -> Result<(), DrawError> {
        if Self::is_software(self) { Ok(()) } else { super::make_pipelines_of(self, plan) }
    }

    fn make_ready_for_load(&self, plan: &DrawPlan<'_>) -> Result<(), DrawError> {
        if Self::is_software(self) { Ok(()) } else { super::make_pipelines_of_gangs(self, plan) }
    }
}
