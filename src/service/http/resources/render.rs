//! `POST /v1/render`: a mesh in, or the name of one, and a picture out.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::jobs;
use crate::service::http::app::App;
use crate::service::http::dto::media_type;
use crate::service::http::error::ApiError;
use crate::service::http::receive::Received;
use crate::service::http::{conditional, negotiate, receive};
use crate::service::jobs::{Failure, Finished, Job, Jobs, State as JobState, Work};

/// Draws while the client waits.
pub async fn post(State(app): State<Arc<App>>, request: Request) -> Result<Response, ApiError> {
    let respond_async = negotiate::prefer(request.headers()).respond_async;
    let Received { work, address } = receive::receive(&app, request).await?;
    if respond_async {
        let job = app.jobs.submit(work, true)?;
        let mut response = jobs::accepted(&job);
        let applied = HeaderValue::from_static("respond-async");
        response.headers_mut().insert("preference-applied", applied);
        return Ok(response);
    }
    let mut response = match done(&app, work).await? {
        JobState::Done(finished) => picture(&finished),
        _ => return Err(ApiError::internal()),
    };
    if let Some((location, (name, etag))) =
        address.and_then(|at| Some((HeaderValue::from_str(&at.url).ok()?, conditional::etag(&at.etag))))
    {
        // What is sent is what is there, so it has the tag that it has there.
        response.headers_mut().insert(header::CONTENT_LOCATION, location);
        response.headers_mut().insert(name, etag);
    }
    Ok(response)
}

/// Has work done while the client waits.
pub async fn done(app: &App, work: Work) -> Result<JobState, ApiError> {
    let waiting = Waiting { job: app.jobs.submit(work, false)?, jobs: app.jobs.clone() };
    match waiting.job.ended().await {
        JobState::Failed(failure) => Err(failed(&waiting.job, &failure)),
        ended => Ok(ended),
    }
}

/// A client that waits. When it hangs up, this is dropped, and its job stops.
struct Waiting {
    job: Arc<Job>,
    jobs: Jobs,
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.jobs.cancel(&self.job);
    }
}

/// The answer for a job without a picture. What the answer must not say goes to the log, under the request's id.
pub fn failed(job: &Job, failure: &Failure) -> ApiError {
    let error = ApiError::from(failure);
    if error.status.is_server_error() {
        tracing::error!(job = %job.id, %failure, "a job failed");
    }
    error
}

/// The picture, with what there is to say about it.
pub fn picture(finished: &Finished) -> Response {
    let etag = format!("\"{:032x}\"", digest(&finished.picture));
    let timings = finished.timings.parts().map(|(name, took)| format!("{name};dur={:.3}", took.as_secs_f64() * 1e3));
    let text = |value: &str| HeaderValue::from_str(value).unwrap_or_else(|_| HeaderValue::from_static(""));
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type(finished.format))),
        (header::ETAG, text(&etag)),
        (HeaderName::from_static("x-render-backend"), HeaderValue::from_static(finished.backend.name())),
        (HeaderName::from_static("server-timing"), text(&timings.join(", "))),
    ];
    // Codes alone: sentences belong into bodies, and a job's state has them.
    let mut codes: Vec<&str> = Vec::new();
    for warning in &finished.warnings {
        if !codes.contains(&warning.code) {
            codes.push(warning.code);
        }
    }
    let warnings = (!codes.is_empty()).then(|| (HeaderName::from_static("x-warnings"), text(&codes.join(", "))));
    let chosen = finished.selection.as_ref().map(|selection| {
        [
            (HeaderName::from_static("x-expected-error"), text(&selection.expected_error.to_string())),
            (HeaderName::from_static("x-chosen"), text(&selection.to_string())),
        ]
    });
    let mut response = (StatusCode::OK, headers, finished.picture.clone()).into_response();
    response.headers_mut().extend(chosen.into_iter().flatten().chain(warnings));
    response
}

/// 128 bits of a body: equal bodies have equal tags, and the other way round but for chance.
pub fn digest(bytes: &[u8]) -> u128 {
    let half = |seed| rapidhash::v3::rapidhash_v3_seeded(bytes, &rapidhash::v3::RapidSecrets::seed(seed));
    u128::from(half(1)) << 64 | u128::from(half(2))
}
