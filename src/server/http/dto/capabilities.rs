//! The answer of `/v1/capabilities` as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::http::state::AppState;
use meshsnap_inspect::check::NAMES;
use meshsnap_render::backend::GpuStatus;
use meshsnap_render::import::Format;
use meshsnap_render::request::{self, Style, word_for, words_of};
use meshsnap_render::spec::BackendChoice;

/// The capabilities of this process, its limits and its load.
#[derive(Serialize)]
pub struct CapabilitiesDto {
    version: &'static str,
    mesh_formats: Vec<&'static str>,
    image_formats: [&'static str; 3],
    styles: Vec<&'static str>,
    schema: &'static str,
    request_keys: Vec<&'static str>,
    request_words: BTreeMap<&'static str, Vec<&'static str>>,
    check_rules: [&'static str; NAMES.len()],
    paths: Vec<String>,
    backend: BackendDto,
    workers: u64,
    load: LoadDto,
    limits: LimitsDto,
}

/// The back-ends that can draw.
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

#[derive(Serialize)]
struct LoadDto {
    queued: usize,
    running: usize,
    wait_ms: u64,
    kept_results: usize,
    kept_result_bytes: u64,
    stored_meshes: usize,
    stored_mesh_bytes: u64,
    resident_meshes: usize,
    resident_mesh_bytes: u64,
    kept_pictures: usize,
    kept_picture_bytes: u64,
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
    mesh_bytes: u64,
    mesh_count: usize,
    resident_bytes: u64,
    picture_bytes: u64,
}

impl CapabilitiesDto {
    /// The answer. `schema` is the path of the schema, `paths` are those that need an API key where
    /// keys are configured.
    pub fn new(state: &AppState, schema: &'static str, paths: Vec<String>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            mesh_formats: Format::names(),
            image_formats: ["png", "webp", "jpeg"],
            styles: words_of::<Style>(),
            schema,
            request_keys: request::keys(),
            request_words: request::vocabulary(),
            check_rules: NAMES,
            paths,
            backend: BackendDto::new(state.rules.backend, state.gpu.status()),
            workers: state.workers,
            load: LoadDto::new(state),
            limits: LimitsDto::new(state),
        }
    }
}

impl BackendDto {
    /// The back-end of requests that name none, and the state of the GPU.
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

impl LoadDto {
    fn new(state: &AppState) -> Self {
        let (jobs, meshes) = (state.jobs.load(), state.meshes.load());
        let (residents, pictures) = (state.residents.load(), state.pictures.load());
        Self {
            queued: jobs.queued,
            running: jobs.running,
            wait_ms: u64::try_from(jobs.wait.as_millis()).unwrap_or(u64::MAX),
            kept_results: jobs.kept,
            kept_result_bytes: jobs.kept_bytes,
            stored_meshes: meshes.count,
            stored_mesh_bytes: meshes.bytes,
            resident_meshes: residents.count,
            resident_mesh_bytes: residents.bytes,
            kept_pictures: pictures.count,
            kept_picture_bytes: pictures.bytes,
        }
    }
}

impl LimitsDto {
    fn new(state: &AppState) -> Self {
        let (limits, (mesh_bytes, mesh_count)) = (&state.rules.limits, state.meshes.limits());
        Self {
            body_bytes: state.body_bytes_max,
            memory_bytes: limits.memory_bytes,
            triangles: limits.triangles,
            nodes: limits.nodes,
            json_depth: limits.json_depth,
            image_px: limits.image_px,
            texture_px: limits.texture_px,
            texture_total_px: limits.texture_total_px,
            bundle_bytes: limits.bundle_bytes,
            bundle_entries: limits.bundle_entries,
            job_ms: state.job_ms_max,
            queue_per_worker: state.queue_per_worker,
            mesh_bytes,
            mesh_count,
            resident_bytes: state.residents.limit_bytes(),
            picture_bytes: state.pictures.limit_bytes(),
        }
    }
}
