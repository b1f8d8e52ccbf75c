//! The state that all handlers share: the job queue, stored meshes, caches, API keys and limits. It is built from the
//! settings when the server starts, and building it starts the workers.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use super::error::ApiError;
use super::event_streams::EventStreams;
use super::hear_of_ends::Settlements;
use super::shared_jobs::service::SharedJobs;
use super::static_document::StaticDocument;
use super::stored_mesh::service::Shared;
use super::{ServeError, descriptions, error, hear_of_ends};
use crate::config::{Config, cores, memory_bytes, why_no_gpu};
use crate::durable::{Durable, Recovered};
use crate::jobs::{CpuThreads, JobSettings, Jobs, Storage, pipeline_renderers};
use crate::keys::Keys;
use crate::memory::{Account, Memory, MemoryLimits};
use crate::metrics::Metrics;
use crate::pictures::Pictures;
use crate::priority::with_low_threads;
use crate::rates::Rates;
use crate::residents::Residents;
use crate::shared_queue::SharedQueue;
use crate::store::Store;
use crate::webhooks::Webhooks;
use meshsnap_render::backend::cpu::DrawingThreads;
use meshsnap_render::backend::{GpuHost, HardwareHint};
use meshsnap_render::request::Rules;

/// Time without work after which a worker frees the memory in which it draws.
const IDLE_TIME: Duration = Duration::from_secs(10);

/// The state that all handlers share.
pub struct AppState {
    /// The limits and defaults by which request documents are read.
    pub rules: Rules,
    /// The JSON Schema of request documents under these rules.
    pub schema: StaticDocument,
    /// The description of the interface under these rules, once somebody has asked for it.
    pub openapi: OnceLock<StaticDocument>,
    /// The job queue and its workers.
    pub jobs: Jobs,
    /// The process's GPU.
    pub gpu: Arc<GpuHost>,
    /// The memory of the process.
    pub memory: Arc<Memory>,
    /// Counters and gauges.
    pub metrics: Arc<Metrics>,
    /// The data folder. None: nothing outlives the process.
    pub durable: Option<Durable>,
    /// The store that several daemons share. None: this one is alone.
    pub shared: Option<Shared>,
    /// The jobs that several daemons share. None: this one has its own.
    pub shared_jobs: Option<Arc<SharedJobs>>,
    /// The webhooks. None: there is no secret for them.
    pub webhooks: Option<Webhooks>,
    /// The clients that follow jobs.
    pub event_streams: EventStreams,
    /// The stored meshes.
    pub meshes: Store,
    /// Stored meshes as they are drawn.
    pub residents: Arc<Residents>,
    /// Pictures that were drawn.
    pub pictures: Pictures,
    /// The largest request body, bytes.
    pub body_bytes_max: u64,
    /// Time limit for reading one request body.
    pub body_timeout: Duration,
    /// Least bytes a second of a request body; 0: any.
    pub least_rate: u64,
    /// Number of worker threads.
    pub workers: u64,
    /// Jobs of a class that wait per worker.
    pub queue_per_worker: u64,
    /// Time limit of a job, milliseconds.
    pub job_ms_max: u64,
    /// The server can be reached from this machine alone.
    pub is_local: bool,
    /// Origins of pages that may use the interface.
    pub cors_origins: Vec<String>,
    /// How much each client has asked for.
    pub rates: Rates,
    /// The API keys. If there are none, no request needs one.
    pub keys: Keys,
    /// The start of the server.
    pub began: Instant,
    leaving: AtomicBool,
    draining: AtomicBool,
}

impl AppState {
    /// Builds the state and starts the workers. Returns what is in the data folder as well.
    pub fn start(
        config: &Config,
        keys: Keys,
        shared: Option<Shared>,
        queue: Option<SharedQueue>,
        is_local: bool,
    ) -> Result<(Arc<Self>, Recovered), ServeError> {
        let (durable, recovered) = match &config.data_dir {
            Some(folder) if !config.ephemeral => {
                let (durable, recovered) = Durable::open(folder)?;
                (Some(durable), recovered)
            }
            _ => (None, Recovered::default()),
        };
        let threads = match config.worker_threads {
            0 => CpuThreads::Shared(Arc::new(with_low_threads(|| DrawingThreads::new(to_usize(cores()))))),
            given => CpuThreads::Each(to_usize(given)),
        };
        let gpu = Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu()), config.cache_dir.clone()));
        let memory = Memory::new(&memory_limits(config));
        let residents = Arc::new(Residents::new(config.resident_bytes, memory.clone()));
        let renderers = pipeline_renderers(gpu.clone(), threads, config.limits.clone(), residents.clone());
        let settlements = Arc::new(Settlements::default());
        let metrics = Arc::new(Metrics::new().map_err(std::io::Error::other)?);
        let webhooks = hear_of_ends::start(config, (durable.clone(), settlements.clone()), &metrics)?;
        let settings = JobSettings {
            metrics: Some(metrics.clone()),
            webhooks: hear_of_ends::of_jobs(webhooks.as_ref()),
            storage: durable.clone().map(|durable| Storage { durable, describe: error::record }),
            ..job_settings(config, &memory)
        };
        let rules = Rules { limits: config.limits.clone(), backend: config.backend };
        let jobs = Jobs::start(settings, renderers)?;
        let shared_jobs = queue.zip(shared.as_ref()).map(|(queue, shared)| {
            let end_time = Duration::from_millis(config.unfetched_ttl_ms);
            Arc::new(SharedJobs::new((queue, shared.store.clone()), &jobs, settlements, end_time))
        });
        let state = Arc::new(Self {
            schema: descriptions::schema(&rules),
            openapi: OnceLock::new(),
            rules,
            jobs,
            shared_jobs,
            gpu,
            // With a shared store, the one in memory is a cache of it, and the data folder has jobs alone.
            meshes: Store::new(
                durable.clone().filter(|_| shared.is_none()),
                memory.clone(),
                to_usize(config.mesh_count),
            ),
            durable,
            shared,
            webhooks,
            event_streams: EventStreams::new(),
            metrics,
            residents,
            pictures: Pictures::new(config.picture_bytes, &memory),
            memory,
            body_bytes_max: config.body_bytes,
            body_timeout: Duration::from_millis(config.body_timeout_ms),
            least_rate: config.least_rate_bytes,
            workers: config.workers,
            queue_per_worker: config.queue_per_worker,
            job_ms_max: config.job_ms,
            is_local,
            cors_origins: config.cors_origins.clone(),
            rates: Rates::new(
                to_u32(config.rate_per_s),
                to_u32(config.rate_burst),
                to_u32(config.quota_per_day),
                config.shared_queue.is_some(),
            ),
            keys,
            began: Instant::now(),
            leaving: AtomicBool::new(false),
            draining: AtomicBool::new(false),
        });
        Ok((state, recovered))
    }

    /// Refuses new work from now on. Accepted jobs go on.
    pub fn drain(&self) {
        self.draining.store(true, Ordering::Relaxed);
        self.jobs.drain();
    }

    /// The server is to end, and takes work for a while yet.
    pub fn leave(&self) {
        self.leaving.store(true, Ordering::Relaxed);
    }

    /// True once [`AppState::leave`] or [`AppState::drain`] was called.
    pub fn is_leaving(&self) -> bool {
        self.leaving.load(Ordering::Relaxed) || self.is_draining()
    }

    /// True once [`AppState::drain`] was called.
    pub fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Relaxed)
    }
}

/// The settings of jobs, which nobody hears of and nothing stores yet.
fn job_settings(config: &Config, memory: &Arc<Memory>) -> JobSettings {
    JobSettings {
        workers: to_usize(config.workers),
        queue: to_usize(config.queue_per_worker.saturating_mul(config.workers)),
        idle_time: IDLE_TIME,
        job_time: Duration::from_millis(config.job_ms),
        overdue_grace: Duration::from_millis(config.overdue_grace_ms),
        result_ttl: Duration::from_millis(config.result_ttl_ms),
        interactive_wait: Duration::from_millis(config.wait_ms),
        batch_wait: Duration::from_millis(config.batch_wait_ms),
        unfetched_ttl: Duration::from_millis(config.unfetched_ttl_ms),
        result_bytes: memory.cap(Account::Results),
        result_count: to_usize(config.result_count),
        memory: memory.clone(),
        metrics: None,
        code_of: |failure| ApiError::from(failure).code,
        webhooks: None,
        storage: None,
    }
}

/// The caps of the accounts: what is configured, and where memory is scarce, parts of it. Half is for jobs then. Caches have
/// caps of their own.
fn memory_limits(config: &Config) -> MemoryLimits {
    let all = memory_bytes(config.memory_bytes);
    let job = config.limits.memory_bytes.min(all / 2);
    let rest = all - job;
    let accounts = vec![
        (Account::Uploads, config.uploads_bytes.min(rest / 2)),
        (Account::Results, config.result_bytes.min(rest / 4)),
        (Account::Meshes, config.mesh_bytes.min(rest / 4)),
    ];
    tracing::info!(bytes = all, job, "memory");
    MemoryLimits { all, job, accounts }
}

fn to_u32(number: u64) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn to_usize(number: u64) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
