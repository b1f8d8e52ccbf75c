//! The daemon over HTTP: bad input, bodies that are too large or end early, and slow clients. Each
//! is refused with its own code, and the server answers the next request.

use std::io::{ErrorKind, Read as _, Write as _};
use std::time::{Duration, Instant};

use crate::http::answers::{FORM, form};
use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server};

#[test]
fn bad_forms_are_refused_precisely() {
    let server = Server::start(&[]);
    let cases: [(Vec<u8>, u16, &str); 8] = [
        (form(&[("request", b"{}")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("other", b"")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("request", b"{}"), ("request", b"{}")]), 400, "bad_form"),
        (form(&[("file", CUBE_OBJ), ("file", CUBE_OBJ)]), 400, "bad_form"),
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
        ("max_error=0", "out_of_range", "above 0, at most 255"),
        ("wire.thickness=inf", "out_of_range", "from 0 to 10"),
        ("camera.eye=1,2,3", "conflicting_keys", "camera.target"),
        ("materials.Glass%20v2.1.surface.opacity=3", "out_of_range", "`materials.Glass v2.1.surface.opacity`"),
        ("materials.Glass.opacity=0.3", "unknown_key", "did you mean materials.Glass.surface.opacity"),
        ("light.direction=0,0,0", "out_of_range", "not all zero"),
        ("wire.method=fwidth&wire.thickness=11", "out_of_range", "from 0 to 10 where"),
        ("format_in=dae", "out_of_range", "obj, gltf, glb, stl, ply"),
        ("background=%00", "out_of_range", "background"),
        ("background=%23fff-%23dde", "out_of_range", "did you mean #fff..#dde?"),
        ("%ff=%ff", "unknown_key", "no key"),
        ("=", "unknown_key", "no key"),
        ("style", "out_of_range", "style"),
    ];
    for (query, code, part) in cases {
        let detail = server.post(&format!("/v1/render?{query}"), CUBE_OBJ).problem(400, code);
        assert!(detail.contains(part), "{query}: {detail}");
    }
    assert_eq!(cases.len(), 21);
    server.post("/v1/render?size=8&materials.Glass%20v2.1.wire=%7B%7D&surface.textures=0", CUBE_OBJ).picture(8, 8);
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
    server.post("/v1/render", b"PK\x03\x04 a zip by its bytes").problem(422, "bundle_broken");
    let zip = ["Content-Type: application/zip"];
    server.request("POST", "/v1/render", &zip, CUBE_OBJ).problem(422, "bundle_broken");
    let gzip = ["Content-Encoding: gzip"];
    server.request("POST", "/v1/render", &gzip, CUBE_OBJ).problem(415, "content_encoding");
}

#[test]
fn a_huge_announced_body_is_refused_at_once_and_unread() {
    let server = Server::start(&[]);
    for expect in ["", "Expect: 100-continue\r\n"] {
        let head =
            format!("POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10000000000\r\n{expect}\r\n");
        // An answer at all is the proof: the announced bytes are never sent.
        let answer = server.send(&head, b"");
        let detail = answer.problem(413, "body_too_large");
        assert!(detail.contains("67108864") && answer.json()["flag"] == "--limit-body-bytes", "{detail}");
    }
    // A length beyond u64 is HTTP that cannot be read.
    let head = "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999999999999999\r\n\r\n";
    assert_eq!(server.send(head, b"").status, 400);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn a_client_that_sends_on_still_hears_the_413() {
    let server = Server::start(&["--limit-body-bytes", "100000"]);
    for chunked in [false, true] {
        let mut stream = server.connect();
        let length = if chunked { "Transfer-Encoding: chunked" } else { "Content-Length: 50000000" };
        write!(stream, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\n{length}\r\n\r\n").unwrap();
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
    answer.problem(413, "body_too_large");
    assert_eq!(answer.json()["flag"], "--uploads-bytes", "trying again would be in vain");
    for _ in 0..10 {
        server.post("/v1/render?size=8", CUBE_OBJ).picture(8, 8);
    }
}

#[test]
fn slow_clients_are_let_go() {
    let server = Server::start(&["--header-timeout-ms", "300", "--body-timeout-ms", "300"]);
    let beginnings: [&[u8]; 4] =
        [b"", b"PRI * HT", b"GET /healthz HTT", b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"];
    for beginning in beginnings {
        let mut stream = server.connect();
        stream.write_all(beginning).unwrap();
        let mut rest = Vec::new();
        // The server closes or resets the connection, before the client's own guard ends the read.
        if let Err(error) = stream.read_to_end(&mut rest) {
            let is_guard = [ErrorKind::WouldBlock, ErrorKind::TimedOut].contains(&error.kind());
            assert!(!is_guard, "{:?} is held", String::from_utf8_lossy(beginning));
        }
    }
    let head = "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000\r\n\r\nv 1 2 3\n";
    server.send(head, b"").problem(408, "body_timeout");
}

#[test]
fn a_body_that_ends_early_costs_nothing() {
    let server = Server::start(&["--workers", "1"]);
    for _ in 0..20 {
        let mut stream = server.connect();
        stream
            .write_all(b"POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5000\r\n\r\nv 1 2 3\n")
            .unwrap();
    }
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    server.wait_for_load(|load| load["queued"] == 0 && load["running"] == 0);
}

/// A refusal that comes before the body is read must not break the connection for the next request,
/// or say that it does.
#[test]
fn early_refusals_leave_the_connection_in_order() {
    let server = Server::start(&["--limit-body-bytes", "3000000"]);
    let mut stream = server.connect();
    for length in [10, 100_000, 900_000] {
        let head = format!("POST /v1/render?size=0 HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n");
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(&vec![b'v'; length]).unwrap();
        let answer = Answer::read(&mut stream);
        answer.problem(400, "out_of_range");
        assert_eq!(answer.header("connection"), None, "{length}");
    }
    let head = "POST /v1/render?size=0 HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2000000\r\n";
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
    loop {
        let answer = server.send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", b"");
        if answer.status == 503 {
            answer.problem(503, "connections_full");
            assert!(answer.header("retry-after").is_some());
            break;
        }
        assert!(began.elapsed() < PATIENCE);
    }
    drop(held);
    while server.send("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", b"").status != 200 {
        assert!(began.elapsed() < PATIENCE);
    }
}
