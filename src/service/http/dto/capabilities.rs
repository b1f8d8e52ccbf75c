//! The answer of `/v1/capabilities` as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::backend::GpuStatus;
use crate::import::Format;
use crate::limits::Limits;
use crate::request::{self, Style, word_for, words_of};
use crate::service::jobs::JobLoad;
use crate::service::store::{Store, StoreLoad};
use crate::spec::BackendChoice;

/// The capabilities of this process, its limits and its load.
#[derive(Serialize)]
pub struct CapabilitiesDto {
    version: &'static str,
    mesh_formats: [&'static str; Format::NAMES.len()],
    image_formats: [&'static str; 3],
    styles: Vec<&'static str>,
    schema: &'static str,
    request_keys: Vec<&'static str>,
    request_words: BTreeMap<&'static str, Vec<&'static str>>,
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

#[derive(Serialize)]
struct LoadDto {
    queued: usize,
    running: usize,
    kept_results: usize,
    kept_result_bytes: u64,
    stored_meshes: usize,
    stored_mesh_bytes: u64,
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
}

impl CapabilitiesDto {
    /// The answer. `schema` is the path of the schema, `paths` are those that need an API key where
    /// keys are configured.
    pub fn new(
        limits: &Limits,
        backend: BackendDto,
        workers: u64,
        load: JobLoad,
        meshes: &Store,
        schema: &'static str,
        paths: Vec<String>,
    ) -> Self {
        let (mesh_bytes, mesh_count) = meshes.limits();
        let StoreLoad { count: stored_meshes, bytes: stored_mesh_bytes } = meshes.load();
        let Limits { body_bytes, memory_bytes, triangles, nodes, json_depth, image_px, .. } = *limits;
        let Limits { bundle_bytes, bundle_entries, job_ms, queue_per_worker, .. } = *limits;
        let Limits { texture_px, texture_total_px, .. } = *limits;
        Self {
            version: env!("CARGO_PKG_VERSION"),
            mesh_formats: Format::NAMES,
            image_formats: ["png", "webp", "jpeg"],
            styles: words_of::<Style>(),
            schema,
            request_keys: request::keys(),
            request_words: request::vocabulary(),
            paths,
            backend,
            workers,
            load: LoadDto {
                queued: load.queued,
                running: load.running,
                kept_results: load.kept,
                kept_result_bytes: load.kept_bytes,
                stored_meshes,
                stored_mesh_bytes,
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
                mesh_bytes,
                mesh_count,
            },
        }
    }
}
