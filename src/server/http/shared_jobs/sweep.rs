//! Looks after the queue, one daemon at a time: jobs and webhooks that are in the store and not in the queue are sent to
//! it again, and old ends are forgotten. A message can be missing because a daemon stopped while it accepted the job, or
//! because JetStream has lost it: it tells clients that a message is kept before it is on the disk.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::accept::message_name;
use super::service::SharedJobs;
use crate::http::error::ApiError;
use crate::jobs::unix_ms;
use crate::shared_queue::Kind;

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
        warn(shared.send_again(Kind::Job).await);
        warn(shared.send_again(Kind::Webhook).await);
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

    /// Sends messages about objects that have none. The objects were listed before the messages are, so that none is
    /// missing because it was written in between.
    async fn send_again(&self, kind: Kind) -> Result<(), ApiError> {
        let objects = match kind {
            Kind::Job => self.store.jobs().await?,
            Kind::Webhook => self.store.owed_webhooks().await?,
        };
        if objects.is_empty() {
            return Ok(());
        }
        let live = self.queue.live(kind).await?;
        let mut count = 0;
        for (key, _) in objects.into_iter().filter(|(key, age)| *age > AGE_MIN && !live.contains(key)) {
            self.queue.send(kind, key, &message_name(key, unix_ms())).await?;
            count += 1;
        }
        if count > 0 {
            tracing::warn!(count, "the queue had lost messages, which are sent again");
        }
        Ok(())
    }
}
