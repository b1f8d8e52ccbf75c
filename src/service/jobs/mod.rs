//! Rendering, and the inspection of what is to be stored, as jobs: a bounded queue, worker threads that each own their renderers, and what became of every job.
//!
//! Architecture invariants: a full queue is a typed refusal at once, never a wait. A job that was accepted is never
//! dropped before it ended. A panic costs its job alone. Nothing here knows HTTP.
//!
//! Reading order: [`job`] (one job and its states), [`board`] (all of them, behind one lock), [`worker`], [`clock`]
//! (raises deadlines), [`bodies`] (bytes of waiting uploads).

mod clock;
mod job;
pub(crate) mod registry;
#[cfg(test)]
mod tests;
pub(crate) mod upload_budget;
mod worker;

pub use job::{Failure, Finished, Job, JobId, Product, State, Task, Timings, Work};
pub use upload_budget::{Reservation, UploadBudget, UploadBudgetFull};
pub use worker::{Engine, Renderer, pipeline_engine};

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use registry::Registry;

/// How many, how long, how much.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Worker threads.
    pub workers: usize,
    /// Jobs that may wait, in all.
    pub queue: usize,
    /// From acceptance to the encoded picture.
    pub job_time: Duration,
    /// How long the result of a kept job can be fetched.
    pub result_ttl: Duration,
    /// Encoded bytes of kept results; the oldest go first.
    pub result_bytes: u64,
    /// Kept results; the oldest go first.
    pub result_count: usize,
}

/// Why a job was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// As many jobs wait as may wait.
    #[error("the queue is full ({queue} waiting); try again in {retry_after_s} s")]
    QueueFull {
        /// How many may wait.
        queue: usize,
        /// When a place should be free.
        retry_after_s: u64,
    },
    /// The process is about to end.
    #[error("the server is shutting down and takes no new work")]
    Draining,
}

/// What the queue looks like at this moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Load {
    /// Jobs that wait.
    pub queued: usize,
    /// Jobs that workers are busy with.
    pub running: usize,
    /// Finished jobs whose results can be fetched.
    pub kept: usize,
    /// Encoded bytes of those.
    pub kept_bytes: u64,
}

/// The job service. Clones are handles to the same one; its threads end after [`Jobs::drain`].
#[derive(Clone)]
pub struct Jobs {
    board: Arc<Registry>,
    workers: Arc<Mutex<Vec<JoinHandle<()>>>>,
}

impl Jobs {
    /// Starts the workers and the clock.
    pub fn start(settings: Settings, engine: Engine) -> std::io::Result<Self> {
        let workers = settings.workers.max(1);
        let board = Arc::new(Registry::new(settings));
        let mut threads = Vec::new();
        for index in 0..workers {
            let (board, engine) = (board.clone(), engine.clone());
            let name = format!("render-{index}");
            threads.push(std::thread::Builder::new().name(name).spawn(move || worker::run(&board, &engine))?);
        }
        let ticking = board.clone();
        std::thread::Builder::new().name("job-clock".into()).spawn(move || clock::run(&ticking))?;
        Ok(Self { board, workers: Arc::new(Mutex::new(threads)) })
    }

    /// Queues work. A kept job can be found again by its id until its result expires; another lives as long as its handle.
    pub fn submit(&self, work: Work, keep: bool) -> Result<Arc<Job>, Refusal> {
        self.board.submit(work, keep)
    }

    /// Whether a job would be accepted now, so that a refusal can come before an upload.
    pub fn would_accept(&self) -> Result<(), Refusal> {
        self.board.would_accept()
    }

    /// A kept job.
    pub fn find(&self, id: JobId) -> Option<Arc<Job>> {
        self.board.find(id)
    }

    /// Stops a job that has not ended; one that has stays as it is.
    pub fn cancel(&self, job: &Job) {
        self.board.end(job, State::Cancelled);
    }

    /// What the queue looks like.
    pub fn load(&self) -> Load {
        self.board.load()
    }

    /// Takes no more work.
    pub fn drain(&self) {
        self.board.drain();
    }

    /// Returns once nothing waits and no worker is busy.
    pub async fn idle(&self) {
        let mut outstanding = self.board.outstanding();
        // The sender lives in the board, so waiting cannot fail while self is there.
        let _ = outstanding.wait_for(|&count| count == 0).await;
    }

    /// Waits, after [`Jobs::drain`], until the workers have ended and dropped their renderers; no longer than `patience`,
    /// since a worker may be stuck. A GPU driver that is unloaded under a thread that still owns its device crashes.
    pub fn join(&self, patience: Duration) {
        let until = Instant::now() + patience;
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        while workers.iter().any(|worker| !worker.is_finished()) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        // Finished or not, there is nothing more to do about them: the process is about to end.
        workers.clear();
    }
}
