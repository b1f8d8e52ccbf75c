//! Types that describe a GPU, for the choice of a back-end and for reports: a hint about the machine before a driver
//! is loaded (`HardwareHint`), an opened device (the trait `GpuDevice`), and the status that reports show
//! (`GpuStatus`).

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::{DrawError, Renderer};
use crate::plan::DrawPlan;

/// Knowledge about the machine before any driver is loaded. Loading Vulkan to find out costs time,
/// and a software one brings a whole compiler with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HardwareHint {
    /// There is certainly no hardware GPU.
    None {
        /// The reason.
        reason: String,
    },
    /// There may be one.
    Maybe,
}

impl HardwareHint {
    /// There may be one, unless a reason is known why not.
    pub fn unless(reason: Option<String>) -> Self {
        reason.map_or(Self::Maybe, |reason| Self::None { reason })
    }
}

/// Adapters that may be opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuKind {
    /// Any, a software Vulkan included.
    Any,
    /// Hardware alone.
    Hardware,
}

/// The opened device.
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

/// An opened device, as the choice of a back-end needs it.
pub trait GpuDevice: Send + Sync {
    /// The opened device.
    fn info(&self) -> &GpuInfo;

    /// True for a software implementation on the CPU.
    fn is_software(&self) -> bool;

    /// The reason if the device is lost.
    fn lost(&self) -> Option<&str>;

    /// A renderer on it, for one thread.
    fn renderer(self: Arc<Self>) -> Box<dyn Renderer>;

    /// Makes what pictures of this plan's kind need and can be made without drawing. A device that gains
    /// nothing by that does nothing.
    fn make_ready(&self, plan: &DrawPlan<'_>) -> Result<(), DrawError>;

    /// The same for pictures that are drawn together with others while the device is busy.
    fn make_ready_for_load(&self, plan: &DrawPlan<'_>) -> Result<(), DrawError>;
}

/// Opens a device.
pub type Opener = dyn Fn(GpuKind) -> Result<Arc<dyn GpuDevice>, DrawError> + Send + Sync;

/// Status of the GPU, for reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GpuStatus {
    /// The state.
    pub state: GpuState,
    /// The device opened last.
    pub info: Option<GpuInfo>,
    /// The reason why there is no GPU, or why `auto` means the CPU although there is one.
    pub reason: Option<String>,
}

/// State of the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GpuState {
    /// No job needed it yet.
    NotOpened,
    /// It passed the probe.
    Ready,
    /// There is none.
    None,
    /// There is one that cannot be used.
    Failed,
}

impl GpuState {
    /// The word used in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotOpened => "not opened",
            Self::Ready => "ready",
            Self::None => "none",
            Self::Failed => "failed",
        }
    }
}

/// Drops an object of a device that may be lost. wgpu may panic then; the panic is ignored.
pub(super) fn drop_catching_panics<T>(thing: T) {
    let _ = catch_unwind(AssertUnwindSafe(|| drop(thing)));
}
