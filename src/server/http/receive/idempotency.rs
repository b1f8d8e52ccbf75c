//! `Idempotency-Key`: a request whose result is fetched later may be sent again, if its answer was lost, and makes no
//! second job. This file reads the header and computes the digest of the request (`diff.rs` that of a
//! comparison); `jobs/claims.rs` keeps name and digest as long as the job can be found.

use std::sync::Arc;

use axum::http::{HeaderMap, HeaderName};

use super::body::{BodyKind, Upload};
use super::query::Query;
use crate::digest::Digest;
use crate::http::dto::media_type;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::negotiate;
use crate::http::shared_jobs;
use crate::http::state::AppState;
use crate::jobs::{Claim, ClaimName, Job, Media, Named, Owner};
use meshsnap_render::import::BundleFile;

/// Longest key, characters.
pub const KEY_CHARS_MAX: usize = 255;

const HEADER: HeaderName = HeaderName::from_static("idempotency-key");

/// A request with a name.
pub enum Sent {
    /// One that is sent for the first time. It has the name as long as this or its job is there.
    First(Arc<Claim>),
    /// One that was accepted before.
    Again(Arc<Job>),
}

/// The name that a client gives its request.
pub fn name_of(headers: &HeaderMap, owner: &Owner) -> Result<Option<ClaimName>, ApiError> {
    let bad = |detail: String| ApiError::new(ErrorKind::BadRequest, "bad_idempotency_key", detail);
    let mut values = headers.get_all(HEADER).iter();
    let Some(value) = values.next() else { return Ok(None) };
    if values.next().is_some() {
        return Err(bad("Idempotency-Key is given twice, and a request has one".to_owned()));
    }
    let is_allowed =
        |text: &&str| (1..=KEY_CHARS_MAX).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_graphic());
    let key = value.to_str().ok().filter(is_allowed).ok_or_else(|| {
        bad(format!("Idempotency-Key must be 1 to {KEY_CHARS_MAX} visible ASCII characters, such as a UUID"))
    })?;
    Ok(Some(ClaimName { owner: owner.clone(), key: key.into() }))
}

/// Finds out whether a request was sent before under its name, to this server or to another of its service.
pub async fn check(state: &AppState, name: &ClaimName, request: Digest) -> Result<Sent, ApiError> {
    match state.jobs.claim(name, request) {
        Named::New(claim) => Ok(shared_jobs::sent_before(state, name, request).await?.unwrap_or(Sent::First(claim))),
        Named::Known(job) => Ok(Sent::Again(job)),
        Named::Pending => Err(in_use()),
        Named::Other => Err(reused()),
    }
}

/// The error of a request that comes while the first one of its name is being accepted.
pub fn in_use() -> ApiError {
    let detail = "a request with this Idempotency-Key is being accepted at this moment; send this one again shortly";
    ApiError::new(ErrorKind::Conflict, "idempotency_key_in_use", detail).retry_after(1)
}

/// The error of a request under the name of another one.
pub fn reused() -> ApiError {
    let detail = "this Idempotency-Key was sent with another request before; give each request a key of its own";
    ApiError::new(ErrorKind::Content, "idempotency_key_reused", detail)
}

/// The name of one mesh of a form that brings several: the first has the name of the request itself, so that this stands
/// for the form. Keys have no spaces in them, so that no other request has such a name.
pub fn name_of_mesh(name: &ClaimName, index: usize) -> ClaimName {
    let key = if index == 0 { name.key.clone() } else { format!("{} {index}", name.key).into() };
    ClaimName { owner: name.owner.clone(), key }
}

/// The digest of all that makes a job: files, query, document, the picture's format by `Accept`, and the webhook.
pub async fn digest(query: &Query, upload: &Upload, headers: &HeaderMap) -> Result<Digest, ApiError> {
    let (bundle, kind) = (upload.bundle.clone(), upload.kind);
    // A large body takes a while.
    let hashing = tokio::task::spawn_blocking(move || match kind {
        BodyKind::Meshes => of_meshes(bundle.files()),
        BodyKind::Raw | BodyKind::Archive | BodyKind::Form => Digest::of_files(bundle.files()).to_string(),
    });
    let files = hashing.await.map_err(|_| ApiError::internal())?;
    let document = upload.document.as_deref().map(|document| Digest::of(document).to_string());
    let format_in = query.reading.format_in.map(|format| format.name());
    let accepted = negotiate::image_format(None, headers).ok().map(|format| media_type(Media::Picture(format)));
    let webhook = headers.get("webhook").map(|address| address.as_bytes());
    let parts = (files, upload.bundle.is_zip(), document, format_in, &query.reading.entry, &query.overrides, accepted);
    // A request without one has the digest that it had before there were webhooks.
    let parts = serde_json::to_vec(&parts).map_err(|_| ApiError::internal())?;
    let parts = webhook.map_or(parts.clone(), |address| [&parts, address].concat());
    Ok(Digest::of(&parts))
}

/// The list of meshes that are a job each, in their order.
fn of_meshes(files: &[BundleFile]) -> String {
    let each = files.iter().map(|file| format!("mesh {} {:?}\n", Digest::of(&file.bytes), file.path));
    each.collect()
}
