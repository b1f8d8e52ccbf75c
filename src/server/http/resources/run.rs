//! Runs interactive jobs: a client waits for the answer. When it hangs up, its job stops.

use std::sync::Arc;

use bytes::Bytes;

use crate::http::error::ApiError;
use crate::http::state::AppState;
use crate::jobs::{Failure, Finished, Job, JobState, Jobs, Work};

/// Draws a picture while the client waits.
pub async fn draw(state: &AppState, work: Work) -> Result<Arc<Finished>, ApiError> {
    match run(state, work).await? {
        JobState::Done(finished) => Ok(finished),
        _ => Err(ApiError::internal()),
    }
}

/// Writes a report, as JSON, while the client waits. It fails if the bundle is not a mesh.
pub async fn inspect(state: &AppState, work: Work) -> Result<Bytes, ApiError> {
    match run(state, work).await? {
        JobState::Inspected(report) => Ok(report),
        _ => Err(ApiError::internal()),
    }
}

/// The error of a failed job. Where the server is at fault, the cause goes to the log, under the
/// request's id, because the answer must not tell it.
pub fn job_error(job: &Job, failure: &Failure) -> ApiError {
    let error = ApiError::from(failure);
    if error.status().is_server_error() {
        tracing::error!(job = %job.id, %failure, "a job failed");
    }
    error
}

async fn run(state: &AppState, work: Work) -> Result<JobState, ApiError> {
    let waiting = CancelOnDrop { job: state.jobs.submit(work, false)?, jobs: state.jobs.clone() };
    match waiting.job.ended().await {
        JobState::Failed(failure) => Err(job_error(&waiting.job, &failure)),
        ended => Ok(ended),
    }
}

/// Cancels a job when the handler that waits for it is dropped.
struct CancelOnDrop {
    job: Arc<Job>,
    jobs: Jobs,
}

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.jobs.cancel(&self.job);
    }
}
