//! The body of a request that compares two meshes: a form that brings both, or a JSON document that names two stored ones.

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest as _, Multipart, Request};

use super::{BodyLimits, Meter, bad_form, empty_file, is_multipart, metered, read_whole, too_slow};
use crate::http::error::ApiError;
use crate::memory::MemoryShare;
use meshsnap_render::import::{Bundle, BundleFile};
use meshsnap_render::limits;

/// The parts of a form that brings two meshes: the older one, and the newer one.
pub const PARTS: [&str; 2] = ["a", "b"];

/// The content of a body.
#[derive(Debug)]
pub enum Sides {
    /// Two meshes, each with the files beside it.
    Meshes {
        /// The meshes.
        bundles: [Bundle; 2],
        /// The memory of each.
        reservations: [MemoryShare; 2],
    },
    /// A document.
    Document(Bytes),
}

/// Reads a form with two meshes, or a document in its place.
pub async fn read(request: Request, limits: BodyLimits<'_>) -> Result<Sides, ApiError> {
    let reading = async {
        let (parts, body) = request.into_parts();
        let meter = Meter::new(&limits);
        let chunks = metered(body, meter.clone());
        if is_multipart(&parts.headers) {
            let form = Request::from_parts(parts, Body::from_stream(chunks));
            return read_form(form, &meter, limits.files).await;
        }
        let document = read_whole(chunks, &meter).await?;
        if !document.trim_ascii_start().starts_with(b"{") {
            let detail = "two meshes are sent as a form with the parts `a` and `b`, and stored ones are named in JSON: \
                          {\"a\": SHA256, \"b\": SHA256}";
            return Err(bad_form(detail));
        }
        Ok(Sides::Document(document))
    };
    tokio::time::timeout(limits.time, reading).await.unwrap_or_else(|_| Err(too_slow(limits.time)))
}

async fn read_form(request: Request, meter: &Meter, files_max: u64) -> Result<Sides, ApiError> {
    let broken = |error: axum::extract::multipart::MultipartError| {
        meter.error_or(|| bad_form(format!("the form cannot be read: {}", error.body_text())))
    };
    let mut form = Multipart::from_request(request, &()).await.map_err(|e| bad_form(e.body_text()))?;
    let mut sides: [Vec<BundleFile>; 2] = [Vec::new(), Vec::new()];
    loop {
        meter.set_between_parts(true);
        let Some(field) = form.next_field().await.map_err(broken)? else { break };
        meter.set_between_parts(false);
        let name: String = field.name().unwrap_or_default().chars().take(40).collect();
        let Some(side) = PARTS.iter().position(|part| *part == name) else {
            return Err(bad_form(format!("a form part is named {name:?}, and allowed are `a` and `b`")));
        };
        let count = (sides[0].len() + sides[1].len() + 1) as u64;
        limits::check("the number of files in the form", count, files_max, "--limit-bundle-entries")
            .map_err(|limit| ApiError::from(&limit))?;
        // The name is checked before the bytes are read, so that a bad one costs nothing.
        let mut file = empty_file(field.file_name(), (sides[side].len(), &name))?;
        file.check_new(&sides[side]).map_err(|e| bad_form(format!("{e}; each `{name}` part needs its own name")))?;
        file.bytes = field.bytes().await.map_err(broken)?;
        sides[side].push(file);
    }
    if let Some(missing) = PARTS.iter().zip(&sides).find(|(_, files)| files.is_empty()).map(|(part, _)| part) {
        return Err(bad_form(format!(
            "the form has no `{missing}` part; send the older mesh as `a`, the newer one as `b`"
        )));
    }
    let whole = meter.take_reservation();
    let bundles = sides.map(Bundle::of_files);
    let older = whole.split(bundles[0].bytes_len());
    Ok(Sides::Meshes { bundles, reservations: [older, whole] })
}
