//! The interface's descriptions of itself: `GET /v1/schema` is the JSON Schema of request documents
//! with this server's own limits, `GET /openapi.json` describes all paths, with the same limits.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;

use crate::http::descriptions;
use crate::http::state::AppState;

/// The path of the schema.
pub const PATH: &str = "/v1/schema";

/// The path of the description of the interface.
pub const OPENAPI_PATH: &str = "/openapi.json";

/// The schema of request documents.
pub async fn get(State(state): State<Arc<AppState>>, headers: HeaderMap) -> Response {
    state.schema.answer(&headers)
}

/// The description of the interface. It needs no API key, because it is the same for all clients.
pub async fn openapi(State(state): State<Arc<AppState>>, headers: HeaderMap) -> Response {
    state.openapi.get_or_init(|| descriptions::openapi(&state.rules)).answer(&headers)
}
