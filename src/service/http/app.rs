//! What handlers share, and which path leads to which.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware;
use axum::routing::{MethodRouter, get, post};

use super::error::ApiError;
use super::{auth, observe};
use crate::backend::{GpuHost, HardwareHint};
use crate::config::{Config, cores, why_no_gpu};
use crate::limits::Limits;
use crate::request::Rules;
use crate::service::http::resources::schema;
use crate::service::http::resources::schema::Schema;
use crate::service::http::resources::{health, jobs, meshes, pictures, render};
use crate::service::jobs::{Engine, Jobs, Settings, UploadBudget, pipeline_engine};
use crate::service::store::Store;

/// What handlers share.
pub struct App {
    /// Reads request documents.
    pub rules: Rules,
    /// The same for those who write them.
    pub schema: Schema,
    /// The queue and its workers.
    pub jobs: Jobs,
    /// The GPU, if there is one.
    pub gpu: Arc<GpuHost>,
    /// Memory of uploads.
    pub bodies: Arc<UploadBudget>,
    /// Meshes that stay.
    pub meshes: Store,
    /// For the whole of a request's body.
    pub body_timeout: Duration,
    /// Threads that draw.
    pub workers: u64,
    /// Bearer tokens; empty: everybody.
    pub api_keys: Vec<String>,
    draining: AtomicBool,
}

impl App {
    /// Starts the workers.
    pub fn start(config: &Config) -> std::io::Result<Arc<Self>> {
        let threads = match config.worker_threads {
            0 => (cores() / config.workers.max(1)).max(1),
            given => given,
        };
        let gpu = Arc::new(GpuHost::new(HardwareHint::unless(why_no_gpu())));
        let engine = pipeline_engine(gpu.clone(), threads as usize, config.limits.clone());
        Self::with_engine(config, engine, gpu)
    }

    /// Starts workers that draw with `engine`, which draws on `gpu` if on any.
    pub fn with_engine(config: &Config, engine: Engine, gpu: Arc<GpuHost>) -> std::io::Result<Arc<Self>> {
        let Limits { queue_per_worker, job_ms, .. } = config.limits;
        let settings = Settings {
            workers: to_usize(config.workers),
            queue: to_usize(queue_per_worker.saturating_mul(config.workers)),
            job_time: Duration::from_millis(job_ms),
            result_ttl: Duration::from_millis(config.result_ttl_ms),
            result_bytes: config.result_bytes,
            result_count: to_usize(config.result_count),
        };
        let rules = Rules { limits: config.limits.clone(), backend: config.backend };
        Ok(Arc::new(Self {
            schema: Schema::new(&rules),
            rules,
            jobs: Jobs::start(settings, engine)?,
            gpu,
            bodies: UploadBudget::new(config.uploads_bytes),
            meshes: Store::new(config.mesh_bytes, to_usize(config.mesh_count)),
            body_timeout: Duration::from_millis(config.body_timeout_ms),
            workers: config.workers,
            api_keys: config.api_keys.clone(),
            draining: AtomicBool::new(false),
        }))
    }

    /// Takes no more work; what was accepted goes on.
    pub fn drain(&self) {
        self.draining.store(true, Ordering::Relaxed);
        self.jobs.drain();
    }

    /// Whether [`App::drain`] was called.
    pub fn is_draining(&self) -> bool {
        self.draining.load(Ordering::Relaxed)
    }
}

/// Where the work is done; these paths want a key where keys are configured.
pub fn paths() -> Vec<String> {
    resources().into_iter().map(|(path, _)| path.replace("{picture}", "render.{png|webp|jpg}")).collect()
}

fn resources() -> [(&'static str, MethodRouter<Arc<App>>); 9] {
    [
        ("/v1/render", post(render::post)),
        ("/v1/meshes", post(meshes::post)),
        ("/v1/meshes/{sha256}", get(meshes::get).put(meshes::put).delete(meshes::delete)),
        // The last part is render.png and so on: the router matches whole parts.
        ("/v1/meshes/{sha256}/{picture}", get(pictures::get)),
        ("/v1/jobs", post(jobs::post)),
        ("/v1/jobs/{id}", get(jobs::get).delete(jobs::delete)),
        ("/v1/jobs/{id}/result", get(jobs::result)),
        (schema::PATH, get(schema::get)),
        ("/v1/capabilities", get(health::capabilities)),
    ]
}

/// Every path there is.
pub fn router(app: &Arc<App>) -> Router {
    let api = resources()
        .into_iter()
        .fold(Router::new(), |router, (path, methods)| router.route(path, methods))
        .route_layer(middleware::from_fn_with_state(app.clone(), auth::check));
    Router::new()
        .route("/healthz", get(health::healthz))
        .route("/readyz", get(health::readyz))
        .route("/version", get(health::version))
        .route(schema::OPENAPI_PATH, get(schema::openapi))
        .merge(api)
        .fallback(|| async {
            ApiError::not_found(
                "there is nothing at this path; the work is done at POST /v1/render, and /openapi.json lists the paths",
            )
        })
        // UploadBudget are metered as they are read, forms too: axum's own limit of 2 MB would come before `--limit-body-bytes`.
        .layer(DefaultBodyLimit::disable())
        .layer(middleware::from_fn(observe::observe))
        .with_state(app.clone())
}

fn to_usize(number: u64) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
