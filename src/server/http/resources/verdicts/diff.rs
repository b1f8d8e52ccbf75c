//! `POST /v1/diff`: the differences of two meshes, as JSON in the words of `meshsnap diff`, or as a picture of both side by
//! side.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderValue, header};
use axum::response::Response;

use crate::http::error::ApiError;
use crate::http::negotiate;
use crate::http::receive::diff;
use crate::http::state::AppState;
use crate::jobs::Class;

/// Compares while the client waits. With `Prefer: respond-async`, accepts a job instead.
pub async fn post(State(state): State<Arc<AppState>>, request: Request) -> Result<Response, ApiError> {
    if negotiate::prefer(request.headers()).respond_async {
        return accept(&state, request).await.map(super::applied);
    }
    let mut response = super::answer(&state, diff::receive(&state, request, Class::Interactive).await?).await?;
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// Accepts a job.
pub async fn accept(state: &AppState, request: Request) -> Result<Response, ApiError> {
    super::accepted(state, diff::receive(state, request, Class::Batch).await?).await
}
