//! Bearer tokens.

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::Next;
use axum::response::Response;

use super::app::App;
use super::error::ApiError;

/// Lets a request through if no keys are configured or it carries one of them.
pub async fn check(State(app): State<Arc<App>>, request: Request, next: Next) -> Result<Response, ApiError> {
    if app.api_keys.is_empty() || is_known(&app.api_keys, request.headers()) {
        return Ok(next.run(request).await);
    }
    let detail = "this server wants an API key; send it as `Authorization: Bearer KEY`";
    Err(ApiError::new(StatusCode::UNAUTHORIZED, "unauthorized", detail).header(header::WWW_AUTHENTICATE, "Bearer"))
}

fn is_known(keys: &[String], headers: &HeaderMap) -> bool {
    let Some(value) = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok()) else { return false };
    let Some((scheme, token)) = value.split_once(' ') else { return false };
    // Every key is compared, so that the time taken tells nothing about which one was close.
    let mut found = false;
    for key in keys {
        found |= same(key.as_bytes(), token.trim().as_bytes());
    }
    found && scheme.eq_ignore_ascii_case("bearer")
}

/// Equality in a time that depends on the lengths alone.
fn same(a: &[u8], b: &[u8]) -> bool {
    let differing = a.iter().zip(b).fold(0, |bits, (x, y)| bits | (x ^ y));
    std::hint::black_box(differing) == 0 && a.len() == b.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_whole_key_is_known() {
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
            assert_eq!(is_known(&keys, &headers), expected, "{value}");
        }
        assert!(!is_known(&keys, &HeaderMap::new()));
    }
}
