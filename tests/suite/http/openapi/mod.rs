//! Tests that `api/openapi.json` and the server agree, in both directions: each path answers to the
//! documented methods and to no others, and answers are as documented.

mod stored;
mod tools;

use std::collections::BTreeSet;

use serde_json::Value;

use crate::http::answers::{FORM, form};
use crate::http::meshes::url;
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};

const METHODS: [&str; 6] = ["GET", "POST", "PUT", "DELETE", "PATCH", "OPTIONS"];

fn document() -> Value {
    serde_json::from_str(include_str!("../../../../api/openapi.json")).unwrap()
}

/// The documented methods of a path, in capitals.
fn methods(item: &Value) -> BTreeSet<String> {
    item.as_object().unwrap().keys().map(|key| key.to_uppercase()).filter(|m| METHODS.contains(&m.as_str())).collect()
}

/// The target of a reference within the document; anything else as it is.
fn follow<'d>(document: &'d Value, at: &'d Value) -> &'d Value {
    match at["$ref"].as_str().and_then(|place| place.strip_prefix('#')) {
        Some(place) => document.pointer(place).unwrap_or_else(|| panic!("{place} leads nowhere")),
        None => at,
    }
}

#[test]
fn the_document_is_whole_and_served_to_everybody() {
    let document = document();
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1."));
    assert_eq!(document["info"]["version"], env!("CARGO_PKG_VERSION"));
    let (mut stack, mut references) = (vec![&document], 0);
    while let Some(value) = stack.pop() {
        match value {
            Value::Object(object) => {
                if let Some(place) = object.get("$ref") {
                    // Tools that make clients follow no others.
                    assert!(place.as_str().unwrap().starts_with("#/"), "{place}");
                    follow(&document, value);
                    references += 1;
                }
                stack.extend(object.values());
            }
            Value::Array(list) => stack.extend(list),
            _ => {}
        }
    }
    assert!(references > 200, "only {references} references");
    let operations =
        document["paths"].as_object().unwrap().values().flat_map(|item| item.as_object().unwrap().values());
    let ids: Vec<&str> = operations.filter_map(|operation| operation["operationId"].as_str()).collect();
    assert_eq!((ids.len(), ids.iter().collect::<BTreeSet<_>>().len()), (23, 23));

    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one");
    let server = Server::start_with(&mut command);
    let answer = server.get("/openapi.json");
    assert_eq!((answer.status, answer.json()), (200, document));
    let known = format!("If-None-Match: {}", answer.header("etag").unwrap());
    assert_eq!(server.request("GET", "/openapi.json", &[&known], b"").status, 304);
    server.get("/v1/schema").problem(401, "unauthorized");
}

#[test]
fn every_path_answers_to_the_methods_that_are_documented_and_to_no_others() {
    let (server, document) = (Server::start(&[]), document());
    let paths = document["paths"].as_object().unwrap();
    let capabilities = server.get("/v1/capabilities").json();
    let listed = capabilities["paths"].as_array().unwrap().iter();
    let listed: BTreeSet<String> =
        listed.map(|path| path.as_str().unwrap().replace("{png|webp|jpg}", "{extension}")).collect();
    let documented = paths.keys().filter(|path| path.starts_with("/v1/")).cloned();
    assert_eq!(documented.collect::<BTreeSet<_>>(), listed);

    let mut asked = 0;
    for (path, item) in paths {
        let real = path.replace("{sha256}", "0").replace("{id}", "0").replace("{extension}", "png");
        let mut allowed = methods(item);
        for method in METHODS {
            let answer = server.request(method, &real, &[], b"");
            assert_eq!(answer.status != 405, allowed.contains(method), "{method} {path}: {}", answer.status);
            asked += 1;
        }
        let said = server.request("PATCH", &real, &[], b"");
        let said: BTreeSet<String> = said.header("allow").unwrap().split(',').map(|m| m.trim().to_owned()).collect();
        if allowed.contains("GET") {
            allowed.insert("HEAD".to_owned());
        }
        assert_eq!(said, allowed, "{path}");
    }
    assert_eq!(asked, 20 * METHODS.len());
}

/// Checks an answer's status, headers, type and JSON against the document.
#[track_caller]
fn check(document: &Value, method: &str, path: &str, answer: &Answer) {
    let what = format!("{method} {path}: {}", answer.status);
    let operation = &document["paths"][path][method.to_lowercase()];
    let response = follow(document, &operation["responses"][answer.status.to_string()]);
    assert!(response.is_object(), "{what} is not documented: {}", String::from_utf8_lossy(&answer.body));
    let documented: BTreeSet<String> =
        response["headers"].as_object().unwrap().keys().map(|name| name.to_lowercase()).collect();
    let of_every_answer = [
        "date",
        "content-length",
        "content-type",
        "connection",
        "transfer-encoding",
        "x-content-type-options",
        "cross-origin-resource-policy",
    ];
    for (name, _) in &answer.headers {
        let is_known = documented.contains(name) || of_every_answer.contains(&name.as_str());
        assert!(is_known || name == "www-authenticate" && answer.status == 401, "{what}: {name} is not documented");
    }
    let Some(media_type) = answer.header("content-type") else {
        assert!(response["content"].is_null(), "{what} has no content");
        return;
    };
    let content = &response["content"][media_type];
    assert!(content.is_object(), "{what}: {media_type} is not documented");
    let schema = &content["schema"];
    if media_type.ends_with("json") {
        let whole = serde_json::json!({ "$ref": schema["$ref"] });
        let mut whole = if schema["$ref"].is_string() { whole } else { schema.clone() };
        whole["components"] = document["components"].clone();
        let validator = jsonschema::draft202012::new(&whole).unwrap();
        assert!(!validator.is_valid(&Value::Null), "{what}: the schema takes anything");
        let complaints: Vec<String> = validator.iter_errors(&answer.json()).map(|e| e.to_string()).collect();
        assert!(complaints.is_empty(), "{what}: {complaints:?}");
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table")]
fn answers_are_as_documented() {
    let (server, document) = (Server::start(&["--limit-triangles", "100"]), document());
    const THUMBNAIL: &str = "/v1/meshes/{sha256}/render.{extension}";
    const RESULT: &str = "/v1/jobs/{id}/result";
    let mut cases = 0;
    let mut ask = |method: &str, path: &str, real: &str, headers: &[&str], body: &[u8], status: u16| {
        let answer = server.request(method, real, headers, body);
        assert_eq!(answer.status, status, "{method} {real}: {}", String::from_utf8_lossy(&answer.body));
        check(&document, method, path, &answer);
        cases += 1;
        answer
    };
    let (cube, many) = (url(CUBE_OBJ), crate::support::shapes::torus(20));
    let json = "Content-Type: application/json";
    ask("POST", "/v1/render", "/v1/render?size=16&max_error=0.01", &[], CUBE_OBJ, 200);
    ask("POST", "/v1/render", "/v1/render?size=16", &["Accept: image/webp"], CUBE_OBJ, 200);
    ask("POST", "/v1/render", "/v1/render?size=16", &["Prefer: respond-async"], CUBE_OBJ, 202);
    ask("POST", "/v1/render", "/v1/render?sise=16", &[], CUBE_OBJ, 400);
    ask("POST", "/v1/render", "/v1/render", &[json], format!("{{\"mesh\":\"{:064}\"}}", 0).as_bytes(), 404);
    ask("POST", "/v1/render", "/v1/render", &["Accept: text/html"], CUBE_OBJ, 406);
    ask("POST", "/v1/render", "/v1/render", &[], b"no mesh", 415);
    ask("POST", "/v1/render", "/v1/render", &[], many.as_bytes(), 422);
    const CHECK: &str = "/v1/check";
    ask("POST", CHECK, "/v1/check?rules=watertight,bounds:1,1,1,max-triangles:3", &[], CUBE_OBJ, 200);
    ask("POST", CHECK, "/v1/check?rules=max-triangles:3&fail=422", &[], CUBE_OBJ, 422);
    ask("POST", CHECK, "/v1/check", &[], b"no mesh", 200);
    ask("POST", CHECK, "/v1/check", &[], many.as_bytes(), 422);
    ask("POST", CHECK, "/v1/check?rules=x", &[], CUBE_OBJ, 400);
    ask("POST", CHECK, "/v1/check", &[json], format!("{{\"mesh\":\"{:064}\"}}", 0).as_bytes(), 404);
    ask("POST", CHECK, "/v1/check", &[], b"", 415);
    let checked =
        ask("POST", CHECK, "/v1/check?rules=max-triangles:3&fail=422", &["Prefer: respond-async"], CUBE_OBJ, 202);
    let checked = checked.header("location").unwrap();
    ask("GET", "/v1/jobs/{id}", checked, &["Prefer: wait=30"], b"", 200);
    ask("GET", RESULT, &format!("{checked}/result"), &[], b"", 422);
    let checked = ask("POST", "/v1/jobs", "/v1/jobs?kind=check&rules=opens", &[], CUBE_OBJ, 202);
    let checked = checked.header("location").unwrap();
    ask("GET", "/v1/jobs/{id}", checked, &["Prefer: wait=30"], b"", 200);
    ask("GET", RESULT, &format!("{checked}/result"), &[], b"", 200);
    const DIFF: &str = "/v1/diff";
    let sides = form(&[("a", CUBE_OBJ), ("b", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")]);
    ask("POST", DIFF, "/v1/diff?max_distance=0.1", &[FORM], &sides, 200);
    ask("POST", DIFF, "/v1/diff?size=64x32", &[FORM, "Accept: image/webp"], &sides, 200);
    ask("POST", DIFF, "/v1/diff?fail=422", &[FORM], &sides, 422);
    ask("POST", DIFF, "/v1/diff", &[FORM], &form(&[("a", CUBE_OBJ), ("b", many.as_bytes())]), 422);
    ask("POST", DIFF, "/v1/diff", &[FORM], &form(&[("a", CUBE_OBJ), ("b", b"no mesh")]), 415);
    ask("POST", DIFF, "/v1/diff", &[FORM, "Accept: text/html"], &sides, 406);
    ask("POST", DIFF, "/v1/diff", &[], CUBE_OBJ, 400);
    ask("POST", DIFF, "/v1/diff", &[json], format!("{{\"a\":\"{0:064}\",\"b\":\"{0:064}\"}}", 0).as_bytes(), 404);
    let compared = ask("POST", DIFF, "/v1/diff?fail=422", &[FORM, "Prefer: respond-async"], &sides, 202);
    let compared = compared.header("location").unwrap();
    ask("GET", "/v1/jobs/{id}", compared, &["Prefer: wait=30"], b"", 200);
    ask("GET", RESULT, &format!("{compared}/result"), &[], b"", 422);
    ask("POST", "/v1/jobs", "/v1/jobs?kind=diff&format=png", &[FORM], &sides, 202);
    ask("POST", "/v1/meshes", "/v1/meshes", &[], CUBE_OBJ, 201);
    ask("POST", "/v1/meshes", "/v1/meshes", &[], CUBE_OBJ, 200);
    ask("POST", "/v1/meshes", "/v1/meshes", &[FORM], &form(&[("other", b"")]), 400);
    let mesh = "/v1/meshes/{sha256}";
    ask("PUT", mesh, &cube, &[], CUBE_OBJ, 200);
    ask("PUT", mesh, &cube, &[], b"v", 422);
    ask("PUT", mesh, "/v1/meshes/x", &[], b"v", 400);
    let report = ask("GET", mesh, &cube, &[], b"", 200);
    let known = format!("If-None-Match: {}", report.header("etag").unwrap());
    ask("GET", mesh, &cube, &[&known], b"", 304);
    ask("GET", mesh, &format!("{cube}?scene.time_s=1"), &[], b"", 200);
    ask("GET", mesh, &format!("{cube}?format_in=glb"), &[], b"", 422);
    let document_of_cube = format!("{{\"mesh\":\"{}\",\"size\":16}}", cube.rsplit('/').next().unwrap());
    let drawn = ask("POST", "/v1/render", "/v1/render", &[json], document_of_cube.as_bytes(), 200);
    ask("GET", THUMBNAIL, drawn.header("content-location").unwrap(), &[], b"", 200);
    let known = format!("If-None-Match: {}", drawn.header("etag").unwrap());
    ask("GET", THUMBNAIL, drawn.header("content-location").unwrap(), &[&known], b"", 304);
    ask("GET", THUMBNAIL, &format!("{cube}/render.jpg?size=0"), &[], b"", 400);
    ask("GET", THUMBNAIL, &format!("{cube}/render.gif"), &[], b"", 404);
    let job = ask("POST", "/v1/jobs", "/v1/jobs?size=16&style=wire&max_error=0.01", &[], CUBE_OBJ, 202);
    let job = job.header("location").unwrap();
    ask("GET", "/v1/jobs/{id}", job, &["Prefer: wait=30"], b"", 200);
    ask("GET", RESULT, &format!("{job}/result"), &[], b"", 200);
    ask("GET", "/v1/jobs/{id}/events", &format!("{job}/events"), &[], b"", 200);
    ask("GET", "/v1/jobs/{id}/events", &format!("{job}/events"), &["Last-Event-ID: done"], b"", 204);
    ask("DELETE", "/v1/jobs/{id}", job, &[], b"", 200);
    let several = form(&[("mesh", CUBE_OBJ), ("mesh", CUBE_OBJ)]);
    let several = ask("POST", "/v1/jobs", "/v1/jobs?size=16", &[FORM], &several, 202);
    assert_eq!(several.json()["jobs"].as_array().unwrap().len(), 2);
    let failed = ask("POST", "/v1/jobs", "/v1/jobs", &[], b"no mesh", 202);
    let failed = failed.header("location").unwrap();
    ask("GET", "/v1/jobs/{id}", failed, &["Prefer: wait=30"], b"", 200);
    ask("GET", RESULT, &format!("{failed}/result"), &[], b"", 415);
    ask("GET", "/v1/jobs/{id}", "/v1/jobs/x", &[], b"", 404);
    ask("DELETE", mesh, &cube, &[], b"", 204);
    ask("DELETE", mesh, &cube, &[], b"", 404);
    for path in ["/", "/status", "/metrics", "/v1/schema", "/v1/capabilities", "/v1/status", "/healthz", "/readyz"] {
        ask("GET", path, path, &[], b"", 200);
    }
    for path in ["/version", "/openapi.json"] {
        ask("GET", path, path, &[], b"", 200);
    }
    ask("GET", "/", "/", &["Accept: text/html"], b"", 200);
    assert_eq!(cases, 72);
}
