//! The accept loop. It is built on hyper, because `axum::serve` installs no timer, and without one
//! a slow client can hold a connection for ever.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::connect_info::ConnectInfo;
use axum::middleware::AddExtension;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto;
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use hyper_util::service::TowerToHyperService;
use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tower_service::Service as _;

use super::activity::{Activity, Client};
use super::io::ClientStream;
use crate::service::http::dto::ProblemDto;
use crate::service::http::error::{ApiError, Fault};

/// Time that clients have to read their answers once the last job has ended.
const CLOSING_TIME: Duration = Duration::from_secs(5);

/// Time beyond that of a header for which a connection may be idle.
const IDLE_GRACE: Duration = Duration::from_secs(1);

/// The routes, with the address of a connection's client.
type Routes = AddExtension<Router, ConnectInfo<Client>>;

/// The first bytes of every HTTP/2 connection.
const HTTP2_PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Accepts connections until `stop` is ready, then lets the open ones finish their answers.
pub async fn run(
    listener: TcpListener,
    router: Router,
    connections_max: usize,
    header_timeout: Duration,
    stop: impl Future<Output = ()>,
) {
    let server = Arc::new(server(header_timeout));
    let mut routes = router.into_make_service_with_connect_info::<Client>();
    let graceful = GracefulShutdown::new();
    let places = Arc::new(Semaphore::new(connections_max));
    let mut stop = std::pin::pin!(stop);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = &mut stop => break,
        };
        let (stream, address) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                pause_after(&error).await;
                continue;
            }
        };
        // Without this, a small body waits for the client's acknowledgement of the header.
        let _ = stream.set_nodelay(true);
        let Ok(place) = places.clone().try_acquire_owned() else {
            tokio::spawn(refuse(stream));
            continue;
        };
        let activity = Activity::new();
        let Ok(service) = routes.call(Client { address, activity: activity.clone() }).await;
        let (server, service, watcher) = (server.clone(), TowerToHyperService::new(service), graceful.watcher());
        tokio::spawn(async move {
            serve_connection(&server, (stream, activity), service, watcher, header_timeout).await;
            drop(place);
        });
    }
    drop(listener);
    let closing = tokio::time::timeout(CLOSING_TIME, graceful.shutdown());
    if closing.await.is_err() {
        tracing::warn!("some clients did not read their answers in time");
    }
}

fn server(header_timeout: Duration) -> auto::Builder<TokioExecutor> {
    let mut server = auto::Builder::new(TokioExecutor::new());
    server.http1().timer(TokioTimer::new()).header_read_timeout(header_timeout).max_buf_size(64 * 1024);
    server
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(64)
        .max_header_list_size(32 * 1024)
        .keep_alive_interval(Duration::from_secs(20))
        .keep_alive_timeout(Duration::from_secs(20));
    server
}

async fn serve_connection(
    server: &auto::Builder<TokioExecutor>,
    (stream, activity): (TcpStream, Arc<Activity>),
    service: TowerToHyperService<Routes>,
    watcher: Watcher,
    header_timeout: Duration,
) {
    if !sends_preface_in_time(&stream, header_timeout).await {
        return;
    }
    let io = TokioIo::new(ClientStream::new(stream, activity.clone()));
    tokio::select! {
        served = watcher.watch(server.serve_connection(io, service)) => {
            // These errors are the client's: it hung up, was too slow or sent no HTTP.
            if let Err(error) = served {
                tracing::debug!(error = %error, "a connection ended early");
            }
        }
        // HTTP/1 has its own timer, which ends first.
        () = activity.idle(header_timeout + IDLE_GRACE) => tracing::debug!("a connection was idle for too long"),
    }
}

/// Waits until the client has sent enough to tell HTTP/1 from HTTP/2. False if that takes longer
/// than `limit`: hyper-util, which tells them apart, has no timer for it.
async fn sends_preface_in_time(stream: &TcpStream, limit: Duration) -> bool {
    let first_bytes = async {
        let mut seen = [0; HTTP2_PREFACE.len()];
        loop {
            let length = stream.peek(&mut seen).await.unwrap_or(0);
            if length == 0 || length == seen.len() || !HTTP2_PREFACE.starts_with(&seen[..length]) {
                return length > 0;
            }
            // While earlier bytes are unread, the socket does not announce new ones: poll for them.
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(limit, first_bytes).await.unwrap_or(false)
}

/// Answers one connection too many with 503, without reading its request, and closes it.
async fn refuse(stream: TcpStream) {
    let detail = "as many connections are open as may be; try again shortly";
    let error = ApiError::new(Fault::Unavailable, "connections_full", detail).flag("--connections");
    let request_id = uuid::Uuid::now_v7().to_string();
    let body = serde_json::to_string(&ProblemDto::new(&error, &request_id)).unwrap_or_default();
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Content-Type: application/problem+json\r\nX-Request-Id: {request_id}\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    let mut stream = ClientStream::new(stream, Activity::new());
    let answering = async {
        let _ = stream.write_all(answer.as_bytes()).await;
        let _ = stream.shutdown().await;
    };
    let _ = tokio::time::timeout(Duration::from_secs(1), answering).await;
}

/// Waits after a failed accept. Its cause, such as a lack of file descriptors, lasts for a while,
/// and trying again at once would only use up processor time.
async fn pause_after(error: &io::Error) {
    tracing::warn!(error = %error, "a connection could not be accepted");
    tokio::time::sleep(Duration::from_millis(50)).await;
}
