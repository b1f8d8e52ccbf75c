//! The whole program in one function: bytes -> Mesh -> DrawPlan -> Image -> encoded bytes.
//!
//! The command line, the synchronous HTTP handler and the job workers all call [`render`]; who asks what is in a file instead
//! of drawing it calls [`inspect`].
//!
//! Architecture invariant: nothing from here down reads a clock, a file, the environment, or knows an async runtime.

use crate::import;
use std::collections::BTreeSet;

use crate::backend::{BackendKind, Backends, DrawError};
use crate::encode::{self, EncodeError};
use crate::image::{Image, ImageFormat};
use crate::import::{Bundle, Format, Imported, MeshError};
use crate::limits::{Budget, Deadline, Limits, Stopped};
use crate::mesh::Mesh;
use crate::plan::{self, Skip};
pub use crate::plan::{Choice, PlanError};
use crate::report::Report;
use crate::spec::Spec;
use crate::warning::Warning;

/// What comes in.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The mesh and what came along with it.
    pub bundle: &'a Bundle,
    /// Overrides sniffing.
    pub format_in: Option<Format>,
    /// What to draw.
    pub spec: &'a Spec,
}

/// What goes out.
#[derive(Debug)]
pub struct Output {
    /// The encoded picture.
    pub bytes: Vec<u8>,
    /// Its format.
    pub format: ImageFormat,
    /// Who drew it.
    pub backend: BackendKind,
    /// What the plan left out, and why.
    pub skips: Vec<Skip>,
    /// What the importer noticed, and what of the request does not go with the mesh.
    pub warnings: Vec<Warning>,
    /// What was chosen for a request that asks for an error or a time; None for others.
    pub choice: Option<Choice>,
}

/// The stages whose durations a response reports. Each is announced when it ends.
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

/// Why there is no picture, by who is at fault.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The mesh is.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh and the request do not go together, or want more than is allowed.
    #[error(transparent)]
    Plan(PlanError),
    /// Nobody: time was up, or the job was cancelled.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// We are: the back-end failed.
    #[error(transparent)]
    Draw(DrawError),
    /// We are: the encoder failed.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// We are: the report could not be written.
    #[error("the report could not be written: {0}")]
    Report(#[from] serde_json::Error),
}

/// A mesh's picture, not yet encoded.
#[derive(Debug)]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// The back-end that drew it.
    pub backend: BackendKind,
    /// What the plan left out, and why.
    pub skips: Vec<Skip>,
    /// What of the request does not go with the mesh.
    pub warnings: Vec<Warning>,
    /// What was chosen for a request that asks for an error or a time; None for others.
    pub choice: Option<Choice>,
}

/// Turns a file into the bytes of a picture.
pub fn render(
    job: Job<'_>,
    backends: &mut Backends,
    limits: &Limits,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Output, RenderError> {
    let mut budget = Budget::new(limits);

    let options = import::Options { format: job.format_in, time_s: job.spec.time_s };
    let Imported { mesh, report } = import::import(job.bundle, options, limits, &mut budget, deadline)?;
    ended(Stage::Parse);

    let drawn = draw(&mesh, job.spec, backends, &mut budget, deadline, ended)?;

    let format = job.spec.image.format.unwrap_or(ImageFormat::Png);
    let bytes = encode::encode(&drawn.image, format)?;
    ended(Stage::Encode);

    let warnings = [report.warnings, drawn.warnings].concat();
    let Drawn { backend, skips, choice, .. } = drawn;
    Ok(Output { bytes, format, backend, skips, warnings, choice })
}

/// Turns a mesh into a picture.
pub fn draw(
    mesh: &Mesh,
    spec: &Spec,
    backends: &mut Backends,
    budget: &mut Budget,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Drawn, RenderError> {
    let mut mesh = mesh.clone();
    let mut warnings: Vec<Warning> = unknown_materials(&mesh, spec).into_iter().collect();
    let mut chosen = plan::choose(spec, mesh.triangles.len(), backends.has_gpu());
    warnings.extend(chosen.iter_mut().flat_map(|chosen| std::mem::take(&mut chosen.warnings)));
    let spec = chosen.as_ref().map_or(spec, |chosen| &chosen.spec);
    warnings.extend(plan::thicken(&mut mesh, spec, budget, deadline)?);
    let plan = plan::build(&mesh, spec, budget, deadline)?;
    if plan::is_out_of_view(&plan) {
        let detail = "the camera looks past the whole mesh, and the picture is blank".to_owned();
        warnings.push(Warning { code: "mesh_out_of_view", detail });
    }
    let bands = backends.bands_bytes(spec.backend, &plan);
    budget.spend("bands of the picture", bands, 1).map_err(PlanError::Limit)?;
    ended(Stage::Plan);

    let drawn = backends.draw(spec.backend, &plan, deadline)?;
    ended(Stage::Render);

    let choice = chosen.map(|chosen| chosen.choice);
    Ok(Drawn { image: drawn.image, backend: drawn.backend, skips: plan.skips, warnings, choice })
}

/// Says what is in a file.
pub fn inspect(
    bundle: &Bundle,
    options: impl Into<import::Options>,
    limits: &Limits,
    deadline: &Deadline,
    ended: &mut dyn FnMut(Stage),
) -> Result<Report, MeshError> {
    let mut budget = Budget::new(limits);
    let Imported { mesh, report } = import::import(bundle, options, limits, &mut budget, deadline)?;
    ended(Stage::Parse);
    Report::of(&mesh, &report, bundle.bytes_len(), &mut budget, deadline)
}

/// A look for a material that the mesh does not have is most likely a misspelt name.
fn unknown_materials(mesh: &Mesh, spec: &Spec) -> Option<Warning> {
    const SHOWN_MAX: usize = 12;
    let quoted = |name: &str| format!("{:?}", name.chars().take(40).collect::<String>());
    let known: BTreeSet<&str> = mesh.materials.iter().map(|slot| slot.name.as_str()).collect();
    let mut unknown = spec.materials.iter().map(|(name, _)| name.as_str()).filter(|name| !known.contains(name));
    let first = unknown.next()?;
    let more = match unknown.count() {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let has: Vec<String> = known.iter().take(SHOWN_MAX).map(|name| quoted(name)).collect();
    let etc = if known.len() > SHOWN_MAX { ", ..." } else { "" };
    let detail = format!("the mesh has no material {}{more}; it has {}{etc}", quoted(first), has.join(", "));
    Some(Warning { code: "material_unknown", detail })
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
