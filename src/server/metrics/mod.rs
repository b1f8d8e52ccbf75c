//! The counters, gauges and histograms of the service, their text for Prometheus (`/metrics`), and failures of late.

pub mod failures;

use std::time::Duration;

use prometheus::core::Collector;
use prometheus::{
    Encoder as _, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge, IntGaugeVec, Opts, Registry,
    TextEncoder,
};

use failures::Failures;

/// The media type of the text.
pub const MEDIA_TYPE: &str = prometheus::TEXT_FORMAT;

/// Upper bounds of durations, seconds: from a thumbnail's stage to a job out of time.
const SECONDS: [f64; 14] = [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 30.0];

/// Counters, which grow as things happen, and gauges, which are set when they are asked for.
pub struct Metrics {
    registry: Registry,
    queue_wait: HistogramVec,
    stages: HistogramVec,
    ends: IntCounterVec,
    answers: IntCounterVec,
    rejections: IntCounterVec,
    pictures: IntCounterVec,
    webhooks: IntCounterVec,
    webhooks_waiting: IntGauge,
    queued: IntGaugeVec,
    expected_wait: IntGaugeVec,
    workers: IntGaugeVec,
    memory: IntGaugeVec,
    memory_limits: IntGaugeVec,
    memory_budget: IntGauge,
    entries: IntGaugeVec,
    gpu_losses: IntCounter,
    overdue: IntCounter,
    quarantined: IntGauge,
    servers: IntGauge,
    resident: IntGauge,
    shared: IntGaugeVec,
    shared_oldest: IntGauge,
    failures: Failures,
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metrics").finish_non_exhaustive()
    }
}

/// The values of gauges at one moment. Names are labels.
#[derive(Clone, Debug, Default)]
pub struct Gauges {
    /// Jobs that wait and milliseconds that one would wait, by class.
    pub queues: Vec<(&'static str, usize, u64)>,
    /// Workers by state.
    pub workers: Vec<(&'static str, u64)>,
    /// Meshes that are refused, by themselves or in comparisons, because workers did not end with them.
    pub quarantined: usize,
    /// Bytes in use and the cap, by account.
    pub memory: Vec<(&'static str, u64, u64)>,
    /// Most bytes of all accounts together.
    pub memory_budget: u64,
    /// Number of things kept, by account.
    pub entries: Vec<(&'static str, usize)>,
    /// Webhooks that are to be delivered.
    pub webhooks: usize,
    /// How often a GPU was lost.
    pub gpu_losses: u64,
    /// Memory of the process.
    pub resident_bytes: u64,
    /// Messages of the queue that several servers share, by kind. Empty where there is none, or it cannot be reached.
    pub shared_queue: Vec<(&'static str, u64)>,
    /// The age of the oldest job there, seconds.
    pub shared_oldest_s: u64,
    /// Servers that share the queue.
    pub servers: u32,
}

impl Metrics {
    /// Nothing has happened yet.
    pub fn new() -> Result<Self, prometheus::Error> {
        let registry = Registry::new();
        let r = &registry;
        let histogram = |name: &str, help: &str, labels: &[&str]| {
            registered(r, HistogramVec::new(HistogramOpts::new(name, help).buckets(SECONDS.to_vec()), labels)?)
        };
        let counter =
            |name: &str, help: &str, labels: &[&str]| registered(r, IntCounterVec::new(Opts::new(name, help), labels)?);
        let gauge =
            |name: &str, help: &str, labels: &[&str]| registered(r, IntGaugeVec::new(Opts::new(name, help), labels)?);
        Ok(Self {
            queue_wait: histogram(
                "meshsnap_queue_wait_seconds",
                "Time for which jobs waited for a worker.",
                &["class"],
            )?,
            stages: histogram("meshsnap_stage_seconds", "Duration of the stages of pictures.", &["stage", "backend"])?,
            ends: counter("meshsnap_jobs_total", "Jobs that ended.", &["class", "end"])?,
            answers: counter("meshsnap_http_answers_total", "Answers by status.", &["status"])?,
            rejections: counter("meshsnap_rejections_total", "Answers that are errors, by code.", &["status", "code"])?,
            pictures: counter("meshsnap_pictures_total", "Pictures of stored meshes, by X-Cache.", &["outcome"])?,
            webhooks: counter("meshsnap_webhooks_total", "Ends of webhooks, and attempts that failed.", &["outcome"])?,
            webhooks_waiting: registered(
                r,
                IntGauge::new("meshsnap_webhooks_waiting", "Webhooks that are to be delivered.")?,
            )?,
            queued: gauge("meshsnap_queue_jobs", "Jobs that wait for a worker.", &["class"])?,
            expected_wait: gauge(
                "meshsnap_queue_expected_wait_milliseconds",
                "Time that a job would wait.",
                &["class"],
            )?,
            workers: gauge("meshsnap_workers", "Worker threads.", &["state"])?,
            memory: gauge("meshsnap_memory_bytes", "Memory in use, by account.", &["account"])?,
            memory_limits: gauge("meshsnap_memory_limit_bytes", "Most memory of an account.", &["account"])?,
            memory_budget: registered(
                r,
                IntGauge::new("meshsnap_memory_budget_bytes", "Most memory of all accounts together.")?,
            )?,
            entries: gauge("meshsnap_kept_entries", "Number of things that are kept.", &["account"])?,
            gpu_losses: registered(r, IntCounter::new("meshsnap_gpu_losses_total", "Times that a GPU was lost.")?)?,
            overdue: registered(
                r,
                IntCounter::new("meshsnap_workers_overdue_total", "Workers that did not end a job whose time was up.")?,
            )?,
            quarantined: registered(
                r,
                IntGauge::new(
                    "meshsnap_quarantined_meshes",
                    "Meshes that are refused because of that, by themselves or in comparisons.",
                )?,
            )?,
            resident: registered(r, IntGauge::new("process_resident_memory_bytes", "Resident memory size in bytes.")?)?,
            shared: gauge(
                "meshsnap_shared_queue_messages",
                "Messages in the queue that several servers share, those that came more than once, and jobs that were given up.",
                &["kind"],
            )?,
            shared_oldest: registered(
                r,
                IntGauge::new("meshsnap_shared_queue_oldest_seconds", "Age of the oldest job in that queue.")?,
            )?,
            servers: registered(
                r,
                IntGauge::new("meshsnap_servers", "Servers of the service that this one hears of, itself too.")?,
            )?,
            failures: Failures::default(),
            registry,
        })
    }

    /// A worker has taken a job.
    pub fn waited(&self, class: &str, time: Duration) {
        self.queue_wait.with_label_values(&[class]).observe(time.as_secs_f64());
    }

    /// A stage of a picture has ended.
    pub fn stage(&self, stage: &str, backend: &str, time: Duration) {
        self.stages.with_label_values(&[stage, backend]).observe(time.as_secs_f64());
    }

    /// A job has ended.
    pub fn ended(&self, class: &str, end: &str) {
        self.ends.with_label_values(&[class, end]).inc();
    }

    /// A job whose end is fetched later has failed.
    pub fn job_failed(&self, code: &'static str) {
        self.failures.add("job", None, code);
    }

    /// An answer was given at a place: a method and a route. `code` is that of an error.
    pub fn answered(&self, place: &str, status: u16, code: Option<&'static str>) {
        let word = status.to_string();
        self.answers.with_label_values(&[word.as_str()]).inc();
        if let Some(code) = code {
            self.rejections.with_label_values(&[word.as_str(), code]).inc();
            self.failures.add(place, Some(status), code);
        }
    }

    /// Failures of late, by kind.
    pub fn failures(&self) -> Vec<failures::Failure> {
        self.failures.list()
    }

    /// Pictures of stored meshes that were given with an outcome.
    pub fn picture_count(&self, outcome: &str) -> u64 {
        self.pictures.with_label_values(&[outcome]).get()
    }

    /// A picture of a stored mesh was given.
    pub fn picture(&self, outcome: &str) {
        self.pictures.with_label_values(&[outcome]).inc();
    }

    /// An attempt to deliver a webhook failed, or it came to an end.
    pub fn webhook(&self, outcome: &str) {
        self.webhooks.with_label_values(&[outcome]).inc();
    }

    /// A worker did not end its job.
    pub fn worker_overdue(&self) {
        self.overdue.inc();
    }

    /// All of it as text.
    pub fn text(&self, gauges: &Gauges) -> Result<String, prometheus::Error> {
        for &(class, jobs, wait_ms) in &gauges.queues {
            self.queued.with_label_values(&[class]).set(to_i64(jobs as u64));
            self.expected_wait.with_label_values(&[class]).set(to_i64(wait_ms));
        }
        for &(state, count) in &gauges.workers {
            self.workers.with_label_values(&[state]).set(to_i64(count));
        }
        self.webhooks_waiting.set(to_i64(gauges.webhooks as u64));
        self.quarantined.set(to_i64(gauges.quarantined as u64));
        for &(account, bytes, limit) in &gauges.memory {
            self.memory.with_label_values(&[account]).set(to_i64(bytes));
            self.memory_limits.with_label_values(&[account]).set(to_i64(limit));
        }
        self.memory_budget.set(to_i64(gauges.memory_budget));
        for &(account, count) in &gauges.entries {
            self.entries.with_label_values(&[account]).set(to_i64(count as u64));
        }
        self.gpu_losses.inc_by(gauges.gpu_losses.saturating_sub(self.gpu_losses.get()));
        self.resident.set(to_i64(gauges.resident_bytes));
        for &(kind, count) in &gauges.shared_queue {
            self.shared.with_label_values(&[kind]).set(to_i64(count));
        }
        self.shared_oldest.set(to_i64(gauges.shared_oldest_s));
        self.servers.set(i64::from(gauges.servers));
        let mut text = Vec::new();
        TextEncoder::new().encode(&self.registry.gather(), &mut text)?;
        String::from_utf8(text).map_err(|error| prometheus::Error::Msg(error.to_string()))
    }
}

fn registered<C: Collector + Clone + 'static>(registry: &Registry, collector: C) -> Result<C, prometheus::Error> {
    registry.register(Box::new(collector.clone()))?;
    Ok(collector)
}

fn to_i64(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}
