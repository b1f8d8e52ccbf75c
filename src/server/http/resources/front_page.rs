//! `/`: an HTML page that says what the server does, with a command to try and links to the rest of
//! the interface.

use std::sync::LazyLock;

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::Response;

use crate::http::static_document::StaticDocument;

/// The page, up to the host of its curl line, and the rest. The host is filled in where the request names a plain one.
const PAGE: &str = include_str!("front_page.html");

static PLAIN: LazyLock<StaticDocument> = LazyLock::new(|| page("127.0.0.1:8080"));

/// The page. It needs no API key, because it is the same for all clients.
pub async fn get(headers: HeaderMap) -> Response {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).filter(|host| is_plain(host));
    let mut response = match host {
        Some(host) => page(host).answer(&headers),
        None => PLAIN.answer(&headers),
    };
    response.headers_mut().extend([
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static("default-src 'none'; style-src 'unsafe-inline'")),
        (HeaderName::from_static("vary"), HeaderValue::from_static("host")),
    ]);
    response
}

fn page(host: &str) -> StaticDocument {
    StaticDocument::new(PAGE.replace("HOST", host), "text/html; charset=utf-8")
}

/// True for a host that means nothing in HTML or in a shell.
fn is_plain(host: &str) -> bool {
    host.len() <= 255 && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-:[]".contains(&byte))
}
