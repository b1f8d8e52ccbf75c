//! `/v1/meshes` of the real server: names and bodies that are refused.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::io::Write as _;

use crate::http::answers::{FORM, form};
use crate::http::meshes::{form_of, head, url};
use crate::support::server::{Answer, CUBE_OBJ, Server};
use crate::support::shapes::Obj;

#[test]
fn names_that_are_no_digest() {
    let server = Server::start(&[]);
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    let digest = url(CUBE_OBJ).rsplit('/').next().unwrap().to_owned();
    let names = [
        "..".to_owned(),
        "..%2f..%2fetc%2fpasswd".to_owned(),
        "%2e%2e%2f".to_owned(),
        "x".to_owned(),
        "%00".to_owned(),
        "%ff".to_owned(),
        digest.to_uppercase(),
        digest[1..].to_owned(),
        format!("{digest}0"),
        format!("{digest}%20"),
        format!("%20{}", &digest[1..]),
        digest.replace(|c: char| c.is_ascii_digit(), "g"),
        "%c3%a9".repeat(32),
        "0".repeat(6000),
    ];
    for name in &names {
        let path = format!("/v1/meshes/{name}");
        let said = server.get(&path).problem(400, "bad_digest");
        assert!(said.contains("64 lower-case hexadecimal digits"), "{said}");
        assert_eq!(server.request("DELETE", &path, &[], b"").problem(400, "bad_digest"), said);
        assert_eq!(server.request("PUT", &path, &[], CUBE_OBJ).problem(400, "bad_digest"), said);
        assert_eq!(head(&server, &path, &[]).status, 400);
        // What is not even text could be a picture of any name.
        let status = if name == "%ff" { 404 } else { 400 };
        assert_eq!(server.get(&format!("{path}/render.png")).status, status, "{name}");
        assert_eq!(head(&server, &format!("{path}/render.png"), &[]).status, status, "{name}");
    }
    assert_eq!(names.len(), 14);
    for path in ["/v1/meshes/", "/v1/meshes/../../etc/passwd", "/v1/meshes/a/b/c"] {
        server.get(path).problem(404, "not_found");
    }
    server.get("/v1/meshes//render.png").problem(400, "bad_digest");
    server.get("/v1/meshes").problem(405, "method_not_allowed");
    server.request("POST", &url(CUBE_OBJ), &[], CUBE_OBJ).problem(405, "method_not_allowed");
    assert_eq!(server.get(&url(CUBE_OBJ)).status, 200, "nothing happened to what is there");
}

/// A name, headers, a query, bytes, and the status.
type Case<'a> = (&'a str, &'a [&'a str], &'a str, &'a [u8], u16);

#[test]
fn what_render_refuses_is_not_stored() {
    let server = Server::start(&["--limit-triangles", "100", "--limit-body-bytes", "100000"]);
    let (zip, gzip) = ("Content-Type: application/zip", "Content-Encoding: gzip");
    let many = crate::support::shapes::torus(20);
    let long = vec![b'\n'; 100_001];
    let both = form_of(&[("a.obj", CUBE_OBJ), ("b.obj", CUBE_OBJ)]);
    let cases: [Case; 15] = [
        ("an empty body", &[], "", b"", 415),
        ("a text", &[], "", b"Dear server, please keep a bunny.", 415),
        ("comments", &[], "?format_in=obj", b"# nothing\n", 422),
        ("no faces", &[], "", &CUBE_OBJ[..40], 422),
        ("a bad index", &[], "", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n", 422),
        ("a torn archive", &[], "", b"PK\x03\x04 a zip by its bytes", 422),
        ("an OBJ that is said to be an archive", &[zip], "", CUBE_OBJ, 422),
        ("packed", &[gzip], "", CUBE_OBJ, 415),
        ("two meshes", &[FORM], "", &both, 422),
        ("a mesh that is not there", &[FORM], "?entry=c.obj", &both, 422),
        ("two files of a name", &[FORM], "", &form_of(&[("a.obj", CUBE_OBJ), ("a.obj", CUBE_OBJ)]), 400),
        ("no file", &[FORM], "", b"--XX--\r\n", 400),
        ("a format that there is not", &[], "?format_in=dae", CUBE_OBJ, 400),
        ("too many triangles", &[], "", many.as_bytes(), 422),
        ("too long", &[], "", &long, 413),
    ];
    assert_eq!(cases.len(), 15);
    for (name, headers, query, body, status) in cases {
        let stored = server.request("POST", &format!("/v1/meshes{query}"), headers, body);
        let drawn = server.request("POST", &format!("/v1/render{query}"), headers, body);
        let code = drawn.json()["code"].as_str().unwrap().to_owned();
        stored.problem(status, &code);
        drawn.problem(status, &code);
        assert_eq!(stored.json()["flag"], drawn.json()["flag"], "{name}");
    }
    // Where a mesh is wanted, JSON is no request document.
    server.request("POST", "/v1/meshes", &["Content-Type: application/json"], b"{}").problem(415, "mesh_unrecognised");
    let load = server.get("/v1/capabilities").json()["load"].take();
    assert_eq!((&load["stored_meshes"], &load["stored_mesh_bytes"]), (&0.into(), &0.into()));

    let detail = server.post("/v1/meshes?size=16", CUBE_OBJ).problem(400, "unknown_key");
    assert!(detail.contains("size") && detail.contains("entry"), "{detail}");
    let document = form(&[("file", CUBE_OBJ), ("request", b"{}")]);
    server.request("POST", "/v1/meshes", &[FORM], &document).problem(400, "bad_form");
}

#[test]
fn a_mesh_larger_than_the_store_is_told_the_flag() {
    let server = Server::start(&["--mesh-bytes", "3000"]);
    let mut long = CUBE_OBJ.to_vec();
    long.resize(3001, b'\n');
    // Announced, it is refused unread; as a form or in chunks, once it is there.
    let answers = [
        server.post("/v1/meshes", &long),
        server.request("PUT", &url(&long), &[], &long),
        server.request("POST", "/v1/meshes", &[FORM], &form_of(&[("a.obj", &long)])),
        {
            let mut stream = server.connect();
            write!(stream, "POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n")
                .unwrap();
            write!(stream, "{:x}\r\n", long.len()).unwrap();
            stream.write_all(&long).unwrap();
            stream.write_all(b"\r\n0\r\n\r\n").unwrap();
            Answer::read(&mut stream)
        },
        // The report takes room as well.
        server.post("/v1/meshes", &long[..2900]),
    ];
    for answer in &answers {
        let detail = answer.problem(413, "mesh_too_large");
        assert!(answer.json()["flag"] == "--mesh-bytes" && detail.contains("3000"), "{detail}");
    }
    assert_eq!(answers.len(), 5);
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    let none = Server::start(&["--mesh-bytes", "0"]);
    none.post("/v1/meshes", CUBE_OBJ).problem(413, "mesh_too_large");
    none.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn a_mesh_that_takes_too_long_or_finds_no_place_is_not_stored() {
    let mut ball = Obj::default();
    ball.ball([0.0; 3], 1.0, 600);
    let ball = ball.finish();
    let server = Server::start(&["--limit-job-ms", "2"]);
    let answer = server.post("/v1/meshes", ball.as_bytes());
    answer.problem(504, "deadline");
    assert_eq!(answer.json()["flag"], "--limit-job-ms");
    server.get(&url(ball.as_bytes())).problem(404, "mesh_unknown");

    let full = Server::start(&["--workers", "1", "--queue", "0"]);
    std::thread::scope(|scope| {
        let client = scope.spawn(|| full.post("/v1/render?size=4096", CUBE_OBJ));
        full.wait_for_load(|load| load["running"] == 1);
        full.post("/v1/meshes", CUBE_OBJ).problem(429, "queue_full");
        client.join().unwrap().picture(4096, 4096);
    });
    assert_eq!(full.post("/v1/meshes", CUBE_OBJ).status, 201);
}
