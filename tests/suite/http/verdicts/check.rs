//! `POST /v1/check` of the real server: the verdicts of `meshsnap check`, over HTTP.

use serde_json::{Value, json};

use crate::http::answers::{FORM, form};
use crate::http::jobs::durable;
use crate::http::meshes::{form_of, url};
use crate::support::files::bundle::zipped;
use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use crate::support::shapes::torus;
use meshsnap_server::digest::Digest;

const JSON: &str = "Content-Type: application/json";

/// A cube without its last face.
fn open_cube() -> Vec<u8> {
    let text = String::from_utf8(CUBE_OBJ.to_vec()).unwrap();
    text.replace("f 4 1 5 8\n", "").into_bytes()
}

/// The verdict that the program prints on a file.
fn printed(name: &str, bytes: &[u8], rules: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    let mut command = meshsnap();
    command.current_dir(folder.path()).args(["check", "--format", "jsonl", "--rules", rules, name]);
    let output = command.output().unwrap();
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
}

#[test]
fn verdicts_are_those_of_the_command_line() {
    let server = Server::start(&[]);
    let rules = "opens,watertight,manifold,consistent-winding,no-degenerate,no-duplicate-faces,no-self-intersection,\
                 no-inverted-volume,no-ngons,single-component,has-normals,has-uv,uv-in-range,uv-no-overlap,\
                 max-triangles:11,max-vertices:8,max-materials:1,max-texture-px:64,max-file-bytes:100,bounds:1,2,3";
    let (open, many) = (open_cube(), torus(12));
    let doubled = [CUBE_OBJ, b"f 1 4 3 2\nf 1 1 2\n"].concat();
    let cases: [(&str, &[u8]); 6] = [
        ("mesh", CUBE_OBJ),
        ("mesh", &open),
        ("mesh", many.as_bytes()),
        ("mesh", &doubled),
        ("mesh", b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"),
        ("mesh", b"v 0 0 0\nf 1 2 3\n"),
    ];
    let mut compared = 0;
    for (name, bytes) in cases {
        let answer = server.post(&format!("/v1/check?rules={rules}"), bytes);
        assert_eq!((answer.status, answer.header("content-type")), (200, Some("application/json")));
        assert_eq!(answer.json(), printed(name, bytes, rules), "{}", String::from_utf8_lossy(bytes));
        compared += 1;
    }
    assert_eq!(compared, 6);
}

#[test]
fn a_failed_verdict_is_an_answer_of_422_only_where_that_is_asked_for() {
    let server = Server::start(&[]);
    let open = open_cube();
    let watertight = server.post("/v1/check?rules=watertight&fail=422", CUBE_OBJ);
    assert_eq!((watertight.status, &watertight.json()["ok"]), (200, &true.into()));
    let told = server.post("/v1/check?rules=watertight", &open);
    assert_eq!((told.status, &told.json()["ok"]), (200, &false.into()));
    let failed = server.post("/v1/check?rules=watertight&fail=422", &open);
    assert_eq!((failed.status, failed.header("content-type")), (422, Some("application/json")));
    assert_eq!(failed.body, told.body);
    let check = &failed.json()["checks"][0];
    assert_eq!(
        (&check["rule"], &check["found"], &check["detail"]),
        (&"watertight".into(), &4.into(), &"4 open edges in 1 loop".into())
    );
    let warned = server.post("/v1/check?warn=watertight&fail=422", &open);
    assert_eq!(
        (warned.status, &warned.json()["ok"], &warned.json()["checks"][0]["ok"]),
        (200, &true.into(), &false.into())
    );
    let usual = server.post("/v1/check", CUBE_OBJ).json();
    let names: Vec<&str> = usual["checks"].as_array().unwrap().iter().map(|c| c["rule"].as_str().unwrap()).collect();
    assert_eq!((names, &usual["ok"]), (vec!["opens", "no-warnings"], &true.into()));
    // A file that is no mesh fails by its verdict, too.
    let no_mesh = server.post("/v1/check?rules=watertight&fail=422", b"no mesh");
    assert_eq!((no_mesh.status, &no_mesh.json()["checks"][0]["rule"]), (422, &"opens".into()));
}

#[test]
fn bundles_and_stored_meshes_have_verdicts_that_are_kept() {
    let server = Server::start(&[]);
    let digest = Digest::of(CUBE_OBJ).to_string();
    let first = server.post("/v1/check?rules=watertight", CUBE_OBJ);
    assert_eq!((first.header("x-cache"), &first.json()["sha256"]), (Some("miss"), &digest.as_str().into()));
    assert!(first.header("server-timing").unwrap().contains("judge;dur="), "{:?}", first.headers);
    let again = server.post("/v1/check?rules=%20watertight%20", CUBE_OBJ);
    assert_eq!((again.header("x-cache"), again.header("age")), (Some("hit"), Some("0")));
    assert_eq!((again.header("etag"), &again.body), (first.header("etag"), &first.body));
    for other in ["/v1/check?rules=manifold", "/v1/check?warn=watertight", "/v1/check?rules=watertight&format_in=obj"] {
        let answer = server.post(other, CUBE_OBJ);
        assert_eq!(answer.header("x-cache"), Some("miss"), "{other}");
        assert_ne!(answer.header("etag"), first.header("etag"), "{other}");
    }

    let document = |more: &str| format!("{{\"mesh\":\"{digest}\"{more}}}");
    server.request("POST", "/v1/check", &[JSON], document("").as_bytes()).problem(404, "mesh_unknown");
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    // The bytes of the upload are the stored mesh's, and so is the verdict.
    let stored = server.request("POST", "/v1/check?rules=watertight", &[JSON], document("").as_bytes());
    assert_eq!((stored.header("x-cache"), &stored.body), (Some("hit"), &first.body));
    let listed = document(",\"rules\":[\"watertight\",\"max-triangles:11\"],\"fail\":422");
    let listed = server.post("/v1/check", listed.as_bytes());
    assert_eq!((listed.status, &listed.json()["checks"][1]["found"]), (422, &12.into()));
    let overridden = document(",\"rules\":\"max-triangles:11\"");
    let overridden = server.post("/v1/check?rules=max-triangles:12", overridden.as_bytes());
    assert_eq!((overridden.status, &overridden.json()["ok"]), (200, &true.into()));

    let open = open_cube();
    let archive = zipped(&[("parts/hinge.obj", &open), ("parts/lid.obj", CUBE_OBJ)]);
    let named = server.post("/v1/check?rules=watertight&entry=parts/hinge.obj", &archive).json();
    assert_eq!((&named["path"], &named["ok"]), (&"parts/hinge.obj".into(), &false.into()));
    assert_eq!(named["sha256"], Digest::of(&archive).to_string());
    server.post("/v1/check?rules=watertight", &archive).problem(422, "entry_unclear");
    let files = form_of(&[("parts/hinge.obj", &open)]);
    let of_form = server.request("POST", "/v1/check?rules=watertight", &[FORM], &files).json();
    assert_eq!((&of_form["path"], &of_form["ok"]), (&"parts/hinge.obj".into(), &false.into()));
}

#[test]
fn mistakes_are_refused_before_a_worker_sees_them() {
    let server = Server::start(&["--limit-triangles", "100", "--limit-body-bytes", "100000"]);
    let digest = Digest::of(CUBE_OBJ).to_string();
    let long = format!("rules={}", "x".repeat(5000));
    let cases: [(&str, &str, &str); 17] = [
        ("rules=watertigt", "unknown_rule", "did you mean `watertight`?"),
        ("rules=max-triangles", "unknown_rule", "max-triangles:1000"),
        ("rules=max-triangles:-1", "unknown_rule", "max-triangles:1000"),
        ("rules=watertight:3", "unknown_rule", "takes no number"),
        ("rules=bounds:1,2", "unknown_rule", "bounds:10,10,2.5"),
        ("rules=bounds:1,nan,2", "unknown_rule", "bounds"),
        ("rules=opens,opens", "unknown_rule", "given twice"),
        ("rules=opens&warn=opens", "unknown_rule", "given twice"),
        ("rules=", "out_of_range", "names no rule"),
        ("rules=opens&rules=opens", "conflicting_keys", "`rules` is given twice"),
        ("fail=1", "out_of_range", "allowed is 422"),
        ("places=some", "out_of_range", "allowed are first, all"),
        ("style=wire", "unknown_key", "`rules`, `warn`, `fail`"),
        ("kind=check", "unknown_key", "`rules`, `warn`, `fail`"),
        ("format_in=exe", "out_of_range", "stl"),
        ("%ff=%fe&rules=%ff", "unknown_key", "there is no key"),
        (&long, "unknown_rule", "there is no rule"),
    ];
    let mut refused = 0;
    for (query, code, part) in cases {
        let answer = server.post(&format!("/v1/check?{query}"), CUBE_OBJ);
        let detail = answer.problem(400, code);
        assert!(detail.contains(part) && detail.len() < 1000, "{query}: {detail}");
        refused += 1;
    }
    let documents = [
        ("{}".to_owned(), "missing_key"),
        ("[]".to_owned(), "not_json"),
        ("{\"mesh\":".to_owned(), "not_json"),
        ("{\"mesh\":1}".to_owned(), "out_of_range"),
        (format!("{{\"mesh\":\"{}\"}}", digest.to_uppercase()), "out_of_range"),
        (format!("{{\"mesh\":\"{digest}\",\"mesh\":\"{digest}\"}}"), "conflicting_keys"),
        (format!("{{\"mesh\":\"{digest}\",\"rules\":{{}}}}"), "wrong_type"),
        (format!("{{\"mesh\":\"{digest}\",\"rules\":[1]}}"), "wrong_type"),
        (format!("{{\"mesh\":\"{digest}\",\"style\":\"wire\"}}"), "unknown_key"),
        (format!("{{\"mesh\":\"{digest}\",\"rules\":\"a\",\"rules\":\"b\"}}"), "conflicting_keys"),
        (format!("{{\"mesh\":\"{digest}\",\"a\":{}}}", "[".repeat(60_000)), "not_json"),
    ];
    for (document, code) in &documents {
        server.request("POST", "/v1/check", &[JSON], document.as_bytes()).problem(400, code);
        refused += 1;
    }
    for (parts, part) in [
        (form(&[]), "no `file` part"),
        (form(&[("mesh", CUBE_OBJ)]), "POST /v1/jobs"),
        (form(&[("file", CUBE_OBJ), ("request", b"{}")]), "`file` parts alone"),
    ] {
        let detail = server.request("POST", "/v1/check", &[FORM], &parts).problem(400, "bad_form");
        assert!(detail.contains(part), "{detail}");
        refused += 1;
    }
    server.post("/v1/check", b"").problem(415, "mesh_unrecognised");
    server.request("POST", "/v1/check", &["Content-Type: application/zip"], b"no zip").problem(422, "bundle_broken");
    let large = server.post("/v1/check", &vec![b'#'; 100_001]);
    large.problem(413, "body_too_large");
    let many = server.post("/v1/check", torus(12).as_bytes());
    let detail = many.problem(422, "limit_exceeded");
    assert_eq!(many.json()["flag"], "--limit-triangles", "{detail}");
    assert_eq!(refused, 31);
    server.get("/v1/check").problem(405, "method_not_allowed");
}

#[test]
fn the_faults_of_a_bad_mesh_are_counted_and_few_are_listed() {
    let server = Server::start(&[]);
    // A triangle for each place of a long row: all edges are open.
    let row = |count: usize| -> String {
        (0..count).map(|i| format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nf -1 -2 -3\n")).collect()
    };
    let text = row(20_000);
    let answer = server.post("/v1/check?rules=watertight,no-self-intersection,single-component", text.as_bytes());
    let verdict = answer.json();
    assert_eq!((&verdict["checks"][0]["found"], &verdict["checks"][2]["found"]), (&60_000.into(), &20_000.into()));
    assert_eq!(verdict["checks"][0]["where"].as_array().unwrap().len(), 20);
    assert!(answer.body.len() < 8000, "{} bytes", answer.body.len());
    // All on request, up to a bound.
    let all = server.post("/v1/check?rules=watertight&places=all", text.as_bytes()).json();
    let places = all["checks"][0]["where"].as_array().unwrap();
    assert_eq!((places.len(), &places[..20]), (60_000, &verdict["checks"][0]["where"].as_array().unwrap()[..]));
    let bounded = server.post("/v1/check?rules=watertight&places=all", row(34_000).as_bytes()).json();
    assert_eq!(bounded["checks"][0]["found"], 102_000);
    assert_eq!(bounded["checks"][0]["where"].as_array().unwrap().len(), 100_000);
}

#[test]
fn a_verdict_is_a_job_too() {
    let server = Server::start(&[]);
    let open = open_cube();
    let told = server.post("/v1/check?rules=watertight", &open);
    let preferred = server.request("POST", "/v1/check?rules=watertight&fail=422", &["Prefer: respond-async"], &open);
    assert_eq!((preferred.status, preferred.header("preference-applied")), (202, Some("respond-async")));
    let by_kind = server.post("/v1/jobs?rules=watertight&kind=check", &open);
    assert_eq!(by_kind.status, 202, "{}", String::from_utf8_lossy(&by_kind.body));
    for (accepted, status) in [(preferred, 422), (by_kind, 200)] {
        let job = accepted.header("location").unwrap();
        let state = server.request("GET", job, &["Prefer: wait=30"], b"").json();
        assert_eq!((&state["state"], &state["result"]["content_type"]), (&"done".into(), &"application/json".into()));
        let result = server.get(&format!("{job}/result"));
        assert_eq!((result.status, result.header("content-type")), (status, Some("application/json")));
        assert_eq!(result.body, told.body);
        assert_eq!(server.request("DELETE", job, &[], b"").status, 200);
    }
    for (query, code) in [
        ("kind=check&style=wire", "unknown_key"),
        ("kind=paint", "out_of_range"),
        ("kind=check&kind=check", "out_of_range"),
    ] {
        server.post(&format!("/v1/jobs?{query}"), CUBE_OBJ).problem(400, code);
    }
    // A request that is sent again makes no second job, and a picture is another request.
    let send = |path: &str| server.request("POST", path, &["Idempotency-Key: one"], CUBE_OBJ);
    let first = send("/v1/jobs?kind=check");
    assert_eq!(send("/v1/jobs?kind=check").header("location"), first.header("location"));
    send("/v1/jobs").problem(422, "idempotency_key_reused");
    send("/v1/jobs?kind=check&rules=opens").problem(422, "idempotency_key_reused");
}

#[test]
fn verdicts_of_jobs_outlive_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let open = open_cube();
    let (waiting, ended, told) = {
        // One worker, which a large picture keeps busy.
        let mut server = durable::start(folder.path(), &["--workers", "1"]);
        let told = server.post("/v1/check?rules=watertight", &open);
        assert_eq!(server.post("/v1/meshes", &open).status, 201);
        let ended = server.post("/v1/jobs?kind=check&rules=watertight&fail=422", &open);
        let ended = ended.header("location").unwrap().to_owned();
        assert_eq!(server.request("GET", &ended, &["Prefer: wait=30"], b"").json()["state"], "done");
        let busy = server.post("/v1/jobs?size=4096&samples=16&style=wire", torus(60).as_bytes());
        assert_eq!(busy.status, 202);
        let document = json!({ "mesh": url(&open).rsplit('/').next(), "rules": "watertight" }).to_string();
        let of_stored = server.post("/v1/jobs?kind=check", document.as_bytes());
        let of_upload = server.post("/v1/jobs?kind=check&rules=watertight", &open);
        let waiting: Vec<String> =
            [of_stored, of_upload].iter().map(|job| job.header("location").unwrap().to_owned()).collect();
        server.kill_9();
        server.wait();
        (waiting, ended, told)
    };
    let server = durable::start(folder.path(), &["--workers", "1"]);
    let result = server.get(&format!("{ended}/result"));
    assert_eq!((result.status, &result.body), (422, &told.body));
    for job in &waiting {
        let state = server.request("GET", job, &["Prefer: wait=60"], b"").json();
        assert_eq!(state["state"], "done", "{state}");
        assert_eq!(server.get(&format!("{job}/result")).body, told.body);
    }
    assert_eq!(waiting.len(), 2);
}
