//! Answers about the process itself. None of them waits for a lock that is held while drawing, nor for a worker.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::capabilities::{BackendDto, CapabilitiesDto};
use crate::service::http::app::App;
use crate::service::http::dto::{StatusDto, VersionDto};
use crate::service::http::error::ApiError;

/// The process is alive.
pub async fn healthz() -> Response {
    fresh(Json(StatusDto { status: "ok" }))
}

/// The process takes work.
pub async fn readyz(State(app): State<Arc<App>>) -> Result<Response, ApiError> {
    if app.is_draining() {
        let detail = "the server is shutting down";
        return Err(ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "draining", detail).retry_after(5));
    }
    Ok(fresh(Json(StatusDto { status: "ready" })))
}

/// Name and version.
pub async fn version() -> Response {
    fresh(Json(VersionDto::new()))
}

/// Formats, styles, keys, paths, limits and load.
pub async fn capabilities(State(app): State<Arc<App>>) -> Response {
    let rules = &app.rules;
    let backend = BackendDto::new(rules.backend, app.gpu.status());
    fresh(Json(CapabilitiesDto::new(&rules.limits, backend, app.workers, app.jobs.load(), &app.meshes)))
}

fn fresh(body: impl IntoResponse) -> Response {
    let mut response = body.into_response();
    response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}
