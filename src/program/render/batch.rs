//! `render MESH... -o DIR/`: a picture of each mesh, drawn in parallel. A mesh that fails does not
//! stop the others.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::tasks::{Task, Tasks};
use super::{RenderArgs, format_in, one};
use crate::bundle::comparable;
use crate::error::CliError;
use crate::output::{Destination, Inputs};
use crate::siblings::{self, Read};
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{Backends, GpuHost, HardwareHint};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::parallel;
use meshsnap_render::pipeline::{self, Context, Job, Output};
use meshsnap_render::spec::Spec;
use meshsnap_server::config::{cores, why_no_gpu};

/// Many pictures to draw.
pub struct Batch<'a> {
    pub arguments: &'a RenderArgs,
    pub limits: Limits,
    pub spec: Spec,
    pub tasks: Tasks,
    /// The folder of the pictures.
    pub folder: PathBuf,
}

/// The end of one picture.
struct Outcome {
    /// Sentences for the user.
    said: Vec<String>,
    result: Result<(), CliError>,
}

/// The state that all threads share.
struct Shared {
    gpu: Arc<GpuHost>,
    next: AtomicUsize,
    /// The named files, by their absolute paths.
    named: BTreeSet<PathBuf>,
    /// Those of them that were used for some mesh.
    used: Mutex<BTreeSet<PathBuf>>,
    inputs: Inputs,
}

impl Batch<'_> {
    /// Draws all pictures. The messages come in the order of the meshes, and last the count.
    pub fn run(&self) -> Result<(), CliError> {
        std::fs::create_dir_all(&self.folder)
            .map_err(|error| CliError::usage(format!("{}: cannot be made: {error}", self.folder.display())))?;
        let meshes = self.tasks.all.iter().map(|task| task.mesh.as_str());
        let companions = self.tasks.companions.iter().map(String::as_str);
        let request = self.arguments.request.as_deref().map(Path::to_string_lossy);
        let shared = Shared {
            gpu: Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu()), self.arguments.cache_dir.clone())),
            next: AtomicUsize::new(0),
            named: self.tasks.companions.iter().map(comparable).collect(),
            used: Mutex::default(),
            inputs: Inputs::of(meshes.chain(companions).chain(request.as_deref())),
        };
        let threads = self.arguments.threads.map_or(cores() as usize, usize::from).min(self.tasks.all.len());
        let (sender, outcomes) = channel();
        let of_all = &shared;
        let work = move || self.work(of_all, &mut |number, outcome| drop(sender.send((number, outcome))));
        let (drawn, failures) = parallel::beside(threads, work, || self.report(&outcomes));
        if !self.tasks.is_part {
            self.mention_unused(&shared);
        }
        say!("{drawn} drawn, {} failed", failures.len());
        match failures.iter().copied().max() {
            None => Ok(()),
            // The sentences are said already.
            Some(3) => Err(CliError::silent(3)),
            Some(_) => Err(CliError::silent(1)),
        }
    }

    /// Draws one picture after the other, until none is left.
    fn work(&self, shared: &Shared, done: &mut (dyn FnMut(usize, Outcome) + Send)) {
        // Many pictures keep all processors busy: each is drawn by one thread.
        let drawing = Arc::new(DrawingThreads::new(1));
        drawing.install(|| {
            let mut backends = Backends::sharing(shared.gpu.clone(), drawing.clone());
            loop {
                let number = shared.next.fetch_add(1, Ordering::Relaxed);
                let Some(task) = self.tasks.all.get(number) else { break };
                let mut said = Vec::new();
                let result = catch_unwind(AssertUnwindSafe(|| self.draw(task, shared, &mut backends, &mut said)));
                let bug =
                    |_| Err(CliError::ours(format!("{}: this is a bug in meshsnap; please report it", task.mesh)));
                done(number, Outcome { said, result: result.unwrap_or_else(bug) });
            }
        });
    }

    /// Draws one picture, with the files that its mesh turns out to refer to.
    fn draw(
        &self,
        task: &Task,
        shared: &Shared,
        backends: &mut Backends,
        said: &mut Vec<String>,
    ) -> Result<(), CliError> {
        let companions = siblings::Companions { named: &shared.named, all: task.has_folder || self.arguments.siblings };
        let Read { value: drawn, names, unread } = siblings::read_on(&task.mesh, companions, &self.limits, |named| {
            let format_in = format_in(self.arguments.format_in.as_deref());
            let job = Job { bundle: named.bundle.clone(), format_in, spec: &self.spec };
            let (budget, deadline) = (Budget::new(&self.limits), &Deadline::default());
            pipeline::render(job, &self.limits, Context { backends, budget, deadline, ended: &mut |_| {} })
        })?;
        let drawn = drawn.map_err(|error| one::of_mesh(error, &task.mesh, &|| advice(task, &unread)))?;
        self.write(task, &drawn, &names, shared)?;
        said.extend(one::warnings(&task.mesh, &drawn.report.warnings, &|| advice(task, &unread)));
        Ok(())
    }

    /// Writes the picture of a mesh that was read from these files.
    fn write(&self, task: &Task, drawn: &Output, names: &[String], shared: &Shared) -> Result<(), CliError> {
        let path = self.folder.join(&task.picture);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|error| CliError::usage(format!("{}: cannot be made: {error}", folder.display())))?;
        }
        let output = path.to_string_lossy();
        // Nor may it be a file that was read though it is not named.
        Destination::new(&output, &Inputs::of(names.iter().map(String::as_str)))?;
        Destination::new(&output, &shared.inputs)?.write(&output, &drawn.bytes)?;
        let used = names.iter().map(comparable);
        shared.used.lock().unwrap_or_else(PoisonError::into_inner).extend(used);
        Ok(())
    }

    /// Prints what is said, in the order of the meshes. Returns the count of pictures, and the exit code
    /// of each failure.
    fn report(&self, outcomes: &Receiver<(usize, Outcome)>) -> (usize, Vec<u8>) {
        let bar = self.bar();
        let (mut drawn, mut failures, mut next) = (0, Vec::new(), 0);
        let mut waiting: BTreeMap<usize, Outcome> = BTreeMap::new();
        for (number, outcome) in outcomes {
            bar.inc(1);
            waiting.insert(number, outcome);
            while let Some(outcome) = waiting.remove(&next) {
                next += 1;
                let failed = match outcome.result {
                    Ok(()) => {
                        drawn += 1;
                        None
                    }
                    Err(error) => {
                        failures.push(error.exit_code);
                        Some(error.sentence)
                    }
                };
                let lines: Vec<String> = outcome.said.into_iter().chain(failed).collect();
                if !lines.is_empty() {
                    bar.suspend(|| lines.iter().for_each(|line| say!("meshsnap: {line}")));
                }
            }
        }
        bar.finish_and_clear();
        (drawn, failures)
    }

    /// A bar with rate and time left; on anything but a terminal, none.
    fn bar(&self) -> ProgressBar {
        let target = ProgressDrawTarget::stderr_with_hz(10);
        let bar = ProgressBar::with_draw_target(Some(self.tasks.all.len() as u64), target);
        let template = "{wide_bar} {pos}/{len}, {per_sec}, {eta} left";
        match ProgressStyle::with_template(template) {
            Ok(style) => bar.with_style(style),
            Err(_) => bar,
        }
    }

    fn mention_unused(&self, shared: &Shared) {
        let used = shared.used.lock().unwrap_or_else(PoisonError::into_inner);
        for name in self.tasks.companions.iter().filter(|name| !used.contains(&comparable(name))) {
            say!("meshsnap: {name}: is not used: no mesh refers to it");
        }
    }
}

/// Advice about files that a mesh refers to, that lie beside it and are not named.
fn advice(task: &Task, unread: &[String]) -> Option<(String, bool)> {
    (!unread.is_empty()).then(|| (siblings::advice_to_add(&task.mesh, unread), true))
}
