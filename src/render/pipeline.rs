//! The pipeline, which is the whole program in one function: bytes -> Mesh -> Scene -> DrawPlan ->
//! back-end -> Image -> encoded bytes.
//!
//! The command line and the job workers call [`render`]; the workers do so for synchronous HTTP
//! too, and call [`render_model`] for a stored mesh. The library calls [`draw`], which turns a mesh
//! that is read already into a picture.
//!
//! Invariant: nothing from here down knows an async runtime, or reads or writes a file or the
//! environment, except the file of a GPU's compiled pipelines, and except in `ignore_displays`, which
//! the program calls at its start. Clocks are read to time the stages of drawing, to choose the back-end
//! while the GPU is busy, and to pause a GPU that was lost several times. Nothing else depends on time,
//! except that a GPU that does not answer for two minutes counts as lost.

mod faces;

pub use faces::{FaceBuffer, find_faces};

use crate::backend::{BackendKind, Backends, Chosen, DrawError, DrawTimes, Renderer};
use crate::caption::{Scale, draw_legend};
use crate::encode::{self, EncodeError};
use crate::image::{Image, ImageFormat, LinearImage, RowSink};
use crate::import::{self, Bundle, Format, ImportReport, MeshError};
use crate::limits::{Budget, Deadline, Limits, Stopped};
use crate::mesh::Mesh;
use crate::plan::{self, DrawPlan, Prepared, Skip, UvLayout};
pub use crate::plan::{PlanError, QualitySelection};
use crate::scene::{Scene, SceneError};
use crate::sheet::{self, Canvas, Cell, Layout};
use crate::spec::{Sheet, Spec};
use crate::warning::Warning;

/// The back-ends that draw a picture, the memory and time that it may take, and the listener to its stages.
pub struct Context<'a> {
    /// The back-ends.
    pub backends: &'a mut Backends,
    /// The memory that is left.
    pub budget: Budget,
    /// A flag that ends the work.
    pub deadline: &'a Deadline,
    /// Called at the end of each stage, so that the caller can keep the time.
    pub ended: &'a mut dyn FnMut(Stage),
}

/// Turns the bytes of a mesh into the bytes of a picture.
///
/// `limits` are those of the file; the memory that is left is the context's.
pub fn render(job: Job<'_>, limits: &Limits, cx: Context<'_>) -> Result<Output, RenderError> {
    // Bytes -> Mesh
    let Job { bundle, format_in, spec } = job;
    let options = import::Options { format: format_in, time_s: spec.time_s, ..import::Options::default() };
    let model = Model::read(&bundle, options, limits, cx.budget, cx.deadline)?;
    // The files' memory is free for drawing, unless the caller holds them, too.
    drop(bundle);
    (cx.ended)(Stage::Parse);

    render_model(&model, spec, Context { budget: model.budget.clone(), ..cx })
}

/// Turns a mesh that is in memory already into the bytes of a picture.
pub fn render_model(model: &Model, spec: &Spec, mut cx: Context<'_>) -> Result<Output, RenderError> {
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
    let Drawn { image, mut report } = match &spec.sheet {
        Some(sheet) => draw_sheet(model.view(), (sheet, animated.is_some()), spec, &mut cx)?,
        None => draw_view(model.view(), spec, rows.as_mut().map(|rows| rows as &mut dyn RowSink), &mut cx)?,
    };

    // Image -> bytes
    let bytes = match (animated, rows) {
        (Some(sheet), _) => encode::encode_animation(&image, sheet.count(), format, effort, cx.deadline)?,
        (None, Some(rows)) => rows.finish(&image)?,
        (None, None) => encode::encode(&image, format, effort, cx.deadline)?,
    };
    (cx.ended)(Stage::Encode);

    let mut warnings = [model.report.warnings.clone(), report.warnings].concat();
    if spec.camera.has_own_up() {
        warnings.retain(|warning| warning.code != import::up_axis::CODE);
    }
    report.warnings = warnings;
    Ok(Output { bytes, format, report })
}

/// Draws a mesh that is in memory already, as often as wanted. A turntable becomes a grid of its views.
pub fn draw(model: &Model, spec: &Spec, mut cx: Context<'_>) -> Result<Drawn, RenderError> {
    match &spec.sheet {
        Some(sheet) => draw_sheet(model.view(), (sheet, false), spec, &mut cx),
        None => draw_view(model.view(), spec, None, &mut cx),
    }
}

/// Bytes per pixel of a picture in linear light: its half floats, and the colours that they are rounded from.
const LINEAR_BYTES: u64 = 8 + 16;

/// The same in linear light, of one view: a sheet and a legend are left out.
pub fn draw_linear(model: &Model, spec: &Spec, mut cx: Context<'_>) -> Result<Drawn<LinearImage>, RenderError> {
    let spec = Spec { sheet: None, ..spec.clone() };
    let pixels = u64::from(spec.image.width_px) * u64::from(spec.image.height_px);
    cx.budget.spend("the picture in linear light", pixels, LINEAR_BYTES).map_err(PlanError::Limit)?;
    let mut draw =
        |renderer: &mut dyn Renderer, plan: &DrawPlan<'_>, deadline: &Deadline| renderer.draw_linear(plan, deadline);
    draw_view_by(model.view(), &spec, &mut cx, &mut draw, |_, _, _| {})
}

/// Draws all views of a sheet: into a grid, or else as the frames of an animation, from top to bottom.
fn draw_sheet(
    view: View<'_>,
    (sheet, is_animated): (&Sheet, bool),
    spec: &Spec,
    cx: &mut Context<'_>,
) -> Result<Drawn, RenderError> {
    let layout = Layout::new(sheet, &spec.image, is_animated);
    let draw = |cell: Option<&Cell>, cx: &mut Context<'_>| {
        let of_cell = match cell {
            Some(cell) => sheet::cell_spec(spec, sheet, cell),
            None => Spec { sheet: None, ..spec.clone() },
        };
        draw_view(view, &of_cell, None, cx)
    };
    draw_cells(layout, cx, draw, |view| sheet.labels.then(|| sheet::label(sheet, view)))
}

/// Draws the cells of a layout one after the other into one picture, each within the memory that is left, and writes the
/// label of each view into its cell. `draw` is called without a cell where the picture has no room for any: what is known
/// of that drawing is reported, and its image is dropped.
pub fn draw_cells(
    layout: Layout,
    cx: &mut Context<'_>,
    mut draw: impl FnMut(Option<&Cell>, &mut Context<'_>) -> Result<Drawn, RenderError>,
    label: impl Fn(u32) -> Option<String>,
) -> Result<Drawn, RenderError> {
    let mut canvas = Canvas::new(layout, &mut cx.budget).map_err(PlanError::Limit)?;
    let mut all: Option<DrawReport> = None;
    for cell in layout.cells().filter(|cell| !cell.size_px.contains(&0)) {
        cx.deadline.check()?;
        // What a cell takes is free again before the next.
        let budget = cx.budget.clone();
        let Context { backends, deadline, ended, .. } = cx;
        let mut of_cell = Context { backends, budget, deadline, ended: &mut **ended };
        let drawn = draw(Some(&cell), &mut of_cell)?;
        canvas.paste(&cell, &drawn.image);
        let Some(view) = cell.view else { continue };
        if let Some(label) = label(view) {
            canvas.write(&cell, &label);
        }
        match &mut all {
            Some(all) => all.add(drawn.report),
            None => all = Some(drawn.report),
        }
    }
    let report = match all {
        Some(all) => all,
        None => draw(None, cx)?.report,
    };
    Ok(Drawn { image: canvas.finish(), report })
}

/// Draws one view.
pub fn draw_view(
    view: View<'_>,
    spec: &Spec,
    mut sink: Option<&mut dyn RowSink>,
    cx: &mut Context<'_>,
) -> Result<Drawn, RenderError> {
    let mut draw = |renderer: &mut dyn Renderer, plan: &DrawPlan<'_>, deadline: &Deadline| match sink.as_deref_mut() {
        Some(sink) => renderer.draw_rows(plan, sink, deadline),
        None => renderer.draw(plan, deadline),
    };
    draw_view_by(view, spec, cx, &mut draw, |image, spec, plan| {
        if spec.image.legend {
            let legends = plan.legends.iter();
            let scales = legends.map(|plan::Legend { title, ends, colors }| Scale { title, ends: *ends, colors });
            draw_legend(image, &scales.collect::<Vec<_>>());
        }
    })
}

/// Draws a plan on a back-end.
type Draw<'a, I> = &'a mut dyn FnMut(&mut dyn Renderer, &DrawPlan<'_>, &Deadline) -> Result<I, DrawError>;

/// Has a back-end draw one view, and finishes its picture.
fn draw_view_by<I>(
    view: View<'_>,
    spec: &Spec,
    cx: &mut Context<'_>,
    draw: Draw<'_, I>,
    finish: impl FnOnce(&mut I, &Spec, &DrawPlan<'_>),
) -> Result<Drawn<I>, RenderError> {
    let Context { backends, budget, deadline, ended } = cx;
    let has_gpu = backends.has_gpu();
    with_scene(view, spec, has_gpu, budget, deadline, |staged, budget| {
        let Staged { scene, prepared, mut warnings, selection, .. } = staged;
        // Scene -> DrawPlan
        let plan = plan::build_from(&scene, prepared, budget, deadline)?;
        let bands_bytes = backends.bands_bytes(scene.spec.backend, &plan);
        budget.spend("bands of the picture", bands_bytes, 1).map_err(PlanError::Limit)?;
        ended(Stage::Plan);

        // DrawPlan -> Image
        let mut drawn = backends.draw_by(scene.spec.backend, &plan, &mut |renderer| draw(renderer, &plan, deadline))?;
        finish(&mut drawn.image, scene.spec, &plan);
        ended(Stage::Render);

        let of_layout = std::mem::take(&mut warnings.of_layout);
        let mut all: Vec<Warning> = plan::unknown_materials(&scene).into_iter().collect();
        all.append(&mut warnings.of_selection);
        all.extend(plan::undrawn_primitives(&scene));
        all.extend(plan::out_of_view(&plan));
        all.extend(plan.warnings.iter().cloned().chain(of_layout));
        let (skips, short_chains) = (plan.skips, plan.short_chains);
        let Chosen { image, backend, draw_times, is_substitute } = drawn;
        let report = DrawReport { backend, is_substitute, draw_times, skips, short_chains, warnings: all, selection };
        Ok(Drawn { image, report })
    })
}

/// A scene before it is planned, and what led to it.
pub struct Staged<'v, 's> {
    /// The scene.
    pub scene: Scene<'v, 's>,
    /// True if the mesh of the scene is the layout of its texture, and not the mesh itself.
    pub is_uv_layout: bool,
    prepared: &'v Prepared,
    warnings: StagingWarnings,
    selection: Option<QualitySelection>,
}

/// Warnings of what precedes the plan.
#[derive(Default)]
struct StagingWarnings {
    of_selection: Vec<Warning>,
    of_layout: Vec<Warning>,
}

/// The recipe for a scene: the request with the quality that is selected for its target, the mesh or the layout of its
/// texture, and the camera that frames it.
pub fn with_scene<R>(
    view: View<'_>,
    spec: &Spec,
    has_gpu: bool,
    budget: &mut Budget,
    deadline: &Deadline,
    then: impl FnOnce(Staged<'_, '_>, &mut Budget) -> Result<R, RenderError>,
) -> Result<R, RenderError> {
    let layout = UvLayout::of(view.mesh, spec, budget, deadline)?;
    let of_layout = Prepared::default();
    let (mesh, spec, prepared) = match &layout {
        Some(layout) => (&layout.mesh, &layout.spec, &of_layout),
        None => (view.mesh, spec, view.prepared),
    };
    let selected = plan::select_quality(spec, mesh.triangles.len(), has_gpu);
    let spec = selected.as_ref().map_or(spec, |selected| &selected.spec);
    let framing = match view.framing {
        Some(_) => None,
        None => plan::framing(mesh, spec, prepared, budget, deadline)?,
    };
    let boxes = prepared.position_boxes(mesh, budget).map_err(SceneError::Limit)?;
    let scene = Scene::framed_by(view.framing.or(framing.as_deref()), &boxes, mesh, spec, budget)?;
    let warnings = StagingWarnings {
        of_selection: selected.as_ref().map(|selected| selected.warnings.clone()).unwrap_or_default(),
        of_layout: layout.as_ref().map(|layout| layout.warnings.clone()).unwrap_or_default(),
    };
    let selection = selected.as_ref().map(|selected| selected.selection.clone());
    then(Staged { scene, is_uv_layout: layout.is_some(), prepared, warnings, selection }, budget)
}

/// Plans a picture and gives the plan away before anything is drawn, for devices that make ready ahead what pictures
/// need, such as pipelines.
pub fn with_plan(
    model: &Model,
    spec: &Spec,
    budget: &mut Budget,
    deadline: &Deadline,
    then: impl FnOnce(&DrawPlan<'_>) -> Result<(), DrawError>,
) -> Result<(), RenderError> {
    let has_gpu = true; // that makes ready
    with_scene(model.view(), spec, has_gpu, budget, deadline, |staged, budget| {
        Ok(then(&plan::build_from(&staged.scene, staged.prepared, budget, deadline)?)?)
    })
}

/// A mesh in memory: imported once, and drawn, judged and compared as often as wanted. What one picture finds out about
/// it, such as its edges, serves the next.
#[derive(Debug)]
pub struct Model {
    mesh: Mesh,
    report: ImportReport,
    prepared: Prepared,
    budget: Budget,
}

/// A mesh as it is drawn.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Facts about the mesh, such as its edges, that earlier pictures have found.
    pub prepared: &'a Prepared,
    /// Positions in the mesh's unit box to which the camera is fitted; None: those of the mesh.
    pub framing: Option<&'a [[f32; 3]]>,
}

impl Model {
    /// Reads a file, which takes its memory from the budget. The rest is for what is done with the mesh.
    pub fn read(
        bundle: &Bundle,
        options: impl Into<import::Options>,
        limits: &Limits,
        mut budget: Budget,
        deadline: &Deadline,
    ) -> Result<Self, MeshError> {
        let (mesh, report) = import::import(bundle, options, limits, &mut budget, deadline)?;
        Ok(Self { mesh, report, prepared: Prepared::default(), budget })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The report on its file.
    pub fn report(&self) -> &ImportReport {
        &self.report
    }

    /// The mesh as it is drawn, with the camera fitted to it.
    pub fn view(&self) -> View<'_> {
        View { mesh: &self.mesh, prepared: &self.prepared, framing: None }
    }

    /// The job's budget after reading it.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// The job's budget after reading it and another mesh, if there is one.
    pub fn budget_beside(&self, other: Option<&Self>) -> Result<Budget, MeshError> {
        let mut budget = self.budget.clone();
        if let Some(other) = other {
            budget.spend("the other mesh", other.budget.spent_bytes(), 1)?;
        }
        Ok(budget)
    }

    /// The same with a budget that borrows from no lender, for a mesh that outlives its job.
    #[must_use]
    pub fn without_lender(self) -> Self {
        Self { budget: self.budget.lent_by(None, 0), ..self }
    }

    /// Memory that it takes, with what pictures have found out so far, bytes.
    pub fn bytes(&self) -> u64 {
        size_of::<Self>() as u64 + self.mesh.bytes() + self.report.bytes() + self.prepared.bytes()
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
    /// The way it was drawn, with the warnings of its mesh.
    pub report: DrawReport,
}

/// The output of [`draw`].
#[derive(Debug)]
pub struct Drawn<I = Image> {
    /// The picture.
    pub image: I,
    /// The way it was drawn.
    pub report: DrawReport,
}

/// The way a picture was drawn.
#[derive(Debug)]
pub struct DrawReport {
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// True if the CPU drew it because a GPU that was chosen could not.
    pub is_substitute: bool,
    /// The durations of the stages of drawing, as far as the back-end times them.
    pub draw_times: DrawTimes,
    /// The parts of drawing that the plan leaves out, with reasons.
    pub skips: Vec<Skip>,
    /// Chains of feature edges and outlines that the plan leaves out because they are short.
    pub short_chains: u32,
    /// Parts of the request that do not go with the mesh.
    pub warnings: Vec<Warning>,
    /// The values selected for a request with a quality target; None for other requests.
    pub selection: Option<QualitySelection>,
}

impl DrawReport {
    /// Adds what there is to say about another view of the same mesh.
    fn add(&mut self, other: Self) {
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
#[non_exhaustive]
pub enum Stage {
    /// Bytes to mesh.
    Parse,
    /// Mesh and spec to plan.
    Plan,
    /// Plan to image.
    Render,
    /// Image to bytes.
    Encode,
    /// Meshes to a verdict, or to a difference.
    Judge,
}

impl Stage {
    /// Its name in headers and traces.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parse => "parse",
            Self::Plan => "plan",
            Self::Render => "render",
            Self::Encode => "encode",
            Self::Judge => "judge",
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
