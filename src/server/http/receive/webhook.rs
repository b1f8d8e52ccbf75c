//! The header `Webhook`: the address that hears of the end of a job.

use std::sync::Arc;

use axum::http::{HeaderMap, HeaderName};

use crate::http::error::{ApiError, ErrorKind};
use crate::http::state::AppState;
use crate::jobs::Class;

const HEADER: HeaderName = HeaderName::from_static("webhook");

/// The address that a request names for the end of its job.
pub fn of(state: &AppState, headers: &HeaderMap, class: Class) -> Result<Option<Arc<str>>, ApiError> {
    let bad = |detail: String| ApiError::new(ErrorKind::BadRequest, "bad_webhook", detail);
    let mut values = headers.get_all(HEADER).iter();
    let Some(value) = values.next() else { return Ok(None) };
    if values.next().is_some() {
        return Err(bad("Webhook is given twice, and a request has one".to_owned()));
    }
    if class != Class::Batch {
        let detail = "a webhook hears of the end of a job: use /v1/jobs, or Prefer: respond-async";
        return Err(bad(detail.to_owned()));
    }
    let Some(webhooks) = &state.webhooks else {
        let detail = "this server sends no webhooks: its MESHSNAP_WEBHOOK_SECRET is not set";
        return Err(ApiError::new(ErrorKind::Content, "webhooks_off", detail));
    };
    let target = webhooks.target(value.to_str().unwrap_or_default()).map_err(|error| bad(error.to_string()))?;
    if webhooks.is_full() {
        let detail = "too many webhooks wait for their receivers; try again later, or without one";
        return Err(ApiError::new(ErrorKind::Busy, "webhooks_full", detail).retry_after(60));
    }
    Ok(Some(target.address().into()))
}
