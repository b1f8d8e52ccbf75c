//! Drawing a mesh, again and again.

use std::sync::Arc;

use crate::{Error, Mesh, Spec};
use meshsnap_render::backend::{BackendKind, Backends, GpuHost, HardwareHint};
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline;
use meshsnap_render::plan::Skip;
use meshsnap_render::spec::BackendChoice;
use meshsnap_render::warning::Warning;

/// Draws meshes. Keeps its buffers, and its GPU if it has one, from picture to picture: make one and
/// use it often.
///
/// One mesh, many views:
///
/// ```
/// use meshsnap::{Mesh, Renderer, Spec};
///
/// # std::env::set_current_dir("../..")?;
/// let mesh = Mesh::read(&std::fs::read("api/examples/knot.obj")?)?;
/// let mut renderer = Renderer::cpu();
/// for view in ["front", "left", "top", "iso"] {
///     let spec = Spec::wire().size_px(96, 96)?.set("view", view)?;
///     let image = renderer.render(&mesh, &spec)?;
///     assert_eq!((image.width_px, image.height_px), (96, 96));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Renderer {
    backends: Backends,
    /// Overrides what specs say.
    backend: Option<BackendChoice>,
    limits: Limits,
}

/// A picture, and what there is to say about it.
#[derive(Debug)]
#[non_exhaustive]
pub struct Picture {
    /// The picture.
    pub image: Image,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// The parts of drawing that the plan left out, with reasons. No skip changes a byte of the
    /// picture.
    pub skips: Vec<Skip>,
    /// Parts of the spec that do not go with the mesh.
    pub warnings: Vec<Warning>,
}

impl Renderer {
    /// Draws on the CPU with all its cores, whatever a spec says. The same spec and mesh give the
    /// same bytes on every machine.
    pub fn cpu() -> Self {
        Self::new(Some(BackendChoice::Cpu), HardwareHint::unless(Some("the caller wants the CPU".to_owned())))
    }

    /// Draws on a GPU, a software Vulkan included, whatever a spec says. It is opened by the first
    /// picture, which fails where there is none.
    #[cfg(feature = "gpu")]
    pub fn gpu() -> Self {
        Self::new(Some(BackendChoice::Gpu), HardwareHint::unless(None))
    }

    /// Draws where the spec says; where it says `auto`, on a hardware GPU if there is one, and else
    /// on the CPU.
    pub fn auto() -> Self {
        Self::new(None, HardwareHint::unless(None))
    }

    /// The same with other limits.
    #[must_use]
    pub fn limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }

    /// Draws a mesh.
    pub fn render(&mut self, mesh: &Mesh, spec: &Spec) -> Result<Image, Error> {
        Ok(self.picture(mesh, spec, &Deadline::default())?.image)
    }

    /// Draws a mesh, and says how. The deadline is a flag that stops the work from another thread.
    pub fn picture(&mut self, mesh: &Mesh, spec: &Spec, deadline: &Deadline) -> Result<Picture, Error> {
        let mut spec = spec.understood()?;
        if let Some(backend) = self.backend {
            spec.backend = backend;
        }
        let mut budget = Budget::new(&self.limits);
        let drawn = pipeline::draw(&mesh.model, &spec, &mut self.backends, &mut budget, deadline, &mut |_| {})?;
        Ok(Picture { image: drawn.image, backend: drawn.backend, skips: drawn.skips, warnings: drawn.warnings })
    }

    fn new(backend: Option<BackendChoice>, hint: HardwareHint) -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let backends = Backends::new(Arc::new(GpuHost::new(hint, None)), threads);
        Self { backends, backend, limits: Limits::default() }
    }
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer").field("backend", &self.backend).finish_non_exhaustive()
    }
}
