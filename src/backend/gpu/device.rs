//! One opened GPU: adapter, device, queue, and what it can do. Shared by all workers.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use super::stages::Stages;
use crate::backend::DrawError;
use crate::limits::Deadline;

/// Which adapters may be opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuKind {
    /// Any, a software Vulkan included.
    Any,
    /// Hardware alone.
    Hardware,
}

/// How visibility samples are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtomicsChoice {
    /// 64-bit atomics where the device has them.
    Best,
    /// Two passes of 32-bit atomics, as on a device without; for tests.
    Force32,
}

/// What was opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GpuInfo {
    /// The adapter's name.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub device_type: &'static str,
    /// Optional features that are used.
    pub features: Vec<&'static str>,
}

/// An opened GPU.
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) stages: Stages,
    pub(super) limits: wgpu::Limits,
    pub(super) int64_atomics: bool,
    info: GpuInfo,
    lost: Lost,
    /// Held while polling: in wgpu-core 30.0.1 a wait that times out panics if another thread's poll has meanwhile found the
    /// queue empty (device/resource.rs:948), and takes other jobs' callbacks down with it.
    polling: Mutex<()>,
}

/// Why the device is gone, once it is.
type Lost = Arc<OnceLock<String>>;

/// Storage buffers that the hungriest stage binds.
const STORAGE_BUFFERS: u32 = 8;

/// How long to wait for the GPU between two looks at the deadline, and before another worker may wait.
const POLL_SLICE: Duration = Duration::from_millis(5);

/// Slices after which a GPU that finishes nothing counts as hung: two minutes.
const POLL_SLICES_MAX: u32 = 24_000;

impl Gpu {
    /// Opens the best adapter of the given kind.
    pub fn open(kind: GpuKind, atomics: AtomicsChoice) -> Result<Self, DrawError> {
        let adapter = find_adapter(kind)?;
        let info = adapter.get_info();
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            let has = limits.max_storage_buffers_per_shader_stage;
            return Err(no_gpu(format!("{} binds {has} storage buffers, and {STORAGE_BUFFERS} are needed", info.name)));
        }
        let int64 = wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX;
        let int64_atomics = atomics == AtomicsChoice::Best && adapter.features().contains(int64);
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("meshsnap"),
            required_features: if int64_atomics { int64 } else { wgpu::Features::empty() },
            required_limits: limits.clone(),
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            trace: wgpu::Trace::Off,
        });
        let (device, queue) = pollster::block_on(request).map_err(|e| no_gpu(format!("{}: {e}", info.name)))?;

        let lost = Lost::default();
        let slot = lost.clone();
        device.set_device_lost_callback(move |reason, message| {
            // Dropping the device reports "destroyed" here too; nobody looks at the slot any more then.
            let _ = slot.set(format!("{reason:?}: {message}"));
        });
        // Without a handler wgpu panics. What a job causes is caught by that job's error scope; this is the rest.
        device
            .on_uncaptured_error(Arc::new(|error| tracing::error!(%error, "the GPU reported an error outside a job")));

        let features = if int64_atomics { vec!["int64-atomics"] } else { vec![] };
        let driver = format!("{} {}", info.driver, info.driver_info).trim().to_owned();
        let info = GpuInfo { name: info.name, driver, device_type: type_name(info.device_type), features };
        Ok(Self {
            device,
            queue,
            stages: Stages::default(),
            limits,
            int64_atomics,
            info,
            lost,
            polling: Mutex::new(()),
        })
    }

    /// What was opened.
    pub fn info(&self) -> &GpuInfo {
        &self.info
    }

    /// Why the device is gone, if it is.
    pub fn lost(&self) -> Option<&str> {
        self.lost.get().map(String::as_str)
    }

    /// Fails if the device is gone.
    pub(super) fn check(&self) -> Result<(), DrawError> {
        self.lost().map_or(Ok(()), |reason| Err(DrawError::DeviceLost(reason.to_owned())))
    }

    /// Whether this is a processor that plays GPU.
    pub(super) fn is_software(&self) -> bool {
        self.info.device_type == type_name(wgpu::DeviceType::Cpu)
    }

    /// Runs `work` and turns what the device complains about meanwhile, on this thread, into an error.
    pub(super) fn scoped<T>(&self, work: impl FnOnce() -> Result<T, DrawError>) -> Result<T, DrawError> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let [a, b, c] = [Internal, OutOfMemory, Validation].map(|filter| self.device.push_error_scope(filter));
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

    /// Waits until a submission is done, looking at the deadline now and then.
    pub(super) fn wait(&self, submission: &wgpu::SubmissionIndex, deadline: &Deadline) -> Result<(), DrawError> {
        for _ in 0..POLL_SLICES_MAX {
            deadline.check()?;
            let wait = wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(POLL_SLICE) };
            // Real device loss panics inside poll, whatever handlers are set.
            let polled = {
                let _polling = self.polling.lock().unwrap_or_else(PoisonError::into_inner);
                catch_unwind(AssertUnwindSafe(|| self.device.poll(wait)))
            };
            match polled {
                Ok(Ok(_)) => return self.check(),
                Ok(Err(wgpu::PollError::Timeout)) => self.check()?,
                Ok(Err(error)) => return Err(DrawError::Device(error.to_string())),
                Err(_) => return Err(self.declare_lost("waiting for it failed")),
            }
        }
        Err(self.declare_lost("it did not answer for two minutes"))
    }

    /// Marks the device as lost.
    pub(super) fn declare_lost(&self, reason: &str) -> DrawError {
        DrawError::DeviceLost(self.lost.get_or_init(|| reason.to_owned()).clone())
    }
}

fn no_gpu(reason: String) -> DrawError {
    DrawError::NoGpu(reason)
}

fn find_adapter(kind: GpuKind) -> Result<wgpu::Adapter, DrawError> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    // Refuse to allocate before the system begins to swap GPU memory: a refused job is better than a lost device.
    descriptor.memory_budget_thresholds =
        wgpu::MemoryBudgetThresholds { for_resource_creation: Some(90), for_device_loss: Some(99) };
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
