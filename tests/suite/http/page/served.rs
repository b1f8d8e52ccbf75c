//! The pages as they are sent: their policy, their tags, and that they need no key.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest as _, Sha256};

use crate::support::server::{Server, meshsnap};

/// Headers of a browser that opens a page.
const BROWSER: &str = "Accept: text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8";

/// The text of the only element that begins with this tag.
fn only<'t>(html: &'t str, begin: &str, end: &str) -> &'t str {
    assert_eq!(html.matches(begin).count(), 1, "{begin}");
    html.split_once(begin).unwrap().1.split_once(end).unwrap().0
}

#[test]
fn pages_are_sent_to_everybody_under_a_policy_of_hashes() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one");
    let server = Server::start_with(&mut command);
    for path in ["/", "/status"] {
        let page = server.request("GET", path, &[BROWSER], b"");
        assert_eq!((page.status, page.header("content-type")), (200, Some("text/html; charset=utf-8")), "{path}");
        let policy = page.header("content-security-policy").unwrap().to_owned();
        let html = String::from_utf8(page.body.clone()).unwrap();
        let hash = |text: &str| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())));
        let script = hash(only(&html, "<script type=\"module\">", "</script>"));
        let style = hash(only(&html, "<style>", "</style>"));
        let expected = format!(
            "default-src 'none'; script-src {script}; style-src {style}; img-src 'self' blob: data:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        );
        assert_eq!(policy, expected, "{path}");
        // Behind a prefix, addresses that begin with a slash lead elsewhere.
        assert!(!html.contains("href=\"/") && !html.contains("src=\"/"), "{path}");
        let known = format!("If-None-Match: {}", page.header("etag").unwrap());
        let again = server.request("GET", path, &[BROWSER, &known], b"");
        assert_eq!((again.status, again.body.len()), (304, 0), "{path}");
        let head = server.request("HEAD", path, &[BROWSER], b"");
        assert_eq!((head.status, head.header("etag")), (200, page.header("etag")), "{path}");
    }
    let other = server.request("GET", "/", &["Accept: */*"], b"");
    assert_ne!(other.header("etag"), server.request("GET", "/", &[BROWSER], b"").header("etag"));
    server.get("/v1/status").problem(401, "unauthorized");
}
