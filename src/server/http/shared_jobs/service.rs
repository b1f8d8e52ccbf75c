//! The queue and the store of a service, and what this daemon has of its jobs. The other files here add to [`SharedJobs`].

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;

use super::others::Others;
use crate::durable::JobKey;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::hear_of_ends::Settlements;
use crate::jobs::{JobId, Jobs};
use crate::shared_queue::{QueueError, QueueLoad, SharedQueue};
use crate::shared_store::SharedStore;

/// Webhooks that this daemon tells at a time.
const TELLING_MAX: usize = 1000;

/// The queue and the store of a service, and what this daemon has of its jobs.
pub struct SharedJobs {
    pub(super) queue: SharedQueue,
    pub(super) store: Arc<SharedStore>,
    /// The name of this daemon.
    pub(super) server: String,
    /// A permit for each job that this daemon has.
    pub(super) slots: Slots,
    /// A permit for each webhook that it tells.
    pub(super) telling: Arc<Semaphore>,
    pub(super) settlements: Arc<Settlements>,
    /// The time for which ends are kept.
    pub(super) end_time: Duration,
    /// The other daemons.
    pub(super) others: Others,
}

/// Permits for jobs of the queue. Those that ask for a GPU have their own, so that they do not wait behind all others here
/// while another daemon could do them.
pub(super) struct Slots {
    /// For jobs that any daemon can do.
    pub(super) any: Arc<Semaphore>,
    /// For jobs that ask for a GPU.
    pub(super) gpu: Arc<Semaphore>,
    count: u32,
}

impl Slots {
    fn new(count: usize) -> Self {
        let [any, gpu] = [(); 2].map(|()| Arc::new(Semaphore::new(count)));
        Self { any, gpu, count: u32::try_from(count).unwrap_or(u32::MAX) }
    }
}

impl SharedJobs {
    /// The jobs of this queue and store.
    pub fn new(
        (queue, store): (SharedQueue, Arc<SharedStore>),
        jobs: &Jobs,
        settlements: Arc<Settlements>,
        end_time: Duration,
    ) -> Self {
        Self {
            queue,
            store,
            server: JobId::fresh().to_string(),
            slots: Slots::new(jobs.shared_slots()),
            telling: Arc::new(Semaphore::new(TELLING_MAX)),
            settlements,
            end_time,
            others: Others::default(),
        }
    }

    /// An error while a job could not be kept.
    pub fn check(&self) -> Result<(), ApiError> {
        match self.queue.is_connected() {
            true => Ok(()),
            false => Err(unavailable()),
        }
    }

    /// Waits, once the server drains, until this daemon has no job of the queue any more.
    pub async fn idle(&self) {
        for slots in [&self.slots.any, &self.slots.gpu] {
            let _ = slots.acquire_many(self.slots.count).await;
        }
    }

    /// The number of daemons of the service.
    pub fn servers(&self) -> u32 {
        self.others.count()
    }

    /// The load of the queue, if it can be reached.
    pub async fn load(&self) -> Option<QueueLoad> {
        self.queue.load().await.ok()
    }
}

/// The error while the queue cannot be reached.
pub fn unavailable() -> ApiError {
    let detail = "the queue of jobs that the servers share cannot be reached; try again shortly";
    ApiError::new(ErrorKind::Unavailable, "queue_unavailable", detail).retry_after(5)
}

impl From<QueueError> for ApiError {
    fn from(error: QueueError) -> Self {
        match error {
            QueueError::Full => {
                let detail = "as many jobs wait in the queue that the servers share as may; try again shortly";
                Self::new(ErrorKind::Busy, "queue_full", detail).flag("--queue-jobs").retry_after(5)
            }
            QueueError::Unavailable { .. } => {
                tracing::error!(%error, "an operation of the shared queue failed");
                unavailable()
            }
        }
    }
}

/// A job's name in logs.
pub(super) fn id_of(key: JobKey) -> JobId {
    JobId::from_key(key)
}
