//! The answer of `/v1/status` as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use super::capabilities::BackendDto;
use crate::http::state::AppState;
use crate::metrics::failures::Failure;
use crate::metrics::{Gauges, Metrics};
use crate::pictures::Source;

/// The state of a server. Its numbers are those of `/metrics`.
#[derive(Serialize)]
pub struct ServerStatusDto {
    version: &'static str,
    uptime_s: u64,
    backend: BackendDto,
    queue: Vec<QueueDto>,
    workers: BTreeMap<&'static str, u64>,
    memory: MemoryDto,
    /// Number of things that are kept, by account.
    kept: BTreeMap<&'static str, usize>,
    /// Pictures of stored meshes that were given, by `X-Cache`.
    pictures: BTreeMap<&'static str, u64>,
    quarantined_meshes: usize,
    webhooks_waiting: usize,
    gpu_losses: u64,
    servers: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_queue: Option<SharedQueueDto>,
    failures: Vec<FailureDto>,
}

#[derive(Serialize)]
struct QueueDto {
    class: &'static str,
    queued: usize,
    /// Time that a job would wait.
    wait_ms: u64,
}

#[derive(Serialize)]
struct MemoryDto {
    limit_bytes: u64,
    resident_bytes: u64,
    accounts: Vec<AccountDto>,
}

#[derive(Serialize)]
struct AccountDto {
    account: &'static str,
    used_bytes: u64,
    limit_bytes: u64,
}

/// The queue that several servers share.
#[derive(Serialize)]
struct SharedQueueDto {
    messages: BTreeMap<&'static str, u64>,
    oldest_s: u64,
}

/// A kind of failure. It says nothing of the client.
#[derive(Serialize)]
struct FailureDto {
    last_at: String,
    place: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    status: Option<u16>,
    code: &'static str,
    count: u64,
}

impl ServerStatusDto {
    /// The answer, from the gauges of this moment.
    pub fn new(state: &AppState, gauges: &Gauges) -> Self {
        let queue = gauges.queues.iter().map(|&(class, queued, wait_ms)| QueueDto { class, queued, wait_ms });
        let shared = (!gauges.shared_queue.is_empty()).then(|| SharedQueueDto {
            messages: gauges.shared_queue.iter().copied().collect(),
            oldest_s: gauges.shared_oldest_s,
        });
        Self {
            version: env!("CARGO_PKG_VERSION"),
            uptime_s: state.began.elapsed().as_secs(),
            backend: BackendDto::new(state.rules.backend, state.gpu.status()),
            queue: queue.collect(),
            workers: gauges.workers.iter().copied().collect(),
            memory: MemoryDto::new(gauges),
            kept: gauges.entries.iter().copied().collect(),
            pictures: pictures(&state.metrics),
            quarantined_meshes: gauges.quarantined,
            webhooks_waiting: gauges.webhooks,
            gpu_losses: gauges.gpu_losses,
            servers: gauges.servers,
            shared_queue: shared,
            failures: state.metrics.failures().into_iter().map(FailureDto::from).collect(),
        }
    }
}

impl MemoryDto {
    fn new(gauges: &Gauges) -> Self {
        let accounts = gauges.memory.iter();
        let accounts =
            accounts.map(|&(account, used_bytes, limit_bytes)| AccountDto { account, used_bytes, limit_bytes });
        Self { limit_bytes: gauges.memory_budget, resident_bytes: gauges.resident_bytes, accounts: accounts.collect() }
    }
}

impl From<Failure> for FailureDto {
    fn from(failure: Failure) -> Self {
        let Failure { place, status, code, count, last } = failure;
        Self { last_at: humantime::format_rfc3339_seconds(last).to_string(), place, status, code, count }
    }
}

fn pictures(metrics: &Metrics) -> BTreeMap<&'static str, u64> {
    Source::ALL.iter().map(|source| (source.name(), metrics.picture_count(source.name()))).collect()
}
