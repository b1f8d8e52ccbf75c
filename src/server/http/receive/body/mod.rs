//! The reading of a request's body within its limits: its size, the number of its files, the memory that all uploads
//! share, its time, and its least speed. A body is one file (a mesh, or the request document for a stored one), a zip
//! archive, or a form with files.

pub mod sides;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest as _, Multipart, Request};
use axum::http::{HeaderMap, header};
use futures_util::{Stream, StreamExt as _, stream};

use crate::http::error::{ApiError, ErrorKind};
use crate::jobs::Refusal;
use crate::memory::{Account, Memory, MemoryShare};
use meshsnap_render::import::{Bundle, BundleFile};
use meshsnap_render::limits;

/// Most bytes between two parts of a form: boundary and headers. The parser searches them from the
/// start with every chunk that arrives, so that their cost grows with the square.
const BETWEEN_PARTS_BYTES_MAX: u64 = 256 << 10;

/// Time in which an upload must go on to keep its memory while others find none.
const STALL: Duration = Duration::from_secs(2);

/// Time over which the speed of an upload is measured otherwise.
const RATE_WINDOW: Duration = Duration::from_secs(10);

/// The content of a body.
#[derive(Debug)]
pub struct Upload {
    /// The mesh and the files beside it; of [`BodyKind::Meshes`], each file is a mesh of its own.
    pub bundle: Bundle,
    /// The kind of body that it came in.
    pub kind: BodyKind,
    /// The request document, if the body is a multipart form that has one.
    pub document: Option<Bytes>,
    /// The memory that bundle and document take.
    pub reservation: MemoryShare,
}

/// Kinds of bodies, by `Content-Type`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// The bytes of a file.
    Raw,
    /// The bytes of a zip archive.
    Archive,
    /// A form with files of one mesh.
    Form,
    /// A form with several meshes, for a job each.
    Meshes,
}

/// The limits within which a body is read.
pub struct BodyLimits<'a> {
    /// Most bytes of the body.
    pub bytes: u64,
    /// Most files in a form.
    pub files: u64,
    /// Most meshes in a form, each for a job of its own. None: such forms are not taken here.
    pub meshes: Option<u64>,
    /// Longest time for the whole body.
    pub time: Duration,
    /// Least bytes a second; 0: any.
    pub least_rate: u64,
    /// The memory of the process.
    pub memory: &'a Arc<Memory>,
}

/// Refuses what can be refused from the header alone. This comes before a byte is read, and so
/// before `100 Continue` is sent.
pub fn check_header(headers: &HeaderMap, bytes_max: u64) -> Result<(), ApiError> {
    if announced_length(headers).is_some_and(|length| length > bytes_max) {
        return Err(ApiError::body_too_large(bytes_max));
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|v| !v.as_bytes().eq_ignore_ascii_case(b"identity")) {
        let detail = "a Content-Encoding is not understood; send the body as it is";
        return Err(ApiError::new(ErrorKind::UnknownFormat, "content_encoding", detail));
    }
    Ok(())
}

/// The announced length of the body, if there is one.
pub fn announced_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// True if the `Content-Type` is JSON.
pub fn is_json(headers: &HeaderMap) -> bool {
    has_media_type(headers, "application/json")
}

/// True if the `Content-Type` is a multipart form.
pub fn is_multipart(headers: &HeaderMap) -> bool {
    has_media_type(headers, "multipart/form-data")
}

/// The error for a malformed form, or one with missing or unexpected parts.
pub fn bad_form(detail: impl Into<String>) -> ApiError {
    ApiError::new(ErrorKind::BadRequest, "bad_form", detail)
}

/// Reads the body: a mesh file, a zip archive, or a form with files.
pub async fn read(request: Request, limits: BodyLimits<'_>) -> Result<Upload, ApiError> {
    let reading = async {
        let (parts, body) = request.into_parts();
        let most = limits.memory.cap(Account::Uploads);
        if announced_length(&parts.headers).is_some_and(|length| length > most) {
            return Err(ApiError::body_beyond_memory(most));
        }
        let meter = Meter::new(&limits);
        let chunks = metered(body, meter.clone());
        if is_multipart(&parts.headers) {
            let most = (limits.files, limits.meshes);
            read_form(Request::from_parts(parts, Body::from_stream(chunks)), &meter, most).await
        } else {
            let is_zip = has_media_type(&parts.headers, "application/zip");
            let bytes = read_whole(chunks, &meter).await?;
            // A worker opens the archive later, because unpacking takes long.
            let (bundle, kind) = match is_zip {
                true => (Bundle::zip(bytes), BodyKind::Archive),
                false => (Bundle::of_one(bytes), BodyKind::Raw),
            };
            Ok(Upload { bundle, kind, document: None, reservation: meter.take_reservation() })
        }
    };
    tokio::time::timeout(limits.time, reading).await.unwrap_or_else(|_| Err(too_slow(limits.time)))
}

async fn read_whole(chunks: impl Stream<Item = Result<Bytes, Interrupted>>, meter: &Meter) -> Result<Bytes, ApiError> {
    let mut chunks = std::pin::pin!(chunks);
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.next().await {
        // The vector grows as bytes arrive: a length that is only announced gets no memory.
        bytes.extend_from_slice(&chunk.map_err(|interrupted| meter.error(interrupted))?);
    }
    Ok(bytes.into())
}

async fn read_form(
    request: Request,
    meter: &Meter,
    (files_max, meshes_max): (u64, Option<u64>),
) -> Result<Upload, ApiError> {
    let broken = |error: axum::extract::multipart::MultipartError| {
        meter.error_or(|| bad_form(format!("the form cannot be read: {}", error.body_text())))
    };
    let mut form = Multipart::from_request(request, &()).await.map_err(|e| bad_form(e.body_text()))?;
    let (mut files, mut document): (Vec<BundleFile>, _) = (Vec::new(), None);
    // Known from the first file on.
    let mut kind = None;
    loop {
        meter.set_between_parts(true);
        let Some(field) = form.next_field().await.map_err(broken)? else { break };
        meter.set_between_parts(false);
        match field.name().unwrap_or_default() {
            part @ ("file" | "mesh") if kind.is_some_and(|kind| kind != kind_of(part)) => {
                return Err(bad_form(format!(
                    "the form has a `{part}` part beside others; `file` parts are one mesh, `mesh` parts are a job each, \
                     and a mesh with files beside it is sent as a zip"
                )));
            }
            "mesh" => {
                let Some(most) = meshes_max else {
                    let detail =
                        "`mesh` parts are a job each, which POST /v1/jobs takes; here the mesh is a `file` part";
                    return Err(bad_form(detail));
                };
                kind = Some(BodyKind::Meshes);
                let count = files.len() as u64 + 1;
                if count > most {
                    return Err(ApiError::from(Refusal::TooMany { most }));
                }
                let unnamed = format!("mesh {count}");
                let name = field.file_name().filter(|name| !name.is_empty()).unwrap_or(&unnamed);
                let mut file = BundleFile::new(name, Bytes::new()).map_err(|error| bad_form(error.to_string()))?;
                file.bytes = field.bytes().await.map_err(broken)?;
                files.push(file);
            }
            "file" => {
                kind = Some(BodyKind::Form);
                let count = files.len() as u64 + 1;
                limits::check("the number of files in the form", count, files_max, "--limit-bundle-entries")
                    .map_err(|limit| ApiError::from(&limit))?;
                // The name is checked before the bytes are read, so that a bad one costs nothing.
                let mut file = empty_file(field.file_name(), (files.len(), "file"))?;
                file.check_new(&files).map_err(|e| bad_form(format!("{e}; each `file` part needs its own")))?;
                file.bytes = field.bytes().await.map_err(broken)?;
                files.push(file);
            }
            "request" if document.is_some() => {
                return Err(bad_form("the form has several `request` parts; send at most one"));
            }
            "request" => document = Some(field.bytes().await.map_err(broken)?),
            other => {
                let name: String = other.chars().take(40).collect();
                return Err(bad_form(format!(
                    "a form part is named {name:?}, and allowed are `file`, `mesh` and `request`"
                )));
            }
        }
    }
    let Some(kind) = kind else {
        return Err(bad_form("the form has no `file` part; send the mesh as one"));
    };
    let bundle = Bundle::of_files(files);
    Ok(Upload { bundle, kind, document, reservation: meter.take_reservation() })
}

fn kind_of(part: &str) -> BodyKind {
    if part == "mesh" { BodyKind::Meshes } else { BodyKind::Form }
}

/// A file without bytes, under the name that its part gives. The first part needs no name.
fn empty_file(name: Option<&str>, (files_before, part): (usize, &str)) -> Result<BundleFile, ApiError> {
    let name = match name {
        None | Some("") if files_before == 0 => "mesh",
        None | Some("") => {
            return Err(bad_form(format!("`{part}` part {} of the form has no filename", files_before + 1)));
        }
        Some(name) => name,
    };
    BundleFile::new(name, Bytes::new()).map_err(|error| bad_form(error.to_string()))
}

/// The error of a body that ended early. The [`Meter`] holds the cause if a limit was hit.
#[derive(Debug, thiserror::Error)]
#[error("the body broke off")]
struct Interrupted;

/// Counts bytes as they arrive, reserves their memory, and keeps the error that stopped it.
#[derive(Clone)]
struct Meter {
    bytes_max: u64,
    least_rate: u64,
    memory: Arc<Memory>,
    state: Arc<Mutex<MeterState>>,
}

struct MeterState {
    bytes: u64,
    /// Bytes since the last part of a form, while the parser searches the next one.
    bytes_between_parts: Option<u64>,
    reservation: MemoryShare,
    error: Option<ApiError>,
}

impl Meter {
    fn new(limits: &BodyLimits<'_>) -> Self {
        let BodyLimits { bytes: bytes_max, least_rate, memory, .. } = *limits;
        let reservation = memory.share(Account::Uploads);
        let state = MeterState { bytes: 0, bytes_between_parts: None, reservation, error: None };
        Self { bytes_max, least_rate, memory: memory.clone(), state: Arc::new(Mutex::new(state)) }
    }

    fn count(&self, bytes: u64) -> Result<(), Interrupted> {
        let mut state = self.lock();
        state.bytes += bytes;
        let before = state.bytes_between_parts;
        state.bytes_between_parts = before.map(|seen| seen + bytes);
        let counted = if state.bytes > self.bytes_max {
            Err(ApiError::body_too_large(self.bytes_max))
        } else if state.bytes > self.memory.cap(Account::Uploads) {
            Err(ApiError::body_beyond_memory(self.memory.cap(Account::Uploads)))
        // The chunk that ends the search may hold much of the part's content, so it does not count.
        } else if before.is_some_and(|seen| seen > BETWEEN_PARTS_BYTES_MAX) {
            Err(bad_form(format!(
                "the form has no part within {BETWEEN_PARTS_BYTES_MAX} bytes; is its boundary the announced one?"
            )))
        } else {
            state.reservation.grow(bytes).map_err(ApiError::from)
        };
        counted.map_err(|error| {
            state.error = Some(error);
            Interrupted
        })
    }

    /// Keeps the error that stops the reading.
    fn stop(&self, error: ApiError) -> Interrupted {
        self.lock().error = Some(error);
        Interrupted
    }

    /// Starts or ends the count of bytes between two parts of a form.
    fn set_between_parts(&self, is_between: bool) {
        self.lock().bytes_between_parts = is_between.then_some(0);
    }

    /// The error that stopped the meter, or another one if nothing did.
    fn error_or(&self, otherwise: impl FnOnce() -> ApiError) -> ApiError {
        self.lock().error.take().unwrap_or_else(otherwise)
    }

    fn error(&self, _: Interrupted) -> ApiError {
        self.error_or(|| {
            let detail = "the request body ended before its announced end";
            ApiError::new(ErrorKind::BadRequest, "body_incomplete", detail)
        })
    }

    /// Hands over the memory that was reserved so far.
    fn take_reservation(&self) -> MemoryShare {
        std::mem::replace(&mut self.lock().reservation, self.memory.share(Account::Uploads))
    }

    fn lock(&self) -> MutexGuard<'_, MeterState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The chunks of a body, counted. It ends with an error where the client sends more slowly than it may.
fn metered(body: Body, meter: Meter) -> impl Stream<Item = Result<Bytes, Interrupted>> + Send {
    let pace = Pace::new(&meter.memory);
    stream::unfold((body.into_data_stream(), meter, pace), |(mut chunks, meter, mut pace)| async move {
        let chunk = loop {
            match tokio::time::timeout(STALL, chunks.next()).await {
                Ok(chunk) => {
                    let chunk = chunk?.map_err(|_| Interrupted);
                    pace.bytes += chunk.as_ref().map_or(0, |chunk| chunk.len() as u64);
                    break pace.check(&meter).and(chunk);
                }
                Err(_) => {
                    if let Err(interrupted) = pace.check(&meter) {
                        break Err(interrupted);
                    }
                }
            }
        };
        let counted = chunk.and_then(|chunk| meter.count(chunk.len() as u64).map(|()| chunk));
        Some((counted, (chunks, meter, pace)))
    })
}

/// The speed of an upload, from window to window.
struct Pace {
    since: Instant,
    bytes: u64,
    /// Uploads that had found no room when the window began.
    refusals: u64,
}

impl Pace {
    fn new(memory: &Memory) -> Self {
        Self { since: Instant::now(), bytes: 0, refusals: memory.refusals(Account::Uploads) }
    }

    /// Refuses an upload that is too slow. While others find no room, a window is short.
    fn check(&mut self, meter: &Meter) -> Result<(), Interrupted> {
        let (time, is_in_the_way) = (self.since.elapsed(), meter.memory.refusals(Account::Uploads) != self.refusals);
        let window = if is_in_the_way { STALL } else { RATE_WINDOW };
        if time < window {
            return Ok(());
        }
        let wanted = (meter.least_rate as f64 * time.as_secs_f64()) as u64;
        if is_in_the_way && (self.bytes == 0 || self.bytes < wanted) {
            return Err(meter.stop(stalled()));
        }
        if self.bytes < wanted {
            return Err(meter.stop(below_rate(meter.least_rate)));
        }
        *self = Self::new(&meter.memory);
        Ok(())
    }
}

/// The error of a client that sends a few bytes now and then.
fn below_rate(least_rate: u64) -> ApiError {
    let detail = format!("the request body arrived with fewer than {least_rate} bytes a second");
    ApiError::new(ErrorKind::TooSlow, "body_timeout", detail).flag("--least-rate-bytes")
}

/// The error of a client that holds memory, sends nothing or hardly anything, and is in others' way.
fn stalled() -> ApiError {
    let detail = "the request body stopped arriving while other uploads waited for the memory that it holds";
    ApiError::new(ErrorKind::TooSlow, "body_timeout", detail).flag("--uploads-bytes")
}

fn has_media_type(headers: &HeaderMap, wanted: &str) -> bool {
    let value = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    value.and_then(|value| value.split(';').next()).is_some_and(|t| t.trim().eq_ignore_ascii_case(wanted))
}

fn too_slow(limit: Duration) -> ApiError {
    let detail = format!("the request body did not arrive within {} ms", limit.as_millis());
    ApiError::new(ErrorKind::TooSlow, "body_timeout", detail).flag("--body-timeout-ms")
}
