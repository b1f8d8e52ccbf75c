//! The CORS headers, by which browsers let pages of the origins in `--cors-origins` use the
//! interface.

use std::time::Duration;

use axum::http::{HeaderName, HeaderValue, Method, header};
use tower_http::cors::{AllowOrigin, CorsLayer};

use crate::config::ANY_ORIGIN;

/// Time for which a browser need not ask again whether a request is allowed. Browsers cap it at two hours.
const MAX_AGE: Duration = Duration::from_secs(7200);

/// Headers that pages may send.
const ALLOWED: [HeaderName; 9] = [
    header::ACCEPT,
    header::AUTHORIZATION,
    header::CONTENT_TYPE,
    header::IF_NONE_MATCH,
    HeaderName::from_static("idempotency-key"),
    HeaderName::from_static("last-event-id"),
    HeaderName::from_static("prefer"),
    HeaderName::from_static("webhook"),
    HeaderName::from_static("x-request-id"),
];

/// Headers that pages may read, beside those that every page may.
const EXPOSED: [HeaderName; 13] = [
    header::AGE,
    header::CONTENT_LOCATION,
    header::ETAG,
    header::LOCATION,
    header::RETRY_AFTER,
    HeaderName::from_static("preference-applied"),
    HeaderName::from_static("server-timing"),
    HeaderName::from_static("x-cache"),
    HeaderName::from_static("x-chosen"),
    HeaderName::from_static("x-expected-error"),
    HeaderName::from_static("x-render-backend"),
    HeaderName::from_static("x-request-id"),
    HeaderName::from_static("x-warnings"),
];

/// The answers to browsers that ask for pages of these origins. None if there are no origins.
pub fn layer(origins: &[String]) -> Option<CorsLayer> {
    if origins.is_empty() {
        return None;
    }
    let layer = CorsLayer::new()
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::DELETE])
        .allow_headers(ALLOWED)
        .expose_headers(EXPOSED)
        .max_age(MAX_AGE);
    if origins.iter().any(|origin| origin == ANY_ORIGIN) {
        return Some(layer.allow_origin(AllowOrigin::any()));
    }
    let origins: Vec<HeaderValue> = origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok()).collect();
    // For proxies that know users by cookies. Here, no cookie means anything.
    Some(layer.allow_origin(AllowOrigin::list(origins)).allow_credentials(true))
}

/// True for the origin of a page that may use the interface.
pub fn is_allowed(origins: &[String], origin: &str) -> bool {
    origins.iter().any(|allowed| allowed == ANY_ORIGIN || allowed == origin)
}
