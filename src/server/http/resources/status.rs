//! `/v1/status`: the queue, the workers, memory and failures of late as JSON, for the page `/status`. The numbers are those
//! of `/metrics`.

use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;

use super::{metrics, responses};
use crate::http::dto::ServerStatusDto;
use crate::http::state::AppState;

/// The state of this server at this moment.
pub async fn get(State(state): State<Arc<AppState>>) -> Response {
    let gauges = metrics::gauges(&state).await;
    responses::uncached(ServerStatusDto::new(&state, &gauges))
}
