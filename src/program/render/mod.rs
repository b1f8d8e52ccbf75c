//! `meshsnap render`: draws a mesh into an image file, or each of several meshes into a file of a
//! folder.

mod batch;
mod explain;
mod one;
mod spec;
mod tasks;
mod watch;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use clap::{Args, ValueHint};

use super::isolation;
use super::output::{Destination, Inputs};
use super::settings::LimitSettings;
use super::siblings;
use crate::bundle::comparable;
use crate::error::CliError;
use batch::Batch;
use meshsnap_render::image::ImageFormat;
use meshsnap_render::import::{Format, Options};
use meshsnap_render::limits::Limits;
use meshsnap_render::mesh::UpAxis;
use meshsnap_render::request::{Style, Words, word_for, words_of};
use meshsnap_render::spec::{BackendChoice, NamedView, Spec};
use meshsnap_server::telemetry;
use one::Drawing;
pub use spec::{by_extension, format_in, pairs};
pub use tasks::{Task, Tasks, find, is_companion};
use watch::{Changed, Watched};

/// Examples at the end of `--help`.
pub const EXAMPLES: &str = "\
Examples:
  meshsnap render knot.obj -o knot.png --style wire --size 800x600 --view top
  meshsnap render model.obj model.mtl wood.png -o model.webp --background transparent
  meshsnap render knot.obj -o sheet.png --sheet front,left,top,iso
  meshsnap render knot.obj -o turn.webp --turntable 24
  meshsnap render models/ 'more/*.stl' -o pictures/ --size 256
  meshsnap render knot.obj -o knot.png --watch
  meshsnap render - -o - --set wire.color=#f00 < knot.obj > knot.png

Without --siblings, no file is read that is not named. Exit codes: 0 done, 1 the mesh or the
request document is at fault, 2 the command line is, 3 meshsnap or the machine is.";

/// Arguments of `render`.
#[derive(Args)]
pub struct RenderArgs {
    #[arg(
        required = true,
        value_name = "MESH",
        value_hint = ValueHint::FilePath,
        help = format!(
            "Mesh file ({}) and the files it refers to, or a .zip of them; `-` for standard input",
            Format::list()
        )
    )]
    pub meshes: Vec<String>,
    /// Image file, `-` for standard output, or a folder (DIR/) for a picture of each mesh
    ///
    /// Image file, `-` for standard output, or a folder, such as pictures/, for a picture of each mesh
    /// that is named. The file's extension chooses the format unless --format does
    #[arg(short, long, value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub output: String,

    #[arg(long, help = "Preset", value_parser = words::<Style>(), help_heading = LOOK)]
    pub style: Option<String>,
    /// N or WxH, in pixels
    #[arg(long, value_name = "N|WxH", value_hint = ValueHint::Other, help_heading = LOOK)]
    pub size: Option<String>,
    #[arg(long, help = "Named direction", value_parser = words::<NamedView>(), help_heading = LOOK)]
    pub view: Option<String>,
    #[arg(long, allow_hyphen_values = true, help = "Axis that points up", value_parser = words::<UpAxis>(), help_heading = LOOK)]
    pub up: Option<String>,
    /// #rgb, #rrggbb, #rrggbbaa or transparent; or two of them from top to bottom: #fff..#dde
    #[arg(long, value_name = "COLOR", value_hint = ValueHint::Other, help_heading = LOOK)]
    pub background: Option<String>,
    #[arg(
        long,
        value_name = "V,V,...",
        help = "Several views in one picture",
        value_delimiter = ',',
        value_parser = words::<NamedView>(),
        help_heading = LOOK
    )]
    pub sheet: Vec<String>,
    /// N views from all around: an animated PNG or WebP, or with --set sheet.columns=C a grid
    #[arg(long, value_name = "N", value_hint = ValueHint::Other, help_heading = LOOK)]
    pub turntable: Option<String>,
    #[arg(long, help = "Image format", value_parser = words::<ImageFormat>(), help_heading = LOOK)]
    pub format: Option<String>,
    /// Dotted key of the request document, such as wire.color=#f00; may be repeated
    ///
    /// Such as wire.color=#f00, outline={}, wire=null or materials.Glass.surface.opacity=0.3, or a
    /// whole section as JSON: outline={"thickness":8}. May be repeated; a later one overrides an
    /// earlier one, and the flags beside it
    #[arg(long, value_name = "KEY=VALUE", value_hint = ValueHint::Other, help_heading = LOOK)]
    pub set: Vec<String>,
    /// Request document (JSON; `meshsnap serve` has its schema at /v1/schema)
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath, help_heading = LOOK, hide_short_help = true)]
    pub request: Option<PathBuf>,
    /// Samples per pixel; by default 4, or 16 up to 256 x 256 pixels without wires; adaptive: 4, and 64 or 256 points in pixels near
    /// which faces differ in colour
    #[arg(long, value_name = "N", value_parser = ["adaptive", "1", "4", "8", "16"], help_heading = LOOK, hide_short_help = true)]
    pub samples: Option<String>,

    #[arg(
        long,
        value_name = "FORMAT",
        help = "Format of the mesh, where its bytes do not tell",
        value_parser = PossibleValuesParser::new(Format::names()),
        ignore_case = true,
        help_heading = FILES,
        hide_short_help = true
    )]
    pub format_in: Option<String>,
    /// The mesh among several files, where more than one could be
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = FILES, hide_short_help = true)]
    pub entry: Option<String>,
    /// Read the files that the mesh refers to from its own folder, though they are not named
    #[arg(long, help_heading = FILES, hide_short_help = true)]
    pub siblings: bool,
    /// Draw again whenever a file that is read has changed, until Ctrl-C
    #[arg(long, help_heading = FILES)]
    pub watch: bool,

    #[arg(long, help = "Back-end", value_parser = words::<BackendChoice>(), help_heading = MACHINE, hide_short_help = true)]
    pub backend: Option<String>,
    /// Threads that read, plan, draw and decode textures [default: one for each processor]
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=1024),
        value_hint = ValueHint::Other,
        help_heading = MACHINE,
        hide_short_help = true
    )]
    pub threads: Option<u16>,
    /// Folder for what the GPU's driver makes of shaders, so that the next start is faster
    #[arg(
        long,
        value_name = "FOLDER",
        env = "MESHSNAP_CACHE_DIR",
        value_hint = ValueHint::DirPath,
        help_heading = MACHINE,
        hide_short_help = true
    )]
    pub cache_dir: Option<PathBuf>,
    /// Print the work that was skipped, and the time of each stage
    #[arg(long)]
    pub explain: bool,
    #[command(flatten)]
    pub limits: LimitSettings,
}

/// Headings of `--help`.
const LOOK: &str = "Picture";
const FILES: &str = "Files";
const MACHINE: &str = "Machine";

/// The words of an enumeration, as the only values of a flag.
fn words<T: Words>() -> PossibleValuesParser {
    PossibleValuesParser::new(words_of::<T>())
}

/// Draws one mesh, with the files that it refers to, into one image file, or each mesh into a folder.
/// `command` is the whole command line, for advice.
pub fn run(arguments: &RenderArgs, command: &[OsString]) -> Result<(), CliError> {
    let filter = std::env::var("MESHSNAP_LOG").unwrap_or_default();
    let filter = if filter.is_empty() { "warn" } else { &filter };
    telemetry::init(filter, Some(false)).map_err(|error| CliError::usage(format!("MESHSNAP_LOG {error}")))?;
    isolation::on_demand();
    let repeatable = Repeatable { arguments, command, limits: arguments.limits.config().limits };
    if arguments.watch {
        repeatable.refuse_streams()?;
        return watch::run(&repeatable);
    }
    repeatable.draw(None)
}

/// A command that may be repeated when its files have changed.
struct Repeatable<'a> {
    arguments: &'a RenderArgs,
    /// The whole command line.
    command: &'a [OsString],
    limits: Limits,
}

impl Repeatable<'_> {
    /// Refuses to watch what is read or written once.
    fn refuse_streams(&self) -> Result<(), CliError> {
        let names = self.arguments.meshes.iter().chain([&self.arguments.output]);
        let request = self.arguments.request.as_deref().is_some_and(|path| path == Path::new("-"));
        if request || names.into_iter().any(|name| name == "-") {
            let sentence = "--watch: `-`, a stream, does not change once it was read or written; name files";
            return Err(CliError::usage(sentence));
        }
        Ok(())
    }

    fn draw_one(&self) -> Result<(), CliError> {
        let Self { arguments, command, ref limits } = *self;
        let destination = Destination::new(&arguments.output, &inputs(arguments))?;
        refuse_folders(&arguments.meshes)?;
        let spec = spec::read(arguments, limits)?;
        Drawing { arguments, command, limits: limits.clone(), spec, destination }.run()
    }

    /// The pictures of a folder. Where `changed` is given, only those of the meshes that changed, unless
    /// something else changed too.
    fn draw_many(&self, changed: Option<&Changed>) -> Result<(), CliError> {
        let Self { arguments, ref limits, .. } = *self;
        let of_one = [("--entry", arguments.entry.is_some()), ("--explain", arguments.explain)];
        if let Some((flag, _)) = of_one.iter().find(|(_, is_given)| *is_given) {
            return Err(CliError::usage(format!("{flag} is for a single picture: give -o FILE, not a folder")));
        }
        let spec = spec::read(arguments, limits)?;
        let mut tasks = find(&arguments.meshes, extension(&spec))?;
        if let Some(changed) = changed {
            tasks.keep_only(changed);
        }
        Batch { arguments, limits: limits.clone(), spec, tasks, folder: PathBuf::from(&arguments.output) }.run()
    }
}

impl Watched for Repeatable<'_> {
    fn named(&self) -> Vec<String> {
        let mut names = tasks::expand(&self.arguments.meshes);
        names.extend(self.arguments.request.as_deref().map(|path| path.to_string_lossy().into_owned()));
        names
    }

    fn beside(&self) -> Vec<String> {
        let Self { arguments, ref limits, .. } = *self;
        if !arguments.siblings || is_folder(&arguments.output) {
            return Vec::new();
        }
        let options = Options { format: format_in(arguments.format_in.as_deref()), ..Options::default() };
        let found = siblings::all_beside(&arguments.meshes, arguments.entry.as_deref(), options, limits);
        // Those of a mesh that cannot be read are not known.
        found.unwrap_or_default()
    }

    fn outputs(&self) -> BTreeSet<PathBuf> {
        let Self { arguments, ref limits, .. } = *self;
        let output = Path::new(&arguments.output);
        if !is_folder(&arguments.output) {
            return BTreeSet::from([comparable(output)]);
        }
        let extension = spec::read(arguments, limits).map_or("png", |spec| extension(&spec));
        let tasks = find(&arguments.meshes, extension).unwrap_or_default().all;
        tasks.iter().map(|task| comparable(output.join(&task.picture))).collect()
    }

    fn draw(&self, changed: Option<&Changed>) -> Result<(), CliError> {
        if is_folder(&self.arguments.output) { self.draw_many(changed) } else { self.draw_one() }
    }
}

/// The extension of pictures in a folder.
fn extension(spec: &Spec) -> &'static str {
    spec.image.format.map_or("png", word_for)
}

/// True if the output names a folder: by a slash at its end, or because it is one.
fn is_folder(output: &str) -> bool {
    output != "-" && (output.ends_with(std::path::is_separator) || Path::new(output).is_dir())
}

/// The files that a render reads.
fn inputs(arguments: &RenderArgs) -> Inputs {
    let request = arguments.request.as_deref().map(Path::to_string_lossy);
    Inputs::of(arguments.meshes.iter().map(String::as_str).chain(request.as_deref()))
}

/// Refuses a folder among the meshes.
fn refuse_folders(meshes: &[String]) -> Result<(), CliError> {
    match meshes.iter().find(|name| Path::new(name).is_dir()) {
        Some(name) => Err(CliError::usage(format!(
            "{name}: is a folder; to draw each mesh in it, give a folder for the pictures: -o DIR/"
        ))),
        None => Ok(()),
    }
}
