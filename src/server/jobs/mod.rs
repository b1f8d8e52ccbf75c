//! Jobs: a bounded queue, worker threads that each own a renderer, and the results. A job draws a
//! picture, judges a mesh, compares two, or writes the report on one.
//!
//! Architecture invariants: a full queue refuses at once and never waits. While the process runs, an accepted job is
//! never dropped before its end. A panic costs its job alone. Nothing here knows HTTP.
//!
//! Reading order: [`job`] (one job and its states, or those of another server's), `class` (its owner, and whether a client waits for it),
//! [`claims`] (names of requests), [`progress`] (how far it has come), [`queue`] (those that wait), [`registry`] (all
//! jobs, behind one lock), [`dispatch`] (the hand-over to workers), [`results`] (those that have ended), [`storage`]
//! (jobs in the data folder), [`estimates`] (time and memory that jobs will take), [`worker`] (does the jobs),
//! [`clock`] (ends jobs whose time is up), [`watchdog`] (workers that do not end them).

mod claims;
mod class;
mod clock;
mod dispatch;
mod estimates;
mod job;
mod progress;
mod queue;
mod registry;
mod results;
mod storage;
#[cfg(test)]
mod tests;
mod watchdog;
mod worker;

pub use claims::{Claim, ClaimName};
pub use class::{Class, Owner};
pub use job::{
    Checking, Comparing, Failure, Finished, Job, JobId, JobState, Media, Newer, Product, Recipe, Task, Timings, Work,
};
pub use progress::{Progress, Step};
pub use storage::{JSON, Storage, end_of, name, picture_record, read_end, read_picture, record_of, value_of};
pub use watchdog::{Quarantine, Strikes};
pub use worker::{CpuThreads, Renderer, RendererFactory, pipeline_renderers};

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::digest::Digest;
use super::durable::{Change, EndRecord, Hold, Unstored};
use super::memory::Memory;
use super::metrics::Metrics;
use claims::Claimed;
pub use job::{Restored, rfc_3339, unix_ms};
use registry::JobRegistry;

/// The limits of the job service.
#[derive(Clone, Debug)]
pub struct JobSettings {
    /// Number of worker threads.
    pub workers: usize,
    /// Most jobs of a class that wait, over all workers.
    pub queue: usize,
    /// Time without work after which a worker drops its renderer, and with it the memory in which it draws.
    pub idle_time: Duration,
    /// Longest time from the moment at which a worker begins to the encoded picture.
    pub job_time: Duration,
    /// Time beyond that after which its worker is replaced.
    pub overdue_grace: Duration,
    /// Longest time for which a job is let wait that somebody waits for, as far as is known.
    pub interactive_wait: Duration,
    /// The same for a job that is fetched later.
    pub batch_wait: Duration,
    /// Time for which the result of a kept job can be fetched again after the first time.
    pub result_ttl: Duration,
    /// Time for which a result waits for being fetched.
    pub unfetched_ttl: Duration,
    /// Most encoded bytes of kept results. `results.rs` says which are dropped first.
    pub result_bytes: u64,
    /// Most kept results. `results.rs` says which are dropped first.
    pub result_count: usize,
    /// The memory of the process.
    pub memory: Arc<Memory>,
    /// The data folder. None: kept jobs end with the process.
    pub storage: Option<Storage>,
    /// Hears of waits, stages and ends.
    pub metrics: Option<Arc<Metrics>>,
    /// Gives the code of a failure.
    pub code_of: fn(&Failure) -> &'static str,
    /// Hears of the end of each job that has a webhook.
    pub webhooks: Option<OnEnd>,
}

/// A function that is called with each job that has ended. The registry holds its lock meanwhile, so the function returns
/// at once.
pub type Hear = dyn Fn(&Arc<Job>) + Send + Sync;

/// Hears of the end of a job.
#[derive(Clone)]
pub struct OnEnd(pub Arc<Hear>);

impl std::fmt::Debug for OnEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OnEnd").finish_non_exhaustive()
    }
}

/// Reasons why a job was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The queue is full.
    #[error("the queue is full ({queue} waiting); try again in {retry_after_s} s")]
    QueueFull {
        /// Most jobs that wait.
        queue: usize,
        /// Seconds until a place should be free.
        retry_after_s: u64,
    },
    /// The job would wait for too long.
    #[error(
        "the work that was accepted before takes about {wait_ms} ms, and a job of this kind is let wait for \
         {limit_ms} ms; try again in {retry_after_s} s"
    )]
    TooLate {
        /// The class of the job.
        class: Class,
        /// Time until it would begin, as far as is known.
        wait_ms: u64,
        /// The longest time for which it is let wait.
        limit_ms: u64,
        /// Seconds until there should be time enough.
        retry_after_s: u64,
    },
    /// There is no memory for the job beside uploads, results and answers.
    #[error(
        "uploads, results and answers that are being sent leave no memory for this job, which takes about {bytes} \
         bytes; try again in {retry_after_s} s"
    )]
    MemoryFull {
        /// Bytes that it takes, as far as is known.
        bytes: u64,
        /// Seconds until there may be some.
        retry_after_s: u64,
    },
    /// More meshes at once than there could ever be places for.
    #[error(
        "the form has more than {most} meshes, for which there is no place even in an empty queue; send fewer at once"
    )]
    TooMany {
        /// Most that may come at once.
        most: u64,
    },
    /// Meshes that would wait for one another for too long.
    #[error(
        "{count} meshes of the form take about {takes_ms} ms, and a job is let wait for {limit_ms} ms; send fewer at \
         once"
    )]
    TooMuch {
        /// Number of meshes.
        count: usize,
        /// Time until the last one would begin if there were no others.
        takes_ms: u64,
        /// The longest time for which it is let wait.
        limit_ms: u64,
    },
    /// The job cannot be stored.
    #[error(transparent)]
    Unstored(#[from] Unstored),
    /// The mesh keeps workers busy beyond the time of a job.
    #[error(
        "the mesh {mesh}, or comparisons with it, kept workers busy long after their time was up, so that is not tried \
         again until the service starts anew"
    )]
    Quarantined {
        /// Its SHA-256.
        mesh: Digest,
    },
    /// The process shuts down.
    #[error("the server is shutting down and takes no new work")]
    Draining,
}

/// The meaning of a request's name.
#[derive(Debug)]
pub enum Named {
    /// This request, which is new.
    New(Arc<Claim>),
    /// This request, which was accepted before as this job.
    Known(Arc<Job>),
    /// This request, which another connection is about to get accepted.
    Pending,
    /// Another request.
    Other,
}

/// The load at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobLoad {
    /// Number of jobs that wait.
    pub queued: usize,
    /// The same by class.
    pub queued_by_class: [usize; 2],
    /// Number of busy workers, without those that are overdue.
    pub running: usize,
    /// Workers that do not end their jobs.
    pub overdue: usize,
    /// Those of them that have no replacement.
    pub missing: usize,
    /// Meshes that are refused because of it, by themselves or in comparisons.
    pub quarantined: usize,
    /// Time after which a job that somebody waits for would begin, as far as is known.
    pub wait: Duration,
    /// The same for a job that is fetched later.
    pub batch_wait: Duration,
    /// Number of ended jobs that can be found by their ids.
    pub kept: usize,
    /// Encoded bytes of their results.
    pub kept_bytes: u64,
}

/// A handle to the job service. Clones share the service. Its threads end after [`Jobs::drain`].
#[derive(Clone)]
pub struct Jobs {
    registry: Arc<JobRegistry>,
    workers: Arc<Mutex<Vec<JoinHandle<()>>>>,
}

impl Jobs {
    /// Starts the workers and the clock.
    pub fn start(settings: JobSettings, renderers: RendererFactory) -> std::io::Result<Self> {
        let workers = settings.workers.max(1);
        let registry = Arc::new(JobRegistry::new(settings));
        let threads = Arc::new(Mutex::new(Vec::new()));
        let start = {
            let (registry, threads) = (registry.clone(), threads.clone());
            move || {
                let (registry, renderers) = (registry.clone(), renderers.clone());
                let mut threads = threads.lock().unwrap_or_else(PoisonError::into_inner);
                let name = format!("render-{}", threads.len());
                let worker = move || worker::run(&registry, &renderers);
                threads.push(std::thread::Builder::new().name(name).spawn(worker)?);
                std::io::Result::Ok(())
            }
        };
        (0..workers).try_for_each(|_| start())?;
        let clocked = registry.clone();
        let replace = move || {
            if let Err(error) = start() {
                tracing::error!(%error, "no worker could be started in the place of an overdue one");
            }
        };
        std::thread::Builder::new().name("job-clock".into()).spawn(move || clock::run(&clocked, &replace))?;
        Ok(Self { registry, workers: threads })
    }

    /// Queues work. A kept job can be found by its id until its result expires. Any other job lives
    /// as long as its handle.
    pub fn submit(&self, work: Work, is_kept: bool) -> Result<Arc<Job>, Refusal> {
        self.check_mesh(&work)?;
        self.registry.submit(work, is_kept)
    }

    /// Queues work that can be found by its id until its result expires. With a data folder, the job is durable
    /// when this returns, and goes on even if the caller does not wait for that.
    pub async fn accept(&self, work: Work) -> Result<Arc<Job>, Refusal> {
        self.accept_all(vec![work]).await?.pop().ok_or(Refusal::Unstored(Unstored::Failed))
    }

    /// As [`Jobs::accept`], of several works of one owner: all of them or none. In a data folder, they share a
    /// transaction.
    pub async fn accept_all(&self, works: Vec<Work>) -> Result<Vec<Arc<Job>>, Refusal> {
        works.iter().try_for_each(|work| self.check_mesh(work))?;
        let storage = self.registry.settings.storage.clone();
        let jobs = self.registry.admit_all(works, storage.is_some())?;
        let Some(storage) = storage else {
            jobs.iter().for_each(|job| self.registry.enqueue(job));
            return Ok(jobs);
        };
        let (registry, stored) = (self.registry.clone(), jobs.clone());
        let storing = tokio::spawn(async move {
            let outcome = store(&storage, &stored).await;
            for job in &stored {
                match outcome {
                    Ok(()) => registry.enqueue(job),
                    Err(_) => registry.withdraw(job),
                }
            }
            outcome
        });
        storing.await.unwrap_or(Err(Unstored::Failed))?;
        Ok(jobs)
    }

    /// Most works that [`Jobs::accept_all`] may ever accept at once.
    pub fn accepted_max(&self) -> usize {
        self.registry.accepted_max()
    }

    /// Lets a name stand for a request, unless it stands for one whose job can be found.
    pub fn claim(&self, name: &ClaimName, request: Digest) -> Named {
        loop {
            match self.registry.claims.claim(name, request) {
                Claimed::New(claim) => return Named::New(claim),
                Claimed::Pending => return Named::Pending,
                Claimed::Other => return Named::Other,
                Claimed::Job(key, claim) => match self.find(JobId::from_key(key)) {
                    Some(job) => return Named::Known(job),
                    // It went in this moment.
                    None => self.registry.claims.free(&claim),
                },
            }
        }
    }

    /// True if the name stands for a request.
    pub fn has_claim(&self, name: &ClaimName) -> bool {
        self.registry.claims.has(name)
    }

    /// Queues a job that an earlier process has accepted at this time.
    pub fn resume(&self, name: (JobId, u64), work: Work, holds: Vec<Arc<Hold>>) {
        self.registry.resume(name, work, true, holds);
    }

    /// Queues a job of a queue that several servers share, for the workers of this one. It lives as long as its handle:
    /// its end is the service's.
    pub fn do_shared(&self, name: (JobId, u64), work: Work) -> Arc<Job> {
        self.registry.resume(name, work, false, Vec::new())
    }

    /// The mesh of a work that is refused, because it keeps workers busy beyond the time of a job.
    pub fn check_mesh(&self, work: &Work) -> Result<(), Refusal> {
        self.registry.quarantine.holds(&work.meshes()).map_or(Ok(()), |mesh| Err(Refusal::Quarantined { mesh }))
    }

    /// The meshes that keep workers busy.
    pub fn quarantine(&self) -> &Quarantine {
        &self.registry.quarantine
    }

    /// Number of jobs that this server does for a queue that several share: those that its workers can do, and one that
    /// waits for each.
    pub fn shared_slots(&self) -> usize {
        2 * self.registry.batch_workers()
    }

    /// Adds a job that has ended in an earlier process, or whose end is found out now.
    pub fn restore(&self, name: Restored, state: JobState, end: Option<&EndRecord>, holds: Vec<Arc<Hold>>) {
        if end.is_none()
            && let Some(storage) = &self.registry.settings.storage
            && let Ok((record, holds)) = storage.of_end(&state)
        {
            storage.durable.store_surely(
                vec![Change::Ended(name.id.key(), Box::new(record))],
                holds,
                Vec::new(),
                |_| (),
            );
        }
        let is_fetched = end.is_some_and(|end| end.fetched_unix_ms.is_some());
        self.registry.restore(name, state, is_fetched, holds);
    }

    /// Forgets a kept job that has ended, and its result.
    pub fn forget(&self, job: &Job) {
        self.registry.forget(job);
    }

    /// A client has the end of a kept job: from now on it is kept for a while only.
    pub fn fetched(&self, job: &Job) {
        self.registry.fetched(job);
    }

    /// Checks that a job would be accepted now, so that a refusal can come before an upload.
    pub fn would_accept(&self, class: Class, owner: &Owner) -> Result<(), Refusal> {
        self.registry.would_accept(class, owner)
    }

    /// A kept job.
    pub fn find(&self, id: JobId) -> Option<Arc<Job>> {
        self.registry.find(id)
    }

    /// Cancels a job. One that has ended stays as it is.
    pub fn cancel(&self, job: &Arc<Job>) {
        self.registry.end(job, JobState::Cancelled);
    }

    /// The load at this moment.
    pub fn load(&self) -> JobLoad {
        self.registry.load()
    }

    /// Refuses new work from now on. Accepted jobs go on.
    pub fn drain(&self) {
        self.registry.drain();
    }

    /// Waits until no job waits and no worker is busy.
    pub async fn idle(&self) {
        let mut outstanding = self.registry.outstanding();
        // This cannot fail: `self` keeps the registry alive, which owns the sender.
        let _ = outstanding.wait_for(|&count| count == 0).await;
    }

    /// Waits, after [`Jobs::drain`], until the workers have dropped their renderers. A GPU driver
    /// that is unloaded while a thread still owns a device crashes. A worker may be stuck, so the
    /// wait is no longer than `time_max`.
    pub fn join(&self, time_max: Duration) {
        let until = Instant::now() + time_max;
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        while workers.iter().any(|worker| !worker.is_finished()) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        for worker in workers.drain(..).filter(JoinHandle::is_finished) {
            // Its panic, if there was one, is in the log. What is left of it is a call of the driver, which is short. Threads
            // that still run are detached: the process is about to end.
            let _ = worker.join();
        }
    }
}

/// Writes accepted jobs to the data folder. Files are written, and hashed, on a thread that may wait.
async fn store(storage: &Storage, jobs: &[Arc<Job>]) -> Result<(), Unstored> {
    let (writer, written) = (storage.clone(), jobs.to_vec());
    let recording = tokio::task::spawn_blocking(move || {
        let record = |job: &Arc<Job>| job.with_work(|work| writer.of_job(job, work)).unwrap_or(Err(Unstored::Failed));
        written.iter().map(record).collect::<Result<Vec<_>, _>>()
    });
    let (records, holds): (Vec<_>, Vec<_>) = recording.await.unwrap_or(Err(Unstored::Failed))?.into_iter().unzip();
    let changes = records.into_iter().map(|record| Change::Accepted(Box::new(record))).collect();
    storage.durable.store(changes, holds.concat()).await?;
    for (job, holds) in jobs.iter().zip(holds) {
        job.hold(holds);
    }
    Ok(())
}
