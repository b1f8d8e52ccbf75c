//! The end of a job of a service. It is written to the store first, so that it is the job's only one. Then
//! everybody is told: by the note, and through the queue of webhooks. If the daemon stops in between, the message of the
//! job comes again, and [`SharedJobs::tell`] does the rest.

use bytes::Bytes;

use super::service::{SharedJobs, id_of};
use crate::digest::Digest;
use crate::durable::JobKey;
use crate::http::error::{self, ApiError};
use crate::jobs::{JobState, end_of};
use crate::shared_queue::{Kind, Note, QueueError};
use crate::shared_store::{EndedJob, Unavailable};

impl SharedJobs {
    /// Stores the end of a job. False if it has another end.
    pub(super) async fn store_end(
        &self,
        key: JobKey,
        ended: &EndedJob,
        content: Bytes,
        name: &str,
    ) -> Result<bool, Untold> {
        if self.store.create_end(key, ended, content).await? {
            tracing::info!(job = %id_of(key), end = name, "a job of the shared queue ended");
            return Ok(true);
        }
        // A refusal alone does not mean that there is an end: S3 also refuses while another write or delete is on its way.
        match self.store.end(key, &mut |_| true).await? {
            // The answer to the write was lost, and it was tried again.
            Some((found, _)) => Ok(found.end.at_unix_ms == ended.end.at_unix_ms),
            None => Err(Untold::Conflict),
        }
    }

    /// Tells everybody that a job has ended, and removes its object.
    pub(super) async fn tell(&self, key: JobKey, ended: &EndedJob, tells_webhook: bool) -> Result<(), Untold> {
        if ended.webhook.is_some() && tells_webhook {
            self.store.owe_webhook(key).await?;
            match self.queue.send(Kind::Webhook, key, &format!("{key:032x} webhook")).await {
                // The sweep sends it when there is room.
                Ok(()) | Err(QueueError::Full) => {}
                Err(error) => return Err(error.into()),
            }
        }
        self.note_end(key).await?;
        // Under the name of a request, there may be a new job by now.
        if ended.claim.is_some()
            && let Some(record) = self.store.job_record(key).await?
            && record.accepted_unix_ms != ended.accepted_unix_ms
        {
            return Ok(());
        }
        Ok(self.store.delete_job(key).await?)
    }

    /// Notes that a job has ended: who asks for it looks in the store then.
    pub(super) async fn note_end(&self, key: JobKey) -> Result<(), QueueError> {
        self.queue.set_note(key, &Note { has_ended: true, ..Note::default() }).await
    }
}

/// A job with its end, and the bytes of its result.
pub(super) fn with_end(job: EndedJob, state: &JobState) -> (EndedJob, Bytes) {
    let content = match state {
        JobState::Done(finished) => finished.content.clone(),
        _ => Bytes::new(),
    };
    let digest = matches!(state, JobState::Done(_)).then(|| Digest::of(&content));
    (EndedJob { end: end_of(state, digest, error::record), ..job }, content)
}

/// Reasons why the end of a job is not stored, or not everybody is told of it. Trying again does the rest.
#[derive(Debug, thiserror::Error)]
pub(super) enum Untold {
    /// The store cannot be reached.
    #[error(transparent)]
    Store(#[from] Unavailable),
    /// The queue cannot be reached.
    #[error(transparent)]
    Queue(#[from] QueueError),
    /// Another server writes to the same object.
    #[error("another server writes the end of the same job")]
    Conflict,
}

impl From<Untold> for ApiError {
    fn from(error: Untold) -> Self {
        match error {
            Untold::Store(error) => error.into(),
            Untold::Queue(error) => error.into(),
            Untold::Conflict => super::service::unavailable(),
        }
    }
}
