//! The pages for people: `/`, on which a mesh is dropped and its picture found, and `/status` for operators. They are built
//! from `web/` and hold no data: what they show they fetch from the interface, with the key of the one who looks.
//!
//! A client that does not ask for HTML, such as curl, gets a text at `/` with a command to try.

use std::sync::LazyLock;

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::response::Response;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::digest::Digest;
use crate::http::static_document::StaticDocument;

static FRONT: LazyLock<Page> = LazyLock::new(|| Page::new(include_str!("../../page/index.html")));
static STATUS: LazyLock<Page> = LazyLock::new(|| Page::new(include_str!("../../page/status.html")));
static TEXT: LazyLock<StaticDocument> = LazyLock::new(|| text("127.0.0.1:8080"));

/// The text, up to the host of its curl line, and the rest.
const WORDS: &str = "meshsnap: POST a mesh, get a picture.

  curl --data-binary @model.obj 'http://HOST/v1/render?style=wire' -o model.png

It reads OBJ, STL, PLY, OFF, FBX, 3MF, glTF and GLB files, or a zip with one, and writes PNG, WebP or JPEG.
Where keys are configured, add -H \"Authorization: Bearer $KEY\".

  /                 in a browser: drop a mesh, turn it, copy the line
  /status           in a browser: the queue, for operators
  /v1/capabilities  formats, styles, keys, limits, load
  /v1/schema        the JSON Schema of requests
  /openapi.json     every path
  /metrics          counters and gauges, for Prometheus
  /healthz /readyz /version
";

/// The page on which a mesh is dropped, or the text. It needs no API key, because it is the same for all clients.
pub async fn front(headers: HeaderMap) -> Response {
    let host = headers.get(header::HOST).and_then(|host| host.to_str().ok()).filter(|host| is_plain(host));
    let mut response = match host {
        _ if wants_html(&headers) => FRONT.answer(&headers),
        Some(host) => text(host).answer(&headers),
        None => TEXT.answer(&headers),
    };
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept, host"));
    response
}

/// The page for operators. What it shows needs a key with the scope admin where keys are configured.
pub async fn status(headers: HeaderMap) -> Response {
    STATUS.answer(&headers)
}

/// A page, and the policy that lets the browser run its own script and use its own style, and nothing else.
struct Page {
    document: StaticDocument,
    policy: HeaderValue,
}

impl Page {
    fn new(html: &'static str) -> Self {
        let [script, style] =
            [("<script type=\"module\">", "</script>"), ("<style>", "</style>")].map(|ends| hash_of(html, ends));
        // Pictures that need a key are fetched, and shown as blobs.
        let policy = format!(
            "default-src 'none'; script-src {script}; style-src {style}; img-src 'self' blob: data:; connect-src 'self'; \
             base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        );
        let policy = HeaderValue::try_from(policy).unwrap_or(HeaderValue::from_static("default-src 'none'"));
        Self { document: StaticDocument::new(html, "text/html; charset=utf-8"), policy }
    }

    fn answer(&self, headers: &HeaderMap) -> Response {
        let mut response = self.document.answer(headers);
        response.headers_mut().extend([
            (header::CONTENT_SECURITY_POLICY, self.policy.clone()),
            // An address may have a signature.
            (HeaderName::from_static("referrer-policy"), HeaderValue::from_static("no-referrer")),
        ]);
        response
    }
}

/// The source of the policy for the element of a page between a tag and its end: the hash of its text.
fn hash_of(html: &str, (tag, end): (&str, &str)) -> String {
    let text = html.split_once(tag).and_then(|(_, rest)| rest.split_once(end));
    text.map_or_else(
        || "'none'".to_owned(),
        |(text, _)| format!("'sha256-{}'", STANDARD.encode(Digest::of(text.as_bytes()).as_bytes())),
    )
}

/// True for a browser that opens a page.
fn wants_html(headers: &HeaderMap) -> bool {
    let accepted = headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
    accepted.flat_map(|value| value.split(',')).any(|range| {
        let (media_type, weight) = range.split_once(';').unwrap_or((range, ""));
        media_type.trim().eq_ignore_ascii_case("text/html") && !matches!(weight.trim(), "q=0" | "q=0.0")
    })
}

fn text(host: &str) -> StaticDocument {
    StaticDocument::new(WORDS.replace("HOST", host), "text/plain; charset=utf-8")
}

/// True for a host that means nothing in a shell.
fn is_plain(host: &str) -> bool {
    host.len() <= 255 && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-:[]".contains(&byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_page_has_one_script_and_one_style_whose_hashes_are_allowed() {
        for page in [&FRONT, &STATUS] {
            let policy = page.policy.to_str().unwrap();
            assert_eq!(policy.matches("'sha256-").count(), 2, "{policy}");
        }
        for html in [include_str!("../../page/index.html"), include_str!("../../page/status.html")] {
            assert_eq!((html.matches("<script").count(), html.matches("<style").count()), (1, 1));
        }
        // The hash of nothing, as other programs print it.
        let nothing = hash_of("<style></style>", ("<style>", "</style>"));
        assert_eq!(nothing, "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='");
    }

    #[test]
    fn browsers_get_the_page_and_other_clients_the_text() {
        let wants = |value: &str| wants_html(&HeaderMap::from_iter([(header::ACCEPT, value.parse().unwrap())]));
        assert!(wants("text/html,application/xhtml+xml;q=0.9,*/*;q=0.8") && wants("*/*, Text/HTML;q=0.5"));
        assert!(!wants("*/*") && !wants("text/html;q=0") && !wants("text/plain") && !wants_html(&HeaderMap::new()));
    }
}
