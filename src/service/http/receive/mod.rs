//! From a request to accepted work, in the order in which refusals are cheapest.

pub(crate) mod body;
pub(crate) mod drainable_body;
pub(crate) mod query;
pub(crate) mod upload;
use std::sync::Arc;

use axum::extract::Request;
use axum::http::HeaderMap;

use self::body::{BodyKind, BodyLimits, Upload};
use self::query::Query;
use super::app::App;
use super::error::ApiError;
use super::negotiate;
use crate::limits::Limits;
use crate::request;
use crate::service::http::resources::meshes;
use crate::service::http::resources::pictures;
use crate::service::http::resources::pictures::Address;
use crate::service::jobs::{Task, Work};
use crate::service::store::{Digest, Reading};
use crate::spec::Spec;

/// What is to be done.
pub struct Received {
    /// For a worker.
    pub work: Work,
    /// Where the picture of a stored mesh can be had again.
    pub address: Option<Address>,
}

/// Reads a request for a picture, and says everything that can be wrong with it before it costs a worker's time.
pub async fn receive(app: &Arc<App>, request: Request) -> Result<Received, ApiError> {
    body::check_header(request.headers(), app.rules.limits.body_bytes)?;
    let Query { reading, overrides } = Query::read(request.uri(), &app.rules)?;
    // A form brings its document with it, and JSON may be one; without one, the query is all there is and can be judged
    // before the upload.
    if !body::is_multipart(request.headers()) && !body::is_json(request.headers()) {
        request::read(None, &overrides, &app.rules).map_err(query::told)?;
    }
    app.jobs.would_accept()?;

    let headers = request.headers().clone();
    let upload = body(app, request).await?;
    let finish = |mut spec: Spec| {
        let format = negotiate::image_format(spec.image.format, &headers)?;
        request::set_format(&mut spec, format);
        Ok::<_, ApiError>(Box::new(spec))
    };
    if let Some(document) = document_of(&upload, &reading, &headers) {
        let (name, spec) = request::read_with_mesh(document, &overrides, &app.rules)?;
        let digest = Digest::parse(&name).ok_or_else(|| request::bad_mesh_name(&name))?;
        let spec = finish(spec)?;
        let stored = meshes::find(app, Some(&name))?;
        let keys = request::all_dotted(document, &overrides, &spec, &app.rules);
        let address = keys.and_then(|keys| pictures::address(app, digest, &reading, &spec, &keys));
        return Ok(Received { work: meshes::work(&stored, reading, Task::Draw(spec)), address });
    }
    upload.bundle.check_sent().map_err(|error| ApiError::from(&error))?;
    let spec = finish(request::read(upload.document.as_deref(), &overrides, &app.rules)?)?;
    let Reading { format_in, entry } = reading;
    let (bundle, task, memory) = (upload.bundle.with_entry(entry), Task::Draw(spec), Arc::new(upload.reservation));
    Ok(Received { work: Work { bundle, format_in, task, memory }, address: None })
}

/// The body, if it is a request document in place of a mesh. Who says how the mesh in it is to be read sent one.
fn document_of<'u>(upload: &'u Upload, reading: &Reading, headers: &HeaderMap) -> Option<&'u [u8]> {
    let body = upload.bundle.files().first().filter(|_| upload.kind == BodyKind::Raw)?.bytes.as_ref();
    let is_faulty = || reading.format_in.is_none() && request::is_faulty_document(body, body::is_json(headers));
    (request::names_mesh(body) || is_faulty()).then_some(body)
}

/// Reads a body within this server's limits.
pub async fn body(app: &App, request: Request) -> Result<Upload, ApiError> {
    let Limits { body_bytes: bytes, bundle_entries: files, .. } = app.rules.limits;
    body::read(request, BodyLimits { bytes, files, time: app.body_timeout, bodies: &app.bodies }).await
}
