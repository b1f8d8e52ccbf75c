//! The jobs that wait, and which of them is next.
//!
//! Two classes wait apart: interactive jobs, for which a client waits, and batch jobs, which are fetched later.
//! Interactive ones go first, but a batch job is taken after a few of them, so that neither starves.
//!
//! Within a class the owners (API keys or addresses) take turns by the estimated time of their jobs (start-time fair
//! queueing). So the jobs of others do not wait for all of the thousand jobs that one client sends. Among the jobs of
//! one owner, that of the lowest rank is first: `registry.rs` gives low ranks to jobs that came early or are short.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::class::{Class, Owner};
use super::job::Job;

/// Interactive jobs that are taken in a row while batch jobs wait.
const INTERACTIVE_IN_A_ROW: u32 = 4;

/// The least time that a job counts with, so that jobs that seem to take none take turns as well.
const TURN_MIN: Duration = Duration::from_millis(1);

/// The jobs that wait.
#[derive(Default)]
pub struct Queue {
    interactive: Waiting,
    batch: Waiting,
    /// Interactive jobs that were taken since the last batch job.
    in_a_row: u32,
}

/// The waiting jobs of a class.
#[derive(Default)]
struct Waiting {
    owners: BTreeMap<Owner, Turns>,
    /// Number of jobs, with those that have a place and are being stored.
    count: usize,
    /// The same of those that are being stored.
    reserved: usize,
    /// The estimates of all.
    time: Duration,
    /// The time, in turns, of the owner that was last taken from.
    now: Duration,
}

/// The waiting jobs of an owner.
#[derive(Default)]
struct Turns {
    jobs: BTreeMap<(Duration, u64), Arc<Job>>,
    reserved: usize,
    time: Duration,
    /// The time that its jobs have had.
    had: Duration,
}

impl Queue {
    /// Gives a job a place, which [`Self::insert`] takes or [`Self::withdraw`] gives back.
    pub fn reserve(&mut self, class: Class, owner: &Owner, estimate: Duration) {
        let waiting = self.class(class);
        let now = waiting.now;
        let turns = waiting.owners.entry(owner.clone()).or_insert_with(|| Turns { had: now, ..Turns::default() });
        turns.reserved += 1;
        turns.time += estimate;
        waiting.count += 1;
        waiting.reserved += 1;
        waiting.time += estimate;
    }

    /// Queues a job that has a place.
    pub fn insert(&mut self, job: &Arc<Job>) {
        let waiting = self.class(job.class);
        waiting.reserved = waiting.reserved.saturating_sub(1);
        if let Some(turns) = waiting.owners.get_mut(&job.owner) {
            turns.reserved = turns.reserved.saturating_sub(1);
            turns.jobs.insert((job.rank, job.serial), job.clone());
        }
    }

    /// Gives the place of a job back that was not queued.
    pub fn withdraw(&mut self, job: &Job) {
        let waiting = self.class(job.class);
        waiting.reserved = waiting.reserved.saturating_sub(1);
        if let Some(turns) = waiting.owners.get_mut(&job.owner) {
            turns.reserved = turns.reserved.saturating_sub(1);
        }
        waiting.leave(job);
    }

    /// Removes a job that was cancelled.
    pub fn remove(&mut self, job: &Job) {
        let waiting = self.class(job.class);
        let turns = waiting.owners.get_mut(&job.owner);
        if turns.is_some_and(|turns| turns.jobs.remove(&(job.rank, job.serial)).is_some()) {
            waiting.leave(job);
        }
    }

    /// The job that [`Self::take`] takes.
    pub fn next(&self, may_batch: bool) -> Option<&Arc<Job>> {
        self.of(self.next_class(may_batch)?).next()
    }

    /// Takes the next job: a batch job only if one may begin.
    pub fn take(&mut self, may_batch: bool) -> Option<Arc<Job>> {
        let class = self.next_class(may_batch)?;
        self.in_a_row = if class == Class::Batch { 0 } else { self.in_a_row.saturating_add(1) };
        self.class(class).take()
    }

    fn next_class(&self, may_batch: bool) -> Option<Class> {
        let has_batch = may_batch && self.batch.has_jobs();
        match self.interactive.has_jobs() {
            true if has_batch && self.in_a_row >= INTERACTIVE_IN_A_ROW => Some(Class::Batch),
            true => Some(Class::Interactive),
            false => has_batch.then_some(Class::Batch),
        }
    }

    /// Number of jobs of a class.
    pub fn count(&self, class: Class) -> usize {
        self.of(class).count
    }

    /// Number of jobs of both.
    pub fn len(&self) -> usize {
        self.interactive.count + self.batch.count
    }

    /// True if no job waits or is being stored.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of jobs of an owner in a class.
    pub fn count_of(&self, class: Class, owner: &Owner) -> usize {
        self.of(class).owners.get(owner).map_or(0, |turns| turns.jobs.len() + turns.reserved)
    }

    /// The estimates of all jobs of a class.
    pub fn time(&self, class: Class) -> Duration {
        self.of(class).time
    }

    /// The estimates of the jobs of a class that are done before one that this owner sends now: others take as many
    /// turns as it does.
    pub fn time_before(&self, class: Class, owner: &Owner) -> Duration {
        let waiting = self.of(class);
        let own = waiting.owners.get(owner).map_or(Duration::ZERO, |turns| turns.time);
        let others = waiting.owners.iter().filter(|(other, _)| *other != owner);
        // One turn more than its own jobs take, of each of the others.
        let turn = |turns: &Turns| turns.jobs.values().next().map_or(TURN_MIN, |job| job.estimate);
        others.map(|(_, turns)| turns.time.min(own + turn(turns))).sum::<Duration>() + own
    }

    fn of(&self, class: Class) -> &Waiting {
        match class {
            Class::Interactive => &self.interactive,
            Class::Batch => &self.batch,
        }
    }

    fn class(&mut self, class: Class) -> &mut Waiting {
        match class {
            Class::Interactive => &mut self.interactive,
            Class::Batch => &mut self.batch,
        }
    }
}

impl Waiting {
    fn has_jobs(&self) -> bool {
        self.count > self.reserved
    }

    /// The job that [`Self::take`] takes.
    fn next(&self) -> Option<&Arc<Job>> {
        let ready = self.owners.values().filter(|turns| !turns.jobs.is_empty());
        ready.min_by_key(|turns| turns.had)?.jobs.first_key_value().map(|(_, job)| job)
    }

    fn take(&mut self) -> Option<Arc<Job>> {
        let ready = self.owners.values_mut().filter(|turns| !turns.jobs.is_empty());
        let turns = ready.min_by_key(|turns| turns.had)?;
        let (_, job) = turns.jobs.pop_first()?;
        self.now = self.now.max(turns.had);
        turns.had += job.estimate.max(TURN_MIN);
        self.leave(&job);
        // An owner without jobs is forgotten once the others have had as much.
        let (now, is_empty) = (self.now, self.count == 0);
        self.owners.retain(|_, turns| !turns.jobs.is_empty() || turns.reserved > 0 || turns.had > now && !is_empty);
        Some(job)
    }

    /// A job has left the queue.
    fn leave(&mut self, job: &Job) {
        self.count = self.count.saturating_sub(1);
        self.time = self.time.saturating_sub(job.estimate);
        if let Some(turns) = self.owners.get_mut(&job.owner) {
            turns.time = turns.time.saturating_sub(job.estimate);
        }
    }
}
