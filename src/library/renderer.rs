//! The `Renderer`: draws meshes on the CPU or on a GPU, and keeps its buffers from picture to picture. It gives an
//! image, an image in linear light, or the triangle that each pixel shows.

use std::sync::Arc;

use meshsnap_render::backend::{BackendKind, Backends, GpuHost, HardwareHint};
use meshsnap_render::image::{Image, LinearImage};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::{self, Context, DrawReport, Drawn, FaceBuffer, Model, RenderError, Stage};
use meshsnap_render::plan::Skip;
use meshsnap_render::spec::{self, BackendChoice};
use meshsnap_render::warning::Warning;

use crate::{Error, Mesh, Spec};

/// Draws meshes. Keeps its buffers, and its GPU if it has one, from picture to picture: make one and
/// use it often. A program with several threads makes one for each; a [`Mesh`] can be shared.
///
/// One mesh, many views:
///
/// ```
/// use meshsnap::{Mesh, Renderer, Spec, View};
///
/// # std::env::set_current_dir("../..")?;
/// let mesh = Mesh::read(&std::fs::read("api/examples/knot.obj")?)?;
/// let mut renderer = Renderer::cpu();
/// for view in [View::Front, View::Left, View::Top, View::Iso] {
///     let image = renderer.render(&mesh, &Spec::wire().size(96, 96).view(view))?;
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
pub struct Picture<I = Image> {
    /// The picture.
    pub image: I,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// The parts of drawing that the plan left out, with reasons. No skip changes a byte of the
    /// picture.
    pub skips: Vec<Skip>,
    /// Parts of the spec that do not go with the mesh.
    pub warnings: Vec<Warning>,
}

/// The progress of a picture while it is drawn, and a way to stop it.
///
/// ```
/// use meshsnap::{Deadline, Watch};
///
/// let deadline = Deadline::default();     // a clone of it stops the drawing from another thread: deadline.stop()
/// let mut heard = |stage| println!("{stage:?} has ended");
/// let watch = Watch::default().deadline(&deadline).progress(&mut heard);
/// ```
#[derive(Default)]
pub struct Watch<'a> {
    deadline: Deadline,
    progress: Option<&'a mut dyn FnMut(Stage)>,
}

impl<'a> Watch<'a> {
    /// A flag that stops the drawing.
    #[must_use]
    pub fn deadline(mut self, deadline: &Deadline) -> Self {
        self.deadline = deadline.clone();
        self
    }

    /// A function that is called at the end of each stage; of a sheet, once for each view.
    #[must_use]
    pub fn progress(mut self, ended: &'a mut dyn FnMut(Stage)) -> Self {
        self.progress = Some(ended);
        self
    }
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

    /// The same with other limits, which count for specs and for drawing.
    #[must_use]
    pub fn limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self
    }

    /// Draws a mesh.
    pub fn render(&mut self, mesh: &Mesh, spec: &Spec) -> Result<Image, Error> {
        Ok(self.picture(mesh, spec, Watch::default())?.image)
    }

    /// Draws a mesh, and says how.
    pub fn picture(&mut self, mesh: &Mesh, spec: &Spec, watch: Watch<'_>) -> Result<Picture, Error> {
        self.drawn(mesh, spec, watch, pipeline::draw)
    }

    /// Draws a mesh in linear light, as half floats. A view alone: the views of a turntable and the legend are left out.
    ///
    /// ```
    /// use meshsnap::{Mesh, Renderer, Spec, Watch};
    ///
    /// # std::env::set_current_dir("../..")?;
    /// let mesh = Mesh::read(&std::fs::read("api/examples/knot.obj")?)?;
    /// let spec = Spec::smooth().size(96, 96).transparent();
    /// let image = Renderer::cpu().linear(&mesh, &spec, Watch::default())?.image;
    /// let [red, green, blue, alpha] = image.pixel(48, 48).map(f32::from);
    /// let values: Vec<u16> = image.rgba.as_flattened().iter().map(|value| value.to_bits()).collect();
    /// # assert_eq!(values.len(), 96 * 96 * 4);
    /// # assert!([red, green, blue].iter().all(|&value| value >= 0.0 && value <= alpha));
    /// # assert!(image.rgba.iter().any(|pixel| f32::from(pixel[3]) == 1.0 && f32::from(pixel[0]) > 0.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn linear(&mut self, mesh: &Mesh, spec: &Spec, watch: Watch<'_>) -> Result<Picture<LinearImage>, Error> {
        self.drawn(mesh, spec, watch, pipeline::draw_linear)
    }

    /// Finds the triangle that each pixel of the same picture shows at its centre, and its distance. Always on the CPU.
    pub fn faces(&mut self, mesh: &Mesh, spec: &Spec, watch: Watch<'_>) -> Result<FaceBuffer, Error> {
        let (spec, mut nothing) = (self.understood(spec)?, |_| {});
        let Watch { deadline, progress } = watch;
        let ended = progress.unwrap_or(&mut nothing);
        let budget = Budget::new(&self.limits);
        let mut context = Context { backends: &mut self.backends, budget, deadline: &deadline, ended };
        Ok(pipeline::find_faces(mesh.model.view(), &spec, &mut context)?)
    }

    fn drawn<I>(
        &mut self,
        mesh: &Mesh,
        spec: &Spec,
        watch: Watch<'_>,
        draw: fn(&Model, &spec::Spec, Context<'_>) -> Result<Drawn<I>, RenderError>,
    ) -> Result<Picture<I>, Error> {
        let (spec, mut nothing) = (self.understood(spec)?, |_| {});
        let Watch { deadline, progress } = watch;
        let ended = progress.unwrap_or(&mut nothing);
        let budget = Budget::new(&self.limits);
        let context = Context { backends: &mut self.backends, budget, deadline: &deadline, ended };
        let Drawn { image, report } = draw(&mesh.model, &spec, context)?;
        let DrawReport { backend, skips, warnings, .. } = report;
        Ok(Picture { image, backend, skips, warnings })
    }

    fn understood(&self, spec: &Spec) -> Result<spec::Spec, Error> {
        let mut spec = spec.understood(&self.limits)?;
        if let Some(backend) = self.backend {
            spec.backend = backend;
        }
        Ok(spec)
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

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    #[test]
    fn a_renderer_of_64_px_refuses_128() {
        let mut limits = Limits::default();
        limits.image_px = 64;
        let mesh = Mesh::read(CUBE.as_bytes()).unwrap();
        let mut renderer = Renderer::cpu().limits(limits);
        let error = renderer.render(&mesh, &Spec::flat().size(128, 128)).unwrap_err();
        assert_eq!(error.fault(), crate::Fault::Request);
        assert!(error.to_string().contains("64"), "{error}");
        assert_eq!(renderer.render(&mesh, &Spec::flat().size(64, 64)).unwrap().width_px, 64);
    }

    #[test]
    fn one_mesh_is_drawn_by_many_threads() {
        let mesh = Mesh::read(CUBE.as_bytes()).unwrap();
        let draw = || Renderer::cpu().render(&mesh, &Spec::wire().size(48, 48)).unwrap();
        let expected = draw();
        let drawn: Vec<Image> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(draw)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert_eq!(drawn.len(), 4);
        assert!(drawn.iter().all(|image| *image == expected));
    }

    #[test]
    fn stages_are_heard_of_and_a_raised_deadline_stops() {
        let mesh = Mesh::read(CUBE.as_bytes()).unwrap();
        let (mut renderer, spec, mut stages) = (Renderer::cpu(), Spec::flat().size(16, 16), Vec::new());
        let mut hear = |stage| stages.push(stage);
        renderer.picture(&mesh, &spec, Watch::default().progress(&mut hear)).unwrap();
        assert_eq!(stages, [Stage::Plan, Stage::Render]);
        let mut heard = 0;
        renderer.faces(&mesh, &spec, Watch::default().progress(&mut |_| heard += 1)).unwrap();
        assert_eq!(heard, 2);
        let deadline = Deadline::default();
        deadline.stop();
        let error = renderer.picture(&mesh, &spec, Watch::default().deadline(&deadline)).unwrap_err();
        assert_eq!(error.fault(), crate::Fault::Deadline);
    }

    #[test]
    fn a_picture_in_linear_light_is_one_view_and_counts_as_memory() {
        let mesh = Mesh::read(CUBE.as_bytes()).unwrap();
        let spec = Spec::unlit().size(32, 24).surface_color("#fff").background("#000").set("sheet.turntable", "4");
        let picture = Renderer::cpu().linear(&mesh, &spec, Watch::default()).unwrap();
        let image = picture.image;
        assert_eq!(
            (image.width_px, image.height_px, image.rgba.len(), picture.backend),
            (32, 24, 768, BackendKind::Cpu)
        );
        assert_eq!(image.pixel(16, 12), [1.0; 4].map(crate::f16::from_f32));
        assert_eq!(image.pixel(0, 0), [0.0, 0.0, 0.0, 1.0].map(crate::f16::from_f32));
        let mut renderer = Renderer::cpu().limits(Limits::default().with(|limits| limits.memory_bytes = 10_000));
        let error = renderer.linear(&mesh, &spec, Watch::default()).unwrap_err();
        assert!(error.to_string().contains("linear light"), "{error}");
    }

    /// The front of the cube, y = 0 with z up, is quad 3: triangles 4 and 5.
    #[test]
    fn faces_are_those_of_the_file_at_their_distance() {
        let mesh = Mesh::read(CUBE.as_bytes()).unwrap();
        let spec = Spec::flat().size(32, 32).set("up", "z").orthographic().view(spec::NamedView::Front);
        let faces = Renderer::cpu().faces(&mesh, &spec, Watch::default()).unwrap();
        let at = |x: usize, y: usize| faces.triangles[y * 32 + x];
        assert_eq!(at(0, 0), FaceBuffer::NONE);
        assert_eq!(faces.depths[0], f32::INFINITY);
        let mut seen: Vec<u32> = faces.triangles.iter().copied().filter(|&id| id != FaceBuffer::NONE).collect();
        seen.sort_unstable();
        assert!(seen.len() > 500, "{}", seen.len());
        seen.dedup();
        assert_eq!(seen, [4, 5]);
        let depths: Vec<f32> = faces.depths.iter().copied().filter(|depth| depth.is_finite()).collect();
        assert!(depths.iter().all(|depth| (depth - depths[0]).abs() < 1e-5), "a wall that faces the viewer");

        // Neither lines nor an outline is a triangle of the mesh, and a layout of the texture has none.
        let outlined = spec.clone().set("outline.thickness", "4").set("outline.unit", "px").line_width(3.0);
        let with_lines = Renderer::cpu().faces(&mesh, &outlined, Watch::default()).unwrap();
        assert!(with_lines.triangles.iter().all(|&id| id == FaceBuffer::NONE || id < 12));
        let layout = spec.set("surface.debug", "uv-layout");
        let layout = Renderer::cpu().faces(&mesh, &layout, Watch::default()).unwrap();
        assert!(layout.triangles.iter().all(|&id| id == FaceBuffer::NONE));

        // In perspective, from an eye that is 3 units before the wall.
        let spec = Spec::flat().size(33, 65).set("up", "z");
        let spec = spec.set("camera.eye", "[0.5,-3,0.5]").set("camera.target", "[0.5,0,0.5]");
        let faces = Renderer::cpu().faces(&mesh, &spec, Watch::default()).unwrap();
        let middle = faces.depths[32 * 33 + 16];
        assert!((middle - 3.0).abs() < 1e-4, "{middle}");
    }
}
