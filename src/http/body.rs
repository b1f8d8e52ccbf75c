//! Reads a request's body within its limits: size, memory shared with other uploads, and time.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest as _, Multipart, Request};
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::{Stream, StreamExt as _};

use super::error::ApiError;
use crate::jobs::{Bodies, Reservation};

/// What a body holds.
#[derive(Debug)]
pub struct Upload {
    /// The mesh file.
    pub mesh: Bytes,
    /// The request document, if the body is a multipart form that has one.
    pub document: Option<Bytes>,
    /// The memory that the two take.
    pub reservation: Reservation,
}

/// Within which a body is read.
pub struct BodyLimits<'a> {
    /// Largest body.
    pub bytes: u64,
    /// For all of it.
    pub time: Duration,
    /// Memory shared with other uploads.
    pub bodies: &'a Arc<Bodies>,
}

/// Refuses what can be refused from the header alone, before a byte is read and before `100 Continue` is sent.
pub fn check_header(headers: &HeaderMap, bytes_max: u64) -> Result<(), ApiError> {
    let length = headers.get(header::CONTENT_LENGTH).and_then(|v| v.to_str().ok()).and_then(|v| v.parse::<u64>().ok());
    if length.is_some_and(|length| length > bytes_max) {
        return Err(ApiError::body_too_large(bytes_max));
    }
    if media_type(headers).is_some_and(|t| t.eq_ignore_ascii_case("application/zip")) {
        return Err(zip());
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|v| !v.as_bytes().eq_ignore_ascii_case(b"identity")) {
        let detail = "a Content-Encoding is not understood; send the body as it is";
        return Err(ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "content_encoding", detail));
    }
    Ok(())
}

/// Whether the body is a form.
pub fn is_multipart(headers: &HeaderMap) -> bool {
    media_type(headers).is_some_and(|t| t.eq_ignore_ascii_case("multipart/form-data"))
}

/// Reads the body: the bytes of a mesh file, or a form with one.
pub async fn read(request: Request, limits: BodyLimits<'_>) -> Result<Upload, ApiError> {
    let reading = async {
        let multipart = is_multipart(request.headers());
        let (parts, body) = request.into_parts();
        let meter = Meter::new(limits.bytes, limits.bodies);
        if multipart {
            let body = Body::from_stream(metered(body, meter.clone()));
            form(Request::from_parts(parts, body), &meter).await
        } else {
            let mesh = whole(metered(body, meter.clone()), &meter).await?;
            Ok(Upload { mesh, document: None, reservation: meter.reservation() })
        }
    };
    let upload = tokio::time::timeout(limits.time, reading).await.unwrap_or_else(|_| Err(too_slow(limits.time)))?;
    if upload.mesh.starts_with(b"PK\x03\x04") {
        return Err(zip());
    }
    Ok(upload)
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

async fn form(request: Request, meter: &Meter) -> Result<Upload, ApiError> {
    let bad = |detail: String| ApiError::new(StatusCode::BAD_REQUEST, "bad_form", detail);
    let broken = |error: axum::extract::multipart::MultipartError| {
        meter.fault_or(|| bad(format!("the form cannot be read: {}", error.body_text())))
    };
    let mut form = Multipart::from_request(request, &()).await.map_err(|e| bad(e.body_text()))?;
    let (mut mesh, mut document) = (None, None);
    while let Some(field) = form.next_field().await.map_err(broken)? {
        let name = field.name().unwrap_or_default().to_owned();
        let place = match name.as_str() {
            "file" => &mut mesh,
            "request" => &mut document,
            _ => {
                let name: String = name.chars().take(40).collect();
                return Err(bad(format!("a form part is named {name:?}, and allowed are `file` and `request`")));
            }
        };
        if place.is_some() && name == "file" {
            let detail = "the form has several `file` parts, and bundles are not read by this version; send one file";
            return Err(ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "bundle_not_supported", detail));
        }
        if place.is_some() {
            return Err(bad("the form has several `request` parts; send at most one".into()));
        }
        *place = Some(field.bytes().await.map_err(broken)?);
    }
    let mesh = mesh.ok_or_else(|| bad("the form has no `file` part; send the mesh as one".into()))?;
    Ok(Upload { mesh, document, reservation: meter.reservation() })
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
    bodies: Arc<Bodies>,
}

struct MeterState {
    seen: u64,
    reservation: Reservation,
    fault: Option<ApiError>,
}

impl Meter {
    fn new(limit: u64, bodies: &Arc<Bodies>) -> Self {
        let state = MeterState { seen: 0, reservation: bodies.reserve(), fault: None };
        Self { limit, inner: Arc::new(Mutex::new(state)), bodies: bodies.clone() }
    }

    fn count(&self, bytes: u64) -> Result<(), Broken> {
        let mut state = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        state.seen += bytes;
        let counted = if state.seen > self.limit {
            Err(ApiError::body_too_large(self.limit))
        } else {
            state.reservation.grow(bytes).map_err(ApiError::from)
        };
        counted.map_err(|fault| {
            state.fault = Some(fault);
            Broken
        })
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

fn zip() -> ApiError {
    let detail = "zip bundles are not read by this version; send one self-contained mesh file";
    ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "bundle_not_supported", detail)
}

fn too_slow(limit: Duration) -> ApiError {
    let detail = format!("the request body did not arrive within {} ms", limit.as_millis());
    ApiError::new(StatusCode::REQUEST_TIMEOUT, "body_timeout", detail).flag(Some("--body-timeout-ms"))
}
