//! The parts of an opened GPU that suffice to make and fill buffers: wgpu's device and queue, the limits, the kinds
//! of buffers that the GPU can use, and the spare buffers for pictures. They have a file of their own because
//! `buffers` needs them and `device`, which has the rest, needs `buffers`.

use std::sync::Arc;

use super::staging::ReadbackPool;

/// Device, queue and limits of an opened GPU.
pub struct Handles {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
    /// True if kernels can write to a buffer that the CPU reads, and read one that it writes.
    pub maps_storage: bool,
    /// The kind of buffer that holds uniforms: storage on a software device. llvmpipe puts the values of uniform buffers
    /// into kernels and compiles them anew for other values.
    pub uniforms: wgpu::BufferBindingType,
    /// Buffers for the next pictures.
    pub readbacks: Arc<ReadbackPool>,
}
