//! The reading of requests: from HTTP to work for a worker. The cheapest refusals come first.
//!
//! This file reads requests for pictures, and [`check`] and [`diff`] those for verdicts, whose
//! parameters [`keys`] reads. [`query`] reads the query, [`body`] the body within its limits.
//! [`meshes`] makes a job of each mesh of a form. [`sender`] tells who sends a request,
//! [`idempotency`] whether it was sent before, [`webhook`] which address is told of its job's end.
//! [`upload`] names a mesh by its content.

pub mod body;
pub mod check;
pub mod diff;
pub mod idempotency;
pub mod keys;
pub mod meshes;
pub mod query;
mod sender;
pub mod upload;
pub mod webhook;

use std::sync::Arc;

use axum::extract::Request;
use axum::http::HeaderMap;

use self::body::{BodyKind, BodyLimits, Upload};
use self::idempotency::Sent;
use self::meshes::MeshOfForm;
use self::query::Query;
use self::sender::Sender;
use super::address::{Address, render_key};
use super::error::ApiError;
use super::state::AppState;
use super::{negotiate, stored_mesh};
use crate::digest::Digest;
use crate::jobs::{Class, Job, Recipe, Task, Work};
use crate::keys::Access;
use crate::store::Reading;
use meshsnap_render::request;
use meshsnap_render::spec::Spec;

/// A request for a picture, once it is read.
pub enum Reception {
    /// One that was found valid.
    New(Box<Received>),
    /// One that was accepted before, as this job.
    Known(Arc<Job>),
    /// A form with several meshes, for a job each.
    Many(Vec<MeshOfForm>),
}

/// A request for a picture that was found valid.
pub struct Received {
    /// The work for a worker.
    pub work: Work,
    /// The render key of the picture, if the mesh is stored.
    pub key: Option<String>,
    /// The address of the picture, if the mesh is stored.
    pub address: Option<Address>,
    /// True if the picture's format depends on `Accept`.
    pub is_negotiated: bool,
}

/// Reads a request for a picture. Every fault that shows without reading the mesh is found here,
/// before it takes a worker's time. A request for a job may have been accepted before.
pub async fn receive(state: &AppState, request: Request, class: Class) -> Result<Reception, ApiError> {
    body::check_header(request.headers(), state.body_bytes_max)?;
    let query = Query::read(request.uri(), &state.rules)?;
    let sender = Sender::of(state, &request, class)?;
    // Forms and JSON may bring a document. Of every other request, the query is the whole document
    // and is checked before the upload.
    if !body::is_multipart(request.headers()) && !body::is_json(request.headers()) {
        request::read(None, &query.overrides, &state.rules).map_err(query::query_error)?;
    }
    sender.check_room(state, request.headers(), class)?;

    let headers = request.headers().clone();
    let meshes = (class == Class::Batch).then(|| state.jobs.accepted_max() as u64);
    let upload = read_body(state, request, meshes).await?;
    let named = match &sender.name {
        Some(name) => Some((name, idempotency::digest(&query, &upload, &headers).await?)),
        None => None,
    };
    if upload.kind == BodyKind::Meshes {
        return meshes::understand(state, query, upload, &headers, (&sender, named)).await.map(Reception::Many);
    }
    let claim = match named {
        Some((name, digest)) => match idempotency::check(state, name, digest).await? {
            Sent::First(claim) => Some(claim),
            Sent::Again(job) => return Ok(Reception::Known(job)),
        },
        None => None,
    };
    let Received { work, key, address, is_negotiated } =
        understand(state, query, upload, &headers, &sender.access).await?;
    let work = sender.sign(work, claim);
    Ok(Reception::New(Box::new(Received { work, key, address, is_negotiated })))
}

/// Reads the document of a request, and finds the mesh that it names.
async fn understand(
    state: &AppState,
    query: Query,
    upload: Upload,
    headers: &HeaderMap,
    access: &Access,
) -> Result<Received, ApiError> {
    let Query { reading, overrides } = query;
    let mut is_negotiated = false;
    let mut with_format = |mut spec: Spec| {
        is_negotiated = negotiate::depends_on_accept(spec.image.format);
        let format = negotiate::image_format(spec.image.format, headers)?;
        request::set_format(&mut spec, format);
        Ok::<_, ApiError>(Box::new(spec))
    };
    if let Some(document) = document_of(&upload, &reading, headers) {
        let (name, spec) = request::read_with_mesh(document, &overrides, &state.rules)?;
        let digest = Digest::parse(&name).ok_or_else(|| request::bad_mesh_name(&name))?;
        let spec = with_format(spec)?;
        let stored = stored_mesh::find(state, Some(&name), access).await?;
        let key = Some(render_key(state, digest, &reading, &spec));
        let keys = request::all_dotted(document, &overrides, &spec, &state.rules);
        let address = keys.and_then(|keys| Address::new(state, digest, &reading, &spec, &keys));
        let document = upload.bundle.files().first().map(|file| file.bytes.clone());
        let recipe = Some(Arc::new(Recipe { document, overrides, mesh: Some(digest) }));
        let work = Work { recipe, ..stored_mesh::work_on(&stored, reading, Task::Draw(spec)) };
        return Ok(Received { work, key, address, is_negotiated });
    }
    upload.bundle.check_sent().map_err(|error| ApiError::from(&error))?;
    let spec = with_format(request::read(upload.document.as_deref(), &overrides, &state.rules)?)?;
    let memory = Arc::new(upload.reservation);
    let recipe = Some(Arc::new(Recipe { document: upload.document, overrides, mesh: None }));
    let work = Work { recipe, ..stored_mesh::work(upload.bundle, reading, Task::Draw(spec), memory) };
    Ok(Received { work, key: None, address: None, is_negotiated })
}

/// What the sender of a request sees.
pub fn access_of(request: &Request) -> Access {
    request.extensions().get::<Access>().cloned().unwrap_or_default()
}

/// The body, if it is a request document that names a stored mesh. A request with `format_in` has a
/// mesh as its body, so that faulty JSON is then no document.
fn document_of<'u>(upload: &'u Upload, reading: &Reading, headers: &HeaderMap) -> Option<&'u [u8]> {
    let body = upload.bundle.files().first().filter(|_| upload.kind == BodyKind::Raw)?.bytes.as_ref();
    let is_faulty = || reading.format_in.is_none() && request::is_faulty_document(body, body::is_json(headers));
    (request::names_mesh(body) || is_faulty()).then_some(body)
}

/// Reads a body that brings one mesh, within this server's limits.
pub async fn read_upload(state: &AppState, request: Request) -> Result<Upload, ApiError> {
    read_body(state, request, None).await
}

async fn read_body(state: &AppState, request: Request, meshes: Option<u64>) -> Result<Upload, ApiError> {
    let (bytes, files) = (state.body_bytes_max, state.rules.limits.bundle_entries);
    let (time, least_rate, memory) = (state.body_timeout, state.least_rate, &state.memory);
    let limits = BodyLimits { bytes, files, meshes, time, least_rate, memory };
    body::read(request, limits).await
}
