//! The daemon over HTTP: what it answers to good and bad requests.

use std::io::{Read as _, Write as _};
use std::time::{Duration, Instant};

use crate::server::{Answer, CUBE_OBJ, PATIENCE, Server};

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
    for style in ["flat", "smooth", "unlit", "wire", "wireframe", "outline", "hidden-line"] {
        for (format, media_type) in [("png", "image/png"), ("webp", "image/webp"), ("jpeg", "image/jpeg")] {
            let answer = server.post(&format!("/v1/render?style={style}&size=48&format={format}"), CUBE_OBJ);
            answer.picture(48, 48);
            assert_eq!(answer.header("content-type"), Some(media_type), "{style}");
            cases += 1;
        }
    }
    assert_eq!(cases, 21);
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

fn form(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, content) in parts {
        body.extend(format!("--XX\r\nContent-Disposition: form-data; name=\"{name}\"; filename=\"x\"\r\n\r\n").bytes());
        body.extend(*content);
        body.extend(b"\r\n");
    }
    body.extend(b"--XX--\r\n");
    body
}

const FORM: &str = "Content-Type: multipart/form-data; boundary=XX";

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
fn bad_forms_are_refused_precisely() {
    let server = Server::start(&[]);
    let cases: [(Vec<u8>, u16, &str); 8] = [
        (form(&[("request", b"{}")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("other", b"")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("request", b"{}"), ("request", b"{}")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("file", CUBE_OBJ)]), 415, "bundle_not_supported"),
        (form(&[("file", CUBE_OBJ), ("request", b"{")]), 400, "not_json"),
        (form(&[("file", CUBE_OBJ), ("request", br#"{"sise":1}"#)]), 400, "unknown_key"),
        (form(&[("file", CUBE_OBJ)])[..40].to_vec(), 400, "bad_form"),
        (b"no form at all".to_vec(), 400, "bad_form"),
    ];
    for (body, status, code) in cases {
        server.request("POST", "/v1/render", &[FORM], &body).problem(status, code);
    }
    let no_boundary = "Content-Type: multipart/form-data";
    server.request("POST", "/v1/render", &[no_boundary], CUBE_OBJ).problem(400, "bad_form");
}

/// Every bad query, and a part of what the answer must say.
#[test]
fn bad_queries_are_a_400_that_names_the_key() {
    let server = Server::start(&[]);
    let cases = [
        ("sise=1", "unknown_key", "size"),
        ("wire.colour=%23f00", "unknown_key", "wire.color"),
        ("size=0", "out_of_range", "from 1 to 4096"),
        ("size=1e9", "out_of_range", "from 1 to 4096"),
        ("size=-5", "out_of_range", "from 1 to 4096"),
        ("size=NaN", "out_of_range", "from 1 to 4096"),
        ("size=", "wrong_type", "N or WxH"),
        ("style=toon", "out_of_range", "wireframe"),
        ("style=topology", "not_supported_yet", "topology"),
        ("wire.thickness=inf", "out_of_range", "from 0 to 10"),
        ("camera.eye=1,2,3", "conflicting_keys", "camera.target"),
        ("format_in=dae", "out_of_range", "obj, gltf, glb, stl"),
        ("background=%00", "out_of_range", "background"),
        ("%ff=%ff", "unknown_key", "no key"),
        ("=", "unknown_key", "no key"),
        ("style", "out_of_range", "style"),
    ];
    for (query, code, part) in cases {
        let detail = server.post(&format!("/v1/render?{query}"), CUBE_OBJ).problem(400, code);
        assert!(detail.contains(part), "{query}: {detail}");
    }
    assert_eq!(cases.len(), 16);
    server.post("/v1/render?size=8&wire.color=f00&background=%23fff8&format_in=obj", CUBE_OBJ).picture(8, 8);
}

#[test]
fn bytes_that_are_no_mesh_are_a_precise_4xx() {
    let server = Server::start(&[]);
    let mut noise = vec![0_u8; 100_000];
    let mut state = 1_u32;
    for byte in &mut noise {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *byte = (state >> 24) as u8;
    }
    let mut glb = b"glTF\x02\0\0\0\xff\xff\xff\xff\x10\0\0\0JSON{\"asset\":{}}   ".to_vec();
    let (random, cut) = (noise.as_slice(), &CUBE_OBJ[..40]);
    let cases: [(&str, &[u8], u16); 9] = [
        ("an empty body", b"", 415),
        ("random bytes", random, 415),
        ("a text", b"Dear server, please draw a bunny.", 415),
        ("an OBJ of only comments", b"# nothing\n# at all\n", 415),
        ("an OBJ without faces", cut, 422),
        ("indices out of range", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", 422),
        ("NaN and infinite vertices", b"v nan 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n", 422),
        ("a GLB whose header lies", &glb, 422),
        ("glTF without a mesh", br#"{"asset":{"version":"2.0"}}"#, 422),
    ];
    for (name, body, status) in cases {
        let answer = server.post("/v1/render?size=16", body);
        assert_eq!(answer.status, status, "{name}: {}", String::from_utf8_lossy(&answer.body));
        let code = answer.json()["code"].as_str().unwrap().to_owned();
        let detail = answer.problem(status, &code);
        assert!(detail.len() > 20, "{name}: {detail}");
        server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    }
    glb.truncate(10);
    assert!((400..500).contains(&server.post("/v1/render", &glb).status));
    // Comments alone could be anything; said to be an OBJ, they are an OBJ without a mesh.
    server.post("/v1/render?format_in=obj", b"# nothing\n# at all\n").problem(422, "mesh_empty");
    server.post("/v1/render", b"PK\x03\x04 a zip by its bytes").problem(415, "bundle_not_supported");
    let zip = ["Content-Type: application/zip"];
    server.request("POST", "/v1/render", &zip, CUBE_OBJ).problem(415, "bundle_not_supported");
    let gzip = ["Content-Encoding: gzip"];
    server.request("POST", "/v1/render", &gzip, CUBE_OBJ).problem(415, "content_encoding");
}

#[test]
fn a_huge_announced_body_is_refused_at_once_and_unread() {
    let server = Server::start(&[]);
    for expect in ["", "Expect: 100-continue\r\n"] {
        let head = format!("POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Length: 10000000000\r\n{expect}\r\n");
        let began = Instant::now();
        let answer = server.send(&head, b"");
        let detail = answer.problem(413, "body_too_large");
        assert!(detail.contains("67108864") && answer.json()["flag"] == "--limit-body-bytes", "{detail}");
        assert!(began.elapsed() < Duration::from_secs(1), "{:?}", began.elapsed());
    }
    // A length beyond u64 is HTTP that cannot be read.
    let head = "POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999999\r\n\r\n";
    assert_eq!(server.send(head, b"").status, 400);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn a_client_that_sends_on_still_hears_the_413() {
    let server = Server::start(&["--limit-body-bytes", "100000"]);
    for chunked in [false, true] {
        let mut stream = server.connect();
        let length = if chunked { "Transfer-Encoding: chunked" } else { "Content-Length: 50000000" };
        write!(stream, "POST /v1/render HTTP/1.1\r\nHost: x\r\n{length}\r\n\r\n").unwrap();
        let chunk = vec![b'v'; 0x4000];
        for _ in 0..200 {
            let sent = if chunked {
                write!(stream, "4000\r\n").and_then(|()| stream.write_all(&chunk)).and_then(|()| write!(stream, "\r\n"))
            } else {
                stream.write_all(&chunk)
            };
            if sent.is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Answer::read(&mut stream).problem(413, "body_too_large");
    }
}

#[test]
fn uploads_share_their_memory() {
    let server = Server::start(&["--uploads-bytes", "1000"]);
    let mut long = CUBE_OBJ.to_vec();
    long.extend(vec![b'\n'; 2000]);
    let answer = server.post("/v1/render?size=8", &long);
    answer.problem(429, "uploads_full");
    assert!(answer.header("retry-after").is_some());
    for _ in 0..10 {
        server.post("/v1/render?size=8", CUBE_OBJ).picture(8, 8);
    }
}

#[test]
fn slow_clients_are_let_go() {
    let server = Server::start(&["--header-timeout-ms", "300", "--body-timeout-ms", "300"]);
    let beginnings: [&[u8]; 4] = [b"", b"PRI * HT", b"GET /healthz HTT", b"GET /healthz HTTP/1.1\r\nHost: x\r\n"];
    for beginning in beginnings {
        let mut stream = server.connect();
        stream.write_all(beginning).unwrap();
        let began = Instant::now();
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        let took = began.elapsed();
        assert!(took < Duration::from_secs(5), "{:?} held for {took:?}", String::from_utf8_lossy(beginning));
    }
    let head = "POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\nv 1 2 3\n";
    server.send(head, b"").problem(408, "body_timeout");
}

#[test]
fn a_body_that_ends_early_costs_nothing() {
    let server = Server::start(&["--workers", "1"]);
    for _ in 0..20 {
        let mut stream = server.connect();
        stream.write_all(b"POST /v1/render HTTP/1.1\r\nHost: x\r\nContent-Length: 5000\r\n\r\nv 1 2 3\n").unwrap();
    }
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    server.wait_for_load(|load| load["queued"] == 0 && load["running"] == 0);
}

#[test]
fn paths_and_methods_that_are_not_there() {
    let server = Server::start(&[]);
    for path in ["/", "/v1", "/v1/render/", "/v1/nothing", "/v1/jobs/x", "/v1/jobs/../../etc/passwd", "/%00"] {
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
    assert_eq!(server.get("/version").json()["version"], env!("CARGO_PKG_VERSION"));
    let capabilities = server.get("/v1/capabilities").json();
    assert_eq!(capabilities["limits"]["triangles"], 1234);
    assert_eq!(capabilities["limits"]["body_bytes"], 64 << 20);
    assert!(capabilities["styles"].as_array().unwrap().len() >= 7);
    let backend = &capabilities["backend"];
    assert_eq!((&backend["default"], &backend["choices"]), (&"cpu".into(), &serde_json::json!(["auto", "gpu", "cpu"])));
    for key in ["state", "name", "driver", "device_type", "features", "reason"] {
        assert!(backend["gpu"].as_object().unwrap().contains_key(key), "{backend}");
    }
    assert!(["not opened", "none"].contains(&backend["gpu"]["state"].as_str().unwrap()), "{backend}");
    let mut stream = server.connect();
    stream.write_all(b"HEAD /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").unwrap();
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
    let mut command = crate::server::meshsnap();
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
        stream.write_all(b"GET /version HTTP/1.1\r\nHost: x\r\n\r\nGET /healthz HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
        assert_eq!(Answer::read(&mut stream).json()["name"], "meshsnap");
        assert_eq!(Answer::read(&mut stream).json()["status"], "ok");
    }
    // An error answer leaves the connection usable too.
    stream.write_all(b"POST /v1/render?size=0 HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n").unwrap();
    Answer::read(&mut stream).problem(400, "out_of_range");
    stream.write_all(b"GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
    assert_eq!(Answer::read(&mut stream).status, 200);
}

/// A refusal that comes before the body is read must not break the connection for the next request, or say that it does.
#[test]
fn early_refusals_leave_the_connection_in_order() {
    let server = Server::start(&["--limit-body-bytes", "3000000"]);
    let mut stream = server.connect();
    for length in [10, 100_000, 900_000] {
        let head = format!("POST /v1/render?size=0 HTTP/1.1\r\nHost: x\r\nContent-Length: {length}\r\n\r\n");
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&vec![b'v'; length]).unwrap();
        let answer = Answer::read(&mut stream);
        answer.problem(400, "out_of_range");
        assert_eq!(answer.header("connection"), None, "{length}");
    }
    let head = "POST /v1/render?size=0 HTTP/1.1\r\nHost: x\r\nContent-Length: 2000000\r\n";
    for more in ["", "Expect: 100-continue\r\n"] {
        let mut stream = server.connect();
        write!(stream, "{head}{more}\r\n").unwrap();
        let answer = Answer::read(&mut stream);
        answer.problem(400, "out_of_range");
        assert_eq!(answer.header("connection"), Some("close"));
    }
}

#[test]
fn a_connection_too_many_is_told_so() {
    let server = Server::start(&["--connections", "2"]);
    let held = [server.connect(), server.connect()];
    let began = Instant::now();
    while server.send("GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n", b"").status != 503 {
        assert!(began.elapsed() < PATIENCE);
    }
    drop(held);
    while server.send("GET /healthz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", b"").status != 200 {
        assert!(began.elapsed() < PATIENCE);
    }
}
