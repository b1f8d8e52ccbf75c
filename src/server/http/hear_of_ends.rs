//! The connection between jobs and webhooks: it starts the sender of webhooks by the settings, and writes the message
//! that a webhook gets at the end of a job, with the JSON of the job's state.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::Serialize;
use tokio::sync::oneshot;

use super::ServeError;
use super::dto::JobDto;
use crate::config::Config;
use crate::durable::{Change, Durable};
use crate::jobs::{Job, JobId, OnEnd};
use crate::metrics::Metrics;
use crate::webhooks::{Delivery, RootCerts, Secret, Target, WebhookSettings, Webhooks, roots};

/// The payload, in the form of Standard Webhooks.
#[derive(Serialize)]
struct PayloadDto {
    r#type: String,
    timestamp: String,
    data: JobDto,
}

/// Those who wait until a webhook was told, or is given up.
#[derive(Default)]
pub struct Settlements(Mutex<HashMap<String, oneshot::Sender<()>>>);

impl Settlements {
    /// Nothing more is sent to the webhook of the job with this id.
    pub fn settle(&self, id: &str) {
        if let Some(waiting) = self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(id) {
            let _ = waiting.send(());
        }
    }

    /// Waits until [`Self::settle`] is called for this id.
    pub fn expect(&self, id: String) -> oneshot::Receiver<()> {
        let (sender, receiver) = oneshot::channel();
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(id, sender);
        receiver
    }
}

/// Starts the webhooks, if there is a secret by which they are signed.
pub fn start(
    config: &Config,
    (durable, settlements): (Option<Durable>, Arc<Settlements>),
    metrics: &Arc<Metrics>,
) -> Result<Option<Webhooks>, ServeError> {
    let Some(text) = &config.webhook_secret else { return Ok(None) };
    let roots = match &config.webhooks_ca {
        None => RootCerts::WebPki,
        Some(path) => {
            let broken = |why: String| ServeError::WebhooksCa(format!("{}: {why}", path.display()));
            let pem = std::fs::read(path).map_err(|error| broken(error.to_string()))?;
            roots(&pem).ok_or_else(|| broken("there are no certificates in PEM".to_owned()))?
        }
    };
    let settings = WebhookSettings {
        roots,
        secret: Secret::read(text).ok_or(ServeError::WebhookSecret)?,
        to_private: config.webhooks_to_private,
        retry: Duration::from_millis(config.webhook_retry_ms),
        metrics: Some(metrics.clone()),
    };
    let settled = move |id: &str| {
        settlements.settle(id);
        if let (Some(durable), Some(id)) = (&durable, JobId::parse(id)) {
            durable.store_soon(vec![Change::Notified(id.key(), crate::jobs::unix_ms())], Vec::new());
        }
    };
    Ok(Some(Webhooks::start(settings, Box::new(settled))?))
}

/// Lets webhooks hear of the ends of jobs.
pub fn of_jobs(webhooks: Option<&Webhooks>) -> Option<OnEnd> {
    let webhooks = webhooks?.clone();
    Some(OnEnd(Arc::new(move |job| {
        if let Some(address) = &job.webhook {
            send(Some(&webhooks), job, address);
        }
    })))
}

/// Tells a webhook of a job that has ended.
pub fn send(webhooks: Option<&Webhooks>, job: &Arc<Job>, address: &str) {
    let (Some(webhooks), Ok(target)) = (webhooks, Target::stored(address)) else {
        return tracing::warn!(job = %job.id, "the webhook of a job is not told: there is no MESHSNAP_WEBHOOK_SECRET now");
    };
    let job = job.clone();
    webhooks.send(Box::new(move || {
        let timestamp = humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string();
        let payload = PayloadDto { r#type: format!("job.{}", job.state().name()), timestamp, data: JobDto::new(&job) };
        let payload = serde_json::to_string(&payload).ok()?;
        Some(Delivery { id: job.id.to_string(), target, payload })
    }));
}
