//! Looks after the queue, one daemon at a time: jobs and webhooks that are in the store and not in the queue are sent to
//! it again, and old ends are forgotten. A message can be missing because a daemon stopped while it accepted the job, or
//! because JetStream has lost it: it tells clients that a message is kept before it is on the disk.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::accept::{kind_of, message_name};
use super::service::SharedJobs;
use crate::durable::JobKey;
use crate::http::error::ApiError;
use crate::jobs::unix_ms;
use crate::shared_queue::Kind;
use crate::shared_store::Ages;

/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_secs(10);

/// Age from which an object without a message is not one that is being accepted.
const AGE_MIN: Duration = Duration::from_secs(15);

/// Time between two looks for old ends.
const FORGET_EVERY: Duration = Duration::from_secs(600);

/// Time for which the daemon that looks has this task to itself.
const LEASE: Duration = Duration::from_secs(60);

/// The name of the lease.
const NAME: &str = "sweep";

/// Looks until the process ends.
pub async fn run(shared: Arc<SharedJobs>) {
    let mut forgot = Instant::now();
    loop {
        tokio::time::sleep(LOOK_EVERY).await;
        if !shared.queue.is_connected() || shared.store.is_in_trouble() {
            continue;
        }
        match shared.queue.lease(NAME, &shared.server, LEASE).await {
            Ok(true) => {}
            Ok(false) => continue,
            Err(error) => {
                tracing::warn!(%error, "the queue was not looked after");
                continue;
            }
        }
        warn(shared.send_jobs_again().await);
        warn(shared.send_webhooks_again().await);
        if forgot.elapsed() >= FORGET_EVERY {
            forgot = Instant::now();
            warn(shared.forget_old_ends().await);
        }
    }
}

fn warn(looked: Result<(), ApiError>) {
    if let Err(error) = looked {
        tracing::warn!(error = error.detail, "the queue was not looked after");
    }
}

impl SharedJobs {
    async fn forget_old_ends(&self) -> Result<(), ApiError> {
        for (key, age) in self.store.ends().await? {
            if age > self.end_time {
                self.store.delete_end(key).await?;
            }
        }
        Ok(())
    }

    /// Sends messages about jobs that have none. The objects were listed before the messages are, so that none is
    /// missing because it was written in between.
    async fn send_jobs_again(&self) -> Result<(), ApiError> {
        let jobs = self.store.jobs().await?;
        if jobs.is_empty() {
            return Ok(());
        }
        let mut live = self.queue.live(Kind::Job).await?;
        live.extend(self.queue.live(Kind::GpuJob).await?);
        let mut count = 0;
        for key in missing(jobs, &live) {
            // One whose object is damaged is ended by the server that takes its message.
            let kind = self.store.job_record(key).await?.map_or(Kind::Job, |record| kind_of(&record));
            self.send_again(kind, key).await?;
            count += 1;
        }
        report(count);
        Ok(())
    }

    /// The same for webhooks.
    async fn send_webhooks_again(&self) -> Result<(), ApiError> {
        let owed = self.store.owed_webhooks().await?;
        if owed.is_empty() {
            return Ok(());
        }
        let live = self.queue.live(Kind::Webhook).await?;
        let mut count = 0;
        for key in missing(owed, &live) {
            self.send_again(Kind::Webhook, key).await?;
            count += 1;
        }
        report(count);
        Ok(())
    }

    async fn send_again(&self, kind: Kind, key: JobKey) -> Result<(), ApiError> {
        Ok(self.queue.send(kind, key, &message_name(key, unix_ms())).await?)
    }
}

fn missing(objects: Ages, live: &HashSet<JobKey>) -> impl Iterator<Item = JobKey> {
    objects.into_iter().filter(|(key, age)| *age > AGE_MIN && !live.contains(key)).map(|(key, _)| key)
}

fn report(count: usize) {
    if count > 0 {
        tracing::warn!(count, "the queue had lost messages, which are sent again");
    }
}
