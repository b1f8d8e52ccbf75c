//! Headers of HTTP caching: `ETag`, the `Cache-Control` of answers that are kept for a day, and the
//! comparison of `If-None-Match` with a tag.
//!
//! They are written by hand: the crate `headers` would save little, and bring SHA-1 and an older
//! version of base64 with it.

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};

/// True if the client has the representation with this tag. The comparison is weak, as RFC 9110
/// (13.1.2) demands for `If-None-Match`.
pub fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let opaque = |tag: &str| tag.trim().trim_start_matches("W/").to_owned();
    let wanted = opaque(tag);
    let lines = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|v| v.to_str().ok());
    lines.flat_map(|line| line.split(',')).any(|given| given.trim() == "*" || opaque(given) == wanted)
}

/// The `ETag` header with this tag.
pub fn etag(tag: &str) -> (HeaderName, HeaderValue) {
    (header::ETAG, HeaderValue::from_str(tag).unwrap_or_else(|_| HeaderValue::from_static("\"\"")))
}

/// A strong tag made of 128 hash bits of the body. Different bodies share one only by chance.
pub fn content_tag(body: &[u8]) -> String {
    let half = |seed| rapidhash::v3::rapidhash_v3_seeded(body, &rapidhash::v3::RapidSecrets::seed(seed));
    format!("\"{:032x}\"", u128::from(half(1)) << 64 | u128::from(half(2)))
}

/// `Cache-Control` for what follows from a stored mesh, a query and this version of the program.
/// After a day, caches revalidate, because a newer version of the program may change the answer.
/// With API keys the answer is `private`, so that shared caches do not keep it.
pub fn cache_for_a_day(has_keys: bool) -> (HeaderName, HeaderValue) {
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
