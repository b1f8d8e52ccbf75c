//! A document that stays the same while the process runs, such as the JSON Schema. It is sent with its `ETag`; a client
//! that has it already gets 304.

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;

use super::conditional;

/// A document with its tag, ready to be sent.
pub struct StaticDocument {
    body: Bytes,
    etag: String,
    media_type: &'static str,
}

impl StaticDocument {
    /// Prepares a document for sending.
    pub fn new(body: impl Into<Bytes>, media_type: &'static str) -> Self {
        let body = body.into();
        let etag = conditional::content_tag(&body);
        Self { body, etag, media_type }
    }

    /// Answers with the document, or with 304 if the client has it.
    pub fn answer(&self, headers: &HeaderMap) -> Response {
        let cached = [
            conditional::etag(&self.etag),
            // A restart of the server may change the document, and a 304 is cheap.
            (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        ];
        if conditional::is_known(headers, &self.etag) {
            return (StatusCode::NOT_MODIFIED, cached).into_response();
        }
        let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type))];
        (cached, media_type, self.body.clone()).into_response()
    }
}
