//! The accept loop. It is built on hyper, because `axum::serve` installs no timer, and without one
//! a slow client can hold a connection for ever.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use axum::extract::connect_info::ConnectInfo;
use axum::http::{HeaderName, header};
use axum::middleware::{AddExtension, Next, from_fn};
use axum::response::{IntoResponse as _, Response};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto;
use hyper_util::service::TowerToHyperService;
use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tower_service::Service as _;

use super::activity::{Activity, Client};
use super::io::ClientStream;
use super::places::{NoPlace, Places};
use crate::http::dto::ProblemDto;
use crate::http::error::{ApiError, ErrorKind};

/// Time that clients have to read their answers once the last job has ended.
const CLOSING_TIME: Duration = Duration::from_secs(5);

/// Time beyond that of a header for which a connection may be idle.
const IDLE_GRACE: Duration = Duration::from_secs(1);

/// Time for an answer about health.
const HEALTH_TIME: Duration = Duration::from_secs(5);

/// The paths that are answered although all places are taken.
const HEALTH_PATHS: [&str; 3] = ["/healthz", "/readyz", "/version"];

/// The routes, with the address of a connection's client.
type Routes = AddExtension<Router, ConnectInfo<Client>>;

/// The first bytes of every HTTP/2 connection.
const HTTP2_PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// The limits of connections.
#[derive(Clone, Copy, Debug)]
pub struct ConnectionLimits {
    /// Most at a time.
    pub all: usize,
    /// Most of one address at a time; 0: three quarters of all.
    pub per_client: usize,
    /// Longest time for a header, and for which a connection is idle.
    pub header_time: Duration,
    /// Time after which a connection is asked to end; what it has begun is answered.
    pub age: Duration,
    /// Bytes a second that a client must read while an answer waits for it; 0: none.
    pub least_rate: u64,
}

/// Accepts connections until `stop` is ready, then lets the open ones finish their answers.
pub async fn run(listener: TcpListener, router: Router, limits: ConnectionLimits, stop: impl Future<Output = ()>) {
    let server = Arc::new(server(limits.header_time));
    let health = Arc::new(health_server());
    let health_routes = |why| {
        let alone = from_fn(move |request: Request, next: Next| health_alone(why, request, next));
        TowerToHyperService::new(router.clone().layer(alone))
    };
    let (full_routes, client_routes) = (health_routes(NoPlace::Full), health_routes(NoPlace::Client));
    let mut routes = router.into_make_service_with_connect_info::<Client>();
    let places = Places::new(limits.all, limits.per_client);
    // Connections hold a receiver each; when the last one is dropped, all have ended.
    let (stopping, stopped) = watch::channel(());
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
        let place = match places.take(address.ip()) {
            Ok(place) => place,
            Err(why) => {
                match places.take_reserved() {
                    Some(place) => {
                        let routes = if why == NoPlace::Full { &full_routes } else { &client_routes };
                        let (server, routes) = (health.clone(), routes.clone());
                        tokio::spawn(async move {
                            answer_health(&server, stream, routes).await;
                            drop(place);
                        });
                    }
                    None => drop(tokio::spawn(refuse(stream, why))),
                }
                continue;
            }
        };
        let activity = Activity::new();
        let Ok(service) = routes.call(Client { address, activity: activity.clone() }).await;
        let (server, service, stopped) = (server.clone(), TowerToHyperService::new(service), stopped.clone());
        tokio::spawn(async move {
            serve_connection(&server, (stream, activity), service, stopped, limits).await;
            drop(place);
        });
    }
    drop((listener, stopped));
    let _ = stopping.send(());
    if tokio::time::timeout(CLOSING_TIME, stopping.closed()).await.is_err() {
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
        // Streams that a client opens and resets cost as well.
        .max_pending_accept_reset_streams(20)
        .max_local_error_reset_streams(100)
        .max_send_buf_size(256 * 1024)
        .max_header_list_size(32 * 1024)
        .keep_alive_interval(Duration::from_secs(20))
        .keep_alive_timeout(Duration::from_secs(20));
    server
}

/// For places that are kept for health: one short question each.
fn health_server() -> auto::Builder<TokioExecutor> {
    let mut server = auto::Builder::new(TokioExecutor::new()).http1_only();
    server.http1().timer(TokioTimer::new()).header_read_timeout(HEALTH_TIME).keep_alive(false).max_buf_size(16 * 1024);
    server
}

async fn serve_connection(
    server: &auto::Builder<TokioExecutor>,
    (stream, activity): (TcpStream, Arc<Activity>),
    service: TowerToHyperService<Routes>,
    mut stopped: watch::Receiver<()>,
    limits: ConnectionLimits,
) {
    if !sends_preface_in_time(&stream, limits.header_time).await {
        return;
    }
    let io = TokioIo::new(ClientStream::new(stream, activity.clone(), limits.least_rate));
    let mut connection = std::pin::pin!(server.serve_connection(io, service));
    let (mut age, mut idle) = (
        std::pin::pin!(tokio::time::sleep(limits.age)),
        // HTTP/1 has its own timer, which ends first.
        std::pin::pin!(activity.idle(limits.header_time + IDLE_GRACE)),
    );
    let mut is_ending = false;
    loop {
        tokio::select! {
            served = &mut connection => {
                // These errors are the client's: it hung up, was too slow or sent no HTTP.
                if let Err(error) = served {
                    tracing::debug!(error = %error, "a connection ended early");
                }
                return;
            }
            () = &mut idle => return tracing::debug!("a connection was idle for too long"),
            () = &mut age, if !is_ending => {}
            _ = stopped.changed(), if !is_ending => {}
        }
        is_ending = true;
        connection.as_mut().graceful_shutdown();
    }
}

/// Answers one question about health, in a short time.
async fn answer_health(server: &auto::Builder<TokioExecutor>, stream: TcpStream, routes: TowerToHyperService<Router>) {
    let io = TokioIo::new(ClientStream::new(stream, Activity::new(), 0));
    let _ = tokio::time::timeout(HEALTH_TIME, server.serve_connection(io, routes)).await;
}

/// Passes on questions about health alone, where all places for others are taken.
async fn health_alone(why: NoPlace, request: Request, next: Next) -> Response {
    if HEALTH_PATHS.contains(&request.uri().path()) {
        return next.run(request).await;
    }
    let (error, request_id) = (no_place(why), uuid::Uuid::now_v7().to_string());
    let body = serde_json::to_string(&ProblemDto::new(&error, &request_id)).unwrap_or_default();
    let headers = [
        (header::CONTENT_TYPE, "application/problem+json"),
        (header::CONNECTION, "close"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("x-request-id"), request_id.as_str()),
        (header::RETRY_AFTER, "1"),
    ];
    (error.status(), headers, body).into_response()
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

/// The answer to a connection for which there is no place.
fn no_place(why: NoPlace) -> ApiError {
    let (detail, flag) = match why {
        NoPlace::Full => ("as many connections are open as may be; try again shortly", "--connections"),
        NoPlace::Client => {
            ("as many connections are open from this address as may be; use them again", "--connections-per-address")
        }
    };
    ApiError::new(ErrorKind::Unavailable, "connections_full", detail).flag(flag)
}

/// Answers one connection too many with 503, without reading its request, and closes it.
async fn refuse(stream: TcpStream, why: NoPlace) {
    let error = no_place(why);
    let request_id = uuid::Uuid::now_v7().to_string();
    let body = serde_json::to_string(&ProblemDto::new(&error, &request_id)).unwrap_or_default();
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Content-Type: application/problem+json\r\nX-Request-Id: {request_id}\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    let mut stream = ClientStream::new(stream, Activity::new(), 0);
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
