//! Authentication by bearer tokens, and whose request it is.

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use axum::extract::connect_info::ConnectInfo;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;

use crate::service::digest::Digest;
use crate::service::http::connection::activity::Client;
use crate::service::http::error::{ApiError, Fault};
use crate::service::http::state::AppState;
use crate::service::jobs::Owner;
use crate::service::signature::Signed;

/// Passes a request on if no keys are configured or it carries one of them. Adds its [`Owner`].
pub async fn check(State(state): State<Arc<AppState>>, mut request: Request, next: Next) -> Result<Response, ApiError> {
    let key_owner = key(&state.api_keys, request.headers()).map(by_key);
    let signed_owner = unsign(&mut request, &state.api_keys, key_owner.is_some())?;
    let owner = match state.api_keys.is_empty() {
        true => Some(by_address(&request)),
        false => key_owner.or(signed_owner),
    };
    if let Some(owner) = owner {
        request.extensions_mut().insert(owner);
        return Ok(next.run(request).await);
    }
    let detail = "this server wants an API key; send it as `Authorization: Bearer KEY`";
    Err(ApiError::new(Fault::Unauthorized, "unauthorized", detail).header(header::WWW_AUTHENTICATE, "Bearer"))
}

/// Removes time of expiry and signature from the address of a picture. The owner whose key has signed it; an error if none
/// has, unless the request has a key of its own or none is needed.
fn unsign(request: &mut Request, keys: &[String], has_key: bool) -> Result<Option<Owner>, ApiError> {
    let is_picture = request.uri().path().starts_with("/v1/meshes/") && request.uri().path().contains("/render.");
    let is_reading = [Method::GET, Method::HEAD].contains(request.method());
    let address = request.uri().path_and_query().map(|address| address.as_str().to_owned()).unwrap_or_default();
    let Some(signed) = Signed::read(&address).filter(|_| is_picture && is_reading) else { return Ok(None) };
    let owner = match signed.check(keys, unix_s()) {
        Ok(key) => Some(by_key(key)),
        Err(_) if has_key || keys.is_empty() => None,
        Err(bad) => return Err(ApiError::new(Fault::Forbidden, "bad_signature", bad.to_string())),
    };
    if let Ok(plain) = signed.plain.parse() {
        *request.uri_mut() = plain;
    }
    Ok(owner)
}

fn unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
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
