//! The step around the router that gives each request an id and a span in log and traces, and logs
//! how it ended. It also writes the body of an error, a problem document (RFC 9457), because the id
//! of the request is part of it. With HTTP/1, it reads what the handler has left of the request's
//! body, or announces that the connection closes (`drainable_body.rs`).

use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::extract::connect_info::ConnectInfo;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Version, header};
use axum::middleware::Next;
use axum::response::Response;
use tracing::Instrument as _;

use super::drainable_body::DrainableBody;
use crate::http::connection::activity::Client;
use crate::http::dto::ProblemDto;
use crate::http::error::{ApiError, IsAnswer};
use crate::http::state::AppState;
use crate::telemetry::traces::{self, Trace};

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Longest path in a log line. A request's path can be as long as a header may be.
const LOGGED_PATH_CHARS_MAX: usize = 256;

/// Gives the request an id and a span, logs how it ended, and turns errors into
/// `application/problem+json`.
pub async fn observe(State(state): State<Arc<AppState>>, request: Request, next: Next) -> Response {
    let began = Instant::now();
    let client = request.extensions().get::<ConnectInfo<Client>>();
    let _busy = client.map(|ConnectInfo(client)| client.activity.begin());
    let id = request_id(request.headers());
    let path: String = request.uri().path().chars().take(LOGGED_PATH_CHARS_MAX).collect();
    let empty = tracing::field::Empty;
    let span = tracing::info_span!("request", request_id = %id, method = %request.method(), path, otel.kind = empty);
    let (headers, version) = (request.headers().clone(), request.version());
    Trace::of_headers(|name| headers.get(name)?.to_str().ok()).adopt(&span);
    let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    traces::describe_request(&span, request.method().as_str(), route);
    let place = place(request.method(), route);
    let (mut parts, body) = request.into_parts();
    parts.extensions.insert(RequestId(id.as_str().into()));
    let (drainable, body) = DrainableBody::new(body);
    let mut response = next.run(Request::from_parts(parts, body)).instrument(span.clone()).await;
    add_id_and_problem(&mut response, &id);
    // HTTP/2 ends a stream without ending the connection.
    if version < Version::HTTP_2 && !drainable.drain(&headers).await {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }

    let (status, duration_ms) = (response.status().as_u16(), began.elapsed().as_secs_f64() * 1e3);
    let code = response.extensions().get::<ApiError>().map(|e| (e.code, e.detail.clone()));
    traces::describe_answer(&span, status);
    state.metrics.answered(&place, status, code.as_ref().map(|(code, _)| *code));
    span.in_scope(|| match code {
        Some((code, detail)) if status >= 500 => tracing::warn!(status, duration_ms, code, detail, "answered"),
        Some((code, detail)) => tracing::info!(status, duration_ms, code, detail, "answered"),
        None => tracing::info!(status, duration_ms, "answered"),
    });
    response
}

/// The method and the route of a request, without anything that the client has made up.
fn place(method: &Method, route: Option<&str>) -> String {
    let known = [Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS];
    let method = known.iter().find(|known| *known == method).map_or("other", Method::as_str);
    format!("{method} {}", route.unwrap_or("elsewhere"))
}

/// The id of a request.
#[derive(Clone)]
struct RequestId(Arc<str>);

/// The id that [`observe`] gave a request.
pub fn id_of(request: &Request) -> Arc<str> {
    request.extensions().get::<RequestId>().map_or_else(|| "".into(), |RequestId(id)| id.clone())
}

/// The client's own id, if it is safe in a log line and a header. A new one otherwise.
fn request_id(headers: &HeaderMap) -> String {
    let is_safe = |id: &&str| {
        (1..=128).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
    };
    let given = headers.get(REQUEST_ID).and_then(|v| v.to_str().ok()).filter(is_safe);
    given.map_or_else(|| uuid::Uuid::now_v7().to_string(), str::to_owned)
}

/// Adds the request's id, and to an error its problem document.
fn add_id_and_problem(response: &mut Response, id: &str) {
    let status = response.status();
    let is_answer = response.extensions().get::<IsAnswer>().is_some();
    if !is_answer && (status.is_client_error() || status.is_server_error()) {
        let error = response.extensions_mut().get_or_insert_with(|| ApiError::of_framework(status)).clone();
        let body = serde_json::to_vec(&ProblemDto::new(&error, id)).unwrap_or_default();
        let headers = response.headers_mut();
        headers.remove(header::CONTENT_LENGTH);
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        *response.body_mut() = Body::from(body);
    }
    add_browsers_rules(response.headers_mut());
    if let Ok(value) = HeaderValue::from_str(id) {
        response.headers_mut().insert(REQUEST_ID, value);
    }
}

/// Types are what they are said to be. Pictures may stand in pages of every origin, also in those that are isolated; all
/// else in pages of this one, unless CORS allows more.
fn add_browsers_rules(headers: &mut HeaderMap) {
    let is_picture = headers.get(header::CONTENT_TYPE).is_some_and(|kind| kind.as_bytes().starts_with(b"image/"));
    let policy = if is_picture { "cross-origin" } else { "same-origin" };
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(HeaderName::from_static("cross-origin-resource-policy"), HeaderValue::from_static(policy));
}
