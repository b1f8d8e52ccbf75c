//! `GET /v1/schema`: the request document as a JSON Schema, with this server's own limits.

use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;

use super::app::App;
use super::conditional;
use super::render::digest;
use crate::request::{self, Rules};

/// Where it is found.
pub const PATH: &str = "/v1/schema";

/// The schema as it is sent: it does not change while the process runs.
pub struct Schema {
    body: Bytes,
    etag: String,
}

impl Schema {
    /// Of documents that are understood under these rules.
    pub fn new(rules: &Rules) -> Self {
        let body = Bytes::from(format!("{:#}\n", request::schema(rules)));
        let etag = format!("\"{:032x}\"", digest(&body));
        Self { body, etag }
    }
}

/// The schema, or 304 for who has it.
pub async fn get(State(app): State<Arc<App>>, headers: HeaderMap) -> Response {
    let Schema { body, etag } = &app.schema;
    let of = [
        conditional::etag(etag),
        // It changes with a restart of the server; asking again costs next to nothing.
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
    ];
    if conditional::is_known(&headers, etag) {
        return (StatusCode::NOT_MODIFIED, of).into_response();
    }
    let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static("application/schema+json"))];
    (of, media_type, body.clone()).into_response()
}
