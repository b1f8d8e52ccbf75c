//! What an opened GPU is used through: all that buffers need of it.

/// Device, queue and limits of an opened GPU.
pub struct Handles {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
}
