//! What goes over the wire as JSON. Domain types do not serialise themselves.

use serde::Serialize;

use super::error::ApiError;
use crate::image::ImageFormat;
use crate::import::Bundle;
use crate::pipeline::QualitySelection;
use crate::service::jobs::{Job, State, Timings};
use crate::service::store::Digest;

/// RFC 9457.
#[derive(Serialize)]
pub struct ProblemDto<'a> {
    r#type: String,
    title: &'a str,
    status: u16,
    detail: &'a str,
    code: &'a str,
    request_id: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    flag: Option<&'a str>,
}

impl<'a> ProblemDto<'a> {
    /// The problem document for an error.
    pub fn new(error: &'a ApiError, request_id: &'a str) -> Self {
        Self {
            r#type: format!("urn:meshsnap:error:{}", error.code),
            title: error.status.canonical_reason().unwrap_or("Error"),
            status: error.status.as_u16(),
            detail: &error.detail,
            code: error.code,
            request_id,
            flag: error.flag,
        }
    }
}

/// State of a job.
#[derive(Serialize)]
pub struct JobDto {
    id: String,
    state: &'static str,
    accepted_unix_ms: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<ResultDto>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<JobErrorDto>,
}

/// What became of a job that is done.
#[derive(Serialize)]
pub struct ResultDto {
    url: String,
    content_type: &'static str,
    bytes: usize,
    backend: &'static str,
    timings_ms: TimingsDto,
    warnings: Vec<WarningDto>,
    #[serde(skip_serializing_if = "Option::is_none")]
    chosen: Option<ChoiceDto>,
}

/// What was chosen for a request that asks for an error or a time. The back-end stands in the result itself.
#[derive(Serialize)]
pub struct ChoiceDto {
    samples: u32,
    wire_methods: Vec<&'static str>,
    expected_error: f64,
    expected_time_ms: f64,
}

impl ChoiceDto {
    fn new(selection: &QualitySelection) -> Self {
        Self {
            samples: selection.samples,
            wire_methods: selection.wire_methods.clone(),
            expected_error: selection.expected_error,
            expected_time_ms: selection.expected_time_ms,
        }
    }
}

/// Why a job failed.
#[derive(Serialize)]
pub struct JobErrorDto {
    status: u16,
    code: &'static str,
    detail: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    flag: Option<&'static str>,
}

/// Something in the file that was read around.
#[derive(Serialize)]
pub struct WarningDto {
    code: &'static str,
    detail: String,
}

/// Milliseconds.
#[derive(Serialize)]
pub struct TimingsDto {
    queue: f64,
    parse: f64,
    plan: f64,
    render: f64,
    encode: f64,
}

impl JobDto {
    /// As it is now.
    pub fn new(job: &Job) -> Self {
        let state = job.state();
        let (result, error) = match &state {
            State::Done(finished) => {
                let warnings = finished.warnings.iter();
                let result = ResultDto {
                    url: format!("/v1/jobs/{}/result", job.id),
                    content_type: media_type(finished.format),
                    bytes: finished.picture.len(),
                    backend: finished.backend.name(),
                    timings_ms: TimingsDto::new(&finished.timings),
                    warnings: warnings.map(|w| WarningDto { code: w.code, detail: w.detail.clone() }).collect(),
                    chosen: finished.selection.as_ref().map(ChoiceDto::new),
                };
                (Some(result), None)
            }
            State::Failed(failure) => {
                let ApiError { status, code, detail, flag, .. } = ApiError::from(&**failure);
                (None, Some(JobErrorDto { status: status.as_u16(), code, detail, flag }))
            }
            State::Queued | State::Running | State::Inspected(_) | State::Cancelled => (None, None),
        };
        let (id, accepted_unix_ms) = (job.id.to_string(), job.accepted_unix_ms);
        Self { id, state: state.name(), accepted_unix_ms, result, error }
    }
}

impl TimingsDto {
    fn new(timings: &Timings) -> Self {
        // Microseconds are as precise as such a clock is.
        let [queue, parse, plan, render, encode] =
            timings.parts().map(|(_, took)| (took.as_secs_f64() * 1e6).round() / 1e3);
        Self { queue, parse, plan, render, encode }
    }
}

/// `/healthz` and `/readyz`.
#[derive(Serialize)]
pub struct StatusDto {
    /// `ok` or `ready`.
    pub status: &'static str,
}

/// `/version`.
#[derive(Serialize)]
pub struct VersionDto {
    name: &'static str,
    version: &'static str,
}

impl VersionDto {
    /// This program.
    pub fn new() -> Self {
        Self { name: env!("CARGO_PKG_NAME"), version: env!("CARGO_PKG_VERSION") }
    }
}

/// A mesh that is stored.
#[derive(Serialize)]
pub struct MeshDto {
    sha256: String,
    /// Of its files, as they came.
    size_bytes: u64,
    files: usize,
    /// Where its report is.
    pub url: String,
    render_url: String,
}

impl MeshDto {
    /// Under this name.
    pub fn new(digest: Digest, bundle: &Bundle) -> Self {
        let url = format!("/v1/meshes/{digest}");
        let render_url = format!("{url}/render.png");
        Self {
            sha256: digest.to_string(),
            size_bytes: bundle.bytes_len(),
            files: bundle.files().len(),
            url,
            render_url,
        }
    }
}

/// The media type of a picture.
pub fn media_type(format: ImageFormat) -> &'static str {
    match format {
        ImageFormat::Png => "image/png",
        ImageFormat::Webp => "image/webp",
        ImageFormat::Jpeg => "image/jpeg",
    }
}
