//! Webhooks of a service: the end of a job is a message of the queue until a daemon has told the receiver. One daemon at a
//! time has it, and makes all attempts; if it stops, another begins again.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::{OwnedSemaphorePermit, oneshot};

use super::service::{SharedJobs, id_of};
use crate::durable::JobKey;
use crate::http::hear_of_ends;
use crate::http::state::AppState;
use crate::jobs::{Job, Owner, Progress, Restored, read_end};
use crate::shared_queue::{Delivery, Kind, SIGN_EVERY};

/// Pause after a failure of the queue or the store.
const PAUSE: Duration = Duration::from_secs(1);

/// Time between two looks at whether the server drains.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Tells webhooks until the server drains.
pub async fn run(shared: Arc<SharedJobs>, state: Arc<AppState>) {
    if state.webhooks.is_none() {
        return;
    }
    while let Ok(permit) = shared.telling.clone().acquire_owned().await {
        if state.is_draining() {
            return;
        }
        match shared.queue.take(Kind::Webhook).await {
            Ok(None) => {}
            Ok(Some(delivery)) => {
                tokio::spawn(shared.clone().tell_of(state.clone(), delivery, permit));
            }
            Err(error) => {
                tracing::warn!(%error, "no webhook was taken");
                tokio::time::sleep(PAUSE).await;
            }
        }
    }
}

impl SharedJobs {
    async fn tell_of(self: Arc<Self>, state: Arc<AppState>, delivery: Delivery, _permit: OwnedSemaphorePermit) {
        let Some(key) = delivery.key() else { return delivery.end().await };
        let Ok(told) = self.begin_to_tell(&state, key).await else { return delivery.give_back(PAUSE).await };
        if let Some(mut told) = told {
            let mut signed = Instant::now();
            loop {
                match tokio::time::timeout(LOOK_EVERY, &mut told).await {
                    Ok(Ok(())) => break,
                    // Another delivery of the same message took its place.
                    Ok(Err(_)) => return,
                    Err(_) if state.is_draining() => return delivery.give_back(Duration::ZERO).await,
                    Err(_) => {}
                }
                if signed.elapsed() >= SIGN_EVERY {
                    signed = Instant::now();
                    delivery.sign_of_life().await;
                }
            }
        }
        match self.store.settle_webhook(key).await {
            Ok(()) => delivery.end().await,
            Err(_) => delivery.give_back(PAUSE).await,
        }
    }

    /// Sends the message about a job. None if nobody is to be told any more.
    async fn begin_to_tell(&self, state: &AppState, key: JobKey) -> Result<Option<oneshot::Receiver<()>>, ()> {
        if !self.store.owes_webhook(key).await.map_err(drop)? {
            return Ok(None);
        }
        let found = self.store.end(key, &mut |_| true).await.map_err(drop)?;
        let Some((ended, content)) = found else { return Ok(None) };
        let Some(address) = ended.webhook else { return Ok(None) };
        let (id, owner) = (id_of(key), Owner::new(&ended.owner));
        let name = Restored { id, accepted_unix_ms: ended.accepted_unix_ms, owner, claim: None };
        let end = read_end(&ended.end, Some(content), &state.memory);
        let job = Arc::new(Job::mirror_of(name, end, Progress::default()));
        let told = self.settlements.expect(id.to_string());
        hear_of_ends::send(state.webhooks.as_ref(), &job, &address);
        Ok(Some(told))
    }
}
