//! Answers about the process itself: `/healthz`, `/readyz`, `/version` and `/v1/capabilities`. None of them waits for a
//! worker, nor for a lock that is held while drawing.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;

use super::{responses, schema};
use crate::durable::Durable;
use crate::http::dto::{CapabilitiesDto, DifficultyDto, StatusDto, VersionDto};
use crate::http::error::{ApiError, ErrorKind};
use crate::http::state::AppState;
use crate::http::stored_mesh::shared;

/// 200 while the process is alive.
pub async fn healthz() -> Response {
    responses::uncached(StatusDto { status: "ok", problems: Vec::new() })
}

/// 200 while the process takes work. It tells of what it cannot do.
pub async fn readyz(State(state): State<Arc<AppState>>) -> Result<Response, ApiError> {
    if state.is_leaving() {
        return Err(ApiError::draining("the server is shutting down"));
    }
    if state.shared.as_ref().is_some_and(|shared| shared.store.is_in_trouble()) {
        return Err(shared::unavailable());
    }
    if let Some(jobs) = &state.shared_jobs {
        jobs.check()?;
    }
    let load = state.jobs.load();
    let detail = format!("{} workers do not end jobs whose time is up", load.overdue);
    if load.missing as u64 >= state.workers {
        let detail = format!("{detail}, and none is left; start the server anew");
        return Err(ApiError::new(ErrorKind::Unavailable, "workers_overdue", detail));
    }
    let overdue = (load.overdue > 0).then_some(DifficultyDto { code: "workers_overdue", detail });
    let trouble = state.durable.as_ref().and_then(Durable::trouble).map(ApiError::from);
    let storage = trouble.map(|error| DifficultyDto { code: error.code, detail: error.detail });
    let problems = overdue.into_iter().chain(storage).collect();
    Ok(responses::uncached(StatusDto { status: "ready", problems }))
}

/// Name and version of the program.
pub async fn version() -> Response {
    responses::uncached(VersionDto::new())
}

/// Formats, styles, keys, limits and load, beside the given paths.
pub fn capabilities(state: &AppState, paths: Vec<String>) -> Response {
    responses::uncached(CapabilitiesDto::new(state, schema::PATH, paths))
}
