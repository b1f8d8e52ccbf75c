//! The run of `meshsnap check` over many files. Several threads judge one file each at the same time; the verdicts
//! are printed in the order of the files, whatever the order in which they are ready. At the end, the reports are
//! written.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

use super::baseline::Baseline;
use super::changes::{self, Changes};
use super::config::Config;
use super::pictures::{Against, Pictures, ViewPictures};
use super::reports::{Findings, Reports, json_line, text};
use super::since::Commit;
use super::{CheckArgs, Output};
use crate::bundle::comparable;
use crate::error::CliError;
use crate::files;
use crate::output::Inputs;
use crate::progress::Bar;
use crate::render::{Task, Tasks};
use crate::siblings::{self, Read};
use meshsnap_inspect::check::{self, Check, Verdict, unopened};
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{Backends, GpuHost, HardwareHint};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::parallel;
use meshsnap_render::pipeline::Model;
use meshsnap_render::pluralise::pluralise;
use meshsnap_render::spec::NamedView;
use meshsnap_server::config::{cores, why_no_gpu};
use meshsnap_server::digest::Digest;

/// Many files to judge.
pub struct Run<'a> {
    arguments: &'a CheckArgs,
    limits: Limits,
    config: Config,
    tasks: Tasks,
    baseline: Option<Baseline>,
    /// The commit with which meshes are compared.
    commit: Option<Commit>,
    /// The pictures, if a report or a baseline wants them.
    pictures: Option<Pictures>,
    gpu: Arc<GpuHost>,
    /// The named files that are no meshes, by their absolute paths.
    named: BTreeSet<PathBuf>,
    /// Those of them that were used for some mesh.
    used: Mutex<BTreeSet<PathBuf>>,
}

/// The end of one file.
struct Outcome {
    /// A sentence for the user beside the verdict.
    said: Option<String>,
    result: Result<Judged, CliError>,
}

/// A file that was judged.
struct Judged {
    verdict: Verdict,
    /// Its pictures, if the page wants them.
    pictures: Vec<ViewPictures>,
}

/// The findings of a run.
#[derive(Default)]
struct RunFindings {
    verdicts: Vec<Verdict>,
    /// The pictures of each verdict.
    pictures: Vec<Vec<ViewPictures>>,
    /// Files without a verdict by a fault of ours.
    lost: usize,
    /// The exit code of such a fault.
    failure: Option<u8>,
}

impl Judged {
    fn without_pictures(path: &str, digest: Option<String>, checks: Vec<Check>) -> Self {
        Self { verdict: Verdict::new(path.to_owned(), digest, checks), pictures: Vec::new() }
    }
}

impl<'a> Run<'a> {
    /// The run of a command.
    pub fn new(arguments: &'a CheckArgs, config: Config, tasks: Tasks, baseline: Option<Baseline>) -> Self {
        let named = tasks.companions.iter().map(comparable).collect();
        let limits = arguments.limits.config().limits;
        let gpu = Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu()), None));
        let (commit, pictures, used) = (None, None, Mutex::default());
        Self { arguments, limits, config, tasks, baseline, commit, pictures, gpu, named, used }
    }

    /// The run that compares meshes with a commit.
    pub fn since(self, commit: Option<Commit>) -> Self {
        Self { commit, ..self }
    }

    /// The run with pictures of these views, if anything shows or keeps them.
    pub fn with_pictures(mut self, views: &[NamedView]) -> Result<Self, CliError> {
        let CheckArgs { reports, pictures, .. } = self.arguments;
        if reports.has_page() || pictures.is_some() || self.baseline.is_some() && self.arguments.update {
            self.pictures = Pictures::new(views, pictures.clone(), &self.limits, self.inputs())?;
        }
        Ok(self)
    }

    /// Judges all. Verdicts go to standard output, and last the count to standard error.
    pub fn all(&self) -> Result<(), CliError> {
        let reports = Reports::new(&self.arguments.reports, &self.inputs())?;
        let threads = self.arguments.jobs.map_or(cores() as usize, usize::from).min(self.tasks.all.len());
        let next = AtomicUsize::new(0);
        let (sender, outcomes) = channel();
        let of_all = &next;
        let work = move || {
            // Many files keep all processors busy: each is read by one thread.
            let threads_of_one = if threads == 1 { cores() as usize } else { 1 };
            let drawing = Arc::new(DrawingThreads::new(threads_of_one));
            drawing.install(|| {
                let mut backends = Backends::sharing(self.gpu.clone(), drawing.clone());
                let mut done = |number, outcome| drop(sender.send((number, outcome)));
                self.work(of_all, &mut backends, &mut done);
            });
        };
        let RunFindings { verdicts, pictures, lost, failure } = parallel::beside(threads, work, || {
            // Where nobody reads the verdicts, no more are made.
            self.print(&outcomes).inspect_err(|_| next.store(self.tasks.all.len(), Ordering::Relaxed))
        })?;
        let findings = Findings { verdicts: &verdicts, pictures: &pictures, lost };
        reports.write(&findings)?;
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        // Of some meshes alone, it is not known what the others use.
        let companions = self.tasks.companions.iter().filter(|_| !self.tasks.is_part);
        for name in companions.filter(|name| !used.contains(&comparable(name))) {
            say!("meshsnap: {name}: is not used: no mesh refers to it");
        }
        if let (Some(reference), true) = (&self.arguments.since, self.tasks.all.is_empty()) {
            say!("no mesh has changed since {reference}");
        }
        let failed = findings.failed();
        let known = match findings.known() {
            0 => String::new(),
            known => format!(", {}", pluralise(known, "known fault", "known faults")),
        };
        say!("{} ok, {failed} failed{known}", self.tasks.all.len() - failed);
        match failure {
            // The sentences are said already.
            Some(code) => Err(CliError::silent(code)),
            None if failed > 0 => Err(CliError::silent(1)),
            None => Ok(()),
        }
    }

    /// Judges one file after the other, until none is left.
    fn work(&self, next: &AtomicUsize, backends: &mut Backends, done: &mut (dyn FnMut(usize, Outcome) + Send)) {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(task) = self.tasks.all.get(number) else { break };
            let mut said = None;
            let result = catch_unwind(AssertUnwindSafe(|| self.judge_known(task, backends, &mut said)));
            let bug = |_| Err(CliError::ours(format!("{}: this is a bug in meshsnap; please report it", task.mesh)));
            done(number, Outcome { said, result: result.unwrap_or_else(bug) });
        }
    }

    /// Judges one file, and marks what is known or accepts what there is.
    fn judge_known(&self, task: &Task, backends: &mut Backends, said: &mut Option<String>) -> Result<Judged, CliError> {
        let Judged { mut verdict, mut pictures } = self.judge(task, backends, said)?;
        if let Some(drawn) = &self.pictures {
            verdict.pictures = drawn.write(&task.picture, &pictures)?.into_iter().collect();
        }
        if !self.arguments.reports.has_page() {
            pictures = Vec::new();
        }
        match &self.baseline {
            Some(baseline) if self.arguments.update => baseline.update(&mut verdict)?,
            Some(baseline) => baseline.apply(&mut verdict)?,
            None => {}
        }
        Ok(Judged { verdict, pictures })
    }

    /// Judges one file, with those that it turns out to refer to.
    fn judge(&self, task: &Task, backends: &mut Backends, said: &mut Option<String>) -> Result<Judged, CliError> {
        let path = &task.mesh;
        let companions = siblings::Companions { named: &self.named, all: task.has_folder || self.arguments.siblings };
        let format = self.arguments.format_in.format();
        let (mut digest, mut paths) = (None, Vec::new());
        let read = siblings::read_on(path, companions, &self.limits, |named| {
            // Alone at first: a digest is that of the mesh's own bytes.
            if let ([own], None) = (named.bundle.files(), &digest) {
                digest = Some(Digest::of(&own.bytes).to_string());
            }
            paths = named.bundle.files().iter().map(|file| file.path.clone()).collect();
            meshsnap_inspect::read(&named.bundle, format, &self.limits, Budget::new(&self.limits), &Deadline::default())
        });
        let Read { value: model, names, unread } = match read {
            Ok(read) => read,
            Err(error) if error.exit_code == 3 => return Err(error),
            Err(error) => {
                let own = format!("{path}: ");
                let detail = error.sentence.strip_prefix(&own).unwrap_or(&error.sentence).to_owned();
                return Ok(Judged::without_pictures(path, digest, vec![unopened(detail)]));
            }
        };
        let mut changes = None;
        let (checks, pictures) = match model {
            Ok(model) => {
                let options = check::Options { all_places: self.arguments.all_places, fails_at_limits: true };
                let rules = self.config.rules_of(Path::new(path));
                let checks = check::check(&model, rules, options, &Deadline::default());
                let checks = checks.map_err(|error| CliError::from(error).about(path))?;
                let Changes { sentences, older } = self.changes(&model, names.iter().cloned().zip(paths).collect());
                changes = self.commit.is_some().then_some(sentences);
                let pictures = self.draw((&model, older.as_ref()), (path, &checks), backends, said)?;
                (checks, pictures)
            }
            Err(error) => (vec![unopened(error.to_string())], Vec::new()),
        };
        if !unread.is_empty() {
            *said = Some(siblings::advice_to_add(path, &unread));
        }
        let used = names.iter().map(comparable);
        self.used.lock().unwrap_or_else(PoisonError::into_inner).extend(used);
        let verdict = Verdict { changes, ..Verdict::new(path.clone(), digest, checks) };
        Ok(Judged { verdict, pictures })
    }

    /// The changes of a mesh since the commit, if there is one.
    fn changes(&self, model: &Model, sources: Vec<(String, String)>) -> Changes {
        let options = self.arguments.format_in.format().into();
        let since = |commit| changes::since(commit, model, &sources, options, &self.limits);
        self.commit.as_ref().map(since).unwrap_or_default()
    }

    /// Draws the pictures of a file. One that cannot be drawn has none, and fails by its faults alone.
    fn draw(
        &self,
        (model, older): (&Model, Option<&Model>),
        (path, checks): (&str, &[Check]),
        backends: &mut Backends,
        said: &mut Option<String>,
    ) -> Result<Vec<ViewPictures>, CliError> {
        let Some(pictures) = &self.pictures else { return Ok(Vec::new()) };
        let against = Against { baseline: self.baseline.as_ref(), is_update: self.arguments.update, older };
        match pictures.draw(model, (path, checks), &against, backends) {
            Err(error) if error.exit_code == 1 => {
                *said = Some(format!("{}: no pictures are made of it", error.sentence));
                Ok(Vec::new())
            }
            drawn => drawn,
        }
    }

    /// The files that are read, which no report may replace.
    fn inputs(&self) -> Inputs {
        let meshes = self.tasks.all.iter().map(|task| task.mesh.as_str());
        let named = meshes.chain(self.tasks.companions.iter().map(String::as_str));
        let config = self.config.path().map(Path::to_string_lossy);
        Inputs::of(named.chain(config.as_deref()))
    }

    /// Prints the verdicts in order, and returns all.
    fn print(&self, outcomes: &Receiver<(usize, Outcome)>) -> Result<RunFindings, CliError> {
        let mut found = RunFindings::default();
        let bar = Bar::start(self.tasks.all.len() as u64);
        let mut waiting: BTreeMap<usize, Outcome> = BTreeMap::new();
        let mut next = 0;
        for (number, outcome) in outcomes {
            waiting.insert(number, outcome);
            while let Some(Outcome { said, result }) = waiting.remove(&next) {
                next += 1;
                match result {
                    Ok(Judged { verdict, pictures }) => {
                        let shown = self.show(&verdict)?;
                        bar.suspend(|| files::print(shown.as_bytes()))?;
                        found.verdicts.push(verdict);
                        found.pictures.push(pictures);
                    }
                    Err(error) => {
                        bar.suspend(|| say!("meshsnap: {}", error.sentence));
                        found.failure = found.failure.max(Some(error.exit_code));
                        found.lost += 1;
                    }
                }
                if let Some(sentence) = said {
                    bar.suspend(|| say!("meshsnap: {sentence}"));
                }
                bar.advance();
            }
        }
        Ok(found)
    }

    fn show(&self, verdict: &Verdict) -> Result<String, CliError> {
        match self.arguments.format {
            Output::Text => Ok(text::text(verdict)),
            Output::Jsonl => json_line(verdict),
        }
    }
}
