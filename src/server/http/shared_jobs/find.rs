//! Mirrors of the jobs of a service, of which clients are told: each shows the knowledge of queue and store about a job,
//! and follows the job for as long as somebody holds the mirror.

use std::sync::{Arc, Weak};
use std::time::Duration;

use super::end::with_end;
use super::service::SharedJobs;
use crate::digest::Digest;
use crate::durable::ClaimRecord;
use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::jobs::{Job, JobId, JobState, Owner, Progress, Restored, Step, read_end};
use crate::memory::{Account, Memory};
use crate::shared_queue::Note;
use crate::shared_store::EndedJob;

/// The longest time between two looks at a job that is followed: a note about it may be missed.
const LOOK_EVERY: Duration = Duration::from_secs(2);

/// A job that this server has, or else a mirror of one of its service.
pub async fn find(state: &AppState, id: JobId) -> Result<Option<Arc<Job>>, ApiError> {
    if let Some(job) = state.jobs.find(id) {
        return Ok(Some(job));
    }
    let Some(shared) = &state.shared_jobs else { return Ok(None) };
    Ok(shared.look_up(&state.memory, id).await?.map(Arc::new))
}

/// Lets a mirror follow its job until it has ended, or nobody holds the mirror any more.
pub fn follow(state: &Arc<AppState>, job: &Arc<Job>) {
    if let Some(shared) = state.shared_jobs.clone().filter(|_| job.is_mirror() && !job.state().is_final()) {
        tokio::spawn(shared.follow(state.memory.clone(), Arc::downgrade(job), job.id));
    }
}

/// Cancels a job of the service that has not ended, or forgets one that has. The job as it is then.
pub async fn delete(state: &AppState, job: Arc<Job>) -> Result<Arc<Job>, ApiError> {
    let Some(shared) = &state.shared_jobs else { return Ok(job) };
    let key = job.id.key();
    if job.state().is_final() {
        // Without its object, a server that is about to end it once more does not.
        shared.store.delete_job(key).await?;
        shared.store.delete_end(key).await?;
        return Ok(job);
    }
    let Some(record) = shared.store.job_record(key).await? else {
        // It has ended since, or its note is what is left of it.
        let _ = shared.note_end(key).await;
        let ended = shared.look_up_stored(&state.memory, job.id).await?;
        return ended.map(|(job, _)| Arc::new(job)).ok_or_else(unknown);
    };
    let (ended, content) = with_end(EndedJob::of(&record), &JobState::Cancelled);
    let is_first = shared.store_end(key, &ended, content, JobState::Cancelled.name()).await?;
    if let Err(error) = shared.tell(key, &ended, is_first).await {
        // Who takes its message tells everybody.
        tracing::warn!(%error, job = %job.id, "everybody is told of a cancelled job later");
    }
    // It may have ended in another way at the same moment.
    let ended = shared.look_up_end(&state.memory, job.id).await?;
    Ok(ended.map_or(job, |(job, _)| Arc::new(job)))
}

/// The error for a job that is not there.
pub fn unknown() -> ApiError {
    ApiError::not_found("there is no such job, or its result has expired")
}

impl SharedJobs {
    /// A mirror of a job. None if there is no such job, or its end has expired.
    pub(super) async fn look_up(&self, memory: &Arc<Memory>, id: JobId) -> Result<Option<Job>, ApiError> {
        // Without the queue, the store knows enough.
        if let Some((note, age)) = self.queue.note(id.key()).await.ok().flatten().filter(|(note, _)| !note.has_ended) {
            // The newest note may be lost with the queue's disk.
            if age > NOTE_TRUST
                && let Some((job, _)) = self.look_up_end(memory, id).await?
            {
                return Ok(Some(job));
            }
            let (state, progress) = shown_by(&note);
            return Ok(Some(mirror(id, (&note.owner, note.accepted_unix_ms), state, progress)));
        }
        Ok(self.look_up_stored(memory, id).await?.map(|(job, _)| job))
    }

    /// A mirror of a job by the store alone, and the name of the job's request.
    pub(super) async fn look_up_stored(
        &self,
        memory: &Arc<Memory>,
        id: JobId,
    ) -> Result<Option<(Job, Option<ClaimRecord>)>, ApiError> {
        if let Some(found) = self.look_up_end(memory, id).await? {
            return Ok(Some(found));
        }
        match self.store.job_record(id.key()).await? {
            Some(record) => {
                let (owner, at) = (&record.owner, record.accepted_unix_ms);
                Ok(Some((mirror(id, (owner, at), JobState::Queued, Progress::default()), record.claim)))
            }
            // It may have ended since.
            None => self.look_up_end(memory, id).await,
        }
    }

    async fn look_up_end(
        &self,
        memory: &Arc<Memory>,
        id: JobId,
    ) -> Result<Option<(Job, Option<ClaimRecord>)>, ApiError> {
        let share = memory.share(Account::Results);
        let mut full = None;
        let mut admit = |bytes| match share.grow(bytes) {
            Ok(()) => true,
            Err(error) => {
                full = Some(error);
                false
            }
        };
        let found = self.store.end(id.key(), &mut admit).await?;
        if let Some(error) = full {
            return Err(error.into());
        }
        let Some((ended, content)) = found else { return Ok(None) };
        let EndedJob { owner, accepted_unix_ms, claim, end, .. } = ended;
        // What the store has damaged is lost.
        let content = Some(content)
            .filter(|bytes| end.picture.as_ref().is_none_or(|picture| Digest::of(bytes) == picture.digest));
        // From here on, the result counts its bytes.
        drop(share);
        let state = read_end(&end, content, memory);
        Ok(Some((mirror(id, (&owner, accepted_unix_ms), state, Progress::default()), claim)))
    }

    async fn follow(self: Arc<Self>, memory: Arc<Memory>, job: Weak<Job>, id: JobId) {
        let mut notes = None;
        while job.strong_count() > 0 {
            if notes.is_none() {
                notes = self.queue.follow(id.key()).await.ok();
            }
            // After it has begun to listen, so that nothing is missed.
            let found = self.look_up(&memory, id).await;
            let Some(mirror) = job.upgrade() else { return };
            match found {
                Ok(Some(found)) => {
                    let progress = *found.watch().1.borrow();
                    mirror.mirror(found.state(), progress);
                }
                // It was cancelled and forgotten meanwhile.
                Ok(None) => mirror.mirror(JobState::Cancelled, Progress::default()),
                // The next look may succeed.
                Err(_) => {}
            }
            if mirror.state().is_final() {
                return;
            }
            drop(mirror);
            let note = async {
                match &mut notes {
                    Some(notes) => notes.next().await,
                    None => std::future::pending().await,
                }
            };
            match tokio::time::timeout(LOOK_EVERY, note).await {
                Ok(Some(note)) if !note.has_ended => {
                    let Some(mirror) = job.upgrade() else { return };
                    let (state, progress) = shown_by(&note);
                    mirror.mirror(state, progress);
                }
                Ok(None) => notes = None,
                _ => {}
            }
        }
    }
}

fn mirror(id: JobId, (owner, accepted_unix_ms): (&str, u64), state: JobState, progress: Progress) -> Job {
    let owner = Owner::new(owner);
    Job::mirror_of(Restored { id, accepted_unix_ms, owner, claim: None }, state, progress)
}

/// The age from which a note that says that a job has not ended is compared with the store.
const NOTE_TRUST: Duration = Duration::from_secs(30);

/// The state and the progress of a job that has not ended.
fn shown_by(note: &Note) -> (JobState, Progress) {
    let state = if note.is_running { JobState::Running } else { JobState::Queued };
    (state, Progress { step: Step::of_name(&note.step), drawn: note.drawn, views: note.views })
}
