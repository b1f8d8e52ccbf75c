//! `meshsnap jobs`: lists the jobs that a server keeps in its data folder, also while the server runs; or those of a queue
//! that several servers share, with its dead letters.

mod queue;

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde::Serialize;

use crate::error::CliError;
use crate::files;
use meshsnap_server::config;
use meshsnap_server::durable::{self, ErrorRecord, JobKey, OpenError, RecoveredJob, RequestKind};
use meshsnap_server::jobs::{JobId, rfc_3339};
use meshsnap_server::shared_queue::Note;

/// Examples at the end of `--help`.
pub const EXAMPLES: &str = "\
Examples:
  meshsnap jobs
  meshsnap jobs --dead --data-dir /var/lib/meshsnap
  meshsnap jobs --dead --queue nats://127.0.0.1:4222/farm
  meshsnap jobs --jsonl | jq -r .id";

/// Arguments of `jobs`.
#[derive(Args)]
pub struct JobsArgs {
    /// Folder of the server [env: MESHSNAP_DATA_DIR=] [default: that of `serve` without a --config]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    data_dir: Option<PathBuf>,
    /// Queue that several servers share, instead of a data folder: its jobs that have not ended [env: MESHSNAP_QUEUE=, where
    /// that is an address]
    #[arg(long, value_name = "nats://HOST:PORT/NAME", conflicts_with = "data_dir")]
    queue: Option<String>,
    /// File of credentials (.creds) for that queue
    #[arg(long, value_name = "FILE", env = "MESHSNAP_QUEUE_CREDENTIALS_FILE", value_hint = ValueHint::FilePath)]
    queue_credentials_file: Option<PathBuf>,
    /// File of certificates in PEM by which the servers of that queue are trusted, beside the system's
    #[arg(long, value_name = "FILE", env = "MESHSNAP_QUEUE_CA", value_hint = ValueHint::FilePath)]
    queue_ca: Option<PathBuf>,
    /// Only jobs that have failed; of a queue, those that were given up: its dead letters
    #[arg(long)]
    dead: bool,
    /// Print a line of JSON for each job
    #[arg(long)]
    jsonl: bool,
}

/// A job in a line of JSON. Of a job in a queue that has not ended, less is known. A field that the state of a job over HTTP
/// has, too, has the same name there.
#[derive(Serialize)]
struct JobLine<'a> {
    id: String,
    /// As over HTTP, but a job that was begun is `running`, also if its server has crashed.
    state: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<RequestKind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    accepted_unix_ms: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    accepted_at: Option<String>,
    /// Times that a worker has begun it.
    starts: u32,
    owner: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    request_id: Option<&'a str>,
    /// The names of its mesh's files.
    #[serde(skip_serializing_if = "Option::is_none")]
    files: Option<Vec<&'a str>>,
    /// The stored mesh that it is about, by its SHA-256.
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ended_unix_ms: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fetched_unix_ms: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<ResultLine<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<&'a ErrorRecord>,
}

/// The result of a job that is done.
#[derive(Serialize)]
struct ResultLine<'a> {
    sha256: String,
    format: &'a str,
    backend: &'a str,
    /// A verdict whose request wanted 422 for it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    has_failed: bool,
}

/// Prints the jobs, the oldest first.
pub fn run(arguments: &JobsArgs) -> Result<(), CliError> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let of_environment = || {
        let queue = set("MESHSNAP_QUEUE")?.into_string().ok()?;
        // `serve` takes a number, too.
        (arguments.data_dir.is_none() && queue.contains("://")).then_some(queue)
    };
    match arguments.queue.clone().or_else(of_environment) {
        Some(address) => of_queue(&address, arguments),
        None => of_folder(arguments, set("MESHSNAP_DATA_DIR").map(PathBuf::from)),
    }
}

fn of_folder(arguments: &JobsArgs, of_environment: Option<PathBuf>) -> Result<(), CliError> {
    let given = arguments.data_dir.clone().filter(|folder| !folder.as_os_str().is_empty());
    let folder = given.or(of_environment).or_else(config::default_data_dir);
    let folder = folder.ok_or_else(|| CliError::usage("there is no home folder: say --data-dir DIR"))?;
    let contents = durable::read(&folder).map_err(|error| match error {
        OpenError::Io { error, .. } if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            let folder = folder.display();
            CliError::usage(format!("{folder} is no data folder of meshsnap: name the one of `serve` with --data-dir"))
        }
        OpenError::Io { error, .. } if error.kind() == ErrorKind::ResourceBusy => CliError::ours(format!(
            "the data folder {} is written to without a pause, so that no copy of its log is of one state: try again",
            folder.display()
        )),
        OpenError::Io { error, .. } => {
            CliError::ours(format!("the data folder {} cannot be read: {error}", folder.display()))
        }
        error => CliError::usage(error.to_string()),
    })?;
    let jobs: Vec<JobLine> = contents.jobs.iter().map(JobLine::new).collect();
    let meshes = plural(contents.meshes.len(), "stored mesh", "stored meshes");
    let summary = format!("{}, {meshes} in {}\n", summary(&jobs, "job", "jobs"), folder.display());
    print(jobs.iter().filter(|job| !arguments.dead || job.state == FAILED), arguments.jsonl, &summary)
}

fn of_queue(address: &str, arguments: &JobsArgs) -> Result<(), CliError> {
    let (found, address) = queue::find(address, arguments)?;
    let (jobs, names): (Vec<JobLine>, _) = match &found {
        queue::Found::Live(jobs) => {
            (jobs.iter().map(|(key, note)| JobLine::of_note(*key, note.as_ref())).collect(), ("job", "jobs"))
        }
        queue::Found::Dead(jobs) => (jobs.iter().map(JobLine::new).collect(), ("dead letter", "dead letters")),
    };
    let summary = format!("{} in {address}\n", summary(&jobs, names.0, names.1));
    print(jobs.iter(), arguments.jsonl, &summary)
}

fn print<'a>(jobs: impl Iterator<Item = &'a JobLine<'a>>, jsonl: bool, summary: &str) -> Result<(), CliError> {
    let mut text = String::new();
    for job in jobs {
        if jsonl {
            text += &serde_json::to_string(job).map_err(|error| CliError::ours(error.to_string()))?;
            text.push('\n');
        } else {
            job.print(&mut text);
        }
    }
    if !jsonl {
        text += summary;
    }
    files::print(text.as_bytes())
}

const FAILED: &str = "failed";

/// The states in the order of a job's life.
const STATES: [&str; 5] = ["queued", "running", "done", FAILED, "cancelled"];

fn state_of(job: &RecoveredJob) -> &'static str {
    match &job.end {
        None if job.starts == 0 => "queued",
        None => "running",
        Some(end) if end.error.is_some() => FAILED,
        Some(end) if end.picture.is_some() => "done",
        Some(_) => "cancelled",
    }
}

impl<'a> JobLine<'a> {
    fn new(job: &'a RecoveredJob) -> Self {
        let (record, end) = (&job.record, job.end.as_ref());
        let picture = end.and_then(|end| end.picture.as_ref());
        Self {
            id: JobId::from_key(record.key).to_string(),
            state: state_of(job),
            kind: Some(record.request.kind),
            accepted_unix_ms: Some(record.accepted_unix_ms),
            accepted_at: Some(rfc_3339(record.accepted_unix_ms)),
            starts: job.starts,
            owner: &record.owner,
            request_id: Some(&record.request_id),
            files: Some(record.files.iter().map(|file| file.path.as_str()).collect()),
            mesh: record.mesh.map(|mesh| mesh.to_string()),
            ended_unix_ms: end.map(|end| end.at_unix_ms),
            fetched_unix_ms: end.and_then(|end| end.fetched_unix_ms),
            result: picture.map(|picture| ResultLine {
                sha256: picture.digest.to_string(),
                format: &picture.format,
                backend: &picture.backend,
                has_failed: picture.has_failed,
            }),
            error: end.and_then(|end| end.error.as_ref()),
        }
    }

    /// A job of a queue, of which the note is what is known.
    fn of_note(key: JobKey, note: Option<&'a Note>) -> Self {
        Self {
            id: JobId::from_key(key).to_string(),
            state: if note.is_some_and(|note| note.is_running) { "running" } else { "queued" },
            kind: None,
            accepted_unix_ms: note.map(|note| note.accepted_unix_ms),
            accepted_at: note.map(|note| rfc_3339(note.accepted_unix_ms)),
            starts: note.map_or(0, |note| note.starts),
            owner: note.map_or("", |note| &note.owner),
            request_id: None,
            files: None,
            mesh: None,
            ended_unix_ms: None,
            fetched_unix_ms: None,
            result: None,
            error: None,
        }
    }

    fn print(&self, text: &mut String) {
        let kind = match self.kind {
            Some(RequestKind::Draw) => "draw",
            Some(RequestKind::Check) => "check",
            Some(RequestKind::Diff) => "diff",
            None => "",
        };
        let accepted = self.accepted_at.as_deref().unwrap_or_default();
        let _ = write!(text, "{}  {:<9}  {accepted:<24}  {kind:<5}", self.id, self.state);
        if let Some(error) = self.error {
            let _ = write!(text, "  {}: ", error.code);
            // Names from the client's file are in it.
            text.extend(error.detail.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c }));
        } else if let Some(result) = &self.result {
            let verdict = if result.has_failed { ", failed" } else { "" };
            let is_fetched = if self.fetched_unix_ms.is_some() { ", fetched" } else { "" };
            let _ = write!(text, "  {}{verdict}{is_fetched}", result.format);
        } else if self.starts > 1 {
            let _ = write!(text, "  begun {} times", self.starts);
        }
        text.push('\n');
    }
}

/// The start of the last line: the number of jobs, by state.
fn summary(jobs: &[JobLine], one: &str, many: &str) -> String {
    let count = |state| jobs.iter().filter(|job| job.state == state).count();
    let counts = STATES.iter().map(|state| (count(*state), state)).filter(|(count, _)| *count > 0);
    let counts: Vec<String> = counts.map(|(count, state)| format!("{count} {state}")).collect();
    let of_states = if counts.is_empty() { String::new() } else { format!(" ({})", counts.join(", ")) };
    format!("{}{of_states}", plural(jobs.len(), one, many))
}

fn plural(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
