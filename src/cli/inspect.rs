//! `meshsnap inspect`.

use clap::Args;

use super::complaint::Complaint;
use super::progress::Progress;
use super::render::format_in;
use super::settings::LimitSettings;
use super::{bundle, files};
use crate::limits::Deadline;
use crate::pipeline;

/// Arguments of `inspect`.
#[derive(Args)]
pub struct InspectArgs {
    /// Mesh file (OBJ, STL, PLY, OFF, FBX, 3MF, glTF, GLB; known by its bytes, whatever its name) and the files it refers to, or
    /// a .zip of them; `-` for standard input. An animated file is measured as it stands when nothing moves it
    #[arg(required = true, value_name = "MESH")]
    meshes: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Format of the mesh, where its bytes do not tell: obj, gltf, glb, stl, ply, off, fbx or 3mf
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
    let mut parsed = |_| progress.next("counting edges");
    let report = pipeline::inspect(&bundle, format, &limits, &Deadline::default(), &mut parsed)
        .map_err(|error| Complaint::from(error).about(mesh_name))?;
    drop(progress);
    let text =
        if arguments.json { report.json().map_err(|error| Complaint::ours(error.to_string()))? } else { report.text() };
    files::print(text.as_bytes())
}
