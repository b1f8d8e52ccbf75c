//! `meshsnap inspect`: reports the content of a mesh file.

mod lines;

use clap::{Args, ValueHint};

use super::format_arg::FormatArg;
use super::progress::Progress;
use super::render::pairs;
use super::settings::LimitSettings;
use super::{bundle, files, isolation};
use crate::error::CliError;
use meshsnap_inspect::report;
use meshsnap_inspect::report::Extras;
use meshsnap_render::import::{self, Format};
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::request::{self, Rules};
use meshsnap_render::spec::BackendChoice;

/// Examples at the end of `--help`.
pub const EXAMPLES: &str = "\
Examples:
  meshsnap inspect knot.obj
  meshsnap inspect model.obj model.mtl wood.png --json
  meshsnap inspect part.stl --print --parts
  meshsnap inspect model.glb --uv
  meshsnap inspect parts/ 'more/*.obj' --jsonl
  meshsnap inspect walk.glb --set scene.time_s=0.5";

/// Arguments of `inspect`.
#[derive(Args)]
pub struct InspectArgs {
    #[arg(
        required = true,
        value_name = "MESH",
        value_hint = ValueHint::FilePath,
        help = format!(
            "Mesh file ({}; known by its bytes, whatever its name) and the files it refers to, \
             or a .zip of them; `-` for standard input",
            Format::list()
        )
    )]
    meshes: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Take each name for a mesh of its own, or a folder or a pattern of meshes, and print the report on each as a line of
    /// JSON, in the order of their paths
    #[arg(long, conflicts_with_all = ["json", "entry"])]
    jsonl: bool,
    /// Report what matters for printing, too: thickness of walls, overhangs, the way in which it stands
    #[arg(long)]
    print: bool,
    /// Report each connected part, too, and the loops of open and sharp edges, with their lengths
    #[arg(long)]
    parts: bool,
    /// Report the charts of the texture, too: their areas, how much they stretch it, and where they overlap
    #[arg(long)]
    uv: bool,
    #[command(flatten)]
    format_in: FormatArg,
    /// The mesh among several files, where more than one could be
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    entry: Option<String>,
    /// scene.time_s=SECONDS: an animated file at that moment; without it, the rest pose
    #[arg(long, value_name = "KEY=VALUE", value_hint = ValueHint::Other)]
    set: Vec<String>,
    #[command(flatten)]
    limits: LimitSettings,
}

impl InspectArgs {
    fn extras(&self) -> Extras {
        Extras { print: self.print, parts: self.parts, uv: self.uv }
    }
}

/// Prints the report.
pub fn run(arguments: &InspectArgs) -> Result<(), CliError> {
    isolation::on_demand();
    let limits = arguments.limits.config().limits;
    let format = arguments.format_in.format();
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
    let time_s = request::read_moment(&pairs(&arguments.set)?, &rules)
        .map_err(|error| CliError::usage(format!("--set: {error}")))?;
    let options = import::Options { format, time_s, ..import::Options::default() };
    if arguments.jsonl {
        return lines::run(arguments, options, limits);
    }
    let progress = Progress::start("reading");
    let mesh_name = bundle::name(&arguments.meshes);
    let named = bundle::read(&arguments.meshes, arguments.entry.clone(), &limits)?;
    let (paths, archives) = named.paths();
    progress.next("parsing");
    let mut parsed = |_| progress.next("counting edges");
    let mut budget = Budget::new(&limits);
    let report = report::inspect(
        &named.bundle,
        options,
        arguments.extras(),
        &limits,
        &mut budget,
        &Deadline::default(),
        &mut parsed,
    )
    .map_err(|error| CliError::from(error).about(mesh_name))?;
    drop(progress);
    for sentence in bundle::unused(&paths, &named.file_use, |path| archives.iter().any(|archive| archive == path)) {
        say!("meshsnap: {sentence}");
    }
    let text =
        if arguments.json { report.json().map_err(|error| CliError::ours(error.to_string()))? } else { report.text() };
    files::print(text.as_bytes())
}
