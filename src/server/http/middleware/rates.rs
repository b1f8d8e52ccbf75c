//! The check of a client's rate limits before its request is handled. `crate::rates` counts and decides.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;

use crate::http::error::ApiError;
use crate::http::receive;
use crate::http::state::AppState;

/// Counts a request of a key, or of a client's network where there are no keys.
pub async fn check(State(state): State<Arc<AppState>>, request: Request, next: Next) -> Result<Response, ApiError> {
    let is_work = [Method::POST, Method::PUT].contains(request.method());
    state.rates.check(&receive::access_of(&request).owner, is_work)?;
    Ok(next.run(request).await)
}
