//! The acceptance of jobs of a service: their objects first, then their messages. What fails before its answer
//! is taken back; what a crash leaves behind is found by the sweep.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use futures_util::{StreamExt as _, TryStreamExt as _, stream};

use super::service::SharedJobs;
use crate::digest::Digest;
use crate::durable::{JobKey, JobRecord};
use crate::http::error::ApiError;
use crate::http::receive::idempotency::{self, Sent};
use crate::http::state::AppState;
use crate::jobs::{ClaimName, Job, JobId, JobState, Progress, Refusal, Restored, Work, record_of, unix_ms};
use crate::shared_queue::{Kind, Note, QueueError};
use crate::shared_store::AcceptedJob;
use crate::telemetry::traces::Trace;

/// Objects that are written at a time.
const WRITES: usize = 8;

/// Accepts a job: durably, where there is a data folder or a shared queue.
pub async fn accept(state: &AppState, work: Work) -> Result<Arc<Job>, ApiError> {
    accept_all(state, vec![work]).await?.pop().ok_or_else(ApiError::internal)
}

/// Accepts several jobs of one owner: all of them or, with an error, none. Where a write to a shared store ends with an
/// error, some may be done all the same.
pub async fn accept_all(state: &AppState, works: Vec<Work>) -> Result<Vec<Arc<Job>>, ApiError> {
    let Some(shared) = &state.shared_jobs else { return Ok(state.jobs.accept_all(works).await?) };
    if state.is_draining() {
        return Err(Refusal::Draining.into());
    }
    works.iter().try_for_each(|work| state.jobs.check_mesh(work))?;
    shared.check()?;
    let shared = shared.clone();
    let traceparent = Trace::here().header();
    // It goes on when the client hangs up, so that a form is accepted as a whole.
    let accepting = tokio::spawn(async move {
        let accepted = shared.accept(works, traceparent).await;
        accepted.map(|records| records.iter().map(|record| Arc::new(queued(record))).collect())
    });
    accepting.await.unwrap_or_else(|_| Err(ApiError::internal()))
}

/// The job of a request that was sent before under its name; None if it was not.
pub async fn sent_before(state: &AppState, name: &ClaimName, request: Digest) -> Result<Option<Sent>, ApiError> {
    let Some(shared) = &state.shared_jobs else { return Ok(None) };
    let Some((job, claim)) = shared.look_up_stored(&state.memory, id_of(name)).await? else { return Ok(None) };
    if claim.is_none_or(|claim| claim.request != request) {
        return Err(idempotency::reused());
    }
    // What is not there has ended in this moment.
    if !job.state().is_final()
        && let Some(record) = shared.store.job_record(job.id.key()).await?
    {
        // The server that stored it may not have sent its message yet, and may find the queue full. The same message
        // twice is one.
        let sent =
            shared.queue.send(kind_of(&record), record.key, &message_name(record.key, job.accepted_unix_ms)).await;
        if matches!(sent, Err(QueueError::Full)) {
            return Err(QueueError::Full.into());
        }
    }
    Ok(Some(Sent::Again(Arc::new(job))))
}

/// The id of a job whose request has a name: two servers that get it at the same time give its job the same id.
fn id_of(name: &ClaimName) -> JobId {
    let owner = Digest::of(name.owner.to_string().as_bytes());
    JobId::of_digest(Digest::of(format!("{owner} {}", name.key).as_bytes()))
}

fn queued(record: &JobRecord) -> Job {
    let id = JobId::from_key(record.key);
    let owner = crate::jobs::Owner::new(&record.owner);
    let name = Restored { id, accepted_unix_ms: record.accepted_unix_ms, owner, claim: None };
    Job::mirror_of(name, JobState::Queued, Progress::default())
}

impl SharedJobs {
    async fn accept(
        self: Arc<Self>,
        works: Vec<Work>,
        traceparent: Option<String>,
    ) -> Result<Vec<JobRecord>, ApiError> {
        // Hashing many bytes would block other requests. The works keep the memory of their bytes until all is written.
        let reading = tokio::task::spawn_blocking(move || {
            let jobs: Vec<Arc<AcceptedJob>> =
                works.iter().map(|work| Arc::new(read(work, traceparent.as_deref()))).collect();
            (works, jobs)
        });
        let (works, jobs) = reading.await.map_err(|_| ApiError::internal())?;
        let written = self.write(&jobs).await;
        drop(works);
        if let Err((error, undone)) = written {
            for key in undone {
                // Without its object, a message means nothing.
                if let Err(error) = self.store.delete_job(key).await {
                    tracing::warn!(%error, "a job that was refused may be done all the same");
                }
                let _ = self.note_end(key).await;
            }
            return Err(error);
        }
        for job in &jobs {
            let (job, request_id) = (JobId::from_key(job.record.key), &*job.record.request_id);
            tracing::info!(%job, request_id, "a job was accepted for the shared queue");
        }
        Ok(jobs.iter().map(|job| job.record.clone()).collect())
    }

    /// Writes the objects and the messages of jobs. After an error, the jobs whose objects were written are to be undone.
    async fn write(self: &Arc<Self>, jobs: &[Arc<AcceptedJob>]) -> Result<(), (ApiError, Vec<JobKey>)> {
        let objects = stream::iter(jobs.to_vec()).map(|job| {
            let shared = self.clone();
            async move { (job.record.key, shared.store.create_job(&job).await) }
        });
        let written: Vec<_> = objects.buffered(WRITES).collect().await;
        // After an error, it may have been written all the same, or be another's: it stays.
        let ours = written.iter().filter(|(_, created)| matches!(created, Ok(true))).map(|(key, _)| *key).collect();
        for (_, created) in written {
            match created {
                Ok(true) => {}
                Ok(false) => return Err((idempotency::in_use(), ours)),
                Err(error) => return Err((error.into(), ours)),
            }
        }
        let messages = stream::iter(jobs.to_vec()).map(|job| {
            let shared = self.clone();
            async move { shared.announce(&job.record).await }
        });
        messages.buffered(WRITES).try_collect::<()>().await.map_err(|full| (full.into(), ours))
    }

    /// Sends the message of a job that is stored. The only error is a full queue. A job whose message is lost in any other way is
    /// kept all the same: the sweep sends it.
    async fn announce(&self, record: &JobRecord) -> Result<(), QueueError> {
        let _ = self.queue.set_note(record.key, &note_of(record)).await;
        match self.queue.send(kind_of(record), record.key, &message_name(record.key, record.accepted_unix_ms)).await {
            Err(QueueError::Full) => Err(QueueError::Full),
            Err(error) => {
                tracing::warn!(%error, job = %JobId::from_key(record.key), "a job will be sent to the queue later");
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }
}

/// The kind of the message of a job.
pub fn kind_of(record: &JobRecord) -> Kind {
    if record.needs_gpu { Kind::GpuJob } else { Kind::Job }
}

/// The note on a job that waits.
pub fn note_of(record: &JobRecord) -> Note {
    Note { owner: record.owner.clone(), accepted_unix_ms: record.accepted_unix_ms, ..Note::default() }
}

/// The name under which JetStream knows a message that is sent twice. A job that is sent again to the queue has another.
pub fn message_name(key: JobKey, unix_ms: u64) -> String {
    format!("{key:032x} {unix_ms}")
}

/// The job as it is stored. A mesh that is stored is not copied into it.
fn read(work: &Work, traceparent: Option<&str>) -> AcceptedJob {
    let mut blobs = BTreeMap::new();
    let id = work.claim.as_ref().map_or_else(JobId::fresh, |claim| id_of(&claim.name));
    let Ok(mut record) = record_of((id, unix_ms()), work, false, &mut |bytes, _| {
        let digest = Digest::of(bytes);
        blobs.insert(digest, bytes.clone());
        Ok::<_, Infallible>(digest)
    });
    record.traceparent = traceparent.map(str::to_owned);
    AcceptedJob { record, blobs }
}
