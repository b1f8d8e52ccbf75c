//! One job: its work (a mesh and a task on it: draw, check, compare or report), its state from the queue to its end, and
//! its result.

mod mirror;
mod work;

pub use work::{Checking, Comparing, Newer, Recipe, Task, Work};

use std::fmt;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use tokio::sync::watch;
use uuid::Uuid;

use super::claims::Claim;
use super::class::{Class, Owner};
use super::progress::Progress;
use crate::digest::Digest;
use crate::durable::{ErrorRecord, Hold, JobKey};
use crate::memory::{Account, Keeping, Memory, MemoryShare, counted};
use crate::telemetry::traces::Trace;
use meshsnap_render::backend::{BackendKind, DrawError, DrawTimes};
use meshsnap_render::image::ImageFormat;
use meshsnap_render::limits::Deadline;
use meshsnap_render::pipeline::{DrawReport, Output, QualitySelection, RenderError, Stage};
use meshsnap_render::warning::Warning;

/// The name of a job. Later ids sort after earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct JobId(Uuid);

impl JobId {
    /// An id that was never given.
    pub fn fresh() -> Self {
        Self(Uuid::now_v7())
    }

    /// The id that the first bytes of a digest name: a UUID of version 8.
    pub fn of_digest(digest: Digest) -> Self {
        let mut bytes = [0; 16];
        bytes.copy_from_slice(&digest.as_bytes()[..16]);
        Self(uuid::Builder::from_custom_bytes(bytes).into_uuid())
    }

    /// The id with this number.
    pub fn from_key(key: JobKey) -> Self {
        Self(Uuid::from_u128(key))
    }

    /// Its number, which names it in the data folder.
    pub fn key(self) -> JobKey {
        self.0.as_u128()
    }

    /// Reads the usual text of a UUID. None for anything else.
    pub fn parse(text: &str) -> Option<Self> {
        Uuid::try_parse(text).ok().map(Self)
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.hyphenated().fmt(f)
    }
}

/// The outcome of a task.
#[derive(Debug)]
pub enum Product {
    /// The outcome of [`Task::Draw`].
    Picture {
        /// The picture.
        output: Box<Output>,
        /// True if its mesh was in memory.
        mesh_was_kept: bool,
    },
    /// The outcome of [`Task::Inspect`], as JSON.
    Report(String),
    /// The outcome of [`Task::Check`], and of [`Task::Diff`] without a picture.
    Verdict {
        /// The verdict, as JSON.
        json: String,
        /// True if its answer is 422.
        has_failed: bool,
    },
}

/// The states of a job. All but the first two are final.
#[derive(Clone, Debug)]
pub enum JobState {
    /// The job waits for a worker.
    Queued,
    /// A worker does it.
    Running,
    /// It ended with a picture or a verdict.
    Done(Arc<Finished>),
    /// It ended with a report, as JSON. Clones share the bytes.
    Inspected(Bytes),
    /// It ended with an error.
    Failed(Arc<Failure>),
    /// The client cancelled it, or hung up.
    Cancelled,
}

/// The form of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Media {
    /// A picture of this format.
    Picture(ImageFormat),
    /// A verdict as JSON.
    Json,
}

/// A picture or a verdict, and the metadata of its making.
#[derive(Debug)]
pub struct Finished {
    /// The encoded picture, or the text of the verdict. Clones share the bytes.
    pub content: Bytes,
    /// The memory of the content, if it is counted.
    pub memory: Option<Arc<MemoryShare>>,
    /// The form of the content.
    pub media: Media,
    /// True for a verdict that is to be answered with 422, as its request asks.
    pub has_failed: bool,
    /// The back-end that drew it; the CPU for verdicts.
    pub backend: BackendKind,
    /// True if the CPU drew it because a GPU that was chosen could not.
    pub is_substitute: bool,
    /// Faults of the file in spite of which it was drawn.
    pub warnings: Vec<Warning>,
    /// The techniques chosen for a request with a quality target.
    pub selection: Option<QualitySelection>,
    /// True if the mesh was in memory as it is drawn, so that nothing was read.
    pub mesh_was_kept: bool,
    /// The duration of each stage.
    pub timings: Timings,
    /// The durations of the stages of drawing, as far as the back-end times them.
    pub draw_times: DrawTimes,
}

impl Failure {
    /// True if the request asks for a GPU, and this server has none.
    pub fn is_without_gpu(&self) -> bool {
        matches!(self, Self::Render(RenderError::Draw(DrawError::NoGpu(_))))
    }
}

impl Finished {
    /// Takes over the pipeline's output.
    pub fn new(output: Output, timings: Timings) -> Self {
        let Output { bytes, format, report } = output;
        let DrawReport { backend, is_substitute, draw_times, warnings, selection, .. } = report;
        Self {
            content: bytes.into(),
            memory: None,
            media: Media::Picture(format),
            has_failed: false,
            backend,
            is_substitute,
            warnings,
            selection,
            mesh_was_kept: false,
            timings,
            draw_times,
        }
    }

    /// A verdict as JSON.
    pub fn verdict(json: String, has_failed: bool, timings: Timings) -> Self {
        Self {
            content: json.into(),
            memory: None,
            media: Media::Json,
            has_failed,
            backend: BackendKind::Cpu,
            is_substitute: false,
            warnings: Vec::new(),
            selection: None,
            mesh_was_kept: false,
            timings,
            draw_times: DrawTimes::default(),
        }
    }

    /// Counts its bytes as long as anything holds them: in a cache, as a result, or in an answer that is being sent.
    #[must_use]
    pub fn counted(mut self, memory: &Arc<Memory>) -> Self {
        let (content, share) = counted(memory, std::mem::take(&mut self.content));
        Self { content, memory: Some(share), ..self }
    }

    /// Counts its bytes on the account of what keeps it, as long as the guard lives.
    pub fn kept_on(&self, account: Account) -> Option<Keeping> {
        self.memory.clone().map(|share| Keeping::new(share, account))
    }
}

/// Reasons why a job failed.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The pipeline failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The job took too long.
    #[error("the job did not finish within {limit_ms} ms after a worker began it")]
    TimeUp {
        /// The longest time allowed.
        limit_ms: u64,
    },
    /// The renderer has a bug.
    #[error("the renderer failed unexpectedly")]
    Panicked,
    /// The process ended each time while it did this job.
    #[error("the server ended {times} times while it did this job, so it is not tried again")]
    Crashed {
        /// How often.
        times: u32,
    },
    /// The data folder, or the store of the service, has lost what the job needs.
    #[error("what this job needs is lost or damaged where it was kept")]
    Lost,
    /// The failure of an earlier process.
    #[error("{}", .0.detail)]
    Recorded(ErrorRecord),
}

impl JobState {
    /// True if the state will not change any more.
    pub fn is_final(&self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }

    /// The state's name: `queued`, `running`, `done`, `failed` or `cancelled`.
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

/// The durations of a job's stages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Waiting for a worker.
    pub queue: Duration,
    /// Bytes to mesh.
    pub parse: Duration,
    /// Mesh and spec to plan.
    pub plan: Duration,
    /// Plan to image, or meshes to verdict.
    pub render: Duration,
    /// Image to bytes.
    pub encode: Duration,
}

impl Timings {
    /// Records the duration of a stage. A sheet has some stages once for each view.
    pub fn record(&mut self, stage: Stage, took: Duration) {
        *match stage {
            Stage::Parse => &mut self.parse,
            Stage::Plan => &mut self.plan,
            Stage::Render | Stage::Judge => &mut self.render,
            Stage::Encode => &mut self.encode,
            // No field has its time.
            _ => return,
        } += took;
    }

    /// Name and duration of every stage, in order.
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
    /// The job's name.
    pub id: JobId,
    /// The job can be found by its id, also after its end.
    pub is_kept: bool,
    /// Its class in the queue: a job that can be found by its id is fetched later.
    pub class: Class,
    /// The party that asked for it.
    pub owner: Owner,
    /// The id of the request that brought it, for the log.
    pub request_id: Arc<str>,
    /// The place of that request in a trace.
    pub trace: Trace,
    /// The address that hears of its end.
    pub webhook: Option<Arc<str>>,
    /// Time of acceptance by this process.
    pub accepted: Instant,
    /// Time of acceptance in milliseconds since 1970, for clients.
    pub accepted_unix_ms: u64,
    /// It shows a job that is not this server's.
    is_mirror: bool,
    /// Its record and its end are in the data folder.
    pub(in crate::jobs) is_durable: bool,
    /// Number in the order of acceptance.
    pub(in crate::jobs) serial: u64,
    pub(in crate::jobs) size: Size,
    /// The time for which it will occupy a worker, as far as is known.
    pub(in crate::jobs) estimate: Duration,
    /// The memory with which a worker begins it, bytes. It grows once, if it turns out that others have what it needs.
    pub(in crate::jobs) memory_bytes: AtomicU64,
    /// Its place in the queue: a time since the registry's beginning.
    pub(in crate::jobs) rank: Duration,
    pub(in crate::jobs) deadline: Deadline,
    pub(in crate::jobs) state: watch::Sender<JobState>,
    /// How far it has come in this process.
    pub(in crate::jobs) progress: watch::Sender<Progress>,
    /// The name that the client gave its request.
    pub(in crate::jobs) claim: Option<Arc<Claim>>,
    work: Mutex<Option<Work>>,
    /// Its bytes in the data folder.
    holds: Mutex<Vec<Arc<Hold>>>,
}

/// The size of a job, on which its estimate depends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Size {
    /// The duration by the formula, seconds.
    pub(in crate::jobs) formula_s: f64,
    /// The number of its kind.
    pub(in crate::jobs) kind: usize,
    /// A hash of the mesh's key and the task, if the mesh is stored. Two that are equal by chance make an
    /// estimate worse, and nothing else.
    pub(in crate::jobs) mesh: Option<u64>,
    /// True for a mesh that was drawn before, and so is likely to be in memory.
    pub(in crate::jobs) is_known: bool,
    /// Bytes of memory by the formula.
    pub(in crate::jobs) formula_bytes: f64,
}

/// A job that has ended in an earlier process.
pub struct Restored {
    /// Its name.
    pub id: JobId,
    /// The time of its acceptance in milliseconds since 1970.
    pub accepted_unix_ms: u64,
    /// The party that asked for it.
    pub owner: Owner,
    /// The name that it gave its request.
    pub claim: Option<Arc<Claim>>,
}

/// What distinguishes a new job beside its work.
pub struct Admission {
    /// The job can be found by its id.
    pub is_kept: bool,
    /// Its class in the queue.
    pub class: Class,
    /// The party that asked for it.
    pub owner: Owner,
    /// It is in the data folder.
    pub is_durable: bool,
    /// Number in the order of acceptance.
    pub serial: u64,
    /// The size on which its estimate depends.
    pub size: Size,
    /// The time for which it will occupy a worker.
    pub estimate: Duration,
    /// The memory with which it begins, bytes.
    pub memory_bytes: u64,
    /// Its place in the queue.
    pub rank: Duration,
    /// The name that the client gave the request.
    pub claim: Option<Arc<Claim>>,
}

impl Job {
    pub(in crate::jobs) fn new(work: Option<Work>, admission: Admission, name: Option<(JobId, u64)>) -> Self {
        let (id, accepted_unix_ms) = name.unwrap_or_else(|| (JobId::fresh(), unix_ms()));
        let Admission { is_kept, class, owner, is_durable, serial, size, estimate, memory_bytes, rank, claim } =
            admission;
        Self {
            id,
            is_kept,
            class,
            owner,
            request_id: work.as_ref().map_or_else(|| "".into(), |work| work.request_id.clone()),
            trace: Trace::here(),
            webhook: work.as_ref().and_then(|work| work.webhook.clone()),
            accepted: Instant::now(),
            accepted_unix_ms,
            is_mirror: false,
            is_durable,
            serial,
            size,
            estimate,
            memory_bytes: AtomicU64::new(memory_bytes),
            rank,
            deadline: Deadline::default(),
            state: watch::Sender::new(JobState::Queued),
            progress: watch::Sender::default(),
            claim,
            work: Mutex::new(work),
            holds: Mutex::default(),
        }
    }

    /// Looks at the work. None if it was taken.
    pub(in crate::jobs) fn with_work<T>(&self, look: impl FnOnce(&Work) -> T) -> Option<T> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(look)
    }

    /// Replaces the bytes that it holds in the data folder, and returns those that it held.
    pub(in crate::jobs) fn hold(&self, holds: Vec<Arc<Hold>>) -> Vec<Arc<Hold>> {
        std::mem::replace(&mut self.holds.lock().unwrap_or_else(PoisonError::into_inner), holds)
    }

    /// The state at this moment.
    pub fn state(&self) -> JobState {
        self.state.borrow().clone()
    }

    /// A worker begins with it.
    pub(in crate::jobs) fn begin(&self, task: &Task) {
        let views = match task {
            Task::Draw(spec) => spec.sheet.as_ref().map_or(1, |sheet| sheet.count()),
            Task::Inspect { .. } | Task::Check(_) | Task::Diff(_) => 0,
        };
        self.progress.send_replace(Progress::begun(views));
    }

    /// Follows its state and how far it has come.
    pub fn watch(&self) -> (watch::Receiver<JobState>, watch::Receiver<Progress>) {
        (self.state.subscribe(), self.progress.subscribe())
    }

    /// Waits for the job's end.
    pub async fn ended(&self) -> JobState {
        let mut states = self.state.subscribe();
        match states.wait_for(JobState::is_final).await {
            Ok(state) => state.clone(),
            // Unreachable, because this job owns the sender. A stale state is better than a panic.
            Err(_) => self.state(),
        }
    }

    /// Gives the work back that a worker has taken, and could not do.
    pub(in crate::jobs) fn put_work(&self, work: Work) {
        *self.work.lock().unwrap_or_else(PoisonError::into_inner) = Some(work);
    }

    /// Takes the work out of the job. None if it was taken before.
    pub(in crate::jobs) fn take_work(&self) -> Option<Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Milliseconds since 1970.
pub fn unix_ms() -> u64 {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_1970.as_millis()).unwrap_or(u64::MAX)
}

/// A time in milliseconds since 1970 as text. Times that have no such text are those of a broken clock.
pub fn rfc_3339(unix_ms: u64) -> String {
    // The last millisecond of the year 9999.
    const UNIX_MS_MAX: u64 = 253_402_300_799_999;
    let time = UNIX_EPOCH + Duration::from_millis(unix_ms.min(UNIX_MS_MAX));
    humantime::format_rfc3339_millis(time).to_string()
}

#[cfg(test)]
mod tests {
    use super::rfc_3339;

    #[test]
    fn times_have_a_text() {
        assert_eq!(rfc_3339(0), "1970-01-01T00:00:00.000Z");
        assert_eq!(rfc_3339(1_709_210_096_789), "2024-02-29T12:34:56.789Z");
        assert_eq!(rfc_3339(u64::MAX), "9999-12-31T23:59:59.999Z");
    }
}
