//! Looks after the queue, one daemon at a time: jobs and webhooks that are in the store and not in the queue are sent to
//! it again, messages about neither are removed, and old ends are forgotten. A message can be missing because a daemon stopped while it accepted the job, or
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

/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_secs(10);

/// Age from which an object without a message is not one that is being accepted.
const AGE_MIN: Duration = Duration::from_secs(15);

/// Time between two looks for old ends.
const FORGET_EVERY: Duration = Duration::from_secs(600);

/// Time for which the daemon that looks has this task to itself. It makes it last longer with each look.
const LEASE: Duration = Duration::from_secs(25);

/// The name of the lease.
const NAME: &str = "sweep";

/// Looks until the process ends.
pub async fn run(shared: Arc<SharedJobs>) {
    let mut forgot = Instant::now();
    let (mut stale_jobs, mut stale_webhooks) = (HashSet::new(), HashSet::new());
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
        warn(shared.compare(&[Kind::Job, Kind::GpuJob], &mut stale_jobs).await);
        warn(shared.compare(&[Kind::Webhook], &mut stale_webhooks).await);
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

    /// Sends messages about objects that have none, and removes messages that are about none: NATS 2.9 may keep them when
    /// it is killed. `stale` are those of the last look, and then those of this one.
    async fn compare(&self, kinds: &[Kind], stale: &mut HashSet<(Kind, JobKey)>) -> Result<(), ApiError> {
        // The objects were listed before the messages are, so that none is missing because it was written in between.
        let objects = match kinds {
            [Kind::Webhook] => self.store.owed_webhooks().await?,
            _ => self.store.jobs().await?,
        };
        let mut live = HashSet::new();
        for kind in kinds {
            live.extend(self.queue.live(*kind).await?.into_iter().map(|key| (*kind, key)));
        }
        let are_live: HashSet<JobKey> = live.iter().map(|(_, key)| *key).collect();
        let mut sent = 0;
        for (key, _) in objects.iter().filter(|(key, age)| *age > AGE_MIN && !are_live.contains(key)) {
            self.send_again(kinds, *key).await?;
            sent += 1;
        }
        let exist: HashSet<JobKey> = objects.into_iter().map(|(key, _)| key).collect();
        let mut removed = 0;
        // One without an object may have been accepted since, or end in this moment. After ten seconds it is neither.
        let without: HashSet<_> = live.into_iter().filter(|(_, key)| !exist.contains(key)).collect();
        for (kind, key) in without.intersection(stale) {
            self.queue.remove(*kind, *key).await?;
            removed += 1;
        }
        *stale = without;
        if sent + removed > 0 {
            tracing::warn!(sent, removed, "the queue had lost messages, or kept some of jobs that have ended");
        }
        Ok(())
    }

    async fn send_again(&self, kinds: &[Kind], key: JobKey) -> Result<(), ApiError> {
        let kind = match kinds {
            [kind] => *kind,
            // One whose object is damaged is ended by the server that takes its message.
            _ => self.store.job_record(key).await?.map_or(Kind::Job, |record| kind_of(&record)),
        };
        Ok(self.queue.send(kind, key, &message_name(key, unix_ms())).await?)
    }
}
