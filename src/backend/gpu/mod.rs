//! The wgpu back-end: compute shaders, headless.
