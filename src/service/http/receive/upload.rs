//! From an upload to what is stored: one bundle for one digest, however it came. Whatever is drawn of a stored mesh then
//! follows from its name and the request alone.

use std::sync::Arc;

use axum::body::Bytes;
use axum::http::StatusCode;

use super::body::{self, BodyKind, Upload};
use crate::import::Bundle;
use crate::service::http::error::ApiError;
use crate::service::jobs::Reservation;
use crate::service::store::Digest;

/// An upload and its name.
pub struct Named {
    /// The name.
    pub digest: Digest,
    /// What is stored under it.
    pub bundle: Bundle,
    /// The memory that it was granted as an upload.
    pub memory: Arc<Reservation>,
}

/// Names an upload: a file or an archive by its bytes, a form by the list of its files.
pub async fn name(upload: Upload) -> Result<Named, ApiError> {
    let Upload { bundle, kind, document, reservation } = upload;
    if document.is_some() {
        let detail = "the form has a `request` part, and nothing is drawn here: send `file` parts alone";
        return Err(body::bad_form(detail.into()));
    }
    // Stored bytes do not keep their Content-Type, so it must not decide how they are read.
    let is_zip = || bundle.files().first().is_some_and(|file| Bundle::of_one(file.bytes.clone()).is_zip());
    if kind == BodyKind::Archive && !is_zip() {
        let detail = "the body is said to be a zip archive and does not begin as one";
        return Err(ApiError::new(StatusCode::UNPROCESSABLE_ENTITY, "bundle_broken", detail));
    }
    // A large body takes its time. The memory goes along: it counts until the bytes are let go, whoever hangs up.
    let naming = tokio::task::spawn_blocking(move || {
        let (digest, bundle) = if kind == BodyKind::Form { of_form(bundle) } else { of_bytes(bundle) };
        Named { digest, bundle, memory: Arc::new(reservation) }
    });
    naming.await.map_err(|_| ApiError::internal())
}

fn of_bytes(bundle: Bundle) -> (Digest, Bundle) {
    let bytes = bundle.into_files().pop().map_or_else(Bytes::new, |file| file.bytes);
    (Digest::of(&bytes), Bundle::of_one(bytes))
}

fn of_form(bundle: Bundle) -> (Digest, Bundle) {
    let mut files = bundle.into_files();
    for file in &mut files {
        // As it came, it may be part of a larger allocation; what is kept for long has its own.
        file.bytes = Bytes::copy_from_slice(&file.bytes);
    }
    // Among equals, the first is taken here and there.
    files.sort_by(|a, b| a.path.cmp(&b.path));
    (Digest::of_files(&files), Bundle::of_files(files))
}
