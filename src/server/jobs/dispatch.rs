//! The hand-over of jobs to workers. `take` waits for the next job of the queue, and for the memory that it is expected to
//! need. `again` queues a job once more that found too little memory while it ran: it then begins with the most that a
//! job may take.

use std::sync::atomic::Ordering;
use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::job::{Job, JobState, Work};
use super::registry::{Inner, JobRegistry};
use super::watchdog::Running;
use crate::durable::Change;
use crate::memory::{Account, JobMemory};

/// Time between two looks for memory of a worker that finds none. Other accounts do not tell when they give some back.
const MEMORY_WAIT: Duration = Duration::from_millis(20);

/// The next step of a worker.
pub enum Next {
    /// It does this job.
    Job(Arc<Job>, Box<Work>, Arc<JobMemory>),
    /// It has waited in vain.
    Idle,
    /// It ends: there will be no more.
    End,
}

impl JobRegistry {
    /// Waits for the next job, no longer than `time_max`, and counts the worker as busy.
    pub fn take(&self, time_max: Option<Duration>) -> Next {
        let until = time_max.and_then(|time_max| Instant::now().checked_add(time_max));
        let mut inner = self.lock();
        loop {
            let may_batch = self.batch_running(&inner) < self.batch_workers();
            if let Some(next) = inner.queue.next(may_batch) {
                let share = self.settings.memory.share(Account::Jobs);
                if let Err(missing) = share.grow_now(next.memory_bytes.load(Ordering::Relaxed)) {
                    inner = self.wait_for_memory(inner, missing.unwrap_or(0));
                    continue;
                }
                let Some(job) = inner.queue.take(may_batch) else { continue };
                if let Some(mut work) = job.take_work() {
                    let memory = JobMemory::new(share, self.settings.memory.job_max());
                    work.lender = Some(memory.clone());
                    let (meshes, since) = (work.meshes(), Instant::now());
                    inner.running.insert(job.serial, Running { job: job.clone(), meshes, since });
                    job.state.send_replace(JobState::Running);
                    // Its time begins now.
                    self.clock.notify_one();
                    if let Some(metrics) = &self.settings.metrics {
                        metrics.waited(job.class.name(), job.accepted.elapsed());
                    }
                    if let Some(storage) = self.storage_of(&job) {
                        storage.durable.store_soon(vec![Change::Started(job.id.key())], Vec::new());
                    }
                    self.publish(&inner);
                    return Next::Job(job, Box::new(work), memory);
                }
                continue;
            }
            // A job that is being stored has its place already.
            if inner.draining && inner.queue.is_empty() {
                return Next::End;
            }
            inner = match until.map(|until| until.saturating_duration_since(Instant::now())) {
                None => self.work.wait(inner).unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => return Next::Idle,
                Some(time) => self.work.wait_timeout(inner, time).unwrap_or_else(PoisonError::into_inner).0,
            };
        }
    }

    /// Lets caches make room, without the lock, or waits for a moment: what other jobs hold is free once they have ended.
    fn wait_for_memory<'a>(&'a self, inner: MutexGuard<'a, Inner>, missing: u64) -> MutexGuard<'a, Inner> {
        drop(inner);
        let has_room = self.settings.memory.make_room(Account::Jobs, missing);
        let inner = self.lock();
        if has_room {
            return inner;
        }
        self.work.wait_timeout(inner, MEMORY_WAIT).unwrap_or_else(PoisonError::into_inner).0
    }

    /// Queues a job anew for which a worker has found too little memory. It begins once there is as much as a job may
    /// take. The work comes back if it has ended meanwhile, or had as much.
    pub fn again(&self, job: &Arc<Job>, mut work: Work) -> Option<Work> {
        let (mut inner, most) = (self.lock(), self.settings.memory.job_max());
        if !inner.active.contains_key(&job.serial) || job.memory_bytes.swap(most, Ordering::Relaxed) >= most {
            return Some(work);
        }
        tracing::info!(job = %job.id, request_id = &*job.request_id, "others have the memory of a job; it is begun again");
        inner.running.remove(&job.serial);
        work.lender = None;
        job.put_work(work);
        job.state.send_replace(JobState::Queued);
        inner.queue.reserve(job.class, &job.owner, job.estimate);
        inner.queue.insert(job);
        self.publish(&inner);
        self.work.notify_all();
        None
    }
}
