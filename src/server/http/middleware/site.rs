//! The refusal of requests that a web page of another site makes a browser send. It is for servers on loopback without
//! keys, whose only protection is that strangers cannot connect.
//!
//! A web page can make a browser that runs on the same machine connect: by a name that it lets mean 127.0.0.1 (DNS
//! rebinding), or by a form that it posts across sites. So the host that is asked for must be a name of this machine,
//! and a page that posts, puts or deletes must come from it, or from an origin that `--cors-origins` allows.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, Method, header};
use axum::middleware::Next;
use axum::response::Response;

use super::cors;
use crate::http::error::{ApiError, ErrorKind};
use crate::http::state::AppState;

/// Refuses what a page of another site makes a browser send.
pub async fn check(State(state): State<Arc<AppState>>, request: Request, next: Next) -> Result<Response, ApiError> {
    if state.is_local && state.keys.current().is_empty() {
        // HTTP/2 has the host in the URI.
        let host = request.uri().authority().map(|authority| authority.as_str().to_owned());
        let host = host.or_else(|| text(request.headers(), &header::HOST).map(str::to_owned));
        if let Some(host) = host.filter(|host| !is_local(host)) {
            let shown: String = host.chars().take(60).collect();
            let detail = format!(
                "this server answers on this machine alone, and the request is for {shown:?}: ask for localhost, or \
                 give the server API keys"
            );
            return Err(ApiError::new(ErrorKind::Forbidden, "foreign_host", detail));
        }
        let is_reading = [Method::GET, Method::HEAD, Method::OPTIONS].contains(request.method());
        if !is_reading && is_cross_site(request.headers(), &state.cors_origins) {
            let detail = "a page of another site sends this request; name its origin in --cors-origins, or give the server API \
                          keys, if it should";
            return Err(ApiError::new(ErrorKind::Forbidden, "cross_site", detail).flag("--cors-origins"));
        }
    }
    Ok(next.run(request).await)
}

/// True for a browser's request that a page of another site has made.
fn is_cross_site(headers: &HeaderMap, allowed: &[String]) -> bool {
    let origin = text(headers, &header::ORIGIN);
    if origin.is_some_and(|origin| cors::is_allowed(allowed, origin)) {
        return false;
    }
    if text(headers, &HeaderName::from_static("sec-fetch-site")).is_some_and(|site| site == "cross-site") {
        return true;
    }
    match origin {
        // A page without an origin, such as a file or a frame in a sandbox, is foreign.
        Some("null") => true,
        Some(origin) => !origin.split_once("://").is_some_and(|(_, host)| is_local(host)),
        None => false,
    }
}

/// True for a name of this machine, with any port.
fn is_local(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else { return false };
    let name = authority.host().trim_matches(['[', ']']);
    let is_loopback = |address: IpAddr| address.is_loopback();
    let is_name = |known: &str| name.eq_ignore_ascii_case(known);
    is_name("localhost")
        || name.len() > 10 && name.as_bytes()[name.len() - 10..].eq_ignore_ascii_case(b".localhost")
        || name.parse().is_ok_and(is_loopback)
}

fn text<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_is_known_by_its_names() {
        for host in ["localhost", "LocalHost:80", "127.0.0.1:8080", "127.9.9.9", "[::1]:1", "a.localhost:8080"] {
            assert!(is_local(host), "{host}");
        }
        for host in ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "10.0.0.1", "", "a b", "[::2]"]
        {
            assert!(!is_local(host), "{host}");
        }
    }

    #[test]
    fn pages_of_other_sites_are_known_by_their_headers() {
        let cases = [
            (None, None, false),
            (Some("http://localhost:3000"), None, false),
            (Some("http://127.0.0.1:8080"), Some("same-origin"), false),
            (Some("https://evil.example"), None, true),
            (Some("null"), None, true),
            (None, Some("cross-site"), true),
        ];
        for (origin, site, expected) in cases {
            let mut headers = HeaderMap::new();
            headers.extend(origin.map(|origin| (header::ORIGIN, origin.parse().unwrap())));
            headers.extend(site.map(|site| (HeaderName::from_static("sec-fetch-site"), site.parse().unwrap())));
            assert_eq!(is_cross_site(&headers, &[]), expected, "{origin:?} {site:?}");
            let is_named = origin == Some("https://evil.example");
            let named = ["https://evil.example".to_owned()];
            assert_eq!(is_cross_site(&headers, &named), expected && !is_named, "{origin:?} {site:?}");
        }
    }
}
