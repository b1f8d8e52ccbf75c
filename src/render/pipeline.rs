//! The whole program in one function: bytes -> Mesh -> Scene -> DrawPlan -> back-end -> Image ->
//! encoded bytes.
//!
//! The command line and the job workers call [`render`]; the workers do so for synchronous HTTP
//! too. The library calls [`draw`], which turns a mesh that is read already into a picture.
//!
//! Invariant: nothing from here down reads a file or the environment, or knows an async runtime. A
//! clock is read to time the stages of drawing, and nothing depends on it.

use crate::backend::{BackendKind, Backends, Chosen, DrawError, DrawTimes, GpuDevice};
use crate::caption::{Scale, draw_legend};
use crate::encode::{self, EncodeError};
use crate::image::{Image, ImageFormat, RowSink};
use crate::import::{self, Bundle, Format, Imported, MeshError};
use crate::limits::{Budget, Deadline, Limits, Stopped};
use crate::mesh::Mesh;
use crate::plan::{self, DrawPlan, Prepared, Skip, UvLayout};
pub use crate::plan::{PlanError, QualitySelection};
use crate::scene::{Scene, SceneError};
use crate::sheet::{self, Canvas, Layout};
use crate::spec::{Sheet, Spec};
use crate::warning::Warning;

/// Turns the bytes of a mesh into the bytes of a picture.
///
/// `ended` is called at the end of each stage, so that the caller can keep the time.
pub fn render(
    job: Job<'_>,
    backends: &mut Backends,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Output, RenderError> {
    // Bytes -> Mesh
    let Job { bundle, format_in, spec } = job;
    let options = import::Options { format: format_in, time_s: spec.time_s, ..import::Options::default() };
    let model = Model::read(&bundle, options, limits, budget, deadline)?;
    // The files' memory is free for drawing, unless the caller holds them, too.
    drop(bundle);
    ended(Stage::Parse);

    render_model(&model, spec, backends, budget, deadline, ended)
}

/// Turns a mesh that is in memory already into the bytes of a picture.
pub fn render_model(
    model: &Model,
    spec: &Spec,
    backends: &mut Backends,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Output, RenderError> {
    // Mesh -> Scene -> DrawPlan -> Image
    let format = spec.image.format.unwrap_or(ImageFormat::Png);
    let animated = spec.sheet.as_ref().filter(|sheet| sheet.is_animated(format));
    let effort = spec.image.effort;
    // One view alone is encoded while it is drawn, as far as its format and its back-end allow it.
    let size_px = [spec.image.width_px, spec.image.height_px];
    let mut rows = match spec.sheet.is_none() && !spec.image.legend {
        true => encode::row_encoder(format, effort, size_px, spec.image.background.is_opaque()),
        false => None,
    };
    let drawn = match &spec.sheet {
        Some(sheet) => draw_sheet(model, (sheet, animated.is_some()), spec, backends, budget, deadline, ended)?,
        None => {
            let sink = rows.as_mut().map(|rows| rows as &mut dyn RowSink);
            draw_view(model.view(), spec, sink, backends, budget, deadline, ended)?
        }
    };

    // Image -> bytes
    let bytes = match (animated, rows) {
        (Some(sheet), _) => encode::encode_animation(&drawn.image, sheet.count(), format, effort, deadline)?,
        (None, Some(rows)) => rows.finish(&drawn.image)?,
        (None, None) => encode::encode(&drawn.image, format, effort, deadline)?,
    };
    ended(Stage::Encode);

    let mut warnings = [model.warnings.clone(), drawn.warnings].concat();
    if spec.camera.has_own_up() {
        warnings.retain(|warning| warning.code != import::up_axis::CODE);
    }
    let Drawn { backend, is_substitute, draw_times, skips, short_chains, selection, .. } = drawn;
    Ok(Output { bytes, format, backend, is_substitute, draw_times, skips, short_chains, warnings, selection })
}

/// Draws a mesh that is in memory already, as often as wanted. A turntable becomes a grid of its views.
pub fn draw(
    model: &Model,
    spec: &Spec,
    backends: &mut Backends,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Drawn, RenderError> {
    match &spec.sheet {
        Some(sheet) => draw_sheet(model, (sheet, false), spec, backends, budget, deadline, ended),
        None => draw_view(model.view(), spec, None, backends, budget, deadline, ended),
    }
}

/// Draws all views of a sheet: into a grid, or else as the frames of an animation, from top to bottom.
fn draw_sheet(
    model: &Model,
    (sheet, is_animated): (&Sheet, bool),
    spec: &Spec,
    backends: &mut Backends,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Drawn, RenderError> {
    let layout = Layout::new(sheet, &spec.image, is_animated);
    let mut canvas = Canvas::new(layout, budget).map_err(PlanError::Limit)?;
    let mut all: Option<Drawn> = None;
    for cell in layout.cells().filter(|cell| !cell.size_px.contains(&0)) {
        deadline.check()?;
        // What a view takes is free again before the next.
        let mut of_cell = budget.clone();
        let of_view = sheet::cell_spec(spec, sheet, &cell);
        let drawn = draw_view(model.view(), &of_view, None, backends, &mut of_cell, deadline, ended)?;
        canvas.paste(&cell, &drawn.image);
        let Some(view) = cell.view else { continue };
        if sheet.labels {
            canvas.write(&cell, &sheet::label(sheet, view));
        }
        match &mut all {
            Some(all) => all.add(drawn),
            None => all = Some(drawn),
        }
    }
    let mut all = match all {
        Some(all) => all,
        None => {
            draw_view(model.view(), &Spec { sheet: None, ..spec.clone() }, None, backends, budget, deadline, ended)?
        }
    };
    all.image = canvas.finish();
    Ok(all)
}

/// Draws one view.
pub fn draw_view(
    view: View<'_>,
    spec: &Spec,
    sink: Option<&mut dyn RowSink>,
    backends: &mut Backends,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Drawn, RenderError> {
    // Mesh -> Scene -> DrawPlan
    let layout = UvLayout::of(view.mesh, spec, budget, deadline)?;
    let of_layout = Prepared::default();
    let (mesh, spec, prepared) = match &layout {
        Some(layout) => (&layout.mesh, &layout.spec, &of_layout),
        None => (view.mesh, spec, view.prepared),
    };
    let selected = plan::select_quality(spec, mesh.triangles.len(), backends.has_gpu());
    let spec = selected.as_ref().map_or(spec, |selected| &selected.spec);
    let framing = plan::framing(mesh, spec, prepared, budget, deadline)?;
    let fitted = view.framing.or(framing.as_deref()).unwrap_or(&mesh.positions);
    let scene = Scene::framed_by(fitted, mesh, spec, budget)?;
    let plan = plan::build_from(&scene, prepared, budget, deadline)?;
    let bands_bytes = backends.bands_bytes(spec.backend, &plan);
    budget.spend("bands of the picture", bands_bytes, 1).map_err(PlanError::Limit)?;
    ended(Stage::Plan);

    // DrawPlan -> Image
    let mut drawn = backends.draw(spec.backend, &plan, sink, deadline)?;
    if spec.image.legend {
        let legends = plan.legends.iter();
        let scales = legends.map(|plan::Legend { title, ends, colors }| Scale { title, ends: *ends, colors });
        draw_legend(&mut drawn.image, &scales.collect::<Vec<_>>());
    }
    ended(Stage::Render);

    let mut warnings: Vec<Warning> = plan::unknown_materials(&scene).into_iter().collect();
    warnings.extend(selected.iter().flat_map(|selected| selected.warnings.iter().cloned()));
    warnings.extend(plan::undrawn_primitives(&scene));
    warnings.extend(plan::out_of_view(&plan));
    warnings.extend(plan.warnings.iter().chain(layout.iter().flat_map(|layout| &layout.warnings)).cloned());
    let selection = selected.as_ref().map(|selected| selected.selection.clone());
    let (skips, short_chains) = (plan.skips, plan.short_chains);
    let Chosen { image, backend, draw_times, is_substitute } = drawn;
    Ok(Drawn { image, backend, is_substitute, draw_times, skips, short_chains, warnings, selection })
}

/// Makes what a picture needs on a device and can be made without drawing, such as pipelines.
pub fn make_ready(
    model: &Model,
    spec: &Spec,
    device: &dyn GpuDevice,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<(), RenderError> {
    let make = |plan: &DrawPlan<'_>| Ok(device.make_ready(plan)?);
    with_plan(model, spec, budget, deadline, make)
}

/// The same for a picture that is drawn together with others while the device is busy.
pub fn make_ready_for_load(
    model: &Model,
    spec: &Spec,
    device: &dyn GpuDevice,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<(), RenderError> {
    let make = |plan: &DrawPlan<'_>| Ok(device.make_ready_for_load(plan)?);
    with_plan(model, spec, budget, deadline, make)
}

fn with_plan(
    model: &Model,
    spec: &Spec,
    budget: &mut Budget,
    deadline: &Deadline,
    then: impl FnOnce(&DrawPlan<'_>) -> Result<(), RenderError>,
) -> Result<(), RenderError> {
    let Model { mesh, prepared, .. } = model;
    let framing = plan::framing(mesh, spec, prepared, budget, deadline)?;
    let scene = Scene::framed_by(framing.as_deref().unwrap_or(&mesh.positions), mesh, spec, budget)?;
    then(&plan::build_from(&scene, prepared, budget, deadline)?)
}

/// A mesh in memory: imported once, and drawn as often as wanted. What one picture finds out about
/// it, such as its edges, serves the next.
#[derive(Debug, Default)]
pub struct Model {
    /// The mesh.
    mesh: Mesh,
    /// Faults of the file that were tolerated.
    warnings: Vec<Warning>,
    prepared: Prepared,
}

/// A mesh as it is drawn.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// What pictures of it have found out.
    pub prepared: &'a Prepared,
    /// Positions in the mesh's unit box to which the camera is fitted; None: those of the mesh.
    pub framing: Option<&'a [[f32; 3]]>,
}

impl Model {
    /// Reads a file.
    pub fn read(
        bundle: &Bundle,
        options: impl Into<import::Options>,
        limits: &Limits,
        budget: &mut Budget,
        deadline: &Deadline,
    ) -> Result<Self, MeshError> {
        let Imported { mesh, report, .. } = import::import(bundle, options, limits, budget, deadline)?;
        Ok(Self { mesh, warnings: report.warnings, prepared: Prepared::default() })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    fn view(&self) -> View<'_> {
        View { mesh: &self.mesh, prepared: &self.prepared, framing: None }
    }

    /// Faults of the file that were tolerated.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Memory that it takes, with what pictures have found out so far, bytes.
    pub fn bytes(&self) -> u64 {
        let warnings = self.warnings.iter().map(Warning::bytes).sum::<usize>();
        size_of::<Self>() as u64 + self.mesh.bytes() + self.prepared.bytes() + warnings as u64
    }
}

/// The input of [`render`].
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// The uploaded files: the mesh, and its materials and textures. Clones share their bytes.
    pub bundle: Bundle,
    /// The mesh's format; None: sniffed from its bytes.
    pub format_in: Option<Format>,
    /// The request.
    pub spec: &'a Spec,
}

/// The output of [`render`].
#[derive(Debug)]
pub struct Output {
    /// The encoded picture.
    pub bytes: Vec<u8>,
    /// The picture's format.
    pub format: ImageFormat,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// True if the CPU drew it because a GPU that was chosen could not.
    pub is_substitute: bool,
    /// The durations of the stages of drawing, as far as the back-end times them.
    pub draw_times: DrawTimes,
    /// The parts of drawing that the plan leaves out, with reasons.
    pub skips: Vec<Skip>,
    /// Chains of outlines that the plan leaves out because they are short.
    pub short_chains: u32,
    /// Faults that the importer noticed, and parts of the request that do not go with the mesh.
    pub warnings: Vec<Warning>,
    /// The values selected for a request with a quality target; None for other requests.
    pub selection: Option<QualitySelection>,
}

/// The output of [`draw`].
#[derive(Debug)]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// True if the CPU drew it because a GPU that was chosen could not.
    pub is_substitute: bool,
    /// The durations of the stages of drawing, as far as the back-end times them.
    pub draw_times: DrawTimes,
    /// The parts of drawing that the plan leaves out, with reasons.
    pub skips: Vec<Skip>,
    /// Chains of outlines that the plan leaves out because they are short.
    pub short_chains: u32,
    /// Parts of the request that do not go with the mesh.
    pub warnings: Vec<Warning>,
    /// The values selected for a request with a quality target; None for other requests.
    pub selection: Option<QualitySelection>,
}

impl Drawn {
    /// Adds what there is to say about another view of the same mesh.
    pub fn add(&mut self, other: Self) {
        if other.backend == BackendKind::Cpu {
            self.backend = BackendKind::Cpu;
        }
        self.is_substitute |= other.is_substitute;
        self.short_chains += other.short_chains;
        self.draw_times.mixed_pixels += other.draw_times.mixed_pixels;
        other.draw_times.parts().for_each(|(stage, took)| self.draw_times.add(stage, took));
        // Left out is what no view needed.
        self.skips.retain(|skip| other.skips.iter().any(|other| other.kind == skip.kind));
        let new = other.warnings.into_iter().filter(|warning| !self.warnings.contains(warning)).collect::<Vec<_>>();
        self.warnings.extend(new);
    }
}

/// The stages whose durations a response reports. Each is announced when it ends; of a sheet, once for each
/// view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Bytes to mesh.
    Parse,
    /// Mesh and spec to plan.
    Plan,
    /// Plan to image.
    Render,
    /// Image to bytes.
    Encode,
}

impl Stage {
    /// Its name in headers, metrics and traces.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parse => "parse",
            Self::Plan => "plan",
            Self::Render => "render",
            Self::Encode => "encode",
        }
    }
}

/// Errors of [`render`] and [`draw`], by who is at fault.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The mesh is at fault.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh and the request do not go together, or take more than is allowed.
    #[error(transparent)]
    Plan(PlanError),
    /// Time was up, or the job was cancelled.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The back-end failed.
    #[error(transparent)]
    Draw(DrawError),
    /// The encoder failed.
    #[error(transparent)]
    Encode(EncodeError),
}

impl From<PlanError> for RenderError {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Stopped(stopped) => Self::Stopped(stopped),
            other => Self::Plan(other),
        }
    }
}

impl From<DrawError> for RenderError {
    fn from(error: DrawError) -> Self {
        match error {
            DrawError::Stopped(stopped) => Self::Stopped(stopped),
            other => Self::Draw(other),
        }
    }
}

impl From<EncodeError> for RenderError {
    fn from(error: EncodeError) -> Self {
        match error {
            EncodeError::Stopped(stopped) => Self::Stopped(stopped),
            other => Self::Encode(other),
        }
    }
}

impl From<SceneError> for RenderError {
    fn from(error: SceneError) -> Self {
        Self::Plan(error.into())
    }
}
