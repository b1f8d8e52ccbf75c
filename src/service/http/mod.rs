//! The daemon: HTTP in front of [`crate::service::jobs`].
//!
//! Reading order: [`app`] (what handlers share, and every path), [`render`], [`meshes`], [`pictures`], [`jobs`] and [`schema`] (the
//! resources), [`receive`] (a request to work, in the order of refusals), [`query`], [`body`], [`upload`] (a body to what is
//! stored), [`negotiate`], [`conditional`], [`error`] (the only status map), [`observe`] and
//! [`lent`] (around every request), [`accept`] and [`io`] (connections).
//!
//! Architecture invariant: axum and hyper are used nowhere else.

mod app;
mod auth;
mod conditional;
pub(crate) mod connection;
mod dto;
mod error;
mod negotiate;
mod observe;
mod receive;
pub(crate) mod resources;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use crate::config::{Config, cores};
use app::App;

/// What jobs may take beyond their deadline before the process ends without them.
const DRAIN_GRACE: Duration = Duration::from_secs(5);

/// How long workers without work may take to put their renderers down.
const WORKERS_GRACE: Duration = Duration::from_secs(2);

/// Why the daemon did not start.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Everybody could use it, and nobody said that they may.
    #[error(
        "{0} can be reached from other machines, and no API keys are configured: set MESHSNAP_API_KEYS, or say --no-auth"
    )]
    Unprotected(SocketAddr),
    /// The address is no address.
    #[error("cannot listen on `{listen}`: {error}")]
    Listen {
        /// As configured.
        listen: String,
        /// Why.
        error: std::io::Error,
    },
    /// Threads or signals.
    #[error("the server could not start: {0}")]
    Start(#[from] std::io::Error),
}

/// Serves until SIGTERM or SIGINT, then finishes what was accepted. `ready` hears the address once clients can connect.
pub fn serve(config: &Config, ready: impl FnOnce(SocketAddr)) -> Result<(), ServeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        // Handlers only pass bytes on; what computes is the workers.
        .worker_threads(cores().clamp(1, 4) as usize)
        .thread_name("http")
        .enable_all()
        .build()?;
    runtime.block_on(run(config, ready))
}

async fn run(config: &Config, ready: impl FnOnce(SocketAddr)) -> Result<(), ServeError> {
    let listen_error = |error| ServeError::Listen { listen: config.listen.clone(), error };
    let addresses: Vec<SocketAddr> = tokio::net::lookup_host(&config.listen).await.map_err(listen_error)?.collect();
    if let Some(open) = addresses.iter().find(|a| !a.ip().is_loopback())
        && config.api_keys.is_empty()
        && !config.no_auth
    {
        return Err(ServeError::Unprotected(*open));
    }
    let listener = TcpListener::bind(&*addresses).await.map_err(listen_error)?;
    let address = listener.local_addr()?;
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);

    let app = App::start(config)?;
    let router = app::router(&app);
    tracing::info!(%address, workers = config.workers, "ready");
    ready(address);

    let stop = async {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
        tokio::select! {
            () = drain(&app, Duration::from_millis(config.limits.job_ms) + DRAIN_GRACE) => {}
            _ = terminate.recv() => tracing::warn!("told twice to end: jobs are abandoned"),
            _ = interrupt.recv() => tracing::warn!("told twice to end: jobs are abandoned"),
        }
    };
    let header_timeout = Duration::from_millis(config.header_timeout_ms);
    connection::accept::run(listener, router, config.connections as usize, header_timeout, stop).await;
    app.jobs.join(WORKERS_GRACE);
    tracing::info!("ended");
    Ok(())
}

/// While this runs, clients can still connect: to hear 503, to see how their jobs are, to fetch results.
async fn drain(app: &Arc<App>, patience: Duration) {
    let load = app.jobs.load();
    tracing::info!(queued = load.queued, running = load.running, "draining");
    app.drain();
    if tokio::time::timeout(patience, app.jobs.idle()).await.is_err() {
        tracing::error!("some jobs did not end in time");
    }
}
