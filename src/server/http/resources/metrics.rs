//! `/metrics`: counters, gauges and histograms in the text format of Prometheus.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};

use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::jobs::Class;
use crate::memory::Account;
use crate::metrics::{Gauges, MEDIA_TYPE};
use crate::webhooks::Webhooks;

/// The longest time for which the shared queue is asked for its load.
const LOOK_TIME: Duration = Duration::from_secs(2);

/// Everything that is counted.
pub async fn get(State(state): State<Arc<AppState>>) -> Result<Response, ApiError> {
    let gauges = gauges(&state).await;
    let text = state.metrics.text(&gauges).map_err(|error| {
        tracing::error!(%error, "the metrics cannot be written");
        ApiError::internal()
    })?;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    Ok((headers, text).into_response())
}

/// The gauges at this moment, those of the shared queue too.
pub async fn gauges(state: &AppState) -> Gauges {
    let mut gauges = own_gauges(state);
    if let Some(jobs) = &state.shared_jobs
        && let Ok(Some(load)) = tokio::time::timeout(LOOK_TIME, jobs.load()).await
    {
        gauges.shared_queue = vec![
            ("jobs", load.jobs),
            ("gpu", load.gpu_jobs),
            ("webhooks", load.webhooks),
            ("redelivered", load.redelivered),
            ("dead", load.dead),
        ];
        gauges.shared_oldest_s = load.oldest.as_secs();
    }
    gauges
}

fn own_gauges(state: &AppState) -> Gauges {
    let (jobs, meshes) = (state.jobs.load(), state.meshes.load());
    let (residents, pictures) = (state.residents.load(), state.pictures.load());
    let waits = [jobs.wait, jobs.batch_wait].map(|wait| u64::try_from(wait.as_millis()).unwrap_or(u64::MAX));
    let queues = Class::ALL.iter().zip(jobs.queued_by_class).zip(waits);
    let memory = &state.memory;
    let cap = |account| match account {
        Account::Residents => state.residents.limit_bytes(),
        Account::Pictures => state.pictures.limit_bytes(),
        _ => memory.cap(account),
    };
    Gauges {
        queues: queues.map(|((class, jobs), wait_ms)| (class.name(), jobs, wait_ms)).collect(),
        workers: vec![("busy", jobs.running as u64), ("all", state.workers), ("overdue", jobs.overdue as u64)],
        quarantined: jobs.quarantined,
        memory: Account::ALL.map(|account| (account.name(), memory.used(account), cap(account))).to_vec(),
        webhooks: state.webhooks.as_ref().map_or(0, Webhooks::count),
        memory_budget: memory.limit(),
        entries: vec![
            ("results", jobs.kept),
            ("meshes", meshes.count),
            ("residents", residents.count),
            ("pictures", pictures.count),
        ],
        gpu_losses: state.gpu.losses_in_all(),
        resident_bytes: resident_bytes(),
        shared_queue: Vec::new(),
        servers: state.shared_jobs.as_ref().map_or(1, |jobs| jobs.servers()),
        shared_oldest_s: 0,
    }
}

/// Memory of this process that is resident. 0 where the system does not say.
fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok());
    kib.unwrap_or(0).saturating_mul(1024)
}
