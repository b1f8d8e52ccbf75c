//! Answers about the process itself. None of them waits for a worker, nor for a lock that is held
//! while drawing.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;

use super::{responses, schema};
use crate::service::http::dto::{CapabilitiesDto, StatusDto, VersionDto};
use crate::service::http::error::ApiError;
use crate::service::http::state::AppState;

/// 200 while the process is alive.
pub async fn healthz() -> Response {
    responses::uncached(StatusDto { status: "ok" })
}

/// 200 while the process takes work.
pub async fn readyz(State(state): State<Arc<AppState>>) -> Result<Response, ApiError> {
    if state.is_draining() {
        return Err(ApiError::draining("the server is shutting down"));
    }
    Ok(responses::uncached(StatusDto { status: "ready" }))
}

/// Name and version of the program.
pub async fn version() -> Response {
    responses::uncached(VersionDto::new())
}

/// Formats, styles, keys, limits and load, beside the given paths.
pub fn capabilities(state: &AppState, paths: Vec<String>) -> Response {
    responses::uncached(CapabilitiesDto::new(state, schema::PATH, paths))
}
