//! The registry of all jobs: waiting, running, and ended with a result that can be fetched.
//!
//! One lock guards them all, because a job may be cancelled at the moment in which a worker takes
//! it. The lock is held for microseconds, and a render takes milliseconds.
//!
//! The queue is not a channel, because a cancelled job must leave it at once and free its place and its memory.
//!
//! Waiting and running are timed apart. A job's time begins when a worker begins it, so that no job fails because
//! it has waited. A job that would wait for too long is refused when it comes. The refusal says after how many seconds to
//! try again.
//!
//! Short jobs overtake long ones of the same owner and class: a job ranks as if it had been accepted later by
//! [`PATIENCE`] times its estimate, at most a quarter of the time that a job may take. So what is accepted later than
//! that cannot overtake it. Where there are several workers, batch jobs leave one of them to interactive jobs.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::claims::Claims;
use super::class::{Class, Owner};
use super::estimates::Estimates;
use super::job::{Admission, Job, JobId, JobState, Media, Restored, Size, Work, unix_ms};
use super::queue::Queue;
use super::results::Results;
use super::storage::Storage;
use super::watchdog::{Overdue, Quarantine, Running};
use super::{JobLoad, JobSettings, OnEnd, Refusal};
use crate::durable::{Change, Hold};

/// The rank that a job loses for each second of its estimate, seconds.
const PATIENCE: u32 = 4;

/// The least memory of a job, bytes: that of one that is not known yet.
const JOB_BYTES_MIN: u64 = 1 << 20;

/// All jobs, and the conditions that threads wait for.
pub struct JobRegistry {
    pub(super) settings: JobSettings,
    pub(super) estimates: Estimates,
    pub(super) claims: Arc<Claims>,
    pub(super) quarantine: Quarantine,
    /// The time from which ranks count.
    began: Instant,
    inner: Mutex<Inner>,
    /// Wakes workers: a job was queued, or draining began.
    pub(super) work: Condvar,
    /// Wakes the clock: there is a new deadline or a new result, or draining began.
    pub(super) clock: Condvar,
    /// Number of jobs that wait or occupy a worker.
    outstanding: watch::Sender<usize>,
}

/// The state of all jobs, behind one lock.
#[derive(Default)]
pub(super) struct Inner {
    pub(super) queue: Queue,
    /// Number of jobs whose end is being stored.
    ending: usize,
    /// Queued and running jobs in the order of acceptance.
    pub(super) active: BTreeMap<u64, Arc<Job>>,
    /// Jobs that occupy a worker, by number. A cancelled one may do so for a moment longer.
    pub(super) running: HashMap<u64, Running>,
    /// Workers that are counted as lost.
    overdue: Overdue,
    kept: HashMap<JobId, Arc<Job>>,
    /// Kept jobs that have ended.
    results: Results,
    pub(super) draining: bool,
    serial: u64,
}

/// The jobs and workers that have taken too long.
#[derive(Default)]
pub struct Late {
    /// Jobs whose time is up.
    pub jobs: Vec<Arc<Job>>,
    /// Jobs that their worker does not end, and whether another worker is to take its place.
    pub workers: Vec<(Running, bool)>,
}

impl JobRegistry {
    /// An empty registry.
    pub fn new(settings: JobSettings) -> Self {
        let outstanding = watch::Sender::new(0);
        Self {
            settings,
            estimates: Estimates::new(),
            claims: Arc::default(),
            quarantine: Quarantine::default(),
            began: Instant::now(),
            inner: Mutex::default(),
            work: Condvar::new(),
            clock: Condvar::new(),
            outstanding,
        }
    }

    /// Checks that a job would be accepted now.
    pub fn would_accept(&self, class: Class, owner: &Owner) -> Result<(), Refusal> {
        self.check(&self.lock(), class, owner)?;
        self.check_memory(JOB_BYTES_MIN)
    }

    /// Checks that what cannot be dropped leaves memory for a job.
    fn check_memory(&self, bytes: u64) -> Result<(), Refusal> {
        match self.settings.memory.could_run(bytes) {
            true => Ok(()),
            false => Err(Refusal::MemoryFull { bytes, retry_after_s: 2 }),
        }
    }

    /// The memory with which a job of this size begins.
    fn memory_of(&self, size: Size) -> u64 {
        self.estimates.memory(size).max(JOB_BYTES_MIN).min(self.settings.memory.job_max())
    }

    /// Queues work. A kept job can be found by its id until its result expires.
    pub fn submit(&self, work: Work, is_kept: bool) -> Result<Arc<Job>, Refusal> {
        let size = self.estimates.size(&work);
        let mut inner = self.lock();
        let job = self.admit(&mut inner, (work, size), is_kept, false)?;
        self.insert(&mut inner, &job);
        Ok(job)
    }

    /// Gives works places in the queue, all or none, which [`Self::enqueue`] takes or [`Self::withdraw`] gives back.
    /// They are kept.
    pub fn admit_all(&self, works: Vec<Work>, are_durable: bool) -> Result<Vec<Arc<Job>>, Refusal> {
        let works: Vec<_> = works.into_iter().map(|work| (self.estimates.size(&work), work)).collect();
        let mut inner = self.lock();
        let mut jobs: Vec<Arc<Job>> = Vec::with_capacity(works.len());
        for (size, work) in works {
            match self.admit(&mut inner, (work, size), true, are_durable) {
                Ok(job) => jobs.push(job),
                Err(refusal) => {
                    jobs.iter().for_each(|job| inner.queue.withdraw(job));
                    self.publish(&inner);
                    return Err(self.for_ever(refusal, &jobs));
                }
            }
        }
        self.publish(&inner);
        Ok(jobs)
    }

    /// The refusal of works that came with others, which are admitted: if these alone are too much, trying again
    /// is in vain.
    fn for_ever(&self, refusal: Refusal, others: &[Arc<Job>]) -> Refusal {
        let most = self.accepted_max() as u64;
        let own: Duration = others.iter().map(|job| job.estimate).sum();
        let (takes, limit) = (own / to_u32(self.batch_workers()), self.settings.batch_wait);
        match refusal {
            Refusal::QueueFull { .. } if others.len() as u64 >= most => Refusal::TooMany { most },
            Refusal::TooLate { .. } if takes > limit => {
                Refusal::TooMuch { count: others.len() + 1, takes_ms: to_ms(takes), limit_ms: to_ms(limit) }
            }
            other => other,
        }
    }

    /// Most works of one owner that could be admitted at once: its share of the queue, and every worker that it may have.
    pub fn accepted_max(&self) -> usize {
        self.share() + self.batch_workers()
    }

    fn admit(
        &self,
        inner: &mut Inner,
        (work, size): (Work, Size),
        is_kept: bool,
        is_durable: bool,
    ) -> Result<Arc<Job>, Refusal> {
        let estimate = self.estimates.estimate(size).min(self.settings.job_time);
        let (memory_bytes, owner) = (self.memory_of(size), work.owner.clone());
        self.check_memory(memory_bytes)?;
        self.check(inner, class_of(is_kept), &owner)?;
        inner.serial += 1;
        let rank = self.began.elapsed() + (estimate * PATIENCE).min(self.settings.job_time / 4);
        let (serial, claim, class) = (inner.serial, work.claim.clone(), class_of(is_kept));
        let admission =
            Admission { is_kept, class, owner, is_durable, serial, size, estimate, memory_bytes, rank, claim };
        let job = Arc::new(Job::new(Some(work), admission, None));
        inner.queue.reserve(job.class, &job.owner, estimate);
        Ok(job)
    }

    /// Queues a job that has a place.
    pub fn enqueue(&self, job: &Arc<Job>) {
        let mut inner = self.lock();
        self.insert(&mut inner, job);
    }

    /// Gives the place of a job back.
    pub fn withdraw(&self, job: &Job) {
        let mut inner = self.lock();
        inner.queue.withdraw(job);
        self.publish(&inner);
        self.wake_if_draining(&inner);
    }

    /// Queues a job that was accepted before, by an earlier process or by another server, however full the queue is. One
    /// that is not kept lives as long as its handle. `holds` are its bytes in the data folder.
    pub fn resume(&self, name: (JobId, u64), work: Work, is_kept: bool, holds: Vec<Arc<Hold>>) -> Arc<Job> {
        let size = self.estimates.size(&work);
        let estimate = self.estimates.estimate(size).min(self.settings.job_time);
        let mut inner = self.lock();
        inner.serial += 1;
        let (serial, rank, owner, claim) = (inner.serial, Duration::ZERO, work.owner.clone(), work.claim.clone());
        let (is_durable, class, memory_bytes) = (is_kept, Class::Batch, self.memory_of(size));
        let admission =
            Admission { is_kept, class, owner, is_durable, serial, size, estimate, memory_bytes, rank, claim };
        let job = Arc::new(Job::new(Some(work), admission, Some(name)));
        job.hold(holds);
        inner.queue.reserve(job.class, &job.owner, estimate);
        self.insert(&mut inner, &job);
        job
    }

    /// Adds a job that has ended in an earlier process.
    pub fn restore(&self, name: Restored, state: JobState, is_fetched: bool, holds: Vec<Arc<Hold>>) {
        let Restored { id, accepted_unix_ms, owner, claim } = name;
        let name = (id, accepted_unix_ms);
        let mut inner = self.lock();
        let (size, estimate, rank, serial) = (Size::default(), Duration::ZERO, Duration::ZERO, 0);
        let (is_kept, class, is_durable, memory_bytes) = (true, Class::Batch, true, 0);
        let admission =
            Admission { is_kept, class, owner, is_durable, serial, size, estimate, memory_bytes, rank, claim };
        let job = Arc::new(Job::new(None, admission, Some(name)));
        job.hold(holds);
        inner.results.add(&job, &state, is_fetched, &self.settings);
        job.state.send_replace(state);
        self.keep(&mut inner, &job);
        self.evict(&mut inner);
        self.clock.notify_one();
    }

    fn insert(&self, inner: &mut Inner, job: &Arc<Job>) {
        inner.queue.insert(job);
        if inner.active.is_empty() {
            self.clock.notify_one();
        }
        inner.active.insert(job.serial, job.clone());
        if job.is_kept {
            self.keep(inner, job);
        }
        self.publish(inner);
        self.work.notify_one();
        self.wake_if_draining(inner);
    }

    /// From now on, the job can be found by its id, and by the name of its request.
    fn keep(&self, inner: &mut Inner, job: &Arc<Job>) {
        inner.kept.insert(job.id, job.clone());
        if let Some(claim) = &job.claim {
            claim.set_job(job.id.key());
        }
    }

    /// Threads that wait for the last jobs that are being stored look again whether there will be more.
    fn wake_if_draining(&self, inner: &Inner) {
        if inner.draining {
            self.work.notify_all();
            self.clock.notify_all();
        }
    }

    /// Ends the job of a worker, which is free again after `took`. True if it takes another job.
    pub fn finish(self: &Arc<Self>, job: &Arc<Job>, state: JobState, took: Duration) -> bool {
        let mut inner = self.lock();
        let goes_on = inner.overdue.ended(job);
        // A batch job may wait for this one's end, although workers are idle.
        self.work.notify_one();
        if let Some(running) = inner.running.remove(&job.serial)
            // What ended early says how long it takes only if that is longer than was thought.
            && (matches!(state, JobState::Done(_) | JobState::Inspected(_)) || took > job.estimate)
        {
            self.estimates.learn(running.job.size, took);
        }
        self.end_with(inner, job, state);
        goes_on
    }

    /// Ends a job from outside its worker: cancelled, or out of time.
    pub fn end(self: &Arc<Self>, job: &Arc<Job>, state: JobState) {
        let inner = self.lock();
        self.end_with(inner, job, state);
    }

    /// Ends a job. Only the first end of a job has an effect. That of a durable one is stored before anybody
    /// hears of it, so that it cannot end in another way after a crash.
    fn end_with(self: &Arc<Self>, mut inner: MutexGuard<'_, Inner>, job: &Arc<Job>, state: JobState) {
        if inner.active.remove(&job.serial).is_none() {
            return self.publish(&inner);
        }
        job.deadline.stop();
        self.count(job, &state);
        if job.take_work().is_some() {
            inner.queue.remove(job);
        }
        let Some(storage) = self.storage_of(job) else {
            self.announce(&mut inner, job, state);
            return self.publish(&inner);
        };
        inner.ending += 1;
        self.publish(&inner);
        drop(inner);
        let (registry, ended) = (self.clone(), job.clone());
        let announce = move |state| {
            let mut inner = registry.lock();
            inner.ending -= 1;
            registry.announce(&mut inner, &ended, state);
            registry.publish(&inner);
        };
        match storage.of_end(&state) {
            Ok((record, holds)) => {
                // What the job was made of is let go once its end is stored.
                let inputs = job.hold(holds.clone());
                let change = Change::Ended(job.id.key(), Box::new(record));
                storage.durable.store_surely(vec![change], holds, inputs, move |_| announce(state));
            }
            // It stays accepted in the data folder: after a restart it is done again.
            Err(_) => announce(state),
        }
    }

    fn count(&self, job: &Job, state: &JobState) {
        // Of a job that a client waits for, the answer is in the log.
        if job.is_kept {
            let (id, request_id, end) = (job.id, &*job.request_id, state.name());
            let ms = job.accepted.elapsed().as_millis();
            match state {
                JobState::Failed(failure) => tracing::warn!(job = %id, request_id, ms, %failure, "a job failed"),
                _ => tracing::info!(job = %id, request_id, ms, end, "a job ended"),
            }
        }
        let Some(metrics) = &self.settings.metrics else { return };
        metrics.ended(job.class.name(), state.name());
        if let (true, JobState::Failed(failure)) = (job.is_kept, state) {
            metrics.job_failed((self.settings.code_of)(failure));
        }
        if let JobState::Done(finished) = state {
            // Waiting has a metric of its own.
            let is_stage = |stage: &str| stage != "queue" && (finished.media != Media::Json || stage == "parse");
            for (stage, took) in finished.timings.parts().into_iter().filter(|(stage, _)| is_stage(stage)) {
                metrics.stage(stage, finished.backend.name(), took);
            }
        }
    }

    /// Tells everybody that a job has ended.
    fn announce(&self, inner: &mut Inner, job: &Arc<Job>, state: JobState) {
        if job.is_kept {
            inner.results.add(job, &state, false, &self.settings);
            self.evict(inner);
            self.clock.notify_one();
        }
        job.state.send_replace(state);
        if let Some(OnEnd(hear)) = &self.settings.webhooks
            && job.webhook.is_some()
        {
            hear(job);
        }
    }

    /// A client has the end of a kept job: from now on it is kept for a while only.
    pub fn fetched(&self, job: &Job) {
        let mut inner = self.lock();
        if inner.results.fetch(job.id, &self.settings) {
            self.evict(&mut inner);
            self.clock.notify_one();
            if let Some(storage) = self.storage_of(job) {
                storage.durable.store_soon(vec![Change::Fetched(job.id.key(), unix_ms())], Vec::new());
            }
        }
    }

    pub(super) fn storage_of(&self, job: &Job) -> Option<&Storage> {
        self.settings.storage.as_ref().filter(|_| job.is_durable)
    }

    /// A kept job.
    pub fn find(&self, id: JobId) -> Option<Arc<Job>> {
        self.lock().kept.get(&id).cloned()
    }

    /// The load at this moment.
    pub fn load(&self) -> JobLoad {
        let inner = self.lock();
        let (overdue, missing) = inner.overdue.counts();
        JobLoad {
            overdue,
            missing,
            quarantined: self.quarantine.count(),
            queued: inner.queue.len(),
            queued_by_class: Class::ALL.map(|class| inner.queue.count(class)),
            running: inner.running.len(),
            wait: self.wait(&inner, Class::Interactive, &Owner::default()),
            batch_wait: self.wait(&inner, Class::Batch, &Owner::default()),
            kept: inner.results.count(),
            kept_bytes: inner.results.bytes(),
        }
    }

    /// Refuses new jobs from now on.
    pub fn drain(&self) {
        self.lock().draining = true;
        self.work.notify_all();
        self.clock.notify_all();
    }

    /// Follows the number of jobs that wait or occupy a worker.
    pub fn outstanding(&self) -> watch::Receiver<usize> {
        self.outstanding.subscribe()
    }

    /// Waits until jobs or workers are late, and returns them. None once there will be no more. Drops expired results
    /// meanwhile.
    pub fn wait_for_late(&self) -> Option<Late> {
        let (limit, most) = (self.settings.job_time, self.settings.job_time + self.settings.overdue_grace);
        let mut inner = self.lock();
        loop {
            self.evict(&mut inner);
            let now = Instant::now();
            let is_active = |running: &&Running| inner.active.contains_key(&running.job.serial);
            let is_late = |running: &&Running, time| now.duration_since(running.since) >= time;
            let late = inner.running.values().filter(is_active).filter(|running| is_late(running, limit));
            let mut late = Late { jobs: late.map(|running| running.job.clone()).collect(), ..Late::default() };
            let stuck: Vec<_> = inner.running.extract_if(|_, running| is_late(&&*running, most)).collect();
            for (_, running) in stuck {
                let is_replaced = inner.overdue.add(&running.job, self.settings.workers);
                late.workers.push((running, is_replaced));
            }
            if !late.jobs.is_empty() || !late.workers.is_empty() {
                self.publish(&inner);
                return Some(late);
            }
            if inner.draining && inner.active.is_empty() && inner.queue.is_empty() {
                return None;
            }
            let next_time =
                |running: &Running| if inner.active.contains_key(&running.job.serial) { limit } else { most };
            let next = inner.running.values().filter_map(|r| r.since.checked_add(next_time(r)));
            inner = match next.chain(inner.results.next_expiry()).min() {
                Some(at) => {
                    let wait = at.saturating_duration_since(now);
                    self.clock.wait_timeout(inner, wait).unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.clock.wait(inner).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Checks that a job of this class may be accepted from this owner.
    fn check(&self, inner: &Inner, class: Class, owner: &Owner) -> Result<(), Refusal> {
        if inner.draining {
            return Err(Refusal::Draining);
        }
        // Idle workers count as places, so that a queue of 0 accepts a job that can start at once.
        let (queue, idle) = (self.settings.queue, self.idle(inner, class));
        let wait = self.wait(inner, class, owner);
        let share = self.share();
        if inner.queue.count(class) >= queue + idle || inner.queue.count_of(class, owner) >= share + idle {
            return Err(Refusal::QueueFull { queue: queue.min(share), retry_after_s: retry_after_s(wait) });
        }
        let limit = self.wait_limit(class);
        if wait > limit {
            let (wait_ms, limit_ms) = (to_ms(wait), to_ms(limit));
            return Err(Refusal::TooLate { class, wait_ms, limit_ms, retry_after_s: retry_after_s(wait - limit) });
        }
        Ok(())
    }

    /// Places of one owner, which leaves a quarter to others.
    fn share(&self) -> usize {
        self.settings.queue - self.settings.queue / 4
    }

    fn wait_limit(&self, class: Class) -> Duration {
        match class {
            Class::Interactive => self.settings.interactive_wait,
            Class::Batch => self.settings.batch_wait,
        }
    }

    /// Workers that batch jobs may occupy. A client that waits for a picture finds the other one free, or finds it so
    /// soon.
    pub(super) fn batch_workers(&self) -> usize {
        self.settings.workers.saturating_sub(1).max(1)
    }

    pub(super) fn batch_running(&self, inner: &Inner) -> usize {
        inner.running.values().filter(|running| running.job.class == Class::Batch).count()
    }

    /// Workers that could begin a job of this class now, if none waited.
    fn idle(&self, inner: &Inner, class: Class) -> usize {
        let idle = self.settings.workers.saturating_sub(inner.running.len());
        match class {
            Class::Interactive => idle,
            Class::Batch => idle.min(self.batch_workers().saturating_sub(self.batch_running(inner))),
        }
    }

    /// Time until a job of this class and owner would begin, as far as the estimates know. None while a worker is
    /// idle.
    fn wait(&self, inner: &Inner, class: Class, owner: &Owner) -> Duration {
        if inner.queue.count(class) < self.idle(inner, class) {
            return Duration::ZERO;
        }
        let limit = self.settings.job_time;
        let running: Duration = inner.running.values().map(|running| running.remaining(limit)).sum();
        let before = match class {
            Class::Interactive => inner.queue.time_before(class, owner),
            Class::Batch => inner.queue.time_before(class, owner) + inner.queue.time(Class::Interactive),
        };
        let workers = if class == Class::Batch { self.batch_workers() } else { self.settings.workers.max(1) };
        (before + running) / to_u32(workers)
    }

    /// Forgets a kept job that has ended.
    pub fn forget(&self, job: &Job) {
        let mut inner = self.lock();
        let removed = inner.results.forget(job.id);
        self.remove(&mut inner, removed);
    }

    /// Drops results that are too old or too many.
    fn evict(&self, inner: &mut Inner) {
        let evicted = inner.results.evict(&self.settings);
        self.remove(inner, evicted);
    }

    fn remove(&self, inner: &mut Inner, ids: impl IntoIterator<Item = JobId>) {
        for id in ids {
            let Some(job) = inner.kept.remove(&id) else { continue };
            if let Some(claim) = &job.claim {
                self.claims.free(claim);
            }
            if let Some(storage) = self.storage_of(&job) {
                storage.durable.store_soon(vec![Change::Forgotten(id.key())], job.hold(Vec::new()));
            }
        }
    }

    pub(super) fn publish(&self, inner: &Inner) {
        self.outstanding.send_replace(inner.queue.len() + inner.running.len() + inner.ending);
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The class of a job: one that can be found by its id is fetched later.
fn class_of(is_kept: bool) -> Class {
    if is_kept { Class::Batch } else { Class::Interactive }
}

/// Seconds after which to try again, at least 1 and at most an hour.
fn retry_after_s(wait: Duration) -> u64 {
    wait.as_secs_f64().ceil().clamp(1.0, 3600.0) as u64
}

fn to_u32(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn to_ms(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
