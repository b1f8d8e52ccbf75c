//! Reads a request's body within its limits: size, memory shared with other uploads, and time.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest as _, Multipart, Request};
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::{Stream, StreamExt as _};

use crate::import::{Bundle, BundleFile};
use crate::limits;
use crate::service::http::error::ApiError;
use crate::service::jobs::{Reservation, UploadBudget};

/// What a body holds.
#[derive(Debug)]
pub struct Upload {
    /// The mesh and what came along with it.
    pub bundle: Bundle,
    /// How it came.
    pub kind: BodyKind,
    /// The request document, if the body is a multipart form that has one.
    pub document: Option<Bytes>,
    /// The memory that the two take.
    pub reservation: Reservation,
}

/// What a body is, as its `Content-Type` has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// The bytes of a file.
    Raw,
    /// Those of a zip archive.
    Archive,
    /// A form with files.
    Form,
}

/// Within which a body is read.
pub struct BodyLimits<'a> {
    /// Largest body.
    pub bytes: u64,
    /// Most files of a form.
    pub files: u64,
    /// For all of it.
    pub time: Duration,
    /// Memory shared with other uploads.
    pub bodies: &'a Arc<UploadBudget>,
}

/// Refuses what can be refused from the header alone, before a byte is read and before `100 Continue` is sent.
pub fn check_header(headers: &HeaderMap, bytes_max: u64) -> Result<(), ApiError> {
    if length(headers).is_some_and(|length| length > bytes_max) {
        return Err(ApiError::body_too_large(bytes_max));
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|v| !v.as_bytes().eq_ignore_ascii_case(b"identity")) {
        let detail = "a Content-Encoding is not understood; send the body as it is";
        return Err(ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "content_encoding", detail));
    }
    Ok(())
}

/// The length that is announced, if one is.
pub fn length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Whether the body is said to be JSON.
pub fn is_json(headers: &HeaderMap) -> bool {
    media_type(headers).is_some_and(|t| t.eq_ignore_ascii_case("application/json"))
}

/// Whether the body is a form.
pub fn is_multipart(headers: &HeaderMap) -> bool {
    media_type(headers).is_some_and(|t| t.eq_ignore_ascii_case("multipart/form-data"))
}

/// Reads the body: the bytes of a mesh file or of a zip archive, or a form with files.
pub async fn read(request: Request, limits: BodyLimits<'_>) -> Result<Upload, ApiError> {
    let reading = async {
        let multipart = is_multipart(request.headers());
        let is_zip = media_type(request.headers()).is_some_and(|t| t.eq_ignore_ascii_case("application/zip"));
        let (parts, body) = request.into_parts();
        let meter = Meter::new(limits.bytes, limits.bodies);
        if multipart {
            let body = Body::from_stream(metered(body, meter.clone()));
            form(Request::from_parts(parts, body), &meter, limits.files).await
        } else {
            let bytes = whole(metered(body, meter.clone()), &meter).await?;
            // An archive stays closed until a worker opens it: unpacking is work.
            let (bundle, kind) = match is_zip {
                true => (Bundle::zip(bytes), BodyKind::Archive),
                false => (Bundle::of_one(bytes), BodyKind::Raw),
            };
            Ok(Upload { bundle, kind, document: None, reservation: meter.reservation() })
        }
    };
    tokio::time::timeout(limits.time, reading).await.unwrap_or_else(|_| Err(too_slow(limits.time)))
}

async fn whole(chunks: impl Stream<Item = Result<Bytes, Broken>>, meter: &Meter) -> Result<Bytes, ApiError> {
    let mut chunks = std::pin::pin!(chunks);
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.next().await {
        // Grown as bytes arrive: a length that is only claimed gets no memory.
        bytes.extend_from_slice(&chunk.map_err(|broken| meter.fault(broken))?);
    }
    Ok(bytes.into())
}

/// What a form may have before a part's content: its boundary and headers. They are looked for from the start with every chunk that comes.
const BETWEEN_PARTS_MAX: u64 = 256 << 10;

async fn form(request: Request, meter: &Meter, files_max: u64) -> Result<Upload, ApiError> {
    let broken = |error: axum::extract::multipart::MultipartError| {
        meter.fault_or(|| bad_form(format!("the form cannot be read: {}", error.body_text())))
    };
    let mut form = Multipart::from_request(request, &()).await.map_err(|e| bad_form(e.body_text()))?;
    let (mut files, mut document): (Vec<BundleFile>, _) = (Vec::new(), None);
    loop {
        meter.is_between_parts(true);
        let Some(field) = form.next_field().await.map_err(broken)? else { break };
        meter.is_between_parts(false);
        match field.name().unwrap_or_default() {
            "file" => {
                let count = files.len() as u64 + 1;
                limits::check("the number of files in the form", count, files_max, "--limit-bundle-entries")
                    .map_err(|limit| ApiError::from(&limit))?;
                // Before its bytes are read, so that a bad name costs nothing.
                let mut file = named(field.file_name(), files.len())?;
                file.check_new(&files).map_err(|e| bad_form(format!("{e}; each `file` part needs its own")))?;
                file.bytes = field.bytes().await.map_err(broken)?;
                files.push(file);
            }
            "request" if document.is_some() => {
                return Err(bad_form("the form has several `request` parts; send at most one".into()));
            }
            "request" => document = Some(field.bytes().await.map_err(broken)?),
            other => {
                let name: String = other.chars().take(40).collect();
                return Err(bad_form(format!("a form part is named {name:?}, and allowed are `file` and `request`")));
            }
        }
    }
    if files.is_empty() {
        return Err(bad_form("the form has no `file` part; send the mesh as one".into()));
    }
    let bundle = Bundle::of_files(files);
    Ok(Upload { bundle, kind: BodyKind::Form, document, reservation: meter.reservation() })
}

/// An empty file by the name that its part gives. One part needs no name.
fn named(name: Option<&str>, before: usize) -> Result<BundleFile, ApiError> {
    let name = match name {
        None | Some("") if before == 0 => "mesh",
        None | Some("") => return Err(bad_form(format!("`file` part {} of the form has no filename", before + 1))),
        Some(name) => name,
    };
    BundleFile::new(name, Bytes::new()).map_err(|error| bad_form(error.to_string()))
}

/// A form that is none, or not what is wanted here.
pub fn bad_form(detail: String) -> ApiError {
    ApiError::new(StatusCode::BAD_REQUEST, "bad_form", detail)
}

/// A body that ended before its end. Why is in the [`Meter`], if it was us.
#[derive(Debug, thiserror::Error)]
#[error("the body broke off")]
struct Broken;

/// Counts bytes as they arrive, takes their memory, and remembers why it stopped.
#[derive(Clone)]
struct Meter {
    limit: u64,
    inner: Arc<Mutex<MeterState>>,
    bodies: Arc<UploadBudget>,
}

struct MeterState {
    seen: u64,
    /// What came while the next part of a form was looked for.
    seen_between_parts: Option<u64>,
    reservation: Reservation,
    fault: Option<ApiError>,
}

impl Meter {
    fn new(limit: u64, bodies: &Arc<UploadBudget>) -> Self {
        let state = MeterState { seen: 0, seen_between_parts: None, reservation: bodies.reserve(), fault: None };
        Self { limit, inner: Arc::new(Mutex::new(state)), bodies: bodies.clone() }
    }

    fn count(&self, bytes: u64) -> Result<(), Broken> {
        let mut state = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        state.seen += bytes;
        let before = state.seen_between_parts;
        state.seen_between_parts = before.map(|seen| seen + bytes);
        let counted = if state.seen > self.limit {
            Err(ApiError::body_too_large(self.limit))
        } else if before.is_some_and(|seen| seen > BETWEEN_PARTS_MAX) {
            let detail =
                format!("the form has no part within {BETWEEN_PARTS_MAX} bytes; is its boundary the announced one?");
            Err(bad_form(detail))
        } else {
            state.reservation.grow(bytes).map_err(ApiError::from)
        };
        counted.map_err(|fault| {
            state.fault = Some(fault);
            Broken
        })
    }

    /// Whether the next part of a form is looked for, or one is read.
    fn is_between_parts(&self, is_between: bool) {
        let mut state = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        state.seen_between_parts = is_between.then_some(0);
    }

    fn fault_or(&self, otherwise: impl FnOnce() -> ApiError) -> ApiError {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).fault.take().unwrap_or_else(otherwise)
    }

    fn fault(&self, _: Broken) -> ApiError {
        self.fault_or(|| {
            let detail = "the request body ended before its announced end";
            ApiError::new(StatusCode::BAD_REQUEST, "body_incomplete", detail)
        })
    }

    /// The memory taken so far; it is the caller's to give back.
    fn reservation(&self) -> Reservation {
        let mut state = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::replace(&mut state.reservation, self.bodies.reserve())
    }
}

fn metered(body: Body, meter: Meter) -> impl Stream<Item = Result<Bytes, Broken>> + Send {
    body.into_data_stream().map(move |chunk| {
        let chunk = chunk.map_err(|_| Broken)?;
        meter.count(chunk.len() as u64).map(|()| chunk)
    })
}

fn media_type(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(header::CONTENT_TYPE)?.to_str().ok()?;
    value.split(';').next().map(str::trim)
}

fn too_slow(limit: Duration) -> ApiError {
    let detail = format!("the request body did not arrive within {} ms", limit.as_millis());
    ApiError::new(StatusCode::REQUEST_TIMEOUT, "body_timeout", detail).flag(Some("--body-timeout-ms"))
}
