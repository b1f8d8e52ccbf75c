//! The registry of all jobs: waiting, running, and ended with a result that can be fetched.
//!
//! One lock guards them all, because a job may be cancelled at the moment in which a worker takes
//! it. The lock is held for microseconds, and a render takes milliseconds.
//!
//! The queue is not a channel, because a cancelled or overdue job must leave it at once and free
//! its place and its memory.
//!
//! Short jobs overtake long ones: a job ranks as if it had been accepted later by [`PATIENCE`] times its
//! estimate, at most a quarter of the time that a job may take. A job is refused if it, or any job that it
//! might overtake, would then not end within the other three quarters. So an accepted job ends in time, as
//! far as the estimates are right: only what is accepted in the first quarter of its time can overtake it.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::estimates::{Estimates, Size};
use super::job::{Job, JobId, JobState, Work};
use super::{JobLoad, JobSettings, Refusal};

/// The rank that a job loses for each second of its estimate, seconds.
const PATIENCE: u32 = 4;

/// All jobs, and the conditions that threads wait for.
pub struct JobRegistry {
    pub(super) settings: JobSettings,
    pub(super) estimates: Estimates,
    /// The time from which ranks count.
    began: Instant,
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
    /// By rank and number.
    queue: BTreeMap<(Duration, u64), (Arc<Job>, Size)>,
    /// The estimates of all queued jobs together.
    queued_time: Duration,
    /// Queued and running jobs in the order of acceptance, which is the order of their deadlines.
    active: BTreeMap<u64, Arc<Job>>,
    /// Jobs that occupy a worker, by number. A cancelled one may do so for a moment longer.
    running: HashMap<u64, Running>,
    kept: HashMap<JobId, Arc<Job>>,
    /// Kept jobs that have ended, oldest first.
    ended: VecDeque<EndedJob>,
    /// Bytes of their results together.
    ended_bytes: u64,
    draining: bool,
    serial: u64,
}

/// The next step of a worker.
pub enum Next {
    /// It does this job.
    Job(Arc<Job>, Work),
    /// It has waited in vain.
    Idle,
    /// It ends: there will be no more.
    End,
}

/// A job that occupies a worker.
struct Running {
    job: Arc<Job>,
    size: Size,
    since: Instant,
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
        Self {
            settings,
            estimates: Estimates::new(),
            began: Instant::now(),
            inner: Mutex::default(),
            work: Condvar::new(),
            clock: Condvar::new(),
            outstanding,
        }
    }

    /// Checks that a job would be accepted now.
    pub fn would_accept(&self) -> Result<(), Refusal> {
        self.check(&self.lock(), None)
    }

    /// Queues work. A kept job can be found by its id until its result expires.
    pub fn submit(&self, work: Work, is_kept: bool) -> Result<Arc<Job>, Refusal> {
        let size = self.estimates.size(&work);
        let estimate = self.estimates.estimate(size).min(self.settings.job_time);
        let mut inner = self.lock();
        self.check(&inner, Some(estimate))?;
        inner.serial += 1;
        let rank = self.began.elapsed() + (estimate * PATIENCE).min(self.settings.job_time / 4);
        let job = Arc::new(Job::new(work, is_kept, inner.serial, estimate, rank));
        inner.queue.insert((rank, job.serial), (job.clone(), size));
        inner.queued_time += estimate;
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

    /// Waits for the next job, no longer than `time_max`, and counts the worker as busy.
    pub fn take(&self, time_max: Option<Duration>) -> Next {
        let until = time_max.and_then(|time_max| Instant::now().checked_add(time_max));
        let mut inner = self.lock();
        loop {
            if let Some((_, (job, size))) = inner.queue.pop_first() {
                inner.queued_time = inner.queued_time.saturating_sub(job.estimate);
                if let Some(work) = job.take_work() {
                    inner.running.insert(job.serial, Running { job: job.clone(), size, since: Instant::now() });
                    job.state.send_replace(JobState::Running);
                    self.publish(&inner);
                    return Next::Job(job, work);
                }
                continue;
            }
            if inner.draining {
                return Next::End;
            }
            inner = match until.map(|until| until.saturating_duration_since(Instant::now())) {
                None => self.work.wait(inner).unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => return Next::Idle,
                Some(time) => self.work.wait_timeout(inner, time).unwrap_or_else(PoisonError::into_inner).0,
            };
        }
    }

    /// Ends the job of a worker, which is free again after `took`.
    pub fn finish(&self, job: &Job, state: JobState, took: Duration) {
        let mut inner = self.lock();
        if let Some(running) = inner.running.remove(&job.serial)
            // What ended early says how long it takes only if that is longer than was thought.
            && (matches!(state, JobState::Done(_) | JobState::Inspected(_)) || took > job.estimate)
        {
            self.estimates.learn(running.size, took);
        }
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
            inner.queue.remove(&(job.rank, job.serial));
            inner.queued_time = inner.queued_time.saturating_sub(job.estimate);
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
            running: inner.running.len(),
            wait: self.wait(&inner),
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

    /// Checks that a job may be accepted whose estimate is this, if it is known yet.
    fn check(&self, inner: &Inner, estimate: Option<Duration>) -> Result<(), Refusal> {
        if inner.draining {
            return Err(Refusal::Draining);
        }
        let queue = self.settings.queue;
        // Idle workers count as places, so that a queue of 0 accepts a job that can start at once.
        let idle = self.settings.workers.saturating_sub(inner.running.len());
        let wait = self.wait(inner);
        if inner.queue.len() >= queue + idle {
            return Err(Refusal::QueueFull { queue, retry_after_s: retry_after_s(wait) });
        }
        let limit = self.settings.job_time;
        let longest =
            inner.queue.values().map(|(job, _)| job.estimate).fold(estimate.unwrap_or_default(), Duration::max);
        let ends = wait.saturating_add(longest);
        // A job that begins at once is never refused for its estimate alone.
        if inner.queue.len() >= idle && ends > limit / 4 * 3 {
            let (wait_ms, takes_ms) = (to_ms(wait), estimate.map(to_ms));
            let retry_after_s = retry_after_s(ends - limit / 4 * 3);
            return Err(Refusal::TooLate { wait_ms, takes_ms, limit_ms: to_ms(limit), retry_after_s });
        }
        Ok(())
    }

    /// Time until the jobs that were accepted are done, as far as the estimates know. None while a worker is
    /// idle.
    fn wait(&self, inner: &Inner) -> Duration {
        if inner.queue.len() + inner.running.len() < self.settings.workers {
            return Duration::ZERO;
        }
        let limit = self.settings.job_time;
        let running: Duration = inner.running.values().map(|running| running.remaining(limit)).sum();
        (inner.queued_time + running) / u32::try_from(self.settings.workers.max(1)).unwrap_or(u32::MAX)
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
        self.outstanding.send_replace(inner.queue.len() + inner.running.len());
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Running {
    /// Time until it ends, as far as is known. A job that takes longer than its estimate is expected to
    /// take as long again as it is late. It stops when its time is up.
    fn remaining(&self, limit: Duration) -> Duration {
        let so_far = self.since.elapsed();
        so_far.abs_diff(self.job.estimate).min(limit.saturating_sub(self.job.accepted.elapsed()))
    }
}

/// Seconds after which to try again, between 1 and 30.
fn retry_after_s(wait: Duration) -> u64 {
    wait.as_secs_f64().ceil().clamp(1.0, 30.0) as u64
}

fn to_ms(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
