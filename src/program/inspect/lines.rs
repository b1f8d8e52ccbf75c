//! `inspect --jsonl`: the reports on many meshes, each as a line of JSON, in the order of their paths. A mesh that
//! cannot be read has a line with the reason.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};

use serde::Serialize;

use super::InspectArgs;
use crate::bundle::comparable;
use crate::error::CliError;
use crate::files;
use crate::progress::Bar;
use crate::render::{Task, Tasks, find};
use crate::siblings::{self, Companions};
use meshsnap_inspect::report;
use meshsnap_inspect::report::Report;
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::import::Options;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::parallel;
use meshsnap_server::config::cores;

/// A line: the path, and the report or the reason why there is none.
#[derive(Serialize)]
struct Line<'a> {
    path: &'a str,
    #[serde(flatten)]
    report: Option<&'a Report>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<&'a str>,
}

/// The end of one mesh.
struct Outcome {
    line: String,
    failure: Option<CliError>,
}

/// Many meshes to report on.
struct Run<'a> {
    arguments: &'a InspectArgs,
    options: Options,
    limits: Limits,
    tasks: Tasks,
    /// The named files that are no meshes, by their absolute paths.
    named: BTreeSet<PathBuf>,
}

/// Prints a line for each mesh. Goes on after a failure, and then ends with its code.
pub fn run(arguments: &InspectArgs, options: Options, limits: Limits) -> Result<(), CliError> {
    let mut tasks = find(&arguments.meshes, "json")?;
    tasks.all.sort_by(|a, b| a.mesh.cmp(&b.mesh));
    let named = tasks.companions.iter().map(comparable).collect();
    Run { arguments, options, limits, tasks, named }.all()
}

impl Run<'_> {
    fn all(&self) -> Result<(), CliError> {
        let all = &self.tasks.all;
        let threads = (cores() as usize).min(all.len());
        let next = AtomicUsize::new(0);
        let (sender, outcomes) = channel();
        let of_all = &next;
        let work = move || {
            // Many files keep all processors busy: each is read by one thread.
            let reading = DrawingThreads::new(if threads == 1 { cores() as usize } else { 1 });
            reading.install(|| {
                while let Some((number, task)) = take(of_all, all) {
                    // Where nobody reads the lines, no more are made.
                    if sender.send((number, self.outcome(task))).is_err() {
                        break;
                    }
                }
            });
        };
        let failure = parallel::beside(threads, work, || print(outcomes, all.len()))?;
        // The sentences are said already.
        failure.map_or(Ok(()), |code| Err(CliError::silent(code)))
    }

    fn outcome(&self, task: &Task) -> Outcome {
        let report = catch_unwind(AssertUnwindSafe(|| self.report(task)));
        let bug = |_| Err(CliError::ours(format!("{}: this is a bug in meshsnap; please report it", task.mesh)));
        let report = report.unwrap_or_else(bug);
        let path = task.mesh.as_str();
        let (line, failure) = match &report {
            Ok(report) => (line(&Line { path, report: Some(report), error: None }), None),
            Err(error) => {
                let own = format!("{path}: ");
                let detail = error.sentence.strip_prefix(&own).unwrap_or(&error.sentence);
                (line(&Line { path, report: None, error: Some(detail) }), report.err())
            }
        };
        match line {
            Ok(line) => Outcome { line, failure },
            Err(error) => Outcome { line: String::new(), failure: Some(error) },
        }
    }

    fn report(&self, task: &Task) -> Result<Report, CliError> {
        let companions = Companions { named: &self.named, all: task.has_folder };
        let read = siblings::read_on(&task.mesh, companions, &self.limits, |named| {
            let extras = self.arguments.extras();
            let mut budget = Budget::new(&self.limits);
            report::inspect(
                &named.bundle,
                self.options,
                extras,
                &self.limits,
                &mut budget,
                &Deadline::default(),
                &mut |_| (),
            )
        })?;
        read.value.map_err(|error| CliError::from(error).about(&task.mesh))
    }
}

/// The next mesh with its number, until none is left.
fn take<'a>(next: &AtomicUsize, all: &'a [Task]) -> Option<(usize, &'a Task)> {
    let number = next.fetch_add(1, Ordering::Relaxed);
    Some((number, all.get(number)?))
}

fn line(line: &Line<'_>) -> Result<String, CliError> {
    serde_json::to_string(line).map(|text| text + "\n").map_err(|error| CliError::ours(error.to_string()))
}

/// Prints the lines in order. Returns the worst exit code of the meshes that failed.
fn print(outcomes: Receiver<(usize, Outcome)>, count: usize) -> Result<Option<u8>, CliError> {
    let bar = Bar::start(count as u64);
    let (mut waiting, mut next, mut failure) = (BTreeMap::new(), 0, None);
    for (number, outcome) in outcomes {
        waiting.insert(number, outcome);
        while let Some(Outcome { line, failure: failed }) = waiting.remove(&next) {
            next += 1;
            bar.suspend(|| files::print(line.as_bytes()))?;
            if let Some(error) = failed {
                bar.suspend(|| say!("meshsnap: {}", error.sentence));
                failure = failure.max(Some(error.exit_code));
            }
            bar.advance();
        }
    }
    Ok(failure)
}
