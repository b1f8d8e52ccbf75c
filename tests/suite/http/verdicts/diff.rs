//! `POST /v1/diff` of the real server: the differences of `meshsnap diff`, over HTTP.

use serde_json::{Value, json};

use crate::http::answers::{FORM, form};
use crate::http::jobs::durable;
use crate::http::meshes::form_of;
use crate::support::files::bundle::zipped;
use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use crate::support::shapes::torus;
use meshsnap_server::digest::Digest;

const JSON: &str = "Content-Type: application/json";

/// A cube without its last face, and a cube that moved.
fn hole() -> Vec<u8> {
    String::from_utf8(CUBE_OBJ.to_vec()).unwrap().replace("f 4 1 5 8\n", "").into_bytes()
}

fn moved() -> Vec<u8> {
    let text = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    text.replace("v 1 ", "v 1.5 ").replace("v -1 ", "v -0.5 ").into_bytes()
}

fn sides(a: &[u8], b: &[u8]) -> Vec<u8> {
    form(&[("a", a), ("b", b)])
}

/// The output of the program on two files.
fn printed(a: &[u8], b: &[u8], arguments: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a"), a).unwrap();
    std::fs::write(folder.path().join("b"), b).unwrap();
    let output = meshsnap().current_dir(folder.path()).args(["diff", "a", "b", "--json"]).args(arguments).output();
    let output = output.unwrap();
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn differences_are_those_of_the_command_line() {
    let server = Server::start(&[]);
    let (hole, moved, torus) = (hole(), moved(), torus(12));
    type Case<'a> = (&'a [u8], &'a [u8], &'a str, &'a [&'a str]);
    let cases: [Case<'_>; 5] = [
        (CUBE_OBJ, &hole, "", &[]),
        (&hole, CUBE_OBJ, "", &[]),
        (CUBE_OBJ, &moved, "", &[]),
        (CUBE_OBJ, &moved, "?max_distance=0.5", &["--max-distance", "0.5"]),
        (CUBE_OBJ, torus.as_bytes(), "?format_in=obj", &["--format-in", "obj"]),
    ];
    let mut compared = 0;
    for (a, b, query, arguments) in cases {
        let answer = server.request("POST", &format!("/v1/diff{query}"), &[FORM], &sides(a, b));
        let what = String::from_utf8_lossy(&answer.body);
        assert_eq!((answer.status, answer.header("content-type")), (200, Some("application/json")), "{what}");
        assert_eq!(answer.json(), printed(a, b, arguments));
        assert_eq!(answer.header("vary"), Some("accept"));
        compared += 1;
    }
    assert_eq!(compared, 5);
    let told = server.request("POST", "/v1/diff", &[FORM], &sides(CUBE_OBJ, &hole)).json();
    assert_eq!(told["summary"][0], "a hole with 4 edges near (-1, 0, 0)");
}

#[test]
fn accept_and_format_decide_between_json_and_a_picture() {
    let server = Server::start(&[]);
    let body = sides(CUBE_OBJ, &moved());
    let cases = [
        ("", "*/*", "application/json"),
        ("", "application/json, image/png;q=0.5", "application/json"),
        ("", "application/*", "application/json"),
        ("", "image/png", "image/png"),
        ("", "image/webp, application/json;q=0.9", "image/webp"),
        ("", "image/*", "image/png"),
        ("&format=png", "application/json", "image/png"),
        ("&format=jpeg", "*/*", "image/jpeg"),
        ("&format=json", "image/png", "application/json"),
    ];
    let mut asked = 0;
    for (query, accept, expected) in cases {
        let path = format!("/v1/diff?size=200x100{query}");
        let answer = server.request("POST", &path, &[FORM, &format!("Accept: {accept}")], &body);
        assert_eq!(answer.header("content-type"), Some(expected), "{query} {accept}");
        if expected != "application/json" {
            answer.picture(200, 100);
            assert_eq!(answer.header("x-render-backend"), Some("cpu"));
        }
        asked += 1;
    }
    assert_eq!(asked, 9);
    // The picture is the command line's.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.obj"), CUBE_OBJ).unwrap();
    std::fs::write(folder.path().join("b.obj"), moved()).unwrap();
    let drawn = meshsnap().current_dir(folder.path()).args(["diff", "a.obj", "b.obj", "-o", "heat.png"]).output();
    assert_eq!(drawn.unwrap().status.code(), Some(1));
    let heat = server.request("POST", "/v1/diff?format=png", &[FORM], &body);
    assert!(heat.body == std::fs::read(folder.path().join("heat.png")).unwrap(), "another picture");
    let other = server.request("POST", "/v1/diff?format=png&view=top", &[FORM], &body);
    assert_ne!(other.body, heat.body);
}

#[test]
fn stored_meshes_and_bundles_are_compared_and_answers_are_kept() {
    let server = Server::start(&[]);
    let hole = hole();
    let first = server.request("POST", "/v1/diff", &[FORM], &sides(CUBE_OBJ, &hole));
    assert_eq!((first.status, first.header("x-cache")), (200, Some("miss")));
    let document = json!({ "a": Digest::of(CUBE_OBJ).to_string(), "b": Digest::of(&hole).to_string() }).to_string();
    server.request("POST", "/v1/diff", &[JSON], document.as_bytes()).problem(404, "mesh_unknown");
    for mesh in [CUBE_OBJ, &hole] {
        assert_eq!(server.post("/v1/meshes", mesh).status, 201);
    }
    let stored = server.request("POST", "/v1/diff", &[JSON], document.as_bytes());
    assert_eq!((stored.header("x-cache"), stored.header("etag")), (Some("hit"), first.header("etag")));
    assert_eq!(stored.body, first.body);
    let failed = document.replace('}', ",\"fail\":422,\"max_distance\":0.25}");
    let failed = server.post("/v1/diff", failed.as_bytes());
    assert_eq!(
        (failed.status, failed.header("content-type"), failed.header("x-cache")),
        (422, Some("application/json"), Some("miss"))
    );
    let same = server.request("POST", "/v1/diff?fail=422", &[FORM], &sides(CUBE_OBJ, CUBE_OBJ));
    assert_eq!((same.status, &same.json()["same"]), (200, &true.into()));

    let archive = zipped(&[
        ("cube.obj", b"mtllib c.mtl\nusemtl p\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("c.mtl", b"newmtl p\nKd 1 0 0\n"),
    ]);
    let files: [(&str, &[u8]); 2] = [
        ("cube.obj", b"mtllib c.mtl\nusemtl p\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("c.mtl", b"newmtl p\nKd 0 1 0\n"),
    ];
    let newer = String::from_utf8(form_of(&files)).unwrap().replace("name=\"file\"", "name=\"b\"");
    let older = String::from_utf8_lossy(&form(&[("a", b"MESH")])).replace("--XX--\r\n", "");
    let (head, tail) = older.split_once("MESH").unwrap();
    let body = [head.as_bytes(), &archive, tail.as_bytes(), newer.as_bytes()].concat();
    let bundles = server.request("POST", "/v1/diff", &[FORM], &body);
    assert_eq!(
        bundles.json()["summary"][1],
        "the material \"p\" changed: colour",
        "{}",
        String::from_utf8_lossy(&bundles.body)
    );
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn mistakes_are_refused_with_what_is_wrong() {
    let server = Server::start(&["--limit-triangles", "100", "--limit-bundle-entries", "3"]);
    let body = sides(CUBE_OBJ, CUBE_OBJ);
    let cases = [
        ("max_distance=-1", "out_of_range", "from 0 on"),
        ("max_distance=nan", "out_of_range", "from 0 on"),
        ("fail=1", "out_of_range", "allowed is 422"),
        ("fail=422&format=png", "conflicting_keys", "for JSON"),
        ("format=gif", "out_of_range", "json, png, webp, jpeg"),
        ("rules=watertight", "unknown_key", "`max_distance`"),
        ("style=wire", "unknown_key", "`max_distance`"),
        ("size=31x16", "out_of_range", "32x16"),
        ("size=99999x2", "out_of_range", "size"),
        ("view=sideways", "out_of_range", "view"),
        ("size=64&size=64", "conflicting_keys", "given twice"),
        ("a=1", "unknown_key", "there is no key \"a\""),
    ];
    let mut refused = 0;
    for (query, code, part) in cases {
        let detail = server.request("POST", &format!("/v1/diff?{query}"), &[FORM], &body).problem(400, code);
        assert!(detail.contains(part), "{query}: {detail}");
        refused += 1;
    }
    let digest = Digest::of(CUBE_OBJ).to_string();
    let documents = [
        ("{}".to_owned(), "missing_key", "`a` is missing"),
        (format!("{{\"a\":\"{digest}\"}}"), "missing_key", "`b` is missing"),
        (format!("{{\"a\":\"{digest}\",\"b\":\"x\"}}"), "out_of_range", "`b` is"),
        (
            format!("{{\"a\":\"{digest}\",\"b\":\"{digest}\",\"b\":\"{digest}\"}}"),
            "conflicting_keys",
            "`b` is given twice",
        ),
        (format!("{{\"a\":\"{digest}\",\"b\":\"{digest}\",\"c\":1}}"), "unknown_key", "`a`, `b`"),
        ("{\"a\":".to_owned(), "not_json", "JSON"),
        ("[1]".to_owned(), "bad_form", "`a` and `b`"),
        (String::new(), "bad_form", "`a` and `b`"),
    ];
    for (document, code, part) in &documents {
        let detail = server.request("POST", "/v1/diff", &[JSON], document.as_bytes()).problem(400, code);
        assert!(detail.contains(part), "{document}: {detail}");
        refused += 1;
    }
    let forms = [
        (form(&[("a", CUBE_OBJ)]), "no `b` part"),
        (form(&[("b", CUBE_OBJ)]), "no `a` part"),
        (form(&[]), "no `a` part"),
        (form(&[("file", CUBE_OBJ)]), "allowed are `a` and `b`"),
        (form(&[("a", CUBE_OBJ), ("a", CUBE_OBJ), ("b", CUBE_OBJ)]), "two files are named"),
        (b"--XX".to_vec(), "cannot be read"),
    ];
    for (parts, part) in &forms {
        let detail = server.request("POST", "/v1/diff", &[FORM], parts).problem(400, "bad_form");
        assert!(detail.contains(part), "{detail}");
        refused += 1;
    }
    assert_eq!(refused, 26);
    server.post("/v1/diff", CUBE_OBJ).problem(400, "bad_form");
    let detail = server.request("POST", "/v1/diff", &[FORM], &sides(CUBE_OBJ, b"")).problem(415, "mesh_unrecognised");
    assert!(detail.contains("empty"), "{detail}");
    let detail = server.request("POST", "/v1/diff", &[FORM], &sides(CUBE_OBJ, b"?")).problem(415, "mesh_unrecognised");
    assert!(detail.starts_with("b: "), "{detail}");
    let detail = server
        .request("POST", "/v1/diff", &[FORM], &sides(b"v 0 0 0\nf 1 2 9\n", CUBE_OBJ))
        .problem(422, "mesh_broken");
    assert!(detail.starts_with("a: "), "{detail}");
    let many = server.request("POST", "/v1/diff", &[FORM], &sides(CUBE_OBJ, torus(12).as_bytes()));
    many.problem(422, "limit_exceeded");
    assert_eq!(many.json()["flag"], "--limit-triangles");
    let body = form_of(&[("1", b"x"), ("2", b"x"), ("3", b"x"), ("4", b"x")]);
    let body = String::from_utf8(body).unwrap().replace("name=\"file\"", "name=\"a\"");
    server.request("POST", "/v1/diff", &[FORM], body.as_bytes()).problem(422, "limit_exceeded");
    server.get("/v1/diff").problem(405, "method_not_allowed");
}

#[test]
fn a_difference_is_a_job_too_and_outlives_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let body = sides(CUBE_OBJ, &hole());
    // Neither mesh of this one is ever stored.
    let unstored = sides(torus(12).as_bytes(), &moved());
    let (jobs, told, told_of_unstored, heat) = {
        let mut server = durable::start(folder.path(), &["--workers", "1"]);
        let told = server.request("POST", "/v1/diff", &[FORM], &body);
        let told_of_unstored = server.request("POST", "/v1/diff", &[FORM], &unstored);
        let heat = server.request("POST", "/v1/diff?format=webp&size=64x32", &[FORM], &body);
        let document =
            json!({ "a": Digest::of(CUBE_OBJ).to_string(), "b": Digest::of(&hole()).to_string() }).to_string();
        for mesh in [CUBE_OBJ, &hole()] {
            assert_eq!(server.post("/v1/meshes", mesh).status, 201);
        }
        let ended = server.request("POST", "/v1/jobs?kind=diff&fail=422", &[FORM], &body);
        let ended = ended.header("location").unwrap().to_owned();
        assert_eq!(server.request("GET", &ended, &["Prefer: wait=30"], b"").json()["state"], "done");
        let busy = server.post("/v1/jobs?size=4096&samples=16&style=wire", torus(60).as_bytes());
        assert_eq!(busy.status, 202);
        server.wait_for_load(|load| load["queued"] == 0);
        let send = || server.request("POST", "/v1/jobs?kind=diff", &[FORM, "Idempotency-Key: one"], &body);
        let of_upload = send();
        assert_eq!(send().header("location"), of_upload.header("location"));
        let of_stored = server.request("POST", "/v1/diff", &[JSON, "Prefer: respond-async"], document.as_bytes());
        assert_eq!(of_stored.header("preference-applied"), Some("respond-async"));
        let picture = server.request("POST", "/v1/jobs?kind=diff&format=webp&size=64x32", &[FORM], &body);
        let of_unstored = server.request("POST", "/v1/jobs?kind=diff", &[FORM], &unstored);
        let waiting =
            [of_upload, of_stored, of_unstored, picture].map(|job| job.header("location").unwrap().to_owned());
        server.kill_9();
        server.wait();
        ([vec![ended], waiting.to_vec()].concat(), told, told_of_unstored, heat)
    };
    let server = durable::start(folder.path(), &["--workers", "1"]);
    let expected =
        [(422, &told.body), (200, &told.body), (200, &told.body), (200, &told_of_unstored.body), (200, &heat.body)];
    for (job, (status, body)) in jobs.iter().zip(expected) {
        let state = server.request("GET", job, &["Prefer: wait=60"], b"").json();
        assert_eq!(state["state"], "done", "{state}");
        let result = server.get(&format!("{job}/result"));
        assert_eq!((result.status, &result.body), (status, body));
    }
    assert_eq!(jobs.len(), 5);
}

#[test]
fn only_who_sees_both_meshes_may_compare_them() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one,two");
    let server = Server::start_with(&mut command);
    let (one, two) = ("Authorization: Bearer one", "Authorization: Bearer two");
    assert_eq!(server.request("POST", "/v1/meshes", &[one], CUBE_OBJ).status, 201);
    assert_eq!(server.request("POST", "/v1/meshes", &[two], &hole()).status, 201);
    let document = json!({ "a": Digest::of(CUBE_OBJ).to_string(), "b": Digest::of(&hole()).to_string() }).to_string();
    for key in [one, two] {
        server.request("POST", "/v1/diff", &[JSON, key], document.as_bytes()).problem(404, "mesh_unknown");
    }
    assert_eq!(server.request("POST", "/v1/meshes", &[one], &hole()).status, 201);
    assert_eq!(server.request("POST", "/v1/diff", &[JSON, one], document.as_bytes()).status, 200);
    server.request("POST", "/v1/diff", &[JSON, two], document.as_bytes()).problem(404, "mesh_unknown");
    server.request("POST", "/v1/diff", &[JSON], document.as_bytes()).problem(401, "unauthorized");
}
