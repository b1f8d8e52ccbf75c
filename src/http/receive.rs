//! From a request to accepted work, in the order in which refusals are cheapest.

use std::sync::Arc;

use axum::extract::{self, Request};
use axum::http::{StatusCode, Uri};

use super::app::App;
use super::body::{self, BodyLimits};
use super::error::ApiError;
use super::negotiate;
use crate::jobs::Work;
use crate::limits::Limits;
use crate::mesh::Format;
use crate::request::{self, Overrides};

/// Reads a request for a picture, and says everything that can be wrong with it before it costs a worker's time.
pub async fn receive(app: &Arc<App>, request: Request) -> Result<Work, ApiError> {
    body::check_header(request.headers(), app.rules.limits.body_bytes)?;
    let Query { format_in, entry, overrides } = query(request.uri())?;
    // A form brings its document with it; without one, the query is all there is and can be judged before the upload.
    if !body::is_multipart(request.headers()) {
        request::read(None, &overrides, &app.rules)?;
    }
    app.jobs.would_accept()?;

    let headers = request.headers().clone();
    let Limits { body_bytes: bytes, bundle_entries: files, .. } = app.rules.limits;
    let limits = BodyLimits { bytes, files, time: app.body_timeout, bodies: &app.bodies };
    let upload = body::read(request, limits).await?;

    let mut spec = request::read(upload.document.as_deref(), &overrides, &app.rules)?;
    let format = negotiate::image_format(spec.image.format, &headers)?;
    request::set_format(&mut spec, format);
    Ok(Work { bundle: upload.bundle.with_entry(entry), format_in, spec, reservation: upload.reservation })
}

/// What the query says.
struct Query {
    format_in: Option<Format>,
    entry: Option<String>,
    /// The dotted keys of the request document.
    overrides: Box<Overrides>,
}

fn query(uri: &Uri) -> Result<Query, ApiError> {
    let bad = |code, detail: String| ApiError::new(StatusCode::BAD_REQUEST, code, detail);
    let extract::Query(mut pairs) = extract::Query::<Vec<(String, String)>>::try_from_uri(uri)
        .map_err(|e| bad("bad_query", format!("the query cannot be read: {}", e.body_text())))?;
    let mut format_in = None;
    for (_, name) in pairs.iter().filter(|(key, _)| key == "format_in") {
        let format = Format::from_name(name).ok_or_else(|| {
            let name: String = name.chars().take(40).collect();
            let allowed = Format::NAMES.join(", ");
            bad("out_of_range", format!("`format_in` is {name:?}, and allowed is one of {allowed}"))
        })?;
        format_in = Some(format);
    }
    let entry = pairs.iter().rfind(|(key, _)| key == "entry").map(|(_, name)| name.clone());
    pairs.retain(|(key, _)| key != "format_in" && key != "entry");
    Ok(Query { format_in, entry, overrides: pairs.into() })
}
