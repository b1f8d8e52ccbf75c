//! `ETag`, `If-None-Match` and `Cache-Control`.

use axum::http::{HeaderMap, HeaderValue, header};

/// Whether the client has the representation of this tag. Weak comparison, as RFC 9110 (13.1.2) wants it for `If-None-Match`.
pub fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let opaque = |tag: &str| tag.trim().trim_start_matches("W/").to_owned();
    let wanted = opaque(tag);
    let lines = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|v| v.to_str().ok());
    lines.flat_map(|line| line.split(',')).any(|given| given.trim() == "*" || opaque(given) == wanted)
}

/// A tag as a header.
pub fn etag(tag: &str) -> (header::HeaderName, HeaderValue) {
    (header::ETAG, HeaderValue::from_str(tag).unwrap_or_else(|_| HeaderValue::from_static("\"\"")))
}

/// For what follows from a stored mesh, a query and this version of the program: good for a day, after which the tag tells
/// whether a newer version sees it otherwise. Where keys are asked for, a shared cache must not give it away.
pub fn day(has_keys: bool) -> (header::HeaderName, HeaderValue) {
    let value = if has_keys { "private, max-age=86400, immutable" } else { "public, max-age=86400, immutable" };
    (header::CACHE_CONTROL, HeaderValue::from_static(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_compared_weakly() {
        let cases = [
            ("\"a\"", "\"a\"", true),
            ("W/\"a\"", "\"a\"", true),
            ("\"a\"", "W/\"a\"", true),
            ("\"x\", W/\"a\" ,\"y\"", "\"a\"", true),
            ("*", "\"a\"", true),
            ("\"b\"", "\"a\"", false),
            ("a", "\"a\"", false),
            ("", "\"a\"", false),
        ];
        for (given, tag, expected) in cases {
            let headers = HeaderMap::from_iter([(header::IF_NONE_MATCH, given.parse().unwrap())]);
            assert_eq!(is_known(&headers, tag), expected, "{given} {tag}");
        }
        assert!(!is_known(&HeaderMap::new(), "\"a\""));
        assert_eq!(cases.len(), 8);
    }
}
