//! The daemon over HTTP: what it answers.

use std::io::{Read as _, Write as _};

use crate::support::server::{Answer, CUBE_OBJ, Server};

#[test]
fn a_posted_mesh_comes_back_as_a_picture() {
    let server = Server::start(&[]);
    let answer = server.post("/v1/render?style=wire&size=96x64", CUBE_OBJ);
    answer.picture(96, 64);
    assert_eq!(answer.header("content-type"), Some("image/png"));
    assert_eq!(answer.header("x-render-backend"), Some("cpu"));
    let etag = answer.header("etag").unwrap();
    assert!(etag.len() == 34 && etag.starts_with('"') && etag.ends_with('"'), "{etag}");
    let timing = answer.header("server-timing").unwrap();
    for part in ["queue", "parse", "plan", "render", "encode"] {
        assert!(timing.contains(&format!("{part};dur=")), "{timing}");
    }
    // The stages of drawing follow, as far as they ran.
    let names: Vec<&str> = timing.split(", ").filter_map(|item| item.split(';').next()).collect();
    let drawing = ["transform", "sort", "face_colors", "visibility", "shade", "lines", "resolve", "encode_rows"];
    let ran: Vec<&str> = drawing.into_iter().filter(|stage| names.contains(stage)).collect();
    assert!(names[5..] == ran && ran.contains(&"visibility") && ran.contains(&"lines"), "{timing}");
    let again = server.post("/v1/render?style=wire&size=96x64", CUBE_OBJ);
    assert_eq!(again.body, answer.body);
    assert_eq!(again.header("etag"), answer.header("etag"));
    let other = server.post("/v1/render?style=flat&size=96x64", CUBE_OBJ);
    assert_ne!(other.header("etag"), answer.header("etag"));
}

#[test]
fn every_style_and_format_is_drawn() {
    let server = Server::start(&[]);
    let mut cases = 0;
    for style in ["flat", "smooth", "unlit", "wire", "wireframe", "outline", "hidden-line", "topology"] {
        for (format, media_type) in [("png", "image/png"), ("webp", "image/webp"), ("jpeg", "image/jpeg")] {
            let answer = server.post(&format!("/v1/render?style={style}&size=48&format={format}"), CUBE_OBJ);
            answer.picture(48, 48);
            assert_eq!(answer.header("content-type"), Some(media_type), "{style}");
            cases += 1;
        }
    }
    assert_eq!(cases, 24);
}

#[test]
fn the_format_comes_from_the_document_then_from_accept_then_is_png() {
    let server = Server::start(&[]);
    let cases = [
        ("", "*/*", "image/png"),
        ("", "image/webp", "image/webp"),
        ("", "text/html, image/jpeg;q=0.9, */*;q=0.1", "image/jpeg"),
        ("&format=png", "image/webp", "image/png"),
        ("&image.format=webp", "text/html", "image/webp"),
    ];
    for (query, accept, expected) in cases {
        let path = format!("/v1/render?size=16{query}");
        let answer = server.request("POST", &path, &[&format!("Accept: {accept}")], CUBE_OBJ);
        assert_eq!(answer.header("content-type"), Some(expected), "{query} {accept}");
    }
    server.request("POST", "/v1/render", &["Accept: text/html"], CUBE_OBJ).problem(406, "not_acceptable");
}

#[test]
fn the_content_type_of_curl_does_not_matter() {
    let server = Server::start(&[]);
    for media_type in ["application/x-www-form-urlencoded", "model/obj", "text/plain", "nonsense"] {
        let header = format!("Content-Type: {media_type}");
        server.request("POST", "/v1/render?size=16", &[&header], CUBE_OBJ).picture(16, 16);
    }
}

pub fn form(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, content) in parts {
        body.extend(format!("--XX\r\nContent-Disposition: form-data; name=\"{name}\"; filename=\"x\"\r\n\r\n").bytes());
        body.extend(*content);
        body.extend(b"\r\n");
    }
    body.extend(b"--XX--\r\n");
    body
}

pub const FORM: &str = "Content-Type: multipart/form-data; boundary=XX";

#[test]
fn a_form_brings_its_document_and_the_query_overrides_it() {
    let server = Server::start(&[]);
    let document = br#"{"style":"wire","image":{"width":40,"height":30}}"#;
    let body = form(&[("request", document), ("file", CUBE_OBJ)]);
    server.request("POST", "/v1/render", &[FORM], &body).picture(40, 30);
    server.request("POST", "/v1/render?image.height=20", &[FORM], &body).picture(40, 20);
    server.request("POST", "/v1/render?size=8", &[FORM], &form(&[("file", CUBE_OBJ)])).picture(8, 8);
}

#[test]
fn the_front_page_says_what_this_is() {
    let server = Server::start(&[]);
    let page = server.get("/");
    assert_eq!((page.status, page.header("content-type")), (200, Some("text/plain; charset=utf-8")));
    let text = String::from_utf8(page.body).unwrap();
    assert!(text.contains("curl --data-binary @model.obj 'http://localhost/v1/render?style=wire'"), "{text}");
    let paths: Vec<&str> =
        text.lines().filter(|line| line.starts_with("  /")).flat_map(str::split_whitespace).collect();
    let paths: Vec<&str> = paths.into_iter().filter(|word| word.starts_with('/')).collect();
    assert_eq!(paths.len(), 9, "{paths:?}");
    for path in paths {
        assert_eq!(server.get(path).status, 200, "{path}");
    }
    // Browsers get pages. Their script and their style are allowed, and nothing else is.
    for path in ["/", "/status"] {
        let page = server.request("GET", path, &["Accept: text/html,application/xhtml+xml,*/*;q=0.8"], b"");
        assert_eq!((page.status, page.header("content-type")), (200, Some("text/html; charset=utf-8")));
        let policy = page.header("content-security-policy").unwrap();
        assert!(policy.starts_with("default-src 'none'; script-src 'sha256-"), "{policy}");
        assert!(!policy.contains("unsafe") && policy.matches("'sha256-").count() == 2, "{policy}");
        let known = format!("If-None-Match: {}", page.header("etag").unwrap());
        assert_eq!(server.request("GET", path, &["Accept: text/html", &known], b"").status, 304);
    }
    // A host that could mean something in a shell is not written there.
    let hostile = server.send("GET / HTTP/1.1\r\nHost: <script>\r\nConnection: close\r\n\r\n", b"");
    assert!(!String::from_utf8_lossy(&hostile.body).contains("script>"), "{hostile:?}");
}

#[test]
fn paths_and_methods_that_are_not_there() {
    let server = Server::start(&[]);
    for path in
        ["/v1", "//", "/v1/render/", "/v1/nothing", "/v1/jobs/x", "/v1/jobs/%ff", "/v1/jobs/../../etc/passwd", "/%00"]
    {
        server.get(path).problem(404, "not_found");
    }
    let cases = [
        ("GET", "/v1/render", "POST"),
        ("PUT", "/v1/jobs", "POST"),
        ("POST", "/healthz", "GET"),
        ("PATCH", "/v1/jobs/x", "DELETE"),
    ];
    for (method, path, allowed) in cases {
        let answer = server.request(method, path, &[], b"");
        answer.problem(405, "method_not_allowed");
        assert!(answer.header("allow").unwrap().contains(allowed), "{:?}", answer.headers);
    }
    assert_eq!(server.send("nonsense\r\n\r\n", b"").status, 400);
}

#[test]
fn request_ids_are_kept_if_sane_and_made_otherwise() {
    let server = Server::start(&[]);
    let echoed = server.request("GET", "/healthz", &["X-Request-Id: abc-123_X.9"], b"");
    assert_eq!(echoed.header("x-request-id"), Some("abc-123_X.9"));
    let long = "y".repeat(200);
    for bad in ["", "a b", "<script>", "a\tb", long.as_str()] {
        let answer = server.request("GET", "/healthz", &[&format!("X-Request-Id: {bad}")], b"");
        let id = answer.header("x-request-id").unwrap();
        assert!(id != bad && id.len() == 36, "{bad}: {id}");
    }
    let error = server.request("POST", "/v1/render?size=0", &["X-Request-Id: mine"], b"");
    assert_eq!(error.json()["request_id"], "mine");
}

#[test]
fn the_process_says_how_it_is() {
    let server = Server::start(&["--limit-triangles", "1234"]);
    assert_eq!(server.get("/healthz").json()["status"], "ok");
    assert_eq!(server.get("/readyz").json()["status"], "ready");
    let version = server.get("/version").json();
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    let commit = version["commit"].as_str();
    assert!(commit.is_none_or(|commit| commit.len() >= 7), "{version}");
    // Tests are not built as a release, and then the commit is the one that the builder has named.
    assert_eq!(commit.is_some(), option_env!("MESHSNAP_COMMIT").is_some(), "{version}");
    let capabilities = server.get("/v1/capabilities").json();
    assert_eq!(capabilities["limits"]["triangles"], 1234);
    assert_eq!(capabilities["limits"]["body_bytes"], 64 << 20);
    assert_eq!(capabilities["styles"].as_array().unwrap().len(), 12);
    assert_eq!(capabilities["styles"], capabilities["request_words"]["style"]);
    assert_eq!(capabilities["request_words"]["wire.hidden"], serde_json::json!(["hide", "show", "fade"]));
    assert!(capabilities["request_keys"].as_array().unwrap().contains(&"topology.nonmanifold".into()));
    let backend = &capabilities["backend"];
    assert_eq!((&backend["default"], &backend["choices"]), (&"cpu".into(), &serde_json::json!(["auto", "gpu", "cpu"])));
    for key in ["state", "name", "driver", "device_type", "features", "reason"] {
        assert!(backend["gpu"].as_object().unwrap().contains_key(key), "{backend}");
    }
    assert!(["not opened", "none"].contains(&backend["gpu"]["state"].as_str().unwrap()), "{backend}");
    let mut stream = server.connect();
    stream.write_all(b"HEAD /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut head = String::new();
    stream.read_to_string(&mut head).unwrap();
    assert!(head.starts_with("HTTP/1.1 200") && head.ends_with("\r\n\r\n"), "{head}");
}

#[test]
fn a_limit_names_the_flag_that_raises_it() {
    let server = Server::start(&["--limit-triangles", "5"]);
    let answer = server.post("/v1/render?size=16", CUBE_OBJ);
    let detail = answer.problem(422, "limit_exceeded");
    assert_eq!(answer.json()["flag"], "--limit-triangles", "{detail}");
}

#[test]
fn keys_are_asked_for_where_they_are_configured() {
    let mut command = crate::support::server::meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one, two");
    let server = Server::start_with(&mut command);
    let answer = server.post("/v1/render?size=16", CUBE_OBJ);
    answer.problem(401, "unauthorized");
    assert_eq!(answer.header("www-authenticate"), Some("Bearer"));
    for (key, status) in [("one", 200), ("two", 200), ("three", 401), ("", 401)] {
        let header = format!("Authorization: Bearer {key}");
        assert_eq!(server.request("POST", "/v1/render?size=16", &[&header], CUBE_OBJ).status, status, "{key}");
    }
    assert_eq!(server.get("/healthz").status, 200);
    assert_eq!(server.get("/v1/capabilities").status, 401);
}

#[test]
fn connections_are_reused_and_pipelined_answers_come_in_order() {
    let server = Server::start(&[]);
    let mut stream = server.connect();
    for _ in 0..3 {
        stream
            .write_all(
                b"GET /version HTTP/1.1\r\nHost: localhost\r\n\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n",
            )
            .unwrap();
        assert_eq!(Answer::read(&mut stream).json()["name"], "meshsnap");
        assert_eq!(Answer::read(&mut stream).json()["status"], "ok");
    }
    // An error answer leaves the connection usable too.
    stream.write_all(b"POST /v1/render?size=0 HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n").unwrap();
    Answer::read(&mut stream).problem(400, "out_of_range");
    stream.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    assert_eq!(Answer::read(&mut stream).status, 200);
}
