//! `/v1/meshes/{sha256}/render.{png|webp|jpg}`: pictures of stored meshes, for caches and `<img>`.

use std::sync::Arc;

use axum::extract::rejection::PathRejection;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};

use super::{responses, run};
use crate::http::address::render_key;
use crate::http::conditional;
use crate::http::dto::media_type;
use crate::http::error::ApiError;
use crate::http::receive::query::{Query, query_error};
use crate::http::state::AppState;
use crate::http::stored_mesh::{self, shared};
use crate::jobs::{Media, Task, Work};
use crate::keys::Access;
use meshsnap_render::image::ImageFormat;
use meshsnap_render::request;

/// Draws a stored mesh, unless the client has the picture. HEAD draws nothing.
pub async fn get(
    State(state): State<Arc<AppState>>,
    Extension(access): Extension<Access>,
    path: Result<Path<(String, String)>, PathRejection>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let path = path.ok().map(|Path(path)| path);
    let format = path.as_ref().and_then(|(_, name)| format_of(name)).ok_or_else(|| {
        ApiError::not_found("pictures of a stored mesh are called render.png, render.webp and render.jpg")
    })?;
    let Query { reading, overrides } = Query::read(&uri, &state.rules)?;
    let mut spec = request::read(None, &overrides, &state.rules).map_err(query_error)?;
    request::set_format(&mut spec, format);

    let stored = stored_mesh::find(&state, path.as_ref().map(|(id, _)| id.as_str()), &access).await?;
    let tag = render_key(&state, stored.mesh.digest, &reading, &spec);
    let cached = [conditional::etag(&tag), conditional::cache_for_a_day(!access.is_open())];
    if conditional::is_known(&headers, &tag) {
        return Ok((StatusCode::NOT_MODIFIED, cached).into_response());
    }
    let mut response = if method == Method::HEAD {
        let media_type = HeaderValue::from_static(media_type(Media::Picture(format)));
        ([(header::CONTENT_TYPE, media_type)], responses::body_of_unknown_length()).into_response()
    } else {
        // No work is made for a picture that is in memory.
        let drawing = shared::picture(&state, (stored.mesh.digest, &tag), async {
            let work =
                Work { owner: access.owner, ..stored_mesh::work_on(&stored, reading, Task::Draw(Box::new(spec))) };
            run::draw(&state, work).await
        });
        let found = state.pictures.find(&tag, drawing).await?;
        state.metrics.picture(found.source.name());
        responses::found(&found, Some(&tag))
    };
    // The render key replaces the tag of the picture's bytes, which HEAD and 304 cannot know.
    for (name, value) in cached {
        response.headers_mut().insert(name, value);
    }
    Ok(response)
}

fn format_of(name: &str) -> Option<ImageFormat> {
    match name.strip_prefix("render.")? {
        "png" => Some(ImageFormat::Png),
        "webp" => Some(ImageFormat::Webp),
        "jpg" | "jpeg" => Some(ImageFormat::Jpeg),
        _ => None,
    }
}
