//! `render MESH... -o FILE`: one picture of one mesh. Its files are read, the picture is drawn and written, and
//! warnings are printed; those about missing files say what to do if the files lie beside the mesh.

use std::ffi::OsString;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::explain::explain;
use super::{RenderArgs, format_in};
use crate::bundle::{self, NamedFiles};
use crate::error::CliError;
use crate::output::Destination;
use crate::progress::Progress;
use crate::siblings;
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{Backends, GpuHost, HardwareHint};
use meshsnap_render::import::{FileUse, MeshFault, Options};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::pipeline::{self, Context, Job, RenderError, Stage};
use meshsnap_render::spec::Spec;
use meshsnap_render::warning::Warning;
use meshsnap_server::config::{cores, why_no_gpu};

/// Codes of warnings that name missing files.
const MISSING: &[&str] = &["mtl_ignored", "textures_missing"];

/// One picture to draw.
pub struct Drawing<'a> {
    pub arguments: &'a RenderArgs,
    /// The whole command line.
    pub command: &'a [OsString],
    pub limits: Limits,
    pub spec: Spec,
    pub destination: Destination,
}

impl Drawing<'_> {
    /// Reads the files, draws, and writes the picture.
    pub fn run(&self) -> Result<(), CliError> {
        let Self { arguments, limits, spec, .. } = self;
        let began = Instant::now();
        let progress = Progress::start("reading");
        let names = self.names()?;
        let mesh_name = bundle::name(&names);
        let named = bundle::read(&names, arguments.entry.clone(), limits)?;
        let ((paths, archives), NamedFiles { bundle, file_use, common, .. }) = (named.paths(), named);
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
        let job = Job { bundle, format_in: format_in(arguments.format_in.as_deref()), spec };
        // The threads that draw also parse the file, find edges, normals and outlines, and decode textures:
        // a second pool would take time to start, and its idle threads time from busy ones.
        let drawing = Arc::new(DrawingThreads::new(threads));
        let drawn = drawing.install(|| {
            let mut backends = Backends::sharing(gpu.clone(), drawing.clone());
            let (budget, deadline) = (Budget::new(limits), &Deadline::default());
            let context = Context { backends: &mut backends, budget, deadline, ended: &mut ended };
            pipeline::render(job, limits, context)
        });
        drop(progress);
        let beside = || self.advice(&names, &common, &file_use);
        let is_one_of_many = arguments.meshes.len() > 1 && arguments.entry.is_none();
        let output = drawn.map_err(|error| match &error {
            RenderError::Mesh(mesh) if mesh.fault == MeshFault::EntryUnclear && is_one_of_many => {
                CliError::input(format!("{error}, or draw each of them with -o DIR/"))
            }
            _ => of_mesh(error, mesh_name, &beside),
        })?;

        self.destination.write(&arguments.output, &output.bytes)?;
        for sentence in warnings(mesh_name, &output.report.warnings, &beside) {
            say!("meshsnap: {sentence}");
        }
        for sentence in bundle::unused(&paths, &file_use, |path| archives.iter().any(|archive| archive == path)) {
            say!("meshsnap: {sentence}");
        }
        if arguments.explain {
            explain(&output.report, &gpu.status(), read, &times, began.elapsed());
        }
        Ok(())
    }

    /// The files that are named, and with `--siblings` those that belong to them.
    fn names(&self) -> Result<Vec<String>, CliError> {
        let mut names = self.arguments.meshes.clone();
        if self.arguments.siblings && !names.iter().any(|name| name == "-") {
            names.extend(self.beside(&names)?);
        }
        Ok(names)
    }

    fn beside(&self, names: &[String]) -> Result<Vec<String>, CliError> {
        let options = Options {
            format: format_in(self.arguments.format_in.as_deref()),
            time_s: self.spec.time_s,
            ..Options::default()
        };
        siblings::all_beside(names, self.arguments.entry.as_deref(), options, &self.limits)
    }

    /// The command that names the missing files too, if they lie beside the mesh; and true if they
    /// are all that is missing.
    fn advice(&self, names: &[String], common: &std::path::Path, file_use: &FileUse) -> Option<(String, bool)> {
        if names.iter().any(|name| name == "-") {
            return None;
        }
        let first = siblings::beside(names, common, file_use, &|_| false);
        if first.is_empty() {
            return None;
        }
        let is_all = first.len() >= file_use.missing().len();
        // What the missing files name in turn.
        let all = self.beside(names).unwrap_or(first);
        let last = self.arguments.meshes.last().map_or("", String::as_str);
        Some((siblings::advice(bundle::name(names), &all, last, self.command), is_all))
    }
}

/// The error of a mesh, with what to do about it on a command line.
pub fn of_mesh(error: RenderError, mesh_name: &str, advice: &dyn Fn() -> Option<(String, bool)>) -> CliError {
    match &error {
        RenderError::Mesh(mesh) if mesh.fault == MeshFault::OutsideBundle => match advice() {
            Some((advice, _)) => CliError::input(advice),
            None => CliError::from(error).about(mesh_name),
        },
        _ => CliError::from(error).about(mesh_name),
    }
}

/// The sentences of warnings. Those about missing files give way to what is to be done about them.
pub fn warnings(mesh_name: &str, all: &[Warning], advice: &dyn Fn() -> Option<(String, bool)>) -> Vec<String> {
    let is_missing = |warning: &Warning| MISSING.contains(&warning.code);
    let advice = if all.iter().any(is_missing) { advice() } else { None };
    let is_answered = advice.as_ref().is_some_and(|(_, is_all)| *is_all);
    let said = all.iter().filter(|warning| !is_answered || !is_missing(warning));
    let sentences = said.map(|warning| format!("{mesh_name}: warning: {}", warning.detail));
    sentences.chain(advice.map(|(advice, _)| advice)).collect()
}

/// The name of the step that follows a stage, for the spinner.
fn after(stage: Stage) -> &'static str {
    match stage {
        Stage::Parse | Stage::Judge => "planning",
        Stage::Plan => "drawing",
        Stage::Render => "encoding",
        Stage::Encode => "writing",
        _ => "working",
    }
}
