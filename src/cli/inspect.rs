//! `meshsnap inspect`.

use clap::Args;

use super::complaint::Complaint;
use super::progress::Progress;
use super::render::format_in;
use super::settings::LimitSettings;
use super::{bundle, files};
use crate::limits::{Budget, Deadline};
use crate::mesh;
use crate::report::Report;

/// Arguments of `inspect`.
#[derive(Args)]
pub struct InspectArgs {
    /// Mesh file (OBJ, STL, PLY, glTF, GLB) and the files it refers to, or a .zip of them; `-` for standard input
    #[arg(required = true, value_name = "MESH")]
    meshes: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Format of the mesh, where its bytes do not tell: obj, gltf, glb, stl or ply
    #[arg(long, value_name = "FORMAT")]
    format_in: Option<String>,
    /// Which of several files is the mesh, where more than one could be
    #[arg(long, value_name = "FILE")]
    entry: Option<String>,
    #[command(flatten)]
    limits: LimitSettings,
}

/// Prints what is in a file.
pub fn run(arguments: &InspectArgs) -> Result<(), Complaint> {
    let limits = arguments.limits.config().limits;
    let format = format_in(arguments.format_in.as_deref())?;
    let progress = Progress::start("reading");
    let mesh_name = bundle::name(&arguments.meshes);
    let bundle = bundle::read(&arguments.meshes, arguments.entry.clone(), &limits)?;
    progress.next("parsing");
    let mut budget = Budget::new(&limits);
    let deadline = Deadline::default();
    let about = |error: mesh::MeshError| Complaint::from(error).about(mesh_name);
    let mesh = mesh::import(&bundle, format, &limits, &mut budget, &deadline).map_err(about)?;
    progress.next("counting edges");
    let report = Report::of(&mesh, bundle.bytes_len(), &mut budget, &deadline).map_err(about)?;
    drop(progress);
    let text = if arguments.json {
        let json = serde_json::to_string_pretty(&report);
        json.map_err(|error| Complaint::ours(error.to_string()))? + "\n"
    } else {
        report.text()
    };
    files::print(text.as_bytes())
}
