//! Every job there is, behind one lock: who waits, who runs, whose result can still be fetched.
//!
//! One lock, because the transitions must agree (a job that is cancelled while a worker reaches for it), and because it
//! is held for microseconds beside renders of milliseconds. The queue is our own and not a channel's, because a job that
//! is cancelled or out of time has to leave it at once and free its place and its memory.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::job::{Job, JobId, State, Work};
use super::{Load, Refusal, Settings};

/// The jobs and what their threads wait for.
pub struct Registry {
    pub(crate) settings: Settings,
    inner: Mutex<Inner>,
    /// Something was queued, or draining began.
    work: Condvar,
    /// The clock has something new to look at.
    clock: Condvar,
    outstanding: watch::Sender<usize>,
}

#[derive(Default)]
struct Inner {
    queue: VecDeque<Arc<Job>>,
    /// Queued or running and not ended, by order of acceptance, which is also the order of their deadlines.
    active: BTreeMap<u64, Arc<Job>>,
    /// Workers that are busy; a job that has ended early may still occupy its worker for a moment.
    busy: usize,
    kept: HashMap<JobId, Arc<Job>>,
    /// Ended kept jobs, oldest first: when they ended, and how many bytes they hold.
    ended: VecDeque<(Instant, JobId, u64)>,
    ended_bytes: u64,
    draining: bool,
    serial: u64,
    /// Running mean of how long a worker takes for a job.
    mean: Duration,
}

impl Registry {
    pub fn new(settings: Settings) -> Self {
        let outstanding = watch::Sender::new(0);
        Self { settings, inner: Mutex::default(), work: Condvar::new(), clock: Condvar::new(), outstanding }
    }

    pub fn would_accept(&self) -> Result<(), Refusal> {
        self.check(&self.lock())
    }

    pub fn submit(&self, work: Work, keep: bool) -> Result<Arc<Job>, Refusal> {
        let mut inner = self.lock();
        self.check(&inner)?;
        inner.serial += 1;
        let job = Arc::new(Job::new(work, keep, inner.serial));
        inner.queue.push_back(job.clone());
        if inner.active.is_empty() {
            self.clock.notify_one();
        }
        inner.active.insert(job.serial, job.clone());
        if keep {
            inner.kept.insert(job.id, job.clone());
        }
        self.publish(&inner);
        self.work.notify_one();
        Ok(job)
    }

    /// The next job for a worker, which is busy from now on; None when there will be no more.
    pub fn take(&self) -> Option<(Arc<Job>, Work)> {
        let mut inner = self.lock();
        loop {
            if let Some(job) = inner.queue.pop_front() {
                if let Some(work) = job.take_work() {
                    inner.busy += 1;
                    job.state.send_replace(State::Running);
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

    /// A worker's news of its job: it ended like this, and the worker is free again after `took`.
    pub fn finish(&self, job: &Job, state: State, took: Duration) {
        let mut inner = self.lock();
        inner.busy = inner.busy.saturating_sub(1);
        inner.mean = if inner.mean.is_zero() { took } else { (inner.mean * 7 + took) / 8 };
        self.end_locked(&mut inner, job, state);
        self.publish(&inner);
    }

    /// A job's end that comes from elsewhere: cancelled, or out of time.
    pub fn end(&self, job: &Job, state: State) {
        let mut inner = self.lock();
        self.end_locked(&mut inner, job, state);
        self.publish(&inner);
    }

    /// The first end counts; later ones change nothing.
    fn end_locked(&self, inner: &mut Inner, job: &Job, state: State) {
        if inner.active.remove(&job.serial).is_none() {
            return;
        }
        job.deadline.stop();
        if job.take_work().is_some() {
            inner.queue.retain(|queued| queued.serial != job.serial);
        }
        if job.keep {
            let bytes = if let State::Done(finished) = &state { finished.picture.len() as u64 } else { 0 };
            inner.ended.push_back((Instant::now(), job.id, bytes));
            inner.ended_bytes += bytes;
            self.evict(inner);
            self.clock.notify_one();
        }
        job.state.send_replace(state);
    }

    pub fn find(&self, id: JobId) -> Option<Arc<Job>> {
        self.lock().kept.get(&id).cloned()
    }

    pub fn load(&self) -> Load {
        let inner = self.lock();
        Load { queued: inner.queue.len(), running: inner.busy, kept: inner.ended.len(), kept_bytes: inner.ended_bytes }
    }

    pub fn drain(&self) {
        self.lock().draining = true;
        self.work.notify_all();
        self.clock.notify_all();
    }

    pub fn outstanding(&self) -> watch::Receiver<usize> {
        self.outstanding.subscribe()
    }

    /// Jobs whose time is up at this moment. Waits until there can be some; None when there never will be.
    pub fn overdue(&self) -> Option<Vec<Arc<Job>>> {
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
            let next_expiry = inner.ended.front().and_then(|&(at, ..)| at.checked_add(self.settings.result_ttl));
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
        // An idle worker's place counts: with a queue of 0, a job is accepted when somebody can start it.
        let idle = self.settings.workers.saturating_sub(inner.busy);
        if inner.queue.len() >= queue + idle {
            return Err(Refusal::QueueFull { queue, retry_after_s: self.retry_after_s(inner) });
        }
        Ok(())
    }

    /// How long the jobs that wait now should take, between 1 and 30 seconds.
    fn retry_after_s(&self, inner: &Inner) -> u64 {
        let waiting = inner.mean.as_secs_f64() * inner.queue.len() as f64 / self.settings.workers.max(1) as f64;
        waiting.ceil().clamp(1.0, 30.0) as u64
    }

    /// Forgets results that are too old or too many. The newest stays, however large.
    fn evict(&self, inner: &mut Inner) {
        let now = Instant::now();
        while let Some(&(at, id, bytes)) = inner.ended.front() {
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
