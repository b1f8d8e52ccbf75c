//! The daemon: HTTP in front of [`crate::jobs`] and [`crate::store`].
//!
//! A request passes these modules in this order:
//!
//! 1. [`connection`] accepts the socket and limits how long a client may be silent.
//! 2. [`router`] finds the handler of a path. [`middleware`] wraps it: request id, log, API key.
//! 3. [`resources`] holds the handlers, one file per resource. They share [`state`].
//! 4. [`receive`] reads the query and the body within their limits.
//! 5. [`dto`] defines the JSON of answers, and [`error`] maps errors to statuses.
//!
//! [`recovery`] takes over what an earlier process has left in the data folder. [`negotiate`] and [`conditional`]
//! read and write single headers. [`stored_mesh`] finds stored meshes for the handlers, [`shared_jobs`] has the jobs that several daemons share, and [`address`] makes the
//! URLs and tags of their pictures. [`event_streams`] counts the event streams of each client, [`hear_of_ends`] tells
//! webhooks of the ends of jobs. [`static_document`] answers with a document that does not change; [`descriptions`]
//! makes two of them. `signals` waits for the signals that end the server or make it read its keys again.
//!
//! Architecture invariant: axum and hyper are used nowhere else.

mod address;
mod conditional;
mod connection;
mod descriptions;
mod dto;
mod error;
mod event_streams;
mod hear_of_ends;
mod middleware;
mod negotiate;
mod receive;
mod recovery;
mod resources;
mod router;
mod shared_jobs;
mod signals;
mod state;
mod static_document;
mod stored_mesh;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use futures_util::FutureExt as _;
use tokio::net::TcpListener;

use crate::config::{Config, cores};
use crate::durable::{OpenError, Recovered};
use crate::keys::{Keys, KeysError};
use crate::shared_queue::{self, QueueSettings, SharedQueue};
use crate::shared_store::{self, SharedStore};
use crate::warm_up::WarmUp;
use connection::accept::ConnectionLimits;
use signals::{EndSignals, HangUps};
use state::AppState;
use stored_mesh::service::Shared;

/// Time beyond a job's deadline after which the process ends without the jobs that still run.
const DRAIN_GRACE: Duration = Duration::from_secs(5);

/// Time that idle workers have to drop their renderers.
const WORKERS_GRACE: Duration = Duration::from_secs(2);

/// Time that threads of the runtime have to end.
const RUNTIME_GRACE: Duration = Duration::from_secs(1);

/// Reasons why the daemon did not start.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address is open to other machines, and neither API keys nor `--no-auth` are given.
    #[error(
        "{0} can be reached from other machines, and no API keys are configured: set MESHSNAP_API_KEYS, or say --no-auth"
    )]
    Unprotected(SocketAddr),
    /// The address cannot be resolved or bound.
    #[error("cannot listen on `{listen}`: {error}")]
    Listen {
        /// The address as configured.
        listen: String,
        /// The cause.
        error: std::io::Error,
    },
    /// The file of API keys cannot be used.
    #[error(transparent)]
    Keys(#[from] KeysError),
    /// The secret of webhooks is none.
    #[error(
        "MESHSNAP_WEBHOOK_SECRET must be whsec_ and 24 to 64 bytes in base64: echo whsec_$(openssl rand -base64 32)"
    )]
    WebhookSecret,
    /// The certificates for webhooks cannot be used.
    #[error("--webhooks-ca {0}")]
    WebhooksCa(String),
    /// The data folder cannot be used.
    #[error(transparent)]
    Data(#[from] OpenError),
    /// The shared store cannot be used.
    #[error(transparent)]
    Shared(#[from] shared_store::OpenError),
    /// The shared queue cannot be used.
    #[error(transparent)]
    SharedQueue(#[from] shared_queue::OpenError),
    /// Threads or signal handlers could not be set up.
    #[error("the server could not start: {0}")]
    Start(#[from] std::io::Error),
}

/// Serves until SIGTERM or SIGINT, then finishes the accepted jobs. `ready` is called with the
/// address once clients can connect.
pub fn serve(config: &Config, ready: impl FnOnce(SocketAddr)) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        // Handlers only pass bytes on: a few threads are enough, and the workers need the cores.
        .worker_threads(cores().clamp(1, 4) as usize)
        .thread_name("http")
        .enable_all()
        .build()?;
    let served = runtime.block_on(run(config, ready));
    // A request to a store that does not answer may still wait for it.
    runtime.shutdown_timeout(RUNTIME_GRACE);
    served
}

/// Serves, on a runtime. The futures of the clients of the shared store and queue are boxed: they are large, and a server
/// that is alone needs no stack for them.
async fn run(config: &Config, ready: impl FnOnce(SocketAddr)) -> Result<(), ServeError> {
    let keys = Keys::open(&config.api_keys, config.api_keys_file.as_deref())?;
    let listen_error = |error| ServeError::Listen { listen: config.listen.clone(), error };
    let addresses: Vec<SocketAddr> = tokio::net::lookup_host(&config.listen).await.map_err(listen_error)?.collect();
    if let Some(open) = addresses.iter().find(|a| !a.ip().is_loopback())
        && keys.current().is_empty()
        && !config.no_auth
    {
        return Err(ServeError::Unprotected(*open));
    }
    let listener = TcpListener::bind(&*addresses).await.map_err(listen_error)?;
    let address = listener.local_addr()?;
    let mut signals = EndSignals::new()?;
    let hang_ups = HangUps::new()?;

    let (shared, queue) = tokio::select! {
        shared = open_shared(config) => shared?,
        () = signals.next() => return Ok(()),
    };
    let (state, recovered) = AppState::start(config, keys, shared, queue, address.ip().is_loopback())?;
    tokio::spawn(reload_keys(hang_ups, state.clone()));
    let is_told_to_end = !take_over(&state, recovered, &mut signals).await?;
    if is_told_to_end {
        return Ok(());
    }
    let router = router::router(&state);
    tracing::info!(%address, workers = config.workers, "ready");
    ready(address);
    let warm_up = WarmUp::start(&state.gpu, config.backend);

    let stop = async {
        signals.next().await;
        let drained = async {
            leave(&state, Duration::from_millis(config.drain_delay_ms)).await;
            drain(&state, Duration::from_millis(config.job_ms) + DRAIN_GRACE).await;
        };
        tokio::select! {
            () = drained => {}
            () = signals.next() => tracing::warn!("told twice to end: jobs are abandoned"),
        }
        state.event_streams.close();
    };
    let limits = ConnectionLimits {
        all: config.connections as usize,
        per_client: config.connections_per_address as usize,
        header_time: Duration::from_millis(config.header_timeout_ms),
        age: Duration::from_millis(config.connection_age_ms),
        least_rate: config.least_rate_bytes,
    };
    connection::accept::run(listener, router, limits, stop).await;
    warm_up.stop();
    warm_up.wait(WORKERS_GRACE);
    state.jobs.join(WORKERS_GRACE);
    if let Some(webhooks) = &state.webhooks {
        webhooks.close();
    }
    if let Some(durable) = &state.durable {
        durable.close();
    }
    tracing::info!("ended");
    Ok(())
}

/// The shared store and the shared queue that are configured, once they answer. None: there is to be none.
async fn open_shared(config: &Config) -> Result<(Option<Shared>, Option<SharedQueue>), ServeError> {
    let queue = config.shared_queue.as_deref().map(shared_queue::Address::read).transpose();
    let queue = queue.map_err(shared_queue::OpenError::from)?;
    let Some(address) = &config.store else {
        return match queue {
            None => Ok((None, None)),
            Some(_) => Err(shared_queue::OpenError::from(shared_queue::AddressError::NoStore).into()),
        };
    };
    connect(config, address, queue).boxed_local().await
}

/// The shared store, and the shared queue if there is to be one, once they answer.
async fn connect(
    config: &Config,
    address: &str,
    queue: Option<shared_queue::Address>,
) -> Result<(Option<Shared>, Option<SharedQueue>), ServeError> {
    let store = SharedStore::new(address).map_err(shared_store::OpenError::from)?;
    store.reach().await?;
    tracing::info!(address, "the shared store answers");
    let Some(address) = queue else { return Ok((Some(Shared::new(store)), None)) };
    store.check_conditions().await?;
    let words = address.words();
    let store_name = store.join(&address.name).await?;
    let queue = SharedQueue::open(QueueSettings {
        address,
        credentials: config.queue_credentials.clone(),
        ca: config.queue_ca.clone(),
        store: store_name,
        jobs_max: config.queue_jobs,
        note_time: Duration::from_millis(config.unfetched_ttl_ms),
    })
    .await?;
    tracing::info!(address = words, "the shared queue answers");
    Ok((Some(Shared::new(store)), Some(queue)))
}

/// Takes over what an earlier process has left. False if the server is told to end meanwhile.
async fn take_over(
    state: &Arc<AppState>,
    mut recovered: Recovered,
    signals: &mut EndSignals,
) -> Result<bool, ServeError> {
    if let Some(shared) = &state.shared {
        let handed_over = tokio::select! {
            handed_over = recovery::hand_over(state, shared, &mut recovered).boxed_local() => handed_over.map(|()| true),
            () = signals.next() => Ok(false),
        };
        if !matches!(handed_over, Ok(true)) {
            // Before `recovered` is dropped: what nothing names any more would be deleted.
            if let Some(durable) = &state.durable {
                durable.close();
            }
            return Ok(handed_over?);
        }
        let store = shared.store.clone();
        tokio::spawn(async move { store.watch().await });
    }
    recovery::recover(state, recovered);
    if let Some(jobs) = &state.shared_jobs {
        shared_jobs::start(jobs, state).boxed_local().await;
    }
    Ok(true)
}

/// Reads the file of API keys again with each SIGHUP. An error leaves the keys as they are.
async fn reload_keys(mut hang_ups: HangUps, state: Arc<AppState>) {
    while hang_ups.next().await {
        let reloading = state.clone();
        // A slow disk must hold nobody up.
        match tokio::task::spawn_blocking(move || reloading.keys.reload()).await {
            Ok(Ok(Some(named))) => tracing::info!(named, "SIGHUP: the API keys are read again"),
            Ok(Ok(None)) => tracing::info!("SIGHUP changes nothing: there is no --api-keys-file"),
            Ok(Err(error)) => tracing::error!(%error, "SIGHUP: the API keys stay as they are"),
            Err(_) => tracing::error!("SIGHUP: the API keys were not read"),
        }
    }
}

/// Says at `/readyz` that the server ends, and takes work for a while all the same: those who distribute requests look there
/// now and then, and send some until they have looked.
async fn leave(state: &Arc<AppState>, delay: Duration) {
    if !delay.is_zero() {
        tracing::info!(seconds = delay.as_secs_f64(), "leaving: not ready any more, and work is taken for a while");
        state.leave();
        tokio::time::sleep(delay).await;
    }
}

/// Refuses new work and waits until the accepted jobs have ended, no longer than `time_max`.
/// Meanwhile clients can still connect, to read job states and fetch results.
async fn drain(state: &Arc<AppState>, time_max: Duration) {
    let load = state.jobs.load();
    tracing::info!(queued = load.queued, running = load.running, "draining");
    state.drain();
    // Without a data folder, what waits is lost if it is not finished.
    let waits = if state.durable.is_some() { Duration::ZERO } else { load.batch_wait.max(load.wait) * 2 };
    let idle = async {
        state.jobs.idle().await;
        if let Some(jobs) = &state.shared_jobs {
            jobs.idle().await;
        }
    };
    if tokio::time::timeout(time_max + waits, idle).await.is_err() {
        tracing::warn!("some jobs did not end in time; those in a data folder are done at the next start");
    }
}
