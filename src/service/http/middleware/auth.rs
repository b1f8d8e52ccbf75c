//! Authentication by bearer tokens, and whose request it is.

use std::sync::Arc;

use axum::extract::connect_info::ConnectInfo;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;

use crate::service::digest::Digest;
use crate::service::http::connection::activity::Client;
use crate::service::http::error::{ApiError, Fault};
use crate::service::http::state::AppState;
use crate::service::jobs::Owner;

/// Passes a request on if no keys are configured or it carries one of them. Adds its [`Owner`].
pub async fn check(State(state): State<Arc<AppState>>, mut request: Request, next: Next) -> Result<Response, ApiError> {
    let owner = match state.api_keys.is_empty() {
        true => Some(by_address(&request)),
        false => key(&state.api_keys, request.headers()).map(by_key),
    };
    if let Some(owner) = owner {
        request.extensions_mut().insert(owner);
        return Ok(next.run(request).await);
    }
    let detail = "this server wants an API key; send it as `Authorization: Bearer KEY`";
    Err(ApiError::new(Fault::Unauthorized, "unauthorized", detail).header(header::WWW_AUTHENTICATE, "Bearer"))
}

/// Without keys, clients are told apart by their addresses.
fn by_address(request: &Request) -> Owner {
    let client = request.extensions().get::<ConnectInfo<Client>>();
    client.map_or_else(Owner::default, |ConnectInfo(client)| Owner::new(&format!("address {}", client.address.ip())))
}

/// A key is named by its digest, because the name is stored.
fn by_key(key: &str) -> Owner {
    Owner::new(&format!("key {}", Digest::of(key.as_bytes())))
}

/// The key that a request carries.
fn key<'k>(keys: &'k [String], headers: &HeaderMap) -> Option<&'k str> {
    let value = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok())?;
    let (scheme, token) = value.split_once(' ')?;
    // Every key is compared, so that the time does not tell which one nearly matched.
    let mut found = None;
    for key in keys {
        if equal_in_constant_time(key.as_bytes(), token.trim().as_bytes()) {
            found = Some(key.as_str());
        }
    }
    found.filter(|_| scheme.eq_ignore_ascii_case("bearer"))
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
            assert_eq!(key(&keys, &headers).is_some(), expected, "{value}");
        }
        assert_eq!(key(&keys, &HeaderMap::new()), None);
    }
}
