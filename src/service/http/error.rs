//! The only map from what went wrong to an HTTP status.
//!
//! An [`ApiError`] becomes an answer in two steps: here its status and headers, in [`super::observe`] the body, because
//! only there the request's id is known.

use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::backend::DrawError;
use crate::import::{MeshError, MeshFault};
use crate::limits::LimitExceeded;
use crate::pipeline::PlanError;
use crate::pipeline::RenderError;
use crate::request::RequestError;
use crate::service::jobs::{Failure, Refusal, UploadBudgetFull};
use crate::service::store::StoreError;

/// An answer that is not what the client wanted.
#[derive(Clone, Debug)]
pub struct ApiError {
    /// The HTTP status.
    pub status: StatusCode,
    /// Stable, snake case.
    pub code: &'static str,
    /// One sentence: what is wrong, where, what to do. Never says anything about our insides.
    pub detail: String,
    /// The flag of `serve` that raises the limit, if one was hit.
    pub flag: Option<&'static str>,
    /// Headers of this answer beside the usual ones.
    pub headers: Vec<(HeaderName, HeaderValue)>,
}

impl ApiError {
    /// An answer without extras.
    pub fn new(status: StatusCode, code: &'static str, detail: impl Into<String>) -> Self {
        Self { status, code, detail: detail.into(), flag: None, headers: Vec::new() }
    }

    /// The same with `Retry-After`.
    pub fn retry_after(mut self, seconds: u64) -> Self {
        self.headers.push((header::RETRY_AFTER, HeaderValue::from(seconds)));
        self
    }

    /// The same with another header.
    pub fn header(mut self, name: HeaderName, value: &'static str) -> Self {
        self.headers.push((name, HeaderValue::from_static(value)));
        self
    }

    /// The same with the flag that raises a limit.
    pub fn flag(mut self, flag: Option<&'static str>) -> Self {
        self.flag = flag;
        self
    }

    /// A bug of ours. What happened is in the log and not in the answer.
    pub fn internal() -> Self {
        let detail = "something failed here that was not the request's fault; the log has more under this request id";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "internal", detail)
    }

    /// The body is larger than is accepted.
    pub fn body_too_large(limit: u64) -> Self {
        let detail = format!("the request body is larger than {limit} bytes (raise the limit with --limit-body-bytes)");
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, "body_too_large", detail).flag(Some("--limit-body-bytes"))
    }

    /// No such path.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not_found", detail)
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let mut response = self.status.into_response();
        response.headers_mut().extend(self.headers.iter().cloned());
        response.extensions_mut().insert(self);
        response
    }
}

impl From<RequestError> for ApiError {
    fn from(error: RequestError) -> Self {
        Self::new(StatusCode::BAD_REQUEST, error.fault.code(), error.to_string()).flag(error.flag)
    }
}

impl From<Refusal> for ApiError {
    fn from(refusal: Refusal) -> Self {
        let detail = refusal.to_string();
        match refusal {
            Refusal::QueueFull { retry_after_s, .. } => {
                let error = Self::new(StatusCode::TOO_MANY_REQUESTS, "queue_full", detail);
                error.flag(Some("--queue")).retry_after(retry_after_s)
            }
            Refusal::Draining => Self::new(StatusCode::SERVICE_UNAVAILABLE, "draining", detail).retry_after(5),
        }
    }
}

impl From<UploadBudgetFull> for ApiError {
    fn from(full: UploadBudgetFull) -> Self {
        let error = Self::new(StatusCode::TOO_MANY_REQUESTS, "uploads_full", full.to_string());
        error.flag(Some("--uploads-bytes")).retry_after(1)
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        let detail = error.to_string();
        match error {
            StoreError::TooLarge { .. } => {
                Self::new(StatusCode::PAYLOAD_TOO_LARGE, "mesh_too_large", detail).flag(Some("--mesh-bytes"))
            }
            StoreError::Busy { flag } => {
                Self::new(StatusCode::TOO_MANY_REQUESTS, "meshes_full", detail).flag(Some(flag)).retry_after(1)
            }
        }
    }
}

impl From<&Failure> for ApiError {
    fn from(failure: &Failure) -> Self {
        match failure {
            Failure::Render(error) => error.into(),
            Failure::TimeUp { .. } => deadline(failure.to_string()),
            Failure::Panicked => Self::internal(),
        }
    }
}

impl From<&RenderError> for ApiError {
    fn from(error: &RenderError) -> Self {
        match error {
            RenderError::Mesh(error) => error.into(),
            RenderError::Plan(error) => error.into(),
            RenderError::Stopped(stopped) => deadline(stopped.to_string()),
            RenderError::Draw(DrawError::Stopped(stopped)) => deadline(stopped.to_string()),
            RenderError::Draw(DrawError::DeviceLost(_)) => {
                let detail = "the GPU of this server was lost while drawing; try again, or ask for backend=cpu";
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "device_lost", detail).retry_after(1)
            }
            // Only reachable by asking for the GPU by name: `auto` goes on with the CPU.
            RenderError::Draw(DrawError::NoGpu(_)) => {
                let detail = "this server has no GPU that can be used; ask for backend=auto or backend=cpu \
                              (backend.gpu at /v1/capabilities says why)";
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, "backend_unavailable", detail)
            }
            RenderError::Draw(_) => {
                let detail = "the GPU of this server cannot draw this; ask for backend=auto or backend=cpu";
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, "backend_unavailable", detail)
            }
            RenderError::Encode(_) | RenderError::Report(_) => Self::internal(),
        }
    }
}

impl From<&PlanError> for ApiError {
    fn from(error: &PlanError) -> Self {
        let code = match error {
            PlanError::Limit(limit) => return limit.into(),
            PlanError::Stopped(stopped) => return deadline(stopped.to_string()),
            PlanError::Texture(_) => "texture_broken",
            PlanError::NoCamera => "no_camera",
        };
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, code, error.to_string())
    }
}

impl From<&MeshError> for ApiError {
    fn from(error: &MeshError) -> Self {
        let (status, code) = match &error.fault {
            MeshFault::Unrecognised => (StatusCode::UNSUPPORTED_MEDIA_TYPE, "mesh_unrecognised"),
            MeshFault::Broken => (StatusCode::UNPROCESSABLE_ENTITY, "mesh_broken"),
            MeshFault::Empty => (StatusCode::UNPROCESSABLE_ENTITY, "mesh_empty"),
            MeshFault::OutsideBundle => (StatusCode::UNPROCESSABLE_ENTITY, "mesh_outside_bundle"),
            MeshFault::BundleBroken => (StatusCode::UNPROCESSABLE_ENTITY, "bundle_broken"),
            MeshFault::EntryUnclear => (StatusCode::UNPROCESSABLE_ENTITY, "entry_unclear"),
            MeshFault::Unsupported => (StatusCode::UNPROCESSABLE_ENTITY, "mesh_unsupported"),
            MeshFault::Limit(limit) => return limit.into(),
            MeshFault::Stopped => return deadline(error.detail.clone()),
        };
        Self::new(status, code, error.detail.clone())
    }
}

impl From<&LimitExceeded> for ApiError {
    fn from(limit: &LimitExceeded) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "limit_exceeded", limit.to_string()).flag(Some(limit.flag))
    }
}

fn deadline(detail: String) -> ApiError {
    ApiError::new(StatusCode::GATEWAY_TIMEOUT, "deadline", detail).flag(Some("--limit-job-ms"))
}
