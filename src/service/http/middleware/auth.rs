//! Authentication by bearer tokens.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;

use crate::service::http::error::{ApiError, Fault};
use crate::service::http::state::AppState;

/// Passes a request on if no keys are configured or it carries one of them.
pub async fn check(State(state): State<Arc<AppState>>, request: Request, next: Next) -> Result<Response, ApiError> {
    if state.api_keys.is_empty() || has_key(&state.api_keys, request.headers()) {
        return Ok(next.run(request).await);
    }
    let detail = "this server wants an API key; send it as `Authorization: Bearer KEY`";
    Err(ApiError::new(Fault::Unauthorized, "unauthorized", detail).header(header::WWW_AUTHENTICATE, "Bearer"))
}

fn has_key(keys: &[String], headers: &HeaderMap) -> bool {
    let Some(value) = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok()) else { return false };
    let Some((scheme, token)) = value.split_once(' ') else { return false };
    // Every key is compared, so that the time does not tell which one nearly matched.
    let mut found = false;
    for key in keys {
        found |= equal_in_constant_time(key.as_bytes(), token.trim().as_bytes());
    }
    found && scheme.eq_ignore_ascii_case("bearer")
}

/// Equality in a time that depends on the lengths alone.
fn equal_in_constant_time(a: &[u8], b: &[u8]) -> bool {
    let differing = a.iter().zip(b).fold(0, |bits, (x, y)| bits | (x ^ y));
    std::hint::black_box(differing) == 0 && a.len() == b.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_whole_key_has_key() {
        let keys = ["secret".to_owned(), "other".to_owned()];
        let cases = [
            ("Bearer secret", true),
            ("bearer other", true),
            ("Bearer  secret", true),
            ("Bearer secre", false),
            ("Bearer secrets", false),
            ("Bearer ", false),
            ("Basic secret", false),
            ("secret", false),
        ];
        for (value, expected) in cases {
            let headers = HeaderMap::from_iter([(header::AUTHORIZATION, value.parse().unwrap())]);
            assert_eq!(has_key(&keys, &headers), expected, "{value}");
        }
        assert!(!has_key(&keys, &HeaderMap::new()));
    }
}
