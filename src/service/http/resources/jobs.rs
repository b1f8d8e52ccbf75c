//! `/v1/jobs`: pictures that are fetched later.

use std::sync::Arc;

use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::render;
use crate::service::http::app::App;
use crate::service::http::dto::JobDto;
use crate::service::http::error::ApiError;
use crate::service::http::{negotiate, receive};
use crate::service::jobs::{Job, JobId, State as JobState};

/// Accepts a job, always with 202.
pub async fn post(State(app): State<Arc<App>>, request: Request) -> Result<Response, ApiError> {
    let received = receive::receive(&app, request).await?;
    let job = app.jobs.submit(received.work, true)?;
    Ok(accepted(&job))
}

/// 202 and where to look.
pub fn accepted(job: &Job) -> Response {
    let mut response = (StatusCode::ACCEPTED, state_of(job)).into_response();
    if let Ok(location) = HeaderValue::from_str(&format!("/v1/jobs/{}", job.id)) {
        response.headers_mut().insert(header::LOCATION, location);
    }
    response
}

/// The job's state; with `Prefer: wait=N`, once it has ended or N seconds are over.
pub async fn get(State(app): State<Arc<App>>, id: JobPath, headers: HeaderMap) -> Result<Response, ApiError> {
    let job = find(&app, id)?;
    let Some(wait) = negotiate::prefer(&headers).wait else { return Ok(state_of(&job)) };
    // Running out of time is no error: the state then says that it has not ended.
    let _ = tokio::time::timeout(wait, job.ended()).await;
    let mut response = state_of(&job);
    if let Ok(applied) = HeaderValue::from_str(&format!("wait={}", wait.as_secs())) {
        response.headers_mut().insert("preference-applied", applied);
    }
    Ok(response)
}

/// Cancels a job that has not ended; says what has become of it.
pub async fn delete(State(app): State<Arc<App>>, id: JobPath) -> Result<Response, ApiError> {
    let job = find(&app, id)?;
    app.jobs.cancel(&job);
    Ok(state_of(&job))
}

/// The picture, or the error that a waiting client would have got.
pub async fn result(State(app): State<Arc<App>>, id: JobPath) -> Result<Response, ApiError> {
    let job = find(&app, id)?;
    let conflict = |code, detail| ApiError::new(StatusCode::CONFLICT, code, detail);
    match job.state() {
        JobState::Done(finished) => Ok(render::picture(&finished)),
        JobState::Failed(failure) => Err(render::failed(&job, &failure)),
        JobState::Queued | JobState::Running => {
            Err(conflict("not_finished", "the job has not ended yet; ask again shortly").retry_after(1))
        }
        // Who has a mesh inspected waits for it, and nobody else hears of that job.
        JobState::Inspected(_) => Err(ApiError::internal()),
        JobState::Cancelled => Err(conflict("cancelled", "the job was cancelled, so it has no result")),
    }
}

/// What the path says in place of an id; not even text, perhaps, which is then no job's id either.
type JobPath = Result<Path<String>, PathRejection>;

fn find(app: &App, id: JobPath) -> Result<Arc<Job>, ApiError> {
    let job = id.ok().and_then(|Path(id)| JobId::parse(&id)).and_then(|id| app.jobs.find(id));
    job.ok_or_else(|| ApiError::not_found("there is no such job, or its result has expired"))
}

fn state_of(job: &Job) -> Response {
    ([(header::CACHE_CONTROL, "no-store")], Json(JobDto::new(job))).into_response()
}
