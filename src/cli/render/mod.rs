//! `meshsnap render`: draws a mesh into an image file.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;

use super::output::{Destination, Inputs};
use super::progress::Progress;
use super::settings::LimitSettings;
use super::{bundle, files};
use crate::backend::cpu::DrawingThreads;
use crate::backend::{Backends, GpuHost, GpuStatus, HardwareHint};
use crate::cli::error::CliError;
use crate::config::{cores, why_no_gpu};
use crate::image::ImageFormat;
use crate::import::Format;
use crate::limits::{Deadline, Limits};
use crate::mesh::UpAxis;
use crate::pipeline::{self, Job, Output, Stage};
use crate::request::{self, Rules, Style, Words, words_of};
use crate::spec::{BackendChoice, NamedView, Spec};
use crate::telemetry;

/// Arguments of `render`.
#[derive(Args)]
pub struct RenderArgs {
    #[arg(
        required = true,
        value_name = "MESH",
        help = format!(
            "Mesh file ({}) and the files it refers to, \
             or a .zip of them; `-` for standard input",
            Format::list()
        )
    )]
    meshes: Vec<String>,
    /// Image file, `-` for standard output; its extension chooses the format unless --format does
    #[arg(short, long, value_name = "OUT")]
    output: String,
    #[arg(long, help = format!("Preset: {}", one_of::<Style>()))]
    style: Option<String>,
    /// Request document (JSON; `meshsnap serve` has its schema at /v1/schema)
    #[arg(long, value_name = "FILE.json")]
    request: Option<PathBuf>,
    /// Dotted key of the request document, such as wire.color=#f00, outline={}, wire=null or
    /// materials.Glass.surface.opacity=0.3, or a whole section as JSON: outline={"thickness":8}.
    /// May be repeated; a later one overrides an earlier one, and the flags beside it
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// N or WxH, in pixels
    #[arg(long, value_name = "N|WxH")]
    size: Option<String>,
    #[arg(long, help = format!("Named direction: {}", one_of::<NamedView>()))]
    view: Option<String>,
    #[arg(long, value_name = "V,V,...", help = format!("Several views in one picture: {}", one_of::<NamedView>()))]
    sheet: Option<String>,
    /// N views from all around: an animated PNG or WebP, or with --set sheet.columns=C a grid
    #[arg(long, value_name = "N")]
    turntable: Option<String>,
    #[arg(long, allow_hyphen_values = true, help = format!("Axis that points up: {}", one_of::<UpAxis>()))]
    up: Option<String>,
    #[arg(long, help = format!("Image format: {}", one_of::<ImageFormat>()))]
    format: Option<String>,
    #[arg(
        long,
        value_name = "FORMAT",
        help = format!("Format of the mesh, where its bytes do not tell: {}", Format::list_names())
    )]
    format_in: Option<String>,
    /// The mesh among several files, where more than one could be
    #[arg(long, value_name = "FILE")]
    entry: Option<String>,
    #[arg(long, help = format!("Back-end: {}", one_of::<BackendChoice>()))]
    backend: Option<String>,
    /// Samples per pixel: 1, 4, 8 or 16
    #[arg(long)]
    samples: Option<String>,
    /// #rgb, #rrggbb, #rrggbbaa or transparent; or two of them from top to bottom: #fff..#dde
    #[arg(long, value_name = "COLOR")]
    background: Option<String>,
    /// Threads that read, plan, draw and decode textures [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Folder for what the GPU's driver makes of shaders, so that the next start is faster
    #[arg(long, value_name = "FOLDER", env = "MESHSNAP_CACHE_DIR")]
    cache_dir: Option<PathBuf>,
    /// Print the work that was skipped, and the time of each stage
    #[arg(long)]
    explain: bool,
    #[command(flatten)]
    limits: LimitSettings,
}

/// The words of an enumeration, for a line of help.
fn one_of<T: Words>() -> String {
    words_of::<T>().join(", ")
}

/// Draws one mesh, with the files that it refers to, into one image file.
pub fn run(arguments: &RenderArgs) -> Result<(), CliError> {
    let filter = std::env::var("MESHSNAP_LOG").unwrap_or_default();
    let filter = if filter.is_empty() { "warn" } else { &filter };
    telemetry::init(filter, Some(false)).map_err(CliError::usage)?;
    let mesh_name = bundle::name(&arguments.meshes);
    let destination = Destination::new(&arguments.output, &inputs(arguments))?;
    let limits = arguments.limits.config().limits;
    let format_in = format_in(arguments.format_in.as_deref())?;
    let spec = read_spec(arguments, &limits)?;

    let began = Instant::now();
    let progress = Progress::start("reading");
    let bundle = bundle::read(&arguments.meshes, arguments.entry.clone(), &limits)?;
    progress.next("parsing");
    let read = began.elapsed();
    let (mut times, mut stage_began): (Vec<(Stage, Duration)>, _) = (Vec::new(), Instant::now());
    let mut ended = |stage| {
        progress.next(after(stage));
        let took = stage_began.elapsed();
        // A sheet has some stages once for each view.
        match times.iter_mut().find(|(known, _)| *known == stage) {
            Some((_, all)) => *all += took,
            None => times.push((stage, took)),
        }
        stage_began = Instant::now();
    };
    let threads = arguments.threads.map_or(cores() as usize, usize::from);
    let gpu = Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu()), arguments.cache_dir.clone()));
    let job = Job { bundle, format_in, spec: &spec };
    // The threads that draw also parse the file, find edges, normals and outlines, and decode textures:
    // a second pool would take time to start, and its idle threads time from busy ones.
    let drawing = Arc::new(DrawingThreads::new(threads));
    let output = drawing
        .install(|| {
            let mut backends = Backends::sharing(gpu.clone(), drawing.clone());
            pipeline::render(job, &mut backends, &limits, &Deadline::default(), &mut ended)
        })
        .map_err(|error| CliError::from(error).about(mesh_name))?;
    drop(progress);

    destination.write(&arguments.output, &output.bytes)?;
    for warning in &output.warnings {
        eprintln!("meshsnap: {mesh_name}: warning: {}", warning.detail);
    }
    if arguments.explain {
        explain(&output, &gpu.status(), read, &times, began.elapsed());
    }
    Ok(())
}

/// The files that a render reads.
fn inputs(arguments: &RenderArgs) -> Inputs {
    let request = arguments.request.as_deref().map(Path::to_string_lossy);
    Inputs::of(arguments.meshes.iter().map(String::as_str).chain(request.as_deref()))
}

/// Reads the request document, the short flags and `--set`; each overrides those before it.
fn read_spec(arguments: &RenderArgs, limits: &Limits) -> Result<Spec, CliError> {
    let document = match &arguments.request {
        Some(path) => Some(files::read(&path.to_string_lossy(), limits.memory_bytes)?),
        None => None,
    };
    let short = [
        ("style", &arguments.style),
        ("size", &arguments.size),
        ("view", &arguments.view),
        ("sheet.views", &arguments.sheet),
        ("sheet.turntable", &arguments.turntable),
        ("up", &arguments.up),
        ("format", &arguments.format),
        ("backend", &arguments.backend),
        ("samples", &arguments.samples),
        ("background", &arguments.background),
    ];
    let mut overrides: Vec<(String, String)> =
        short.iter().filter_map(|&(key, value)| Some((key.to_owned(), value.clone()?))).collect();
    overrides.extend(pairs(&arguments.set)?);
    let rules = Rules { limits: limits.clone(), backend: BackendChoice::Auto };
    let mut spec = request::read(document.as_deref(), &overrides, &rules)?;
    // A format on the command line overrides the output's extension, which overrides the document's
    // format.
    overrides.retain(|(key, _)| ["format", "image.format", "image"].contains(&key.as_str()));
    let is_given = request::read(None, &overrides, &rules)?.image.format.is_some();
    let format = if is_given { spec.image.format } else { by_extension(&arguments.output, spec.image.format)? };
    request::set_format(&mut spec, format.unwrap_or(ImageFormat::Png));
    Ok(spec)
}

/// The keys and values given with `--set`.
pub fn pairs(set: &[String]) -> Result<Vec<(String, String)>, CliError> {
    let pair = |text: &String| match text.split_once('=') {
        Some((key, value)) => Ok((key.to_owned(), value.to_owned())),
        None => Err(CliError::usage(format!("--set {text}: write KEY=VALUE, such as wire.color=#f00"))),
    };
    set.iter().map(pair).collect()
}

/// The format of the output's extension, else that of the document.
fn by_extension(output: &str, of_document: Option<ImageFormat>) -> Result<Option<ImageFormat>, CliError> {
    let extension = Path::new(output).extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("png") => Ok(Some(ImageFormat::Png)),
        Some("webp") => Ok(Some(ImageFormat::Webp)),
        Some("jpg" | "jpeg") => Ok(Some(ImageFormat::Jpeg)),
        None => Ok(of_document),
        _ if of_document.is_some() => Ok(of_document),
        Some(other) => {
            let sentence =
                format!("{output}: no image format is called `{other}`; write png, webp or jpg, or give --format");
            Err(CliError::usage(sentence))
        }
    }
}

/// The mesh format that `--format-in` names.
pub fn format_in(name: Option<&str>) -> Result<Option<Format>, CliError> {
    let Some(name) = name else { return Ok(None) };
    let unknown = || CliError::usage(format!("--format-in {name}: allowed is one of {}", Format::names().join(", ")));
    Format::from_name(name).map(Some).ok_or_else(unknown)
}

/// The name of the step that follows a stage, for the spinner.
fn after(stage: Stage) -> &'static str {
    match stage {
        Stage::Parse => "planning",
        Stage::Plan => "drawing",
        Stage::Render => "encoding",
        Stage::Encode => "writing",
    }
}

/// Prints what `--explain` asks for.
fn explain(output: &Output, gpu: &GpuStatus, read: Duration, times: &[(Stage, Duration)], total: Duration) {
    eprintln!("drawn by {}", output.backend.name());
    if let Some(selection) = &output.selection {
        let (error, time_ms) = (selection.expected_error, selection.expected_time_ms);
        eprintln!("chosen: {selection}; expected error {error}/255, expected time {time_ms} ms");
    }
    let device = gpu.info.as_ref().map(|info| {
        let features = if info.features.is_empty() { "no optional features".into() } else { info.features.join(", ") };
        format!("{}, {}, {}, {features}", info.name, info.driver, info.device_type)
    });
    let parts = [Some(gpu.state.name().to_owned()), device, gpu.reason.clone()];
    eprintln!("gpu: {}", parts.into_iter().flatten().collect::<Vec<_>>().join("; "));
    for skip in &output.skips {
        eprintln!("skipped {}: {}", skip.kind, skip.why);
    }
    if output.short_chains > 0 {
        eprintln!("lines of the outline left out, shorter than outline.min_length: {}", output.short_chains);
    }
    eprintln!("{:<6} {:9.3} ms", "read", read.as_secs_f64() * 1e3);
    for (stage, took) in times {
        eprintln!("{:<6} {:9.3} ms", format!("{stage:?}").to_lowercase(), took.as_secs_f64() * 1e3);
        if *stage == Stage::Render {
            for (part, took) in output.draw_times.parts() {
                eprintln!("  {:<12} {:9.3} ms", part.name(), took.as_secs_f64() * 1e3);
            }
        }
    }
    eprintln!("{:<6} {:9.3} ms", "total", total.as_secs_f64() * 1e3);
}
