//! `POST /v1/check`: judges a mesh by the rules of `meshsnap check`.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::response::Response;

use crate::http::error::ApiError;
use crate::http::negotiate;
use crate::http::receive::check;
use crate::http::state::AppState;
use crate::jobs::Class;

/// Judges while the client waits. With `Prefer: respond-async`, accepts a job instead.
pub async fn post(State(state): State<Arc<AppState>>, request: Request) -> Result<Response, ApiError> {
    if negotiate::prefer(request.headers()).respond_async {
        return accept(&state, request).await.map(super::applied);
    }
    super::answer(&state, check::receive(&state, request, Class::Interactive).await?).await
}

/// Accepts a job.
pub async fn accept(state: &AppState, request: Request) -> Result<Response, ApiError> {
    super::accepted(state, check::receive(state, request, Class::Batch).await?).await
}
