//! `/v1/meshes/{sha256}/render.{png|webp|jpg}`: pictures of stored meshes, for caches and `<img>`.

use std::sync::Arc;

use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::{meshes, render};
use crate::image::ImageFormat;
use crate::request;
use crate::service::http::app::App;
use crate::service::http::conditional;
use crate::service::http::conditional::{day, etag};
use crate::service::http::dto::media_type;
use crate::service::http::error::ApiError;
use crate::service::http::receive::query;
use crate::service::http::receive::query::Query;
use crate::service::jobs::{State as JobState, Task};
use crate::service::store::{Digest, Reading};
use crate::spec::BackendChoice;
use crate::spec::Spec;

/// Draws a stored mesh, unless the client has the picture. HEAD draws nothing.
pub async fn get(
    State(app): State<Arc<App>>,
    path: Result<Path<(String, String)>, PathRejection>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let path = path.ok().map(|Path(path)| path);
    let format = path.as_ref().and_then(|(_, name)| format_of(name)).ok_or_else(|| {
        ApiError::not_found("pictures of a stored mesh are called render.png, render.webp and render.jpg")
    })?;
    let Query { reading, overrides } = Query::read(&uri, &app.rules)?;
    let mut spec = request::read(None, &overrides, &app.rules).map_err(query::told)?;
    request::set_format(&mut spec, format);

    let stored = meshes::find(&app, path.as_ref().map(|(id, _)| id.as_str()))?;
    let tag = tag(&app, stored.mesh.digest, &reading, &spec);
    let cached = [etag(&tag), day(!app.api_keys.is_empty())];
    if conditional::is_known(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, cached).into_response());
    }
    let mut response = if method == Method::HEAD {
        let media_type = HeaderValue::from_static(media_type(format));
        ([(header::CONTENT_TYPE, media_type)], meshes::unmade()).into_response()
    } else {
        match render::done(&app, meshes::work(&stored, reading, Task::Draw(Box::new(spec)))).await? {
            JobState::Done(finished) => render::picture(&finished),
            _ => return Err(ApiError::internal()),
        }
    };
    // In place of the picture's own tag, which nobody can know beforehand.
    for (name, value) in cached {
        response.headers_mut().insert(name, value);
    }
    Ok(response)
}

/// Where a picture of a stored mesh is, and the tag that it has there. None where no address of a sane length says it.
pub fn address(
    app: &App,
    digest: Digest,
    reading: &Reading,
    spec: &Spec,
    keys: &[(String, String)],
) -> Option<Address> {
    const URL_BYTES_MAX: usize = 2000;
    let extension = match spec.image.format? {
        ImageFormat::Png => "png",
        ImageFormat::Webp => "webp",
        ImageFormat::Jpeg => "jpg",
    };
    let format_in = reading.format_in.map(|format| ("format_in", format.name()));
    let entry = reading.entry.as_deref().map(|entry| ("entry", entry));
    let keys = keys.iter().map(|(key, text)| (key.as_str(), text.as_str())).chain(format_in).chain(entry);
    let query: Vec<String> =
        keys.map(|(key, text)| format!("{}={}", query::escape(key), query::escape(text))).collect();
    let mark = if query.is_empty() { "" } else { "?" };
    let url = format!("/v1/meshes/{digest}/render.{extension}{mark}{}", query.join("&"));
    (url.len() <= URL_BYTES_MAX).then(|| Address { url, etag: tag(app, digest, reading, spec) })
}

/// Of a picture that can be had again.
pub struct Address {
    /// Where.
    pub url: String,
    /// Its tag there.
    pub etag: String,
}

fn format_of(name: &str) -> Option<ImageFormat> {
    match name.strip_prefix("render.")? {
        "png" => Some(ImageFormat::Png),
        "webp" => Some(ImageFormat::Webp),
        "jpg" | "jpeg" => Some(ImageFormat::Jpeg),
        _ => None,
    }
}

/// The render key: everything that decides the picture, hashed, so that it is known before anything is drawn. Requests that
/// come to the same, whatever order or short names they use, have the same key.
///
/// The CPU's bytes are the same on every machine, so its tag is a strong one. Two GPUs, or a GPU and the CPU that steps in for
/// it, may differ in the last place: where one may draw, the tag is weak.
fn tag(app: &App, digest: Digest, reading: &Reading, spec: &Spec) -> String {
    let may_be_gpu = match spec.backend {
        BackendChoice::Cpu => false,
        BackendChoice::Auto => app.gpu.may_have_hardware(),
        BackendChoice::Gpu => true,
    };
    // Debug writes every field, numbers so that they come back the same, and text in quotes: different specs differ here.
    let key = format!("{} {digest} {reading:?} {spec:?} {may_be_gpu}", env!("CARGO_PKG_VERSION"));
    let weak = if may_be_gpu { "W/" } else { "" };
    format!("{weak}\"{}\"", Digest::of(key.as_bytes()))
}
