//! The name of an upload: the SHA-256 of its bytes; of a form, that of the list of its files. The same content gives
//! the same name and the same list of files. So every picture of a stored mesh follows from its name and the request
//! alone.

use std::sync::Arc;

use axum::body::Bytes;

use super::body::{self, BodyKind, Upload};
use crate::digest::Digest;
use crate::http::error::{ApiError, ErrorKind};
use crate::memory::MemoryShare;
use meshsnap_render::import::Bundle;

/// An upload and its name.
pub struct NamedUpload {
    /// The name in the store.
    pub digest: Digest,
    /// The files to store.
    pub bundle: Bundle,
    /// The memory of the upload.
    pub memory: Arc<MemoryShare>,
}

/// Names an upload: a file or an archive by its bytes, a form by the list of its files.
pub async fn name(upload: Upload) -> Result<NamedUpload, ApiError> {
    let Upload { bundle, kind, document, reservation } = upload;
    if document.is_some() {
        let detail = "the form has a `request` part, and nothing is drawn here: send `file` parts alone";
        return Err(body::bad_form(detail));
    }
    // The Content-Type is not stored, so it must not decide how the bytes are read.
    let is_zip = || bundle.files().first().is_some_and(|file| Bundle::of_one(file.bytes.clone()).is_zip());
    if kind == BodyKind::Archive && !is_zip() {
        let detail = "the body is said to be a zip archive and does not begin as one";
        return Err(ApiError::new(ErrorKind::Content, "bundle_broken", detail));
    }
    // Hashing a large body would block other requests. The reservation moves along, so that the
    // memory counts until the bytes are dropped, even if the client hangs up.
    let naming = tokio::task::spawn_blocking(move || {
        let (digest, bundle) = if kind == BodyKind::Form { name_form(bundle) } else { name_file(bundle) };
        NamedUpload { digest, bundle, memory: Arc::new(reservation) }
    });
    naming.await.map_err(|_| ApiError::internal())
}

fn name_file(bundle: Bundle) -> (Digest, Bundle) {
    let bytes = bundle.into_files().pop().map_or_else(Bytes::new, |file| file.bytes);
    (Digest::of(&bytes), Bundle::of_one(bytes))
}

fn name_form(bundle: Bundle) -> (Digest, Bundle) {
    let mut files = bundle.into_files();
    for file in &mut files {
        // The bytes may be part of a larger allocation, which a stored mesh would keep alive.
        file.bytes = Bytes::copy_from_slice(&file.bytes);
    }
    // Where several files could be meant, import takes the first: the order must not depend on the
    // form's.
    files.sort_by(|a, b| a.path.cmp(&b.path));
    (Digest::of_files(&files), Bundle::of_files(files))
}
