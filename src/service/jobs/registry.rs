//! The registry of all jobs: waiting, running, and ended with a result that can be fetched.
//!
//! One lock guards them all, because a job may be cancelled at the moment in which a worker takes
//! it. The lock is held for microseconds, and a render takes milliseconds.
//!
//! The queue is not a channel, because a cancelled or overdue job must leave it at once and free
//! its place and its memory.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::job::{Job, JobId, JobState, Work};
use super::{JobLoad, JobSettings, Refusal};

/// All jobs, and the conditions that threads wait for.
pub struct JobRegistry {
    pub(super) settings: JobSettings,
    inner: Mutex<Inner>,
    /// Wakes workers: a job was queued, or draining began.
    work: Condvar,
    /// Wakes the clock: there is a new deadline or a new result, or draining began.
    clock: Condvar,
    /// Number of jobs that wait or occupy a worker.
    outstanding: watch::Sender<usize>,
}

#[derive(Default)]
struct Inner {
    queue: VecDeque<Arc<Job>>,
    /// Queued and running jobs in the order of acceptance, which is the order of their deadlines.
    active: BTreeMap<u64, Arc<Job>>,
    /// Number of busy workers. A cancelled job may occupy its worker for a moment longer.
    busy: usize,
    kept: HashMap<JobId, Arc<Job>>,
    /// Kept jobs that have ended, oldest first.
    ended: VecDeque<EndedJob>,
    /// Bytes of their results together.
    ended_bytes: u64,
    draining: bool,
    serial: u64,
    /// Running mean of the time that a job occupies a worker.
    mean: Duration,
}

/// A kept job that has ended.
struct EndedJob {
    at: Instant,
    id: JobId,
    bytes: u64,
}

impl JobRegistry {
    /// An empty registry.
    pub fn new(settings: JobSettings) -> Self {
        let outstanding = watch::Sender::new(0);
        Self { settings, inner: Mutex::default(), work: Condvar::new(), clock: Condvar::new(), outstanding }
    }

    /// Checks that a job would be accepted now.
    pub fn would_accept(&self) -> Result<(), Refusal> {
        self.check(&self.lock())
    }

    /// Queues work. A kept job can be found by its id until its result expires.
    pub fn submit(&self, work: Work, is_kept: bool) -> Result<Arc<Job>, Refusal> {
        let mut inner = self.lock();
        self.check(&inner)?;
        inner.serial += 1;
        let job = Arc::new(Job::new(work, is_kept, inner.serial));
        inner.queue.push_back(job.clone());
        if inner.active.is_empty() {
            self.clock.notify_one();
        }
        inner.active.insert(job.serial, job.clone());
        if is_kept {
            inner.kept.insert(job.id, job.clone());
        }
        self.publish(&inner);
        self.work.notify_one();
        Ok(job)
    }

    /// Waits for the next job, and counts the worker as busy. None once there will be no more.
    pub fn take(&self) -> Option<(Arc<Job>, Work)> {
        let mut inner = self.lock();
        loop {
            if let Some(job) = inner.queue.pop_front() {
                if let Some(work) = job.take_work() {
                    inner.busy += 1;
                    job.state.send_replace(JobState::Running);
                    self.publish(&inner);
                    return Some((job, work));
                }
            } else if inner.draining {
                return None;
            } else {
                inner = self.work.wait(inner).unwrap_or_else(PoisonError::into_inner);
            }
        }
    }

    /// Ends the job of a worker, which is free again after `took`.
    pub fn finish(&self, job: &Job, state: JobState, took: Duration) {
        let mut inner = self.lock();
        inner.busy = inner.busy.saturating_sub(1);
        inner.mean = if inner.mean.is_zero() { took } else { (inner.mean * 7 + took) / 8 };
        self.end_locked(&mut inner, job, state);
        self.publish(&inner);
    }

    /// Ends a job from outside its worker: cancelled, or out of time.
    pub fn end(&self, job: &Job, state: JobState) {
        let mut inner = self.lock();
        self.end_locked(&mut inner, job, state);
        self.publish(&inner);
    }

    /// Ends a job. Only the first end of a job has an effect.
    fn end_locked(&self, inner: &mut Inner, job: &Job, state: JobState) {
        if inner.active.remove(&job.serial).is_none() {
            return;
        }
        job.deadline.stop();
        if job.take_work().is_some() {
            inner.queue.retain(|queued| queued.serial != job.serial);
        }
        if job.is_kept {
            let bytes = if let JobState::Done(finished) = &state { finished.picture.len() as u64 } else { 0 };
            inner.ended.push_back(EndedJob { at: Instant::now(), id: job.id, bytes });
            inner.ended_bytes += bytes;
            self.evict(inner);
            self.clock.notify_one();
        }
        job.state.send_replace(state);
    }

    /// A kept job.
    pub fn find(&self, id: JobId) -> Option<Arc<Job>> {
        self.lock().kept.get(&id).cloned()
    }

    /// The load at this moment.
    pub fn load(&self) -> JobLoad {
        let inner = self.lock();
        JobLoad {
            queued: inner.queue.len(),
            running: inner.busy,
            kept: inner.ended.len(),
            kept_bytes: inner.ended_bytes,
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

    /// Waits until jobs are overdue, and returns them. None once there will be no more. Drops
    /// expired results meanwhile.
    pub fn wait_for_overdue(&self) -> Option<Vec<Arc<Job>>> {
        let mut inner = self.lock();
        loop {
            self.evict(&mut inner);
            let now = Instant::now();
            let late = |job: &&Arc<Job>| now.duration_since(job.accepted) >= self.settings.job_time;
            let overdue: Vec<_> = inner.active.values().take_while(late).cloned().collect();
            if !overdue.is_empty() {
                return Some(overdue);
            }
            if inner.draining && inner.active.is_empty() {
                return None;
            }
            let next_deadline =
                inner.active.values().next().and_then(|job| job.accepted.checked_add(self.settings.job_time));
            let next_expiry = inner.ended.front().and_then(|ended| ended.at.checked_add(self.settings.result_ttl));
            inner = match next_deadline.into_iter().chain(next_expiry).min() {
                Some(at) => {
                    let wait = at.saturating_duration_since(now);
                    self.clock.wait_timeout(inner, wait).unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.clock.wait(inner).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    fn check(&self, inner: &Inner) -> Result<(), Refusal> {
        if inner.draining {
            return Err(Refusal::Draining);
        }
        let queue = self.settings.queue;
        // Idle workers count as places, so that a queue of 0 accepts a job that can start at once.
        let idle = self.settings.workers.saturating_sub(inner.busy);
        if inner.queue.len() >= queue + idle {
            return Err(Refusal::QueueFull { queue, retry_after_s: self.retry_after_s(inner) });
        }
        Ok(())
    }

    /// Expected time in seconds until the waiting jobs are done, between 1 and 30.
    fn retry_after_s(&self, inner: &Inner) -> u64 {
        let waiting = inner.mean.as_secs_f64() * inner.queue.len() as f64 / self.settings.workers.max(1) as f64;
        waiting.ceil().clamp(1.0, 30.0) as u64
    }

    /// Drops results that are too old or too many. The newest stays, however large.
    fn evict(&self, inner: &mut Inner) {
        let now = Instant::now();
        while let Some(&EndedJob { at, id, bytes }) = inner.ended.front() {
            let too_old = now.duration_since(at) >= self.settings.result_ttl;
            let too_many = inner.ended.len() > 1
                && (inner.ended_bytes > self.settings.result_bytes || inner.ended.len() > self.settings.result_count);
            if !too_old && !too_many {
                break;
            }
            inner.ended.pop_front();
            inner.ended_bytes -= bytes;
            inner.kept.remove(&id);
        }
    }

    fn publish(&self, inner: &Inner) {
        self.outstanding.send_replace(inner.queue.len() + inner.busy);
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
