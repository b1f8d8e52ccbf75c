//! The state of a job as JSON.

use serde::Serialize;

use super::media_type;
use crate::http::error::ApiError;
use crate::jobs::{Finished, Job, JobId, JobState, Timings, rfc_3339};
use meshsnap_render::pipeline::QualitySelection;
use meshsnap_render::spec::Samples;

/// The state of a job.
#[derive(Serialize)]
pub struct JobDto {
    id: String,
    state: &'static str,
    accepted_unix_ms: u64,
    /// The same as a time of RFC 3339.
    accepted_at: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<ResultDto>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<JobErrorDto>,
}

/// The states of jobs that came in one form, in its order.
#[derive(Serialize)]
pub struct JobsDto {
    /// The jobs.
    pub jobs: Vec<JobOfMeshDto>,
}

/// The state of a job that came in a form with others.
#[derive(Serialize)]
pub struct JobOfMeshDto {
    /// The name of its mesh in the form.
    name: String,
    /// The address of the job.
    url: String,
    job: JobDto,
}

impl JobOfMeshDto {
    /// The state of the job of the mesh with this name.
    pub fn new(name: String, job: &Job) -> Self {
        Self { name, url: format!("/v1/jobs/{}", job.id), job: JobDto::new(job) }
    }
}

/// The result of a job that is done.
#[derive(Serialize)]
struct ResultDto {
    url: String,
    content_type: &'static str,
    bytes: usize,
    backend: &'static str,
    timings_ms: TimingsDto,
    warnings: Vec<WarningDto>,
    #[serde(skip_serializing_if = "Option::is_none")]
    chosen: Option<ChoiceDto>,
}

/// The techniques that were chosen for a request with a quality target. The back-end, also chosen,
/// is in the result itself.
#[derive(Serialize)]
struct ChoiceDto {
    samples: SamplesDto,
    wire_methods: Vec<&'static str>,
    expected_error: f64,
    expected_time_ms: f64,
}

/// The value of `image.samples`.
#[derive(Serialize)]
#[serde(untagged)]
enum SamplesDto {
    Fixed(u32),
    Word(String),
}

/// The reason why a job failed.
#[derive(Serialize)]
struct JobErrorDto {
    status: u16,
    code: &'static str,
    detail: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    flag: Option<&'static str>,
}

/// A fault of the file in spite of which it was drawn.
#[derive(Serialize)]
struct WarningDto {
    code: &'static str,
    detail: String,
}

/// Durations in milliseconds.
#[derive(Serialize)]
struct TimingsDto {
    queue: f64,
    parse: f64,
    plan: f64,
    render: f64,
    encode: f64,
}

impl JobDto {
    /// The state of a job at this moment.
    pub fn new(job: &Job) -> Self {
        let state = job.state();
        let (result, error) = match &state {
            JobState::Done(finished) => (Some(ResultDto::new(job.id, finished)), None),
            JobState::Failed(failure) => (None, Some(JobErrorDto::new(ApiError::from(&**failure)))),
            JobState::Queued | JobState::Running | JobState::Inspected(_) | JobState::Cancelled => (None, None),
        };
        let (id, accepted_unix_ms) = (job.id.to_string(), job.accepted_unix_ms);
        let accepted_at = rfc_3339(accepted_unix_ms);
        Self { id, state: state.name(), accepted_unix_ms, accepted_at, result, error }
    }
}

impl ResultDto {
    fn new(id: JobId, finished: &Finished) -> Self {
        let warnings = finished.warnings.iter();
        Self {
            url: format!("/v1/jobs/{id}/result"),
            content_type: media_type(finished.media),
            bytes: finished.content.len(),
            backend: finished.backend.name(),
            timings_ms: TimingsDto::new(&finished.timings),
            warnings: warnings.map(|w| WarningDto { code: w.code, detail: w.detail.clone() }).collect(),
            chosen: finished.selection.as_ref().map(ChoiceDto::new),
        }
    }
}

impl SamplesDto {
    fn new(samples: Samples) -> Self {
        match samples {
            Samples::Fixed(samples) => Self::Fixed(samples),
            other => Self::Word(other.to_string()),
        }
    }
}

impl ChoiceDto {
    fn new(choice: &QualitySelection) -> Self {
        Self {
            samples: SamplesDto::new(choice.samples),
            wire_methods: choice.wire_methods.clone(),
            expected_error: choice.expected_error,
            expected_time_ms: choice.expected_time_ms,
        }
    }
}

impl JobErrorDto {
    fn new(error: ApiError) -> Self {
        let status = error.status().as_u16();
        Self { status, code: error.code, detail: error.detail, flag: error.flag }
    }
}

impl TimingsDto {
    fn new(timings: &Timings) -> Self {
        // Rounded to microseconds: more digits would only be noise.
        let [queue, parse, plan, render, encode] =
            timings.parts().map(|(_, took)| (took.as_secs_f64() * 1e6).round() / 1e3);
        Self { queue, parse, plan, render, encode }
    }
}
