//! The end of a job of a service. It is written to the store first, so that it is the job's only one. Then
//! everybody is told: by the note, and through the queue of webhooks. If the daemon stops in between, the message of the
//! job comes again, and [`SharedJobs::tell`] does the rest.

use bytes::Bytes;

use super::service::{SharedJobs, id_of};
use crate::digest::Digest;
use crate::durable::{JobKey, JobRecord};
use crate::http::error::{self, ApiError};
use crate::jobs::{JobState, end_of};
use crate::shared_queue::{Kind, Note, QueueError};
use crate::shared_store::{EndedJob, Unavailable};

impl SharedJobs {
    /// Ends a job in this state, unless it has ended in another.
    pub(super) async fn end(&self, record: &JobRecord, state: &JobState) -> Result<(), Untold> {
        let content = match state {
            JobState::Done(finished) => finished.content.clone(),
            _ => Bytes::new(),
        };
        let digest = matches!(state, JobState::Done(_)).then(|| Digest::of(&content));
        let ended = EndedJob::of(record, end_of(state, digest, error::record));
        if ended.webhook.is_some() {
            self.store.owe_webhook(record.key).await?;
        }
        if self.store.create_end(record.key, &ended, content).await? {
            let (job, request_id, end) = (id_of(record.key), &*record.request_id, state.name());
            tracing::info!(%job, request_id, end, "a job of the shared queue ended");
        }
        self.tell(record.key, ended.webhook.is_some()).await
    }

    /// Tells everybody that a job has ended, and removes its object.
    pub(super) async fn tell(&self, key: JobKey, has_webhook: bool) -> Result<(), Untold> {
        if has_webhook {
            self.queue.send(Kind::Webhook, key, &format!("{key:032x} webhook")).await?;
        }
        self.queue.set_note(key, &Note { has_ended: true, ..Note::default() }).await?;
        Ok(self.store.delete_job(key).await?)
    }
}

/// Reasons why the end of a job is not stored, or not everybody is told of it. To end the job again does the rest.
#[derive(Debug, thiserror::Error)]
pub(super) enum Untold {
    /// The store cannot be reached.
    #[error(transparent)]
    Store(#[from] Unavailable),
    /// The queue cannot be reached.
    #[error(transparent)]
    Queue(#[from] QueueError),
}

impl From<Untold> for ApiError {
    fn from(error: Untold) -> Self {
        match error {
            Untold::Store(error) => error.into(),
            Untold::Queue(error) => error.into(),
        }
    }
}
