//! Mistakes that people make in requests: the answer names the mistake and says what to do instead.
//! Also the warnings in the header of a picture.

use crate::http::answers::{FORM, form};
use crate::http::meshes::head;
use crate::support::server::{CUBE_OBJ, Server};

const JSON: &str = "Content-Type: application/json";

/// A body that is said to be JSON, the code of the answer, and parts of what it must say.
#[test]
fn json_with_a_mistake_is_told_where_and_not_taken_for_a_mesh() {
    let server = Server::start(&[]);
    let cases: [(&str, &str, &[&str]); 15] = [
        ("", "not_json", &["empty"]),
        (" \n", "not_json", &["empty"]),
        ("{", "not_json", &["line 1, column 1", "EOF while parsing an object"]),
        ("{\n  \"style\": \"wire\",\n}", "not_json", &["line 3, column 1", "trailing comma"]),
        ("{\"style\": 'wire'}", "not_json", &["line 1, column 11", "expected value"]),
        ("{\"style\": \"wi\u{1}re\"}", "not_json", &["line 1, column 14", "control character"]),
        ("{\"style\": \"wire\"} x", "not_json", &["line 1, column 19", "trailing characters"]),
        ("[]", "not_json", &["[]", "a JSON object"]),
        ("\"wire\"", "not_json", &["a JSON object"]),
        ("{}", "missing_key", &["`mesh` is missing", "SHA-256", "`asset`"]),
        (r#"{"style":"wire"}"#, "missing_key", &["`mesh` is missing"]),
        (r#"{"mseh":"0123"}"#, "unknown_key", &["did you mean mesh?", ", camera,", ", mesh,"]),
        (r#"{"mesh":["0123"]}"#, "wrong_type", &["`mesh` is [\"0123\"]", "SHA-256"]),
        (r#"{"mesh":"0123","sytle":"wire"}"#, "unknown_key", &["did you mean style?"]),
        (r#"{"mesh":"0123"}"#, "out_of_range", &["64 lower-case hexadecimal digits"]),
    ];
    for (body, code, parts) in cases {
        for path in ["/v1/render", "/v1/jobs"] {
            let detail = server.request("POST", path, &[JSON], body.as_bytes()).problem(400, code);
            assert!(parts.iter().all(|part| detail.contains(part)), "{path} {body:?}: {detail}");
        }
    }
    assert_eq!(cases.len(), 15);
    let deep = format!("{{\"a\":{}", "[".repeat(100_000));
    let answer = server.request("POST", "/v1/render", &[JSON], deep.as_bytes());
    answer.problem(400, "not_json");
    assert_eq!(answer.json()["flag"], "--limit-json-depth");
    // A mesh is a mesh, whatever it is called; glTF, broken or not, is one too.
    server.request("POST", "/v1/render?size=16", &[JSON], CUBE_OBJ).picture(16, 16);
    let gltf = br#"{"asset":{"version":"2.0"},}"#;
    let detail = server.request("POST", "/v1/render", &[JSON], gltf).problem(422, "mesh_broken");
    assert!(detail.contains("line 1"), "{detail}");
    server.request("POST", "/v1/render?format_in=gltf", &[JSON], b"{}").problem(422, "mesh_broken");
    server.post("/v1/render", br#"{"style":"wire"}"#).problem(415, "mesh_unrecognised");
    // In a form, the mesh is a file.
    let both = form(&[("file", CUBE_OBJ), ("request", br#"{"mesh":"0123"}"#)]);
    let detail = server.request("POST", "/v1/render", &[FORM], &both).problem(400, "unknown_key");
    assert!(detail.contains("in place of a mesh"), "{detail}");
}

#[test]
fn nothing_to_draw_is_refused_at_once_by_every_route() {
    let server = Server::start(&[]);
    let mut refused = 0;
    for path in ["/v1/render", "/v1/jobs", "/v1/jobs?format_in=obj"] {
        for body in [(&[][..], b"".to_vec()), (&[FORM][..], form(&[("file", b"")]))] {
            let detail = server.request("POST", path, body.0, &body.1).problem(415, "mesh_unrecognised");
            assert!(detail.contains("is empty, and should be a mesh"), "{path}: {detail}");
            refused += 1;
        }
    }
    assert_eq!(refused, 6);
    server.request("POST", "/v1/render", &["Prefer: respond-async"], b"").problem(415, "mesh_unrecognised");
}

/// Queries that say something twice, and the two names that the answer must have.
#[test]
fn a_query_that_says_something_twice_is_refused() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let picture = format!("{}/render.png", crate::http::meshes::url(CUBE_OBJ));
    let cases = [
        ("style=wire&style=flat", "`style` is given twice", ""),
        ("max_error=1&max_error=2", "`max_error` is given twice", ""),
        ("size=64&image.width=32", "`image.width`", "`size`"),
        ("image.height=32&samples=1&size=64", "`size`", "`image.height`"),
        ("samples=1&image.samples=4", "`image.samples`", "`samples`"),
        ("up=z&camera.up=y", "`camera.up`", "`up`"),
        ("wire.color=f00&wire=%7B%22color%22:%22f00%22%7D", "`wire.color` is given twice", ""),
        ("materials.A.wire.color=f00&materials.A.wire.color=0f0", "`materials.A.wire.color` is given twice", ""),
        ("format_in=obj&format_in=obj", "`format_in` is given twice", ""),
        ("entry=a&entry=b", "`entry` is given twice", ""),
    ];
    for (query, one, other) in cases {
        for answer in [server.post(&format!("/v1/render?{query}"), CUBE_OBJ), server.get(&format!("{picture}?{query}"))]
        {
            let detail = answer.problem(400, "conflicting_keys");
            assert!(detail.contains(one) && detail.contains(other), "{query}: {detail}");
        }
    }
    assert_eq!(cases.len(), 10);
    // A layer and its keys are in order, and a query overrides a document.
    server.post("/v1/render?size=16&wire=null&wire.color=f00&materials.A.wire.color=0f0", CUBE_OBJ).picture(16, 16);
    let both = form(&[("file", CUBE_OBJ), ("request", br#"{"size":32,"style":"flat"}"#)]);
    server.request("POST", "/v1/render?image.width=16&style=wire", &[FORM], &both).picture(16, 32);
}

#[test]
fn a_query_takes_a_section_as_json() {
    let server = Server::start(&[]);
    let section = "outline=%7B%22thickness%22:3,%22unit%22:%22px%22%7D";
    let keys = "outline.thickness=3&outline.unit=px";
    let [a, b] = [section, keys].map(|query| server.post(&format!("/v1/render?size=32&{query}"), CUBE_OBJ).body);
    assert!(a == b && !a.is_empty());
    let cases = [
        ("outline=%7Bthickness:8%7D", "wrong_type", "one key alone is outline.KEY=VALUE"),
        ("outline=%7B%22thicknes%22:8%7D", "unknown_key", "did you mean outline.thickness?"),
        ("outline=%7B%22thickness%22:8,%22thickness%22:9%7D", "conflicting_keys", "`outline.thickness` is given twice"),
        ("outline=8", "wrong_type", "one key alone is outline.KEY=VALUE"),
        ("image=%5B%5D", "wrong_type", "one key alone is image.KEY=VALUE"),
        ("wire.color=%7B%7D", "out_of_range", "#rgb"),
    ];
    for (query, code, part) in cases {
        let detail = server.post(&format!("/v1/render?{query}"), CUBE_OBJ).problem(400, code);
        assert!(detail.contains(part), "{query}: {detail}");
    }
    assert_eq!(cases.len(), 6);
    let deep = format!("/v1/render?materials={}", "%7B%22a%22:".repeat(100));
    let detail = server.post(&deep, CUBE_OBJ).problem(400, "wrong_type");
    assert!(detail.contains("at most 64 deep"), "{detail}");
}

#[test]
fn values_in_the_wrong_notation_are_told_the_right_one() {
    let server = Server::start(&[]);
    let cases: [(&[u8], &str, &[&str]); 6] = [
        (br#"{"samples":"4"}"#, "wrong_type", &["`samples` is \"4\", a number in quotes", "16, without quotes"]),
        (br#"{"wire":{"thickness":"2"}}"#, "wrong_type", &["a number in quotes", "from 0 to 100, without quotes"]),
        (br#"{"wire":{"lit":"true"}}"#, "wrong_type", &["a truth value in quotes"]),
        (br#"{"image":{"max_error":"0.5"}}"#, "wrong_type", &["without quotes, or null"]),
        (br#"{"samples":"many"}"#, "wrong_type", &["`samples` is \"many\", and allowed is adaptive or 1 or 4"]),
        (br#"{"camera":{"eye":"1,2,3"}}"#, "wrong_type", &["[x, y, z]", "x,y,z", "in a query"]),
    ];
    for (document, code, parts) in cases {
        let body = form(&[("file", CUBE_OBJ), ("request", document)]);
        let detail = server.request("POST", "/v1/render", &[FORM], &body).problem(400, code);
        assert!(parts.iter().all(|part| detail.contains(part)), "{detail}");
    }
    assert_eq!(cases.len(), 6);
    let detail = server.post("/v1/render?camera.eye=1,2", CUBE_OBJ).problem(400, "wrong_type");
    assert!(detail.contains("[x, y, z]") && detail.contains("x,y,z"), "{detail}");
    let detail = server.post("/v1/render?sise=1", CUBE_OBJ).problem(400, "unknown_key");
    let top = "did you mean size? (the keys are backend, background, camera, format, image, light, materials, \
               max_error, outline, points, samples, scene, sheet, size, style, surface, topology, up, view, wire); of the mesh, a query says `format_in` and `entry`";
    assert!(detail.ends_with(top), "{detail}");
}

#[test]
fn warnings_stand_in_a_header_of_the_picture() {
    let server = Server::start(&[]);
    let warned = |query: &str, body: &[u8]| {
        let answer = server.post(&format!("/v1/render?size=16&{query}"), body);
        assert_eq!(answer.status, 200, "{query}");
        answer.header("x-warnings").map(str::to_owned)
    };
    assert_eq!(warned("style=wire", CUBE_OBJ), None);
    assert_eq!(warned("max_error=200", CUBE_OBJ), None);
    assert_eq!(warned("style=wire&max_error=0.01", CUBE_OBJ).as_deref(), Some("max_error_unmet"));
    assert_eq!(warned("image.max_time_ms=0.000001", CUBE_OBJ).as_deref(), Some("max_time_ms_unmet"));
    let lacking = [b"mtllib a.mtl\nmtllib b.mtl\n", CUBE_OBJ].concat();
    let several = warned("max_error=0.01&materials.Glas.wire=null", &lacking);
    assert_eq!(several.as_deref(), Some("mtl_ignored, material_unknown, max_error_unmet"));

    // The same for a picture of a stored mesh, and for a job's.
    server.post("/v1/meshes", CUBE_OBJ);
    let stored = format!("{}/render.png?size=16&style=wire&max_error=0.01", crate::http::meshes::url(CUBE_OBJ));
    assert_eq!(server.get(&stored).header("x-warnings"), Some("max_error_unmet"));
    assert_eq!(head(&server, &stored, &[]).status, 200);
    let job = server.post("/v1/jobs?size=16&style=wire&max_error=0.01", CUBE_OBJ);
    let location = job.header("location").unwrap().to_owned();
    server.request("GET", &location, &["Prefer: wait=30"], b"");
    assert_eq!(server.get(&format!("{location}/result")).header("x-warnings"), Some("max_error_unmet"));
}
