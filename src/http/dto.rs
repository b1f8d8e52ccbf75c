//! What goes over the wire as JSON. Domain types do not serialise themselves.

use std::collections::BTreeMap;

use serde::Serialize;

use super::error::ApiError;
use super::schema;
use crate::backend::GpuStatus;
use crate::image::ImageFormat;
use crate::jobs::{Job, Load, State, Timings};
use crate::limits::BackendChoice;
use crate::limits::Limits;
use crate::mesh::Format;
use crate::pipeline::Choice;
use crate::request::{self, Style, word_for, words_of};

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
    fn new(choice: &Choice) -> Self {
        Self {
            samples: choice.samples,
            wire_methods: choice.wire_methods.clone(),
            expected_error: choice.expected_error,
            expected_time_ms: choice.expected_time_ms,
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
                    chosen: finished.choice.as_ref().map(ChoiceDto::new),
                };
                (Some(result), None)
            }
            State::Failed(failure) => {
                let ApiError { status, code, detail, flag, .. } = ApiError::from(&**failure);
                (None, Some(JobErrorDto { status: status.as_u16(), code, detail, flag }))
            }
            State::Queued | State::Running | State::Cancelled => (None, None),
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

/// `/v1/capabilities`.
#[derive(Serialize)]
pub struct CapabilitiesDto {
    version: &'static str,
    mesh_formats: [&'static str; Format::NAMES.len()],
    image_formats: [&'static str; 3],
    styles: Vec<&'static str>,
    schema: &'static str,
    request_keys: Vec<&'static str>,
    request_words: BTreeMap<&'static str, Vec<&'static str>>,
    backend: BackendDto,
    workers: u64,
    load: LoadDto,
    limits: LimitsDto,
}

/// Who draws.
#[derive(Serialize)]
pub struct BackendDto {
    default: &'static str,
    choices: Vec<&'static str>,
    gpu: GpuDto,
}

#[derive(Serialize)]
struct GpuDto {
    state: &'static str,
    name: Option<String>,
    driver: Option<String>,
    device_type: Option<&'static str>,
    features: Vec<&'static str>,
    reason: Option<String>,
}

impl BackendDto {
    /// The back-end of a request that names none, and how it stands with the GPU.
    pub fn new(default: BackendChoice, gpu: GpuStatus) -> Self {
        let GpuStatus { state, info, reason } = gpu;
        let (name, driver, device_type, features) = match info {
            Some(info) => (Some(info.name), Some(info.driver), Some(info.device_type), info.features),
            None => (None, None, None, Vec::new()),
        };
        Self {
            default: word_for(default),
            choices: words_of::<BackendChoice>(),
            gpu: GpuDto { state: state.name(), name, driver, device_type, features, reason },
        }
    }
}

#[derive(Serialize)]
struct LoadDto {
    queued: usize,
    running: usize,
    kept_results: usize,
    kept_result_bytes: u64,
}

#[derive(Serialize)]
struct LimitsDto {
    body_bytes: u64,
    memory_bytes: u64,
    triangles: u64,
    nodes: u64,
    json_depth: u64,
    image_px: u64,
    texture_px: u64,
    texture_total_px: u64,
    bundle_bytes: u64,
    bundle_entries: u64,
    job_ms: u64,
    queue_per_worker: u64,
}

impl CapabilitiesDto {
    /// What this process can do.
    pub fn new(limits: &Limits, backend: BackendDto, workers: u64, load: Load) -> Self {
        let Limits { body_bytes, memory_bytes, triangles, nodes, json_depth, image_px, .. } = *limits;
        let Limits { bundle_bytes, bundle_entries, job_ms, queue_per_worker, .. } = *limits;
        let Limits { texture_px, texture_total_px, .. } = *limits;
        Self {
            version: env!("CARGO_PKG_VERSION"),
            mesh_formats: Format::NAMES,
            image_formats: ["png", "webp", "jpeg"],
            styles: words_of::<Style>(),
            schema: schema::PATH,
            request_keys: request::keys(),
            request_words: request::vocabulary(),
            backend,
            workers,
            load: LoadDto {
                queued: load.queued,
                running: load.running,
                kept_results: load.kept,
                kept_result_bytes: load.kept_bytes,
            },
            limits: LimitsDto {
                body_bytes,
                memory_bytes,
                triangles,
                nodes,
                json_depth,
                image_px,
                texture_px,
                texture_total_px,
                bundle_bytes,
                bundle_entries,
                job_ms,
                queue_per_worker,
            },
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
