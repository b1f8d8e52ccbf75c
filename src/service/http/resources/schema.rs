//! What the interface says of itself: `GET /v1/schema`, the request document as a JSON Schema with this server's own limits, and
//! `GET /openapi.json`.

use std::sync::{Arc, LazyLock};

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;

use super::render::digest;
use crate::request::{self, Rules};
use crate::service::http::app::App;
use crate::service::http::conditional;

/// Where the schema is found.
pub const PATH: &str = "/v1/schema";

/// Where the whole interface is described.
pub const OPENAPI_PATH: &str = "/openapi.json";

static OPENAPI: LazyLock<Schema> = LazyLock::new(|| {
    Schema::of(Bytes::from_static(include_bytes!("../../../../api/openapi.json")), "application/json")
});

/// A description as it is sent: it does not change while the process runs.
pub struct Schema {
    body: Bytes,
    etag: String,
    media_type: &'static str,
}

impl Schema {
    /// Of documents that are understood under these rules.
    pub fn new(rules: &Rules) -> Self {
        Self::of(Bytes::from(format!("{:#}\n", request::schema(rules))), "application/schema+json")
    }

    fn of(body: Bytes, media_type: &'static str) -> Self {
        let etag = format!("\"{:032x}\"", digest(&body));
        Self { body, etag, media_type }
    }

    fn answer(&self, headers: &HeaderMap) -> Response {
        let of = [
            conditional::etag(&self.etag),
            // It changes with a restart of the server; asking again costs next to nothing.
            (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        ];
        if conditional::is_known(headers, &self.etag) {
            return (StatusCode::NOT_MODIFIED, of).into_response();
        }
        let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type))];
        (of, media_type, self.body.clone()).into_response()
    }
}

/// The schema, or 304 for who has it.
pub async fn get(State(app): State<Arc<App>>, headers: HeaderMap) -> Response {
    app.schema.answer(&headers)
}

/// The description of the interface, which needs no key: it is the same for everybody.
pub async fn openapi(headers: HeaderMap) -> Response {
    OPENAPI.answer(&headers)
}
