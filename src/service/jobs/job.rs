//! One job: what is to be done, and how far it is.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use tokio::sync::watch;
use uuid::Uuid;

use super::Reservation;
use crate::backend::BackendKind;
use crate::image::ImageFormat;
use crate::import::{Bundle, Format};
use crate::limits::Deadline;
use crate::pipeline::{Output, QualitySelection, RenderError, Stage};
use crate::spec::Spec;
use crate::warning::Warning;

/// Names a job; ids made later sort later.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct JobId(Uuid);

impl JobId {
    fn new() -> Self {
        Self(Uuid::now_v7())
    }

    /// From its usual text; None for anything else.
    pub fn parse(text: &str) -> Option<Self> {
        Uuid::try_parse(text).ok().map(Self)
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.hyphenated().fmt(f)
    }
}

/// What is to be done.
#[derive(Debug)]
pub struct Work {
    /// The mesh and what came along with it.
    pub bundle: Bundle,
    /// Overrides sniffing.
    pub format_in: Option<Format>,
    /// What to do with it.
    pub task: Task,
    /// The memory that `bundle` was granted. Shared where others hold the same bytes.
    pub memory: Arc<Reservation>,
}

/// What is wanted of a mesh.
#[derive(Clone, Debug)]
pub enum Task {
    /// A picture.
    Draw(Box<Spec>),
    /// A report on what is in it.
    Inspect {
        /// As [`Spec::time_s`].
        time_s: Option<f64>,
    },
}

/// What a worker made.
#[derive(Debug)]
pub enum Product {
    /// For [`Task::Draw`].
    Picture(Output),
    /// For [`Task::Inspect`]: JSON.
    Report(String),
}

/// How far a job is. All but the first two are final.
#[derive(Clone, Debug)]
pub enum State {
    /// Waits for a worker.
    Queued,
    /// A worker is at it.
    Running,
    /// There is a picture.
    Done(Arc<Finished>),
    /// There is a report: JSON; clones share it.
    Inspected(Bytes),
    /// There is none, and never will be.
    Failed(Arc<Failure>),
    /// Whoever asked no longer wants it.
    Cancelled,
}

/// A picture and what is known about it.
#[derive(Debug)]
pub struct Finished {
    /// The encoded picture; clones share it.
    pub picture: Bytes,
    /// Its format.
    pub format: ImageFormat,
    /// Who drew it.
    pub backend: BackendKind,
    /// What the importer noticed.
    pub warnings: Vec<Warning>,
    /// What was chosen for a request that asks for an error or a time.
    pub selection: Option<QualitySelection>,
    /// How long each part took.
    pub timings: Timings,
}

impl Finished {
    /// From what the pipeline gave.
    pub fn new(output: Output, timings: Timings) -> Self {
        let Output { bytes, format, backend, warnings, selection, .. } = output;
        Self { picture: bytes.into(), format, backend, warnings, selection, timings }
    }
}

/// Why a job has no picture.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The pipeline says why.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// It took too long, waiting included.
    #[error("the job did not finish within {limit_ms} ms of being accepted")]
    TimeUp {
        /// How long it could have taken.
        limit_ms: u64,
    },
    /// A bug of ours.
    #[error("the renderer failed unexpectedly")]
    Panicked,
}

impl State {
    /// Whether nothing will change any more.
    pub fn is_final(&self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }

    /// `queued`, `running`, `done`, `failed` or `cancelled`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done(_) | Self::Inspected(_) => "done",
            Self::Failed(_) => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// How long each part of a job took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Waiting for a worker.
    pub queue: Duration,
    /// Bytes to mesh.
    pub parse: Duration,
    /// Mesh and spec to plan.
    pub plan: Duration,
    /// Plan to image.
    pub render: Duration,
    /// Image to bytes.
    pub encode: Duration,
}

impl Timings {
    /// Notes what a stage took.
    pub fn note(&mut self, stage: Stage, took: Duration) {
        *match stage {
            Stage::Parse => &mut self.parse,
            Stage::Plan => &mut self.plan,
            Stage::Render => &mut self.render,
            Stage::Encode => &mut self.encode,
        } = took;
    }

    /// Name and duration of every part, in order.
    pub fn parts(&self) -> [(&'static str, Duration); 5] {
        [
            ("queue", self.queue),
            ("parse", self.parse),
            ("plan", self.plan),
            ("render", self.render),
            ("encode", self.encode),
        ]
    }
}

/// A job that was accepted.
#[derive(Debug)]
pub struct Job {
    /// Its name.
    pub id: JobId,
    /// Whether it can be found by its id.
    pub keep: bool,
    /// When it was accepted.
    pub accepted: Instant,
    /// The same for people, milliseconds since 1970.
    pub accepted_unix_ms: u64,
    /// Order of acceptance.
    pub(crate) serial: u64,
    pub(crate) deadline: Deadline,
    pub(crate) state: watch::Sender<State>,
    work: Mutex<Option<Work>>,
}

impl Job {
    pub(crate) fn new(work: Work, keep: bool, serial: u64) -> Self {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self {
            id: JobId::new(),
            keep,
            accepted: Instant::now(),
            accepted_unix_ms: u64::try_from(since_1970.as_millis()).unwrap_or(u64::MAX),
            serial,
            deadline: Deadline::default(),
            state: watch::Sender::new(State::Queued),
            work: Mutex::new(Some(work)),
        }
    }

    /// How far it is.
    pub fn state(&self) -> State {
        self.state.borrow().clone()
    }

    /// Waits for its end.
    pub async fn ended(&self) -> State {
        let mut states = self.state.subscribe();
        match states.wait_for(State::is_final).await {
            Ok(state) => state.clone(),
            // The sender is ours, so this cannot happen; saying what is known is better than a panic.
            Err(_) => self.state(),
        }
    }

    /// The work, once; its memory is the taker's.
    pub(crate) fn take_work(&self) -> Option<Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
