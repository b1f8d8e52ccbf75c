//! `/v1/meshes`: meshes that stay, so that each is sent once.
//!
//! A stored mesh is its bytes. How they are read (`format_in`, `entry`) is said wherever they are, so that every address with
//! its query means the same for ever.

use std::sync::Arc;

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::render;
use crate::service::http::app::App;
use crate::service::http::conditional;
use crate::service::http::conditional::{day, etag};
use crate::service::http::dto::MeshDto;
use crate::service::http::error::ApiError;
use crate::service::http::receive::body;
use crate::service::http::receive::query::Query;
use crate::service::http::receive::upload;
use crate::service::http::receive::upload::Named;
use crate::service::jobs::{State as JobState, Task, Work};
use crate::service::store::{Digest, NewMesh, Reading, StoredMesh};

/// What the path says in place of a digest; not even text, perhaps.
pub type MeshPath = Result<Path<String>, PathRejection>;

/// Stores a mesh under its digest.
pub async fn post(State(app): State<Arc<App>>, request: Request) -> Result<Response, ApiError> {
    store(&app, request, None).await
}

/// Stores a mesh whose digest the client has worked out.
pub async fn put(State(app): State<Arc<App>>, id: MeshPath, request: Request) -> Result<Response, ApiError> {
    let digest = digest(id.ok().map(|Path(id)| id).as_deref())?;
    store(&app, request, Some(digest)).await
}

/// The report on a mesh. HEAD only asks whether it is there.
pub async fn get(
    State(app): State<Arc<App>>,
    id: MeshPath,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let (reading, time_s) = Query::moment(&uri, &app.rules)?;
    let stored = find(&app, id.ok().map(|Path(id)| id).as_deref())?;
    let tag = tag(stored.mesh.digest, &reading, time_s);
    let cached = [etag(&tag), day(!app.api_keys.is_empty())];
    if conditional::is_known(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, cached).into_response());
    }
    let body = if stored.mesh.reading == reading && time_s.is_none() {
        Body::from(stored.mesh.report.clone())
    } else if method == Method::HEAD {
        unmade()
    } else {
        Body::from(done(&app, work(&stored, reading, Task::Inspect { time_s })).await?)
    };
    let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))];
    Ok((cached, media_type, body).into_response())
}

/// Forgets a mesh. Who draws it can go on.
pub async fn delete(State(app): State<Arc<App>>, id: MeshPath) -> Result<Response, ApiError> {
    match app.meshes.remove(digest(id.ok().map(|Path(id)| id).as_deref())?) {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => Err(unknown()),
    }
}

/// The stored mesh of this name.
pub fn find(app: &App, name: Option<&str>) -> Result<Arc<StoredMesh>, ApiError> {
    app.meshes.find(digest(name)?).ok_or_else(unknown)
}

/// The digest that a path names.
fn digest(name: Option<&str>) -> Result<Digest, ApiError> {
    name.and_then(Digest::parse).ok_or_else(|| {
        let detail = "the path names no SHA-256, which is 64 lower-case hexadecimal digits";
        ApiError::new(StatusCode::BAD_REQUEST, "bad_digest", detail)
    })
}

/// What a worker does with a stored mesh.
pub fn work(stored: &StoredMesh, reading: Reading, task: Task) -> Work {
    let Reading { format_in, entry } = reading;
    let bundle = stored.mesh.bundle.clone().with_entry(entry);
    Work { bundle, format_in, task, memory: stored.memory.clone() }
}

/// The body of an answer to HEAD where what GET would send has not been made: its length is not known.
pub fn unmade() -> Body {
    Body::from_stream(futures_util::stream::empty::<Result<Bytes, std::convert::Infallible>>())
}

async fn store(app: &Arc<App>, request: Request, wanted: Option<Digest>) -> Result<Response, ApiError> {
    let reading = Query::reading(request.uri(), &app.rules)?;
    body::check_header(request.headers(), app.rules.limits.body_bytes)?;
    if let Some(length) = body::length(request.headers()).filter(|_| !body::is_multipart(request.headers())) {
        app.meshes.check_size(length)?;
    }
    app.jobs.would_accept()?;
    let Named { digest, bundle, memory } = upload::name(body(app, request).await?).await?;
    if let Some(wanted) = wanted.filter(|wanted| *wanted != digest) {
        let detail = format!("the path says {wanted}, and the SHA-256 of what was sent is {digest}");
        return Err(ApiError::new(StatusCode::UNPROCESSABLE_ENTITY, "digest_mismatch", detail));
    }
    app.meshes.check_size(bundle.bytes_len())?;
    let body = MeshDto::new(digest, &bundle);
    // What was once read like this need not be read again.
    let is_known = app.meshes.find(digest).is_some_and(|stored| stored.mesh.reading == reading);
    let is_new = !is_known && {
        let Reading { format_in, entry } = reading.clone();
        let task = Task::Inspect { time_s: None };
        let work = Work { bundle: bundle.clone().with_entry(entry), format_in, task, memory: memory.clone() };
        let report = done(app, work).await?;
        app.meshes.insert(NewMesh { digest, bundle, reading, report })?
    };
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let location = HeaderValue::from_str(&body.url).unwrap_or_else(|_| HeaderValue::from_static("/v1/meshes"));
    let no_store = HeaderValue::from_static("no-store");
    let headers = [
        etag(&tag(digest, &Reading::default(), None)),
        (header::LOCATION, location),
        (header::CACHE_CONTROL, no_store),
    ];
    Ok((status, headers, Json(body)).into_response())
}

/// Has a worker say what is in a bundle; that it is a mesh, in the first place.
async fn done(app: &App, work: Work) -> Result<Bytes, ApiError> {
    match render::done(app, work).await? {
        JobState::Inspected(report) => Ok(report),
        _ => Err(ApiError::internal()),
    }
}

/// The mesh's name; where it is read in a way of its own or at a moment, that too.
fn tag(digest: Digest, reading: &Reading, time_s: Option<f64>) -> String {
    if *reading == Reading::default() && time_s.is_none() {
        return format!("\"{digest}\"");
    }
    let moment = time_s.map_or_else(String::new, |time_s| format!(" {time_s:?}"));
    format!("\"{}\"", Digest::of(format!("{digest} {reading:?}{moment}").as_bytes()))
}

fn unknown() -> ApiError {
    let detail =
        "no mesh of this name is stored: it never was, or was deleted, or made room for others; send it to /v1/meshes";
    ApiError::new(StatusCode::NOT_FOUND, "mesh_unknown", detail)
}
