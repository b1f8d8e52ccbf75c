//! Device, queue and limits of an opened GPU, in a file of their own because buffers and submissions need
//! no more.

use crate::backend::DrawError;

/// Device, queue and limits of an opened GPU.
pub struct Handles {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
}

impl Handles {
    /// Runs `work` and turns the device's errors on this thread into an error.
    pub fn scoped<T>(&self, work: impl FnOnce() -> Result<T, DrawError>) -> Result<T, DrawError> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let [a, b, c] = [Internal, OutOfMemory, Validation].map(|filter| self.device.push_error_scope(filter));
        let result = work();
        // Innermost first. On wgpu's own back-ends these futures are ready at once.
        let errors = [c, b, a].map(|scope| pollster::block_on(scope.pop()));
        // Whatever went wrong first on the device is the cause of what `work` saw.
        match (errors.into_iter().flatten().next(), result) {
            (_, Err(DrawError::Stopped(stopped))) => Err(DrawError::Stopped(stopped)),
            (Some(error), _) => Err(DrawError::Device(error.to_string())),
            (None, result) => result,
        }
    }
}
