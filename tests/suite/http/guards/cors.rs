//! CORS: what the server tells a browser about pages of other origins.

use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};

const APP: &str = "Origin: https://app.example";

fn preflight(server: &Server, path: &str, origin: &str, method: &str) -> Answer {
    let method = format!("Access-Control-Request-Method: {method}");
    let headers = "Access-Control-Request-Headers: authorization,content-type,idempotency-key,prefer";
    server.request("OPTIONS", path, &[origin, &method, headers], b"")
}

fn words(answer: &Answer, name: &str) -> Vec<String> {
    let values = answer.headers.iter().filter(|(key, _)| key == name).flat_map(|(_, value)| value.split(','));
    values.map(|word| word.trim().to_ascii_lowercase()).collect()
}

fn keyed(origins: &str) -> Server {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--cors-origins", origins]);
    Server::start_with(command.env("MESHSNAP_API_KEYS", "one"))
}

#[test]
fn pages_of_named_origins_may_send_and_read() {
    let server = keyed("https://app.example, http://LOCALHOST:3000");
    for (origin, name) in [(APP, "https://app.example"), ("Origin: http://localhost:3000", "http://localhost:3000")] {
        // A browser asks without a key.
        let asked = preflight(&server, "/v1/meshes/0", origin, "PUT");
        assert_eq!((asked.status, asked.header("access-control-allow-origin")), (200, Some(name)));
        let (methods, headers) =
            (words(&asked, "access-control-allow-methods"), words(&asked, "access-control-allow-headers"));
        for method in ["get", "head", "post", "put", "delete"] {
            assert!(methods.contains(&method.to_owned()), "{methods:?}");
        }
        for header in ["authorization", "content-type", "idempotency-key", "if-none-match", "last-event-id", "prefer"] {
            assert!(headers.contains(&header.to_owned()), "{headers:?}");
        }
        assert_eq!(asked.header("access-control-max-age"), Some("7200"));
    }
    let sent = server.request("POST", "/v1/render?size=16", &[APP, "Authorization: Bearer one"], CUBE_OBJ);
    sent.picture(16, 16);
    assert_eq!(sent.header("access-control-allow-origin"), Some("https://app.example"));
    assert_eq!(sent.header("access-control-allow-credentials"), Some("true"));
    let exposed = words(&sent, "access-control-expose-headers");
    for (name, _) in &sent.headers {
        let every_page_may =
            ["content-type", "content-length", "cache-control", "x-content-type-options"].contains(&name.as_str());
        let is_ours = name.starts_with("x-") || ["etag", "server-timing", "location"].contains(&name.as_str());
        assert!(every_page_may || !is_ours || exposed.contains(name), "{name} cannot be read: {exposed:?}");
    }
    for name in ["etag", "location", "retry-after", "x-request-id", "x-render-backend", "server-timing"] {
        assert!(exposed.contains(&name.to_owned()), "{exposed:?}");
    }
    let vary = words(&sent, "vary");
    assert!(vary.contains(&"origin".to_owned()) && vary.contains(&"accept".to_owned()), "{vary:?}");
    // Errors can be read, too.
    for (headers, status) in [(vec![APP], 401), (vec![APP, "Authorization: Bearer one"], 404)] {
        let error = server.request("GET", "/v1/jobs/x", &headers, b"");
        assert_eq!((error.status, error.header("access-control-allow-origin")), (status, Some("https://app.example")));
        assert!(
            error.header("content-type") == Some("application/problem+json") && error.header("x-request-id").is_some()
        );
    }
}

#[test]
fn other_pages_are_told_nothing() {
    let server = keyed("https://app.example");
    let others = [
        "https://evil.example",
        "http://app.example",
        "https://app.example:8443",
        "https://app.example.evil.example",
        "null",
    ];
    for other in others {
        let origin = format!("Origin: {other}");
        assert_eq!(preflight(&server, "/v1/render", &origin, "POST").header("access-control-allow-origin"), None);
        let sent = server.request("POST", "/v1/render?size=16", &[&origin, "Authorization: Bearer one"], CUBE_OBJ);
        assert_eq!(sent.header("access-control-allow-origin"), None, "{other}");
    }
    let off = Server::start(&[]);
    let asked = preflight(&off, "/v1/render", APP, "POST");
    assert_eq!(asked.status, 405);
    let read = off.request("GET", "/v1/capabilities", &[APP], b"");
    for answer in [asked, read] {
        assert!(answer.headers.iter().all(|(name, _)| !name.starts_with("access-control-")), "{answer:?}");
    }
}

#[test]
fn all_origins_come_without_credentials() {
    let server = keyed("*");
    let asked = preflight(&server, "/v1/jobs", APP, "POST");
    let sent = server.request("POST", "/v1/render?size=16", &[APP, "Authorization: Bearer one"], CUBE_OBJ);
    sent.picture(16, 16);
    for answer in [asked, sent] {
        assert_eq!(answer.header("access-control-allow-origin"), Some("*"));
        assert_eq!(answer.header("access-control-allow-credentials"), None);
    }
}

#[test]
fn on_loopback_without_keys_named_origins_alone_may_post() {
    let server = Server::start(&["--cors-origins", "https://app.example"]);
    let cross = "Sec-Fetch-Site: cross-site";
    server.request("POST", "/v1/render?size=16", &[APP, cross], CUBE_OBJ).picture(16, 16);
    for origin in ["Origin: https://evil.example", "Origin: null", "Sec-Fetch-Mode: no-cors"] {
        let refused = server.request("POST", "/v1/render?size=16", &[origin, cross], CUBE_OBJ);
        refused.problem(403, "cross_site");
        assert_eq!(refused.json()["flag"], "--cors-origins");
    }
    // The name of the server has to be right all the same.
    let head = format!(
        "POST /v1/render HTTP/1.1\r\nHost: evil.example\r\n{APP}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
    );
    server.send(&head, b"").problem(403, "foreign_host");
}
