//! The check of a request's API key: whose request it is, and whether the key permits it. A key is sent as a bearer token,
//! or has signed the address of a picture. Where no keys are configured, everything is permitted, and clients are told
//! apart by their addresses.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use axum::extract::connect_info::ConnectInfo;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;

use crate::http::connection::activity::Client;
use crate::http::connection::places::network;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::state::AppState;
use crate::jobs::Owner;
use crate::keys::{Access, Key, KeySet, Scope};
use crate::signature::Signed;

/// Passes a request on if no keys are configured or it carries one that permits it. Adds its [`Access`].
pub async fn check(State(state): State<Arc<AppState>>, mut request: Request, next: Next) -> Result<Response, ApiError> {
    let keys = state.keys.current();
    let key = bearer(request.headers()).and_then(|token| keys.find(token));
    let signer = unsign(&mut request, &keys, key.is_some())?;
    let access = match (key, signer) {
        _ if keys.is_empty() => Access::open(by_address(&request)),
        (Some(key), _) => {
            check_scope(key, &request)?;
            key.access()
        }
        // Its address is a picture's, and what it shows is what this key sees.
        (None, Some(key)) if key.may(Scope::Render) => key.access(),
        _ => {
            let detail = "this server wants an API key; send it as `Authorization: Bearer KEY`";
            let error = ApiError::new(ErrorKind::Unauthorized, "unauthorized", detail);
            return Err(error.header(header::WWW_AUTHENTICATE, "Bearer"));
        }
    };
    request.extensions_mut().insert(access);
    Ok(next.run(request).await)
}

/// Refuses a request that its key does not permit.
fn check_scope(key: &Key, request: &Request) -> Result<(), ApiError> {
    let path = request.extensions().get::<MatchedPath>().map_or("", MatchedPath::as_str);
    let wanted = wanted(request.method(), path);
    if wanted.is_empty() || wanted.iter().any(|scope| key.may(*scope)) {
        return Ok(());
    }
    let words: Vec<&str> = wanted.iter().map(|scope| scope.name()).collect();
    let detail = format!("this needs a key with the scope {}, and \"{}\" has it not", words.join(" or "), key.name);
    Err(ApiError::new(ErrorKind::Forbidden, "scope_missing", detail))
}

/// The scopes of which a request needs one, by the path of its route. None: every key will do.
fn wanted(method: &Method, path: &str) -> &'static [Scope] {
    let is_writing = [Method::POST, Method::PUT, Method::DELETE].contains(method);
    match path {
        "/metrics" => &[Scope::Metrics],
        "/v1/status" => &[Scope::Admin],
        "/v1/capabilities" | "/v1/schema" => &[],
        "/v1/meshes" | "/v1/meshes/{sha256}" if is_writing => &[Scope::Store],
        // Whoever stores meshes asks first whether they are there.
        "/v1/meshes/{sha256}" => &[Scope::Render, Scope::Store],
        _ => &[Scope::Render],
    }
}

/// Removes time of expiry and signature from the address of a picture. The key that has signed it; an error if none
/// has, unless the request has a key of its own or none is needed.
fn unsign(request: &mut Request, keys: &KeySet, has_key: bool) -> Result<Option<Arc<Key>>, ApiError> {
    let is_picture = request.uri().path().starts_with("/v1/meshes/") && request.uri().path().contains("/render.");
    let is_reading = [Method::GET, Method::HEAD].contains(request.method());
    let address = request.uri().path_and_query().map(|address| address.as_str().to_owned()).unwrap_or_default();
    let Some(signed) = Signed::read(&address).filter(|_| is_picture && is_reading) else { return Ok(None) };
    let signer = match signed.check(keys.iter(), |key| &key.signs_with, unix_s()) {
        Ok(key) => Some(key.clone()),
        Err(_) if has_key || keys.is_empty() => None,
        Err(bad) => return Err(ApiError::new(ErrorKind::Forbidden, "bad_signature", bad.to_string())),
    };
    if let Ok(plain) = signed.plain.parse() {
        *request.uri_mut() = plain;
    }
    Ok(signer)
}

fn unix_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// Without keys, clients are told apart by their addresses.
fn by_address(request: &Request) -> Owner {
    let client = request.extensions().get::<ConnectInfo<Client>>();
    client.map_or_else(Owner::default, |ConnectInfo(client)| of_network(client.address.ip()))
}

fn of_network(address: IpAddr) -> Owner {
    Owner::new(&format!("address {}", network(address)))
}

/// The token that a request carries. None if it carries two, of which the crate `headers` would take the first.
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let mut values = headers.get_all(header::AUTHORIZATION).iter();
    let value = values.next().and_then(|v| v.to_str().ok())?;
    let (scheme, token) = value.split_once(' ')?;
    Some(token.trim()).filter(|_| scheme.eq_ignore_ascii_case("bearer") && values.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_an_ipv6_network_have_one_owner() {
        let of = |text: &str| of_network(text.parse().unwrap());
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff:1"));
        assert_ne!(of("2001:db8::1"), of("2001:db8:0:1::1"));
        assert_ne!(of("10.0.0.1"), of("10.0.0.2"));
    }

    #[test]
    fn only_a_bearer_token_is_one() {
        let cases = [
            ("Bearer secret", Some("secret")),
            ("bearer other", Some("other")),
            ("Bearer  secret", Some("secret")),
            ("Bearer ", Some("")),
            ("Basic secret", None),
            ("secret", None),
        ];
        for (value, expected) in cases {
            let headers = HeaderMap::from_iter([(header::AUTHORIZATION, value.parse().unwrap())]);
            assert_eq!(bearer(&headers), expected, "{value}");
        }
        assert_eq!(bearer(&HeaderMap::new()), None);
        let mut two = HeaderMap::new();
        two.append(header::AUTHORIZATION, "Bearer a".parse().unwrap());
        two.append(header::AUTHORIZATION, "Bearer b".parse().unwrap());
        assert_eq!(bearer(&two), None, "which one?");
    }
}
