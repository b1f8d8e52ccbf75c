//! The map from errors to HTTP statuses. Handlers name the kind of an error ([`ErrorKind`]), and its status follows from
//! that here.
//!
//! An [`ApiError`] becomes an answer in two steps: status and headers here, the body in
//! [`super::middleware::observe`], because an `ApiError` does not know the id of its request, which is in the body.
//!
//! Some statuses of 400 or more are set elsewhere. The 422 of a failed verdict is an answer and no error:
//! `resources/responses.rs` sets it. `connection/accept.rs` sends the 503 for a connection too many, because such a
//! connection passes no middleware. axum and hyper refuse some requests by themselves (405, 431).

use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::durable::{ErrorRecord, Unstored};
use crate::jobs::{Class, Failure, Refusal, name};
use crate::memory::MemoryFull;
use crate::rates::TooMuch;
use crate::store::StoreError;
use meshsnap_render::backend::DrawError;
use meshsnap_render::import::{MeshError, MeshFault};
use meshsnap_render::limits::LimitExceeded;
use meshsnap_render::pipeline::{PlanError, RenderError};
use meshsnap_render::request::RequestError;

/// Kinds of errors, by who is at fault. Each has one status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// The request is malformed: query, document, form or header.
    BadRequest,
    /// The request has no valid API key.
    Unauthorized,
    /// The request's API key does not permit it.
    Forbidden,
    /// The path names nothing.
    NotFound,
    /// The path does not accept this method.
    MethodNotAllowed,
    /// The client accepts none of the available formats.
    NotAcceptable,
    /// The client sent its body too slowly.
    TooSlow,
    /// The resource is in a state that does not permit the request.
    Conflict,
    /// The body is too large.
    TooLarge,
    /// The body is not in a known format.
    UnknownFormat,
    /// The content is at fault: a broken mesh, a bad reference, or too much of something.
    Content,
    /// The server has no room now. The same request may succeed later.
    Busy,
    /// The server cannot serve this now: it shuts down, or lost its GPU.
    Unavailable,
    /// The job took longer than a job may take.
    Deadline,
    /// The server cannot store what it would have to.
    NoRoom,
    /// The server has a bug.
    Internal,
    /// The framework refused the request by itself, with this status.
    Framework(StatusCode),
}

impl ErrorKind {
    /// The HTTP status.
    pub fn status(self) -> StatusCode {
        match self {
            Self::BadRequest => StatusCode::BAD_REQUEST,
            Self::Unauthorized => StatusCode::UNAUTHORIZED,
            Self::Forbidden => StatusCode::FORBIDDEN,
            Self::NotFound => StatusCode::NOT_FOUND,
            Self::MethodNotAllowed => StatusCode::METHOD_NOT_ALLOWED,
            Self::NotAcceptable => StatusCode::NOT_ACCEPTABLE,
            Self::TooSlow => StatusCode::REQUEST_TIMEOUT,
            Self::Conflict => StatusCode::CONFLICT,
            Self::TooLarge => StatusCode::PAYLOAD_TOO_LARGE,
            Self::UnknownFormat => StatusCode::UNSUPPORTED_MEDIA_TYPE,
            Self::Content => StatusCode::UNPROCESSABLE_ENTITY,
            Self::Busy => StatusCode::TOO_MANY_REQUESTS,
            Self::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
            Self::Deadline => StatusCode::GATEWAY_TIMEOUT,
            Self::NoRoom => StatusCode::INSUFFICIENT_STORAGE,
            Self::Internal => StatusCode::INTERNAL_SERVER_ERROR,
            Self::Framework(status) => status,
        }
    }
}

/// The kinds of errors by which jobs fail, under their names in the data folder.
const KINDS_OF_JOBS: &[(&str, ErrorKind)] = &[
    ("bad-request", ErrorKind::BadRequest),
    ("unknown-format", ErrorKind::UnknownFormat),
    ("content", ErrorKind::Content),
    ("unavailable", ErrorKind::Unavailable),
    ("deadline", ErrorKind::Deadline),
    ("internal", ErrorKind::Internal),
];

/// A failure as it is stored.
pub fn record(failure: &Failure) -> ErrorRecord {
    record_of(ApiError::from(failure))
}

/// An error as it is stored.
pub fn record_of(error: ApiError) -> ErrorRecord {
    let fault = KINDS_OF_JOBS.iter().find(|(_, kind)| *kind == error.kind).map_or("internal", |(name, _)| name);
    let flag = error.flag.map(str::to_owned);
    ErrorRecord { fault: fault.to_owned(), code: error.code.to_owned(), detail: error.detail, flag }
}

/// Marks an answer with the status of an error whose body is what was asked for.
#[derive(Clone, Copy, Debug)]
pub struct IsAnswer;

/// An error as a client sees it.
#[derive(Clone, Debug)]
pub struct ApiError {
    /// Its kind; the status follows from it.
    pub kind: ErrorKind,
    /// The error's stable name, in snake case.
    pub code: &'static str,
    /// One sentence: what is wrong, where, what to do. It never tells the server's internals.
    pub detail: String,
    /// The flag of `serve` that raises the limit, if a limit was hit.
    pub flag: Option<&'static str>,
    /// Headers of this answer beside the usual ones.
    pub headers: Vec<(HeaderName, HeaderValue)>,
}

impl ApiError {
    /// An error without a flag and without headers of its own.
    pub fn new(kind: ErrorKind, code: &'static str, detail: impl Into<String>) -> Self {
        Self { kind, code, detail: detail.into(), flag: None, headers: Vec::new() }
    }

    /// Adds `Retry-After`.
    pub fn retry_after(mut self, seconds: u64) -> Self {
        self.headers.push((header::RETRY_AFTER, HeaderValue::from(seconds)));
        self
    }

    /// True if trying again may help.
    pub fn may_pass(&self) -> bool {
        self.headers.iter().any(|(name, _)| name == header::RETRY_AFTER)
    }

    /// Adds a header.
    pub fn header(mut self, name: HeaderName, value: &'static str) -> Self {
        self.headers.push((name, HeaderValue::from_static(value)));
        self
    }

    /// Sets the flag that raises the limit.
    pub fn flag(mut self, flag: impl Into<Option<&'static str>>) -> Self {
        self.flag = flag.into();
        self
    }

    /// A bug of the server. The cause is in the log and not in the answer.
    pub fn internal() -> Self {
        let detail = "something failed here that was not the request's fault; the log has more under this request id";
        Self::new(ErrorKind::Internal, "internal", detail)
    }

    /// The body is larger than is accepted.
    pub fn body_too_large(limit: u64) -> Self {
        let detail = format!("the request body is larger than {limit} bytes (raise the limit with --limit-body-bytes)");
        Self::new(ErrorKind::TooLarge, "body_too_large", detail).flag("--limit-body-bytes")
    }

    /// The body is larger than the memory for all uploads.
    pub fn body_beyond_memory(limit: u64) -> Self {
        let detail = format!(
            "the request body is larger than {limit} bytes, the memory for all uploads (raise it with --uploads-bytes, and \
             --memory-bytes where that is less than four times as much)"
        );
        Self::new(ErrorKind::TooLarge, "body_too_large", detail).flag("--uploads-bytes")
    }

    /// The server shuts down and takes no new work.
    pub fn draining(detail: impl Into<String>) -> Self {
        Self::new(ErrorKind::Unavailable, "draining", detail).retry_after(5)
    }

    /// The path names nothing.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(ErrorKind::NotFound, "not_found", detail)
    }

    /// An error that the framework answered by itself.
    pub fn of_framework(status: StatusCode) -> Self {
        match status {
            StatusCode::METHOD_NOT_ALLOWED => {
                let detail = "this path does not answer to this method; the Allow header says to which it does";
                Self::new(ErrorKind::MethodNotAllowed, "method_not_allowed", detail)
            }
            StatusCode::INTERNAL_SERVER_ERROR => Self::internal(),
            _ => {
                let detail = status.canonical_reason().unwrap_or("the request failed");
                Self::new(ErrorKind::Framework(status), "bad_request", detail)
            }
        }
    }

    /// The HTTP status.
    pub fn status(&self) -> StatusCode {
        self.kind.status()
    }

    /// The error for a job that asks for a GPU where no server of the service has one.
    pub fn no_gpu_anywhere() -> Self {
        let detail = "no server of the service has a GPU that can be used; ask for backend=auto or backend=cpu";
        Self::new(ErrorKind::Content, "backend_unavailable", detail)
    }

    fn deadline(detail: String) -> Self {
        Self::new(ErrorKind::Deadline, "deadline", detail).flag("--limit-job-ms")
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let mut response = self.status().into_response();
        response.headers_mut().extend(self.headers.iter().cloned());
        response.extensions_mut().insert(self);
        response
    }
}

impl From<RequestError> for ApiError {
    fn from(error: RequestError) -> Self {
        Self::new(ErrorKind::BadRequest, error.fault.code(), error.to_string()).flag(error.flag)
    }
}

impl From<Refusal> for ApiError {
    fn from(refusal: Refusal) -> Self {
        let detail = refusal.to_string();
        match refusal {
            Refusal::QueueFull { retry_after_s, .. } => {
                let error = Self::new(ErrorKind::Busy, "queue_full", detail);
                error.flag("--queue").retry_after(retry_after_s)
            }
            Refusal::TooLate { class, retry_after_s, .. } => {
                let flag = match class {
                    Class::Interactive => "--wait-ms",
                    Class::Batch => "--batch-wait-ms",
                };
                Self::new(ErrorKind::Busy, "too_late", detail).flag(flag).retry_after(retry_after_s)
            }
            Refusal::MemoryFull { retry_after_s, .. } => {
                Self::new(ErrorKind::Busy, "memory_full", detail).flag("--memory-bytes").retry_after(retry_after_s)
            }
            Refusal::TooMany { .. } => Self::new(ErrorKind::Content, "too_many_meshes", detail).flag("--queue"),
            Refusal::TooMuch { .. } => Self::new(ErrorKind::Content, "too_many_meshes", detail).flag("--batch-wait-ms"),
            Refusal::Quarantined { .. } => Self::new(ErrorKind::Content, "mesh_quarantined", detail),
            Refusal::Unstored(unstored) => unstored.into(),
            Refusal::Draining => Self::draining(detail),
        }
    }
}

impl From<Unstored> for ApiError {
    fn from(unstored: Unstored) -> Self {
        let code = match unstored {
            Unstored::Full => "storage_full",
            Unstored::Failed => "storage_failed",
        };
        Self::new(ErrorKind::NoRoom, code, unstored.to_string()).retry_after(5)
    }
}

impl From<&ErrorRecord> for ApiError {
    fn from(record: &ErrorRecord) -> Self {
        let known = KINDS_OF_JOBS.iter().find(|(name, _)| *name == record.fault);
        let error = Self::new(known.map_or(ErrorKind::Internal, |(_, kind)| *kind), name(&record.code), &record.detail);
        error.flag(record.flag.as_deref().map(name))
    }
}

impl From<TooMuch> for ApiError {
    fn from(much: TooMuch) -> Self {
        let (code, flag) = match much {
            TooMuch::Rate { .. } => ("rate_limited", "--rate-per-s"),
            TooMuch::Day { .. } => ("quota_exceeded", "--quota-per-day"),
        };
        Self::new(ErrorKind::Busy, code, much.to_string()).flag(flag).retry_after(much.retry_after_s())
    }
}

impl From<MemoryFull> for ApiError {
    fn from(full: MemoryFull) -> Self {
        let (code, flag) = match full {
            MemoryFull::Account { account, .. } => ("uploads_full", account.flag()),
            MemoryFull::Process { .. } => ("memory_full", "--memory-bytes"),
        };
        Self::new(ErrorKind::Busy, code, full.to_string()).flag(flag).retry_after(1)
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        let detail = error.to_string();
        match error {
            StoreError::TooLarge { .. } => {
                Self::new(ErrorKind::TooLarge, "mesh_too_large", detail).flag("--mesh-bytes")
            }
            StoreError::Full => Self::new(ErrorKind::Busy, "memory_full", detail).flag("--memory-bytes").retry_after(1),
            StoreError::Busy { flag } => Self::new(ErrorKind::Busy, "meshes_full", detail).flag(flag).retry_after(1),
        }
    }
}

impl From<&Failure> for ApiError {
    fn from(failure: &Failure) -> Self {
        match failure {
            Failure::Render(error) => error.into(),
            Failure::TimeUp { .. } => Self::deadline(failure.to_string()),
            Failure::Crashed { .. } => Self::new(ErrorKind::Content, "crashed", failure.to_string()),
            Failure::Recorded(record) => record.into(),
            Failure::Panicked | Failure::Lost => Self::internal(),
        }
    }
}

impl From<&RenderError> for ApiError {
    fn from(error: &RenderError) -> Self {
        match error {
            RenderError::Mesh(error) => error.into(),
            RenderError::Plan(error) => error.into(),
            RenderError::Stopped(stopped) => Self::deadline(stopped.to_string()),
            RenderError::Draw(DrawError::Stopped(stopped)) => Self::deadline(stopped.to_string()),
            RenderError::Draw(DrawError::DeviceLost(_)) => {
                let detail = "the GPU of this server was lost while drawing; try again, or ask for backend=cpu";
                Self::new(ErrorKind::Unavailable, "device_lost", detail).retry_after(1)
            }
            // Only with `backend=gpu`: `auto` goes on with the CPU.
            RenderError::Draw(DrawError::NoGpu(_)) => {
                let detail = "this server has no GPU that can be used; ask for backend=auto or backend=cpu \
                              (backend.gpu at /v1/capabilities says why)";
                Self::new(ErrorKind::Content, "backend_unavailable", detail)
            }
            RenderError::Draw(_) => {
                let detail = "the GPU of this server cannot draw this; ask for backend=auto or backend=cpu";
                Self::new(ErrorKind::Content, "backend_unavailable", detail)
            }
            RenderError::Encode(_) => Self::internal(),
        }
    }
}

impl From<&PlanError> for ApiError {
    fn from(error: &PlanError) -> Self {
        match error {
            PlanError::Limit(limit) => limit.into(),
            PlanError::Stopped(stopped) => Self::deadline(stopped.to_string()),
            other => Self::new(ErrorKind::Content, other.code(), other.to_string()),
        }
    }
}

impl From<&MeshError> for ApiError {
    fn from(error: &MeshError) -> Self {
        let kind = match &error.fault {
            MeshFault::Limit(limit) => return limit.into(),
            MeshFault::Stopped => return Self::deadline(error.detail.clone()),
            MeshFault::Unrecognised => ErrorKind::UnknownFormat,
            _ => ErrorKind::Content,
        };
        Self::new(kind, error.fault.code(), error.detail.clone())
    }
}

impl From<&LimitExceeded> for ApiError {
    fn from(limit: &LimitExceeded) -> Self {
        Self::new(ErrorKind::Content, "limit_exceeded", limit.to_string()).flag(limit.flag)
    }
}
