//! `/v1/meshes`: stored meshes, which are sent once and drawn often.
//!
//! The name of a stored mesh follows from its files alone. How they are read (`format_in`, `entry`) is part of each
//! URL, so that a URL with its query always means the same.

use std::sync::Arc;

use axum::Json;
use axum::body::Body;
use axum::extract::{Extension, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::{PathName, responses, run, text_of};
use crate::digest::Digest;
use crate::durable::{Change, FileRecord, MeshRecord};
use crate::http::conditional;
use crate::http::dto::MeshDto;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::receive::query::Query;
use crate::http::receive::upload::{self, NamedUpload};
use crate::http::receive::{self, body};
use crate::http::state::AppState;
use crate::http::stored_mesh::{self, shared};
use crate::jobs::{Class, Owner, Task, Work};
use crate::keys::Access;
use crate::store::{NewMesh, Reading, Removed};

/// Stores a mesh under its digest.
pub async fn post(State(state): State<Arc<AppState>>, request: Request) -> Result<Response, ApiError> {
    store(&state, request, None).await
}

/// Stores a mesh whose digest the client computed.
pub async fn put(State(state): State<Arc<AppState>>, id: PathName, request: Request) -> Result<Response, ApiError> {
    let digest = stored_mesh::digest(text_of(id).as_deref())?;
    store(&state, request, Some(digest)).await
}

/// The report on a mesh. HEAD tells whether the mesh is stored.
pub async fn get(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    id: PathName,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let (reading, time_s) = Query::read_for_report(&uri, &state.rules)?;
    let stored = stored_mesh::find(&state, text_of(id).as_deref(), &access).await?;
    let tag = report_tag(stored.mesh.digest, &reading, time_s);
    let cached = [conditional::etag(&tag), conditional::cache_for_a_day(!access.is_open())];
    if conditional::is_known(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, cached).into_response());
    }
    let body = if stored.mesh.reading == reading && time_s.is_none() {
        Body::from(stored.mesh.report.clone())
    } else if method == Method::HEAD {
        responses::body_of_unknown_length()
    } else {
        let work = Work { owner: access.owner, ..stored_mesh::work_on(&stored, reading, Task::Inspect { time_s }) };
        Body::from(run::inspect(&state, work).await?)
    };
    let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))];
    Ok((cached, media_type, body).into_response())
}

/// Removes a mesh; other keys that have stored it keep it. Jobs that already draw it go on.
pub async fn delete(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    id: PathName,
) -> Result<Response, ApiError> {
    let digest = stored_mesh::digest(text_of(id).as_deref())?;
    let removed = match &state.shared {
        Some(shared) => shared::delete_mesh(&state, shared, digest, &access).await?,
        None => stored_mesh::remove(&state, digest, &access),
    };
    match removed {
        Removed::Gone | Removed::OfOthers => Ok(StatusCode::NO_CONTENT.into_response()),
        Removed::Unknown => Err(stored_mesh::unknown()),
    }
}

async fn store(state: &AppState, request: Request, wanted: Option<Digest>) -> Result<Response, ApiError> {
    let reading = Query::read_for_upload(request.uri(), &state.rules)?;
    let headers = request.headers();
    body::check_header(headers, state.body_bytes_max)?;
    // A form's length is not the mesh's, because the form has boundaries and headers as well.
    if let Some(length) = body::announced_length(headers).filter(|_| !body::is_multipart(headers)) {
        state.meshes.check_size(length)?;
    }
    let access = receive::access_of(&request);
    state.jobs.would_accept(Class::Interactive, &access.owner)?;
    let NamedUpload { digest, bundle, memory } = upload::name(receive::read_upload(state, request).await?).await?;
    if let Some(wanted) = wanted.filter(|wanted| *wanted != digest) {
        let detail = format!("the path says {wanted}, and the SHA-256 of what was sent is {digest}");
        return Err(ApiError::new(ErrorKind::Content, "digest_mismatch", detail));
    }
    state.meshes.check_size(bundle.bytes_len())?;
    let body = MeshDto::new(digest, &bundle);
    // A mesh that was read in this way before need not be read again.
    let known = state.meshes.find(digest, &access).filter(|stored| stored.mesh.reading == reading);
    // Where servers share a store, another one may have deleted it.
    let is_known = known.is_some() && state.shared.is_none();
    let is_new = !is_known && {
        let task = Task::Inspect { time_s: None };
        let read = stored_mesh::work(bundle.clone(), reading.clone(), task, memory.clone());
        let work = Work { owner: access.owner.clone(), ..read };
        let report = match known {
            Some(known) => known.mesh.report.clone(),
            None => run::inspect(state, work).await?,
        };
        // Addresses are no identity: without keys, a mesh is everybody's.
        let owners = vec![if access.is_open() { Owner::default() } else { access.owner.clone() }];
        let mesh = NewMesh { digest, bundle, reading, report, owners };
        match &state.shared {
            Some(shared) => shared::store_mesh(state, shared, mesh, &access).await?,
            None => insert(state, mesh).await?,
        }
    };
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let headers = [
        conditional::etag(&report_tag(digest, &Reading::default(), None)),
        (header::LOCATION, responses::header_text(&body.url)),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    Ok((status, headers, Json(body)).into_response())
}

/// Stores a mesh, in the data folder first, so that an answer promises nothing that a crash can take back.
async fn insert(state: &AppState, mesh: NewMesh) -> Result<bool, ApiError> {
    let Some(durable) = state.durable.clone() else { return Ok(state.meshes.insert(mesh, [].into())?) };
    state.meshes.check_size(mesh.bundle.bytes_len())?;
    let (writer, written) = (durable.clone(), mesh.clone());
    let holding = tokio::task::spawn_blocking(move || {
        let files = written.bundle.files().iter().map(|file| &file.bytes);
        files.chain([&written.report]).map(|bytes| writer.hold(bytes)).collect::<Result<Vec<_>, _>>()
    });
    let holds = holding.await.map_err(|_| ApiError::internal())??;
    let digests = holds.iter().map(|hold| hold.digest());
    let files = mesh.bundle.files().iter().zip(digests);
    let record = MeshRecord {
        digest: mesh.digest,
        files: files.map(|(file, digest)| FileRecord { path: file.path.clone(), digest }).collect(),
        format_in: mesh.reading.format_in.map(|format| format.name().to_owned()),
        entry: mesh.reading.entry.clone(),
        owner: mesh.owners.first().map(ToString::to_string).unwrap_or_default(),
        later_owners: Vec::new(),
        report: Digest::of(&mesh.report),
    };
    durable.store(vec![Change::MeshStored(Box::new(record))], holds.clone()).await?;
    let digest = mesh.digest;
    state.meshes.insert(mesh, holds.into()).map_err(|error| {
        durable.store_soon(vec![Change::MeshRemoved(digest)], Vec::new());
        error.into()
    })
}

/// The tag of a report: the mesh's name, or a digest of name, way of reading and time.
fn report_tag(digest: Digest, reading: &Reading, time_s: Option<f64>) -> String {
    if *reading == Reading::default() && time_s.is_none() {
        return format!("\"{digest}\"");
    }
    let time = time_s.map_or_else(String::new, |time_s| format!(" {time_s:?}"));
    format!("\"{}\"", Digest::of(format!("{digest} {reading:?}{time}").as_bytes()))
}
