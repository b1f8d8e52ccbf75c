//! The interface's descriptions of itself: `GET /v1/schema` is the JSON Schema of request documents
//! with this server's own limits, `GET /openapi.json` describes all paths.

use std::sync::{Arc, LazyLock};

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;

use crate::service::http::state::AppState;
use crate::service::http::static_document::StaticDocument;

/// The path of the schema.
pub const PATH: &str = "/v1/schema";

/// The path of the description of the interface.
pub const OPENAPI_PATH: &str = "/openapi.json";

static OPENAPI: LazyLock<StaticDocument> =
    LazyLock::new(|| StaticDocument::new(include_str!("../../../../api/openapi.json"), "application/json"));

/// The schema of request documents.
pub async fn get(State(state): State<Arc<AppState>>, headers: HeaderMap) -> Response {
    state.schema.answer(&headers)
}

/// The description of the interface. It needs no API key, because it is the same for all clients.
pub async fn openapi(headers: HeaderMap) -> Response {
    OPENAPI.answer(&headers)
}
