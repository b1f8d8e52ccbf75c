//! The owner of the process's one GPU device, which all workers share. The device is opened when it
//! is first needed, and opened again after it was lost.
//!
//! Before a device draws with a number of samples per pixel for the first time, it has to draw a
//! test picture with that number (`probe`). If it draws that wrong, this process uses no GPU any
//! more. There is one exception: when a device that is opened again after a loss fails its first
//! test picture, that counts as another loss.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};

use super::DrawError;
use super::costs::CostModel;
use super::device::{GpuDevice, GpuKind, GpuState, GpuStatus, HardwareHint, Opener, drop_catching_panics};
use super::probe::{ProbeError, probe};
use super::recovery::{Clock, Recovery};

/// The process's one GPU, shared by all workers.
pub struct GpuHost {
    open: Box<Opener>,
    /// The reason why `auto` means the CPU for ever. Set at most once, and never cleared.
    without: OnceLock<String>,
    /// Held while a device is opened.
    device: Mutex<Slot>,
    opening: Mutex<Opening>,
    /// Notified when `opening` changes.
    opening_changed: Condvar,
    /// Never held for long: reports must not wait for a driver.
    status: Mutex<GpuStatus>,
    /// Devices that were lost since the start.
    losses_in_all: AtomicU64,
    /// Losses in a row, after which `auto` means the CPU for a while.
    recovery: Recovery,
    costs: CostModel,
}

#[derive(Default)]
struct Slot {
    current: Option<Arc<dyn GpuDevice>>,
    /// The reason for which the first opening failed. There is no second attempt then.
    failed: Option<String>,
    /// True once an opening has succeeded. From then on a failure counts as a loss.
    opened_before: bool,
    /// Bits of the numbers of samples per pixel with which the current device has drawn the probe.
    probed: u32,
}

/// Progress of an opening, for threads that wait for its end.
#[derive(Default)]
enum Opening {
    /// No device is being opened.
    #[default]
    None,
    /// One is being opened.
    Begun,
    /// It is open, and draws its probe.
    Probing(Arc<dyn GpuDevice>),
}

/// Reason of a failed opening.
enum OpenError {
    /// There is no such device.
    Absent(String),
    /// There is one that cannot be used.
    Unusable(String),
}

impl GpuHost {
    /// The host of Vulkan's GPUs, whose pipelines are kept in the folder `cache`. Nothing is loaded yet.
    pub fn new(hint: HardwareHint, cache: Option<PathBuf>) -> Self {
        Self::with_opener(hint, CostModel::learning(), Box::new(move |kind| open(kind, cache.as_deref())))
    }

    /// A host whose devices `open` opens. While one is busy, `costs` says which jobs it gets.
    pub fn with_opener(hint: HardwareHint, costs: CostModel, open: Box<Opener>) -> Self {
        let status = match &hint {
            HardwareHint::None { reason } => {
                GpuStatus { state: GpuState::None, info: None, reason: Some(reason.clone()) }
            }
            HardwareHint::Maybe => GpuStatus { state: GpuState::NotOpened, info: None, reason: None },
        };
        let without = OnceLock::new();
        if let HardwareHint::None { reason } = hint {
            tracing::info!(reason, "no hardware GPU: `auto` means the CPU");
            let _ = without.set(reason);
        }
        let (device, status) = (Mutex::default(), Mutex::new(status));
        let (opening, opening_changed) = (Mutex::default(), Condvar::new());
        Self {
            open,
            without,
            device,
            opening,
            opening_changed,
            status,
            recovery: Recovery::default(),
            losses_in_all: AtomicU64::new(0),
            costs,
        }
    }

    /// The same host, which takes the time of rests from `now`.
    #[must_use]
    pub fn with_clock(self, now: Box<Clock>) -> Self {
        Self { recovery: Recovery::with_clock(now), ..self }
    }

    /// The status. Does not wait for an opening.
    pub fn status(&self) -> GpuStatus {
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(reason) = self.recovery.resting() {
            status.reason = Some(reason);
        }
        // A GPU is ready then: a software one, or one that has recovered.
        if status.state == GpuState::Ready {
            status.reason = status.reason.map(|reason| format!("`auto` means the CPU all the same: {reason}"));
        }
        status
    }

    /// The costs of drawing here.
    pub(super) fn costs(&self) -> &CostModel {
        &self.costs
    }

    /// Devices that were lost since the start.
    pub fn losses_in_all(&self) -> u64 {
        self.losses_in_all.load(Ordering::Relaxed)
    }

    /// True as long as `auto` may choose a GPU, now or later.
    pub fn may_have_hardware(&self) -> bool {
        self.without.get().is_none()
    }

    /// True if `auto` may choose a GPU now.
    pub fn is_eligible(&self) -> bool {
        self.may_have_hardware() && self.recovery.resting().is_none()
    }

    /// The device for a request of this kind. It is opened on first use, and draws the probe on first
    /// use of a number of samples per pixel; other workers wait meanwhile. A thread that opens it calls
    /// `opened` before it draws the probe, and one that waits may call it meanwhile.
    ///
    /// `NoGpu` is final, or lasts for the time of a rest. `DeviceLost` means that a device that was there is gone, and that another
    /// try may help.
    pub fn device(
        &self,
        kind: GpuKind,
        samples: u32,
        opened: &dyn Fn(&Arc<dyn GpuDevice>),
    ) -> Result<Arc<dyn GpuDevice>, DrawError> {
        self.check_auto(kind)?;
        let mut slot = self.lock_device(opened);
        // The previous holder of the lock may have decided it.
        self.check_auto(kind)?;
        if let Some(device) = slot.current.clone() {
            if let Some(reason) = device.lost().map(str::to_owned) {
                self.retire(slot.current.take(), &reason);
                return Err(DrawError::DeviceLost(reason));
            }
            return self.ensure_probed(&mut slot, device, samples);
        }
        if let Some(reason) = &slot.failed {
            return Err(DrawError::NoGpu(reason.clone()));
        }
        match self.open_and_probe(kind, samples, opened) {
            Ok(device) => {
                slot.probed = samples;
                self.opened(&mut slot, device, kind)
            }
            Err(error) => Err(self.not_opened(&mut slot, error, kind)),
        }
    }

    /// The current device, if it draws the probe with so many samples per pixel. One that draws it wrong
    /// is not used again.
    fn ensure_probed(
        &self,
        slot: &mut Slot,
        device: Arc<dyn GpuDevice>,
        samples: u32,
    ) -> Result<Arc<dyn GpuDevice>, DrawError> {
        if slot.probed & samples != 0 {
            return Ok(device);
        }
        let attempt = || probe(&mut *device.clone().renderer(), samples);
        let result = catch_unwind(AssertUnwindSafe(attempt));
        if let Some(reason) = device.lost().map(str::to_owned) {
            self.retire(slot.current.take(), &reason);
            return Err(DrawError::DeviceLost(reason));
        }
        let reason = match result {
            Ok(Ok(())) => {
                slot.probed |= samples;
                return Ok(device);
            }
            // Refused, perhaps for lack of memory: that says nothing about its numbers.
            Ok(Err(ProbeError::Draw(error))) => return Err(error),
            Ok(Err(error)) => format!("{}: {error}", device.info().name),
            Err(_) => format!("{}: probing it panicked; the log has more", device.info().name),
        };
        drop_catching_panics((std::mem::take(slot), device));
        Err(self.not_opened(slot, OpenError::Unusable(reason), GpuKind::Any))
    }

    /// Reports that a job found the device lost. True for the first report.
    pub fn note_lost(&self, device: &Arc<dyn GpuDevice>, reason: &str) -> bool {
        let mut slot = self.device.lock().unwrap_or_else(PoisonError::into_inner);
        let is_current = slot.current.as_ref().is_some_and(|current| Arc::ptr_eq(current, device));
        if is_current {
            self.retire(slot.current.take(), reason);
        }
        is_current
    }

    /// Counts a job whose device was lost under it. After too many in a row `auto` means the CPU for a while.
    pub fn count_loss(&self, reason: &str) {
        if let Some(reason) = self.recovery.lost(reason) {
            tracing::warn!(reason, "the GPU rests: `auto` means the CPU");
        }
    }

    /// Counts a job that the device drew without trouble.
    pub fn count_success(&self) {
        if self.recovery.drawn() {
            tracing::info!("the GPU draws again");
        }
    }

    fn check_auto(&self, kind: GpuKind) -> Result<(), DrawError> {
        if kind == GpuKind::Any {
            return Ok(());
        }
        match self.without.get().cloned().or_else(|| self.recovery.resting()) {
            Some(reason) => Err(DrawError::NoGpu(reason)),
            None => Ok(()),
        }
    }

    fn opened(
        &self,
        slot: &mut Slot,
        device: Arc<dyn GpuDevice>,
        kind: GpuKind,
    ) -> Result<Arc<dyn GpuDevice>, DrawError> {
        let info = device.info();
        tracing::info!(
            name = info.name,
            driver = info.driver,
            device_type = info.device_type,
            features = ?info.features,
            "opened the GPU"
        );
        slot.opened_before = true;
        self.set_status(|status| {
            *status = GpuStatus { state: GpuState::Ready, info: Some(info.clone()), reason: None }
        });
        if device.is_software() {
            // The best adapter there is: `auto` need not look for a better one.
            self.go_without(format!("{} is no hardware", info.name), false);
        }
        slot.current = Some(device.clone());
        // After it is stored, so that it is not opened twice.
        self.check_auto(kind)?;
        Ok(device)
    }

    fn not_opened(&self, slot: &mut Slot, error: OpenError, kind: GpuKind) -> DrawError {
        let (state, reason) = match error {
            OpenError::Absent(reason) => (GpuState::None, reason),
            OpenError::Unusable(reason) => (GpuState::Failed, reason),
        };
        self.set_status(|status| *status = GpuStatus { state, info: None, reason: Some(reason.clone()) });
        if slot.opened_before {
            return DrawError::DeviceLost(reason);
        }
        self.go_without(reason.clone(), state == GpuState::Failed);
        // Without hardware there may still be a software implementation.
        if kind == GpuKind::Any || state == GpuState::Failed {
            slot.failed = Some(reason.clone());
        }
        DrawError::NoGpu(reason)
    }

    /// Decides, once, that `auto` means the CPU.
    fn go_without(&self, reason: String, is_fault: bool) {
        if self.without.set(reason.clone()).is_ok() {
            match is_fault {
                true => tracing::warn!(reason, "the GPU cannot be used: `auto` means the CPU"),
                false => tracing::info!(reason, "no hardware GPU: `auto` means the CPU"),
            }
        }
        self.set_status(|_| {});
    }

    /// Changes the status; while `auto` does without, the reason stays in it.
    fn set_status(&self, change: impl FnOnce(&mut GpuStatus)) {
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut status);
        if let Some(reason) = self.without.get() {
            status.reason = Some(reason.clone());
        }
    }

    /// Drops a lost device and reports it.
    fn retire(&self, device: Option<Arc<dyn GpuDevice>>, reason: &str) {
        tracing::warn!(reason, "the GPU was lost");
        self.losses_in_all.fetch_add(1, Ordering::Relaxed);
        self.set_status(|status| {
            status.state = GpuState::Failed;
            status.reason = Some(format!("the GPU was lost: {reason}"));
        });
        drop_catching_panics(device);
    }

    fn open_and_probe(
        &self,
        kind: GpuKind,
        samples: u32,
        opened: &dyn Fn(&Arc<dyn GpuDevice>),
    ) -> Result<Arc<dyn GpuDevice>, OpenError> {
        let attempt = || {
            self.set_opening(Opening::Begun);
            let device = (self.open)(kind).map_err(|error| match error {
                DrawError::NoGpu(reason) => OpenError::Absent(reason),
                other => OpenError::Unusable(other.to_string()),
            })?;
            let name = device.info().name.clone();
            self.set_opening(Opening::Probing(device.clone()));
            opened(&device);
            probe(&mut *device.clone().renderer(), samples)
                .map_err(|error| OpenError::Unusable(format!("{name}: {error}")))?;
            Ok(device)
        };
        // A panic in wgpu disables the GPU but does not fail the job.
        let result = catch_unwind(AssertUnwindSafe(attempt))
            .unwrap_or_else(|_| Err(OpenError::Unusable("opening the GPU panicked; the log has more".to_owned())));
        self.set_opening(Opening::None);
        result
    }

    /// The slot. While another thread opens a device, this one waits, and calls `opened` when it is open.
    fn lock_device(&self, opened: &dyn Fn(&Arc<dyn GpuDevice>)) -> MutexGuard<'_, Slot> {
        match self.device.try_lock() {
            Ok(slot) => return slot,
            Err(TryLockError::Poisoned(slot)) => return slot.into_inner(),
            Err(TryLockError::WouldBlock) => {}
        }
        let opening = self.opening.lock().unwrap_or_else(PoisonError::into_inner);
        let begun = |opening: &mut Opening| matches!(opening, Opening::Begun);
        let opening = self.opening_changed.wait_while(opening, begun).unwrap_or_else(PoisonError::into_inner);
        let probing = if let Opening::Probing(device) = &*opening { Some(device.clone()) } else { None };
        drop(opening);
        if let Some(device) = probing {
            opened(&device);
            // The last reference if the probe has failed meanwhile.
            drop_catching_panics(device);
        }
        self.device.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set_opening(&self, opening: Opening) {
        let before = std::mem::replace(&mut *self.opening.lock().unwrap_or_else(PoisonError::into_inner), opening);
        self.opening_changed.notify_all();
        // The last reference to a device that could not be used.
        drop_catching_panics(before);
    }
}

#[cfg(feature = "gpu")]
fn open(kind: GpuKind, cache: Option<&Path>) -> Result<Arc<dyn GpuDevice>, DrawError> {
    use super::gpu::{AtomicsChoice, Gpu};
    Ok(Arc::new(Gpu::open(kind, AtomicsChoice::Best, cache)?))
}

#[cfg(not(feature = "gpu"))]
fn open(_: GpuKind, _: Option<&Path>) -> Result<Arc<dyn GpuDevice>, DrawError> {
    Err(DrawError::NoGpu("this program was built without the feature `gpu`".to_owned()))
}

impl std::fmt::Debug for GpuHost {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuHost").field("status", &self.status()).finish_non_exhaustive()
    }
}
