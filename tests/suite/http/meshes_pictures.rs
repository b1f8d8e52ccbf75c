//! Pictures of stored meshes, by address and by request document.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use crate::http::meshes::{head, url};
use crate::support::files::bundle::zipped;
use crate::support::files::mesh::Solid;
use crate::support::server::{CUBE_OBJ, Server};
use meshsnap_server::digest::Digest;

const JSON: &str = "Content-Type: application/json";

#[test]
fn a_stored_mesh_is_drawn_as_if_it_were_sent() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let mut pictures = 0;
    for (extension, format) in [("png", "png"), ("webp", "webp"), ("jpg", "jpeg"), ("jpeg", "jpeg")] {
        for query in ["style=wire&size=40x30", "style=hidden-line&size=32&background=transparent", "size=16&samples=1"]
        {
            let path = format!("{}/render.{extension}?{query}", url(CUBE_OBJ));
            let stored = server.get(&path);
            let sent = server.post(&format!("/v1/render?{query}&format={format}"), CUBE_OBJ);
            assert_eq!((stored.status, &stored.body), (200, &sent.body), "{path}");
            assert_eq!(stored.header("content-type"), sent.header("content-type"));
            assert_eq!(stored.header("x-render-backend"), Some("cpu"));
            assert_eq!(stored.header("cache-control"), Some("public, max-age=86400, immutable"));
            let tag = stored.header("etag").unwrap();
            assert!(tag.starts_with('"') && tag.len() == 66, "strong: {tag}");
            assert_eq!(server.get(&path).header("etag"), Some(tag));
            let asked = head(&server, &path, &[]);
            assert_eq!((asked.status, asked.header("etag")), (200, Some(tag)));
            for name in ["content-type", "cache-control"] {
                assert_eq!(asked.header(name), stored.header(name));
            }
            assert_eq!(asked.header("content-length"), None, "nobody knows before it is drawn");
            pictures += 1;
        }
    }
    assert_eq!(pictures, 12);
    // The extension decides.
    let png = server.get(&format!("{}/render.png?size=16&format=webp", url(CUBE_OBJ)));
    assert_eq!(png.header("content-type"), Some("image/png"));
}

#[test]
fn the_tag_is_a_key_of_what_is_drawn() {
    let server = Server::start(&[]);
    let solid = Solid::cuboid().obj();
    let two = zipped(&[("a.obj", CUBE_OBJ), ("b.obj", solid.as_bytes())]);
    server.post("/v1/meshes", CUBE_OBJ);
    server.post("/v1/meshes", solid.as_bytes());
    server.post("/v1/meshes?entry=a.obj", &two);
    let tag = |bytes: &[u8], rest: &str| {
        let answer = head(&server, &format!("{}/render.{rest}", url(bytes)), &[]);
        assert_eq!(answer.status, 200, "{rest}");
        answer.header("etag").unwrap().to_owned()
    };
    let base = tag(CUBE_OBJ, "png?style=wire&size=64");
    let same = [
        "png?size=64x64&style=wire",
        "png?image.width=64&image.height=64&style=wire",
        "png?style=wire&size=64&format=jpeg",
        "png?style=wire&size=64&wire.color=%23000&samples=4",
    ];
    for rest in same {
        assert_eq!(tag(CUBE_OBJ, rest), base, "{rest}");
    }
    assert_eq!(same.len(), 4);
    let tags = [
        base,
        tag(solid.as_bytes(), "png?style=wire&size=64"),
        tag(CUBE_OBJ, "webp?style=wire&size=64"),
        tag(CUBE_OBJ, "jpg?style=wire&size=64"),
        tag(CUBE_OBJ, "png?style=wire&size=65"),
        tag(CUBE_OBJ, "png?style=flat&size=64"),
        tag(CUBE_OBJ, "png?style=wire&size=64&wire.thickness=1.5"),
        tag(CUBE_OBJ, "png?style=wire&size=64&camera.azimuth_deg=0.1"),
        tag(CUBE_OBJ, "png?style=wire&size=64&materials.Glass.wire=null"),
        tag(CUBE_OBJ, "png?style=wire&size=64&format_in=obj"),
        tag(CUBE_OBJ, "png?style=wire&size=64&max_error=1"),
        tag(&two, "png?style=wire&size=64&entry=a.obj"),
        tag(&two, "png?style=wire&size=64&entry=b.obj"),
    ];
    let different: std::collections::BTreeSet<&String> = tags.iter().collect();
    assert_eq!(different.len(), 13);

    // A GPU, even one in software, promises no more than to agree within the last place.
    let weak = tag(CUBE_OBJ, "png?style=wire&size=64&backend=gpu");
    assert!(weak.starts_with("W/\"") && !different.contains(&weak), "{weak}");
    let path = format!("{}/render.png?style=wire&size=64&backend=gpu", url(CUBE_OBJ));
    assert_eq!(server.request("GET", &path, &[&format!("If-None-Match: {weak}")], b"").status, 304);

    // Two readings of one archive.
    let drawn = |e: &str| server.get(&format!("{}/render.png?size=32&entry={e}", url(&two))).body;
    assert_eq!(drawn("a.obj"), server.post("/v1/render?size=32", CUBE_OBJ).body);
    assert_eq!(drawn("b.obj"), server.post("/v1/render?size=32", solid.as_bytes()).body);
}

#[test]
fn who_has_the_picture_costs_no_worker() {
    let server = Server::start(&["--workers", "1", "--queue", "0"]);
    server.post("/v1/meshes", CUBE_OBJ);
    let path = format!("{}/render.png?size=48&style=wire", url(CUBE_OBJ));
    let drawn = server.get(&path);
    drawn.picture(48, 48);
    let known = format!("If-None-Match: {}", drawn.header("etag").unwrap());
    std::thread::scope(|scope| {
        let client = scope.spawn(|| server.post("/v1/render?size=4096", CUBE_OBJ));
        server.wait_for_load(|load| load["running"] == 1);
        // There is no worker to be had.
        server.get(&format!("{path}&view=top")).problem(429, "queue_full");
        let kept = server.get(&path);
        assert_eq!((kept.header("x-cache"), &kept.body), (Some("hit"), &drawn.body));
        let unmodified = server.request("GET", &path, &[&known], b"");
        assert_eq!((unmodified.status, unmodified.body.len()), (304, 0));
        assert_eq!(unmodified.header("etag"), drawn.header("etag"));
        assert_eq!(unmodified.header("cache-control"), drawn.header("cache-control"));
        assert_eq!(head(&server, &path, &[&known]).status, 304);
        assert_eq!(head(&server, &path, &[]).status, 200);
        client.join().unwrap().picture(4096, 4096);
    });
    assert_eq!(server.request("GET", &path, &["If-None-Match: \"other\""], b"").body, drawn.body);
}

#[test]
fn pictures_that_cannot_be() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let url = url(CUBE_OBJ);
    let cases = [
        ("render", 404, "not_found"),
        ("render.", 404, "not_found"),
        ("render.gif", 404, "not_found"),
        ("render.PNG", 404, "not_found"),
        ("picture.png", 404, "not_found"),
        ("%ff.png", 404, "not_found"),
        ("render.png?size=0", 400, "out_of_range"),
        ("render.png?sise=8", 400, "unknown_key"),
        ("render.png?mesh=x", 400, "unknown_key"),
        ("render.png?camera.eye=1,2,3", 400, "conflicting_keys"),
        ("render.png?format_in=dae", 400, "out_of_range"),
        ("render.png?format_in=glb", 422, "mesh_broken"),
        ("render.png?entry=x.obj", 422, "entry_unclear"),
    ];
    for (rest, status, code) in cases {
        server.get(&format!("{url}/{rest}")).problem(status, code);
    }
    assert_eq!(cases.len(), 13);
    assert_eq!(head(&server, &format!("{url}/render.png?size=0"), &[]).status, 400);
    server.request("POST", &format!("{url}/render.png"), &[], b"").problem(405, "method_not_allowed");
}

#[test]
fn a_document_names_a_stored_mesh() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let digest = Digest::of(CUBE_OBJ).to_string();
    let document = format!(r#"{{"mesh":"{digest}","style":"wire","image":{{"width":40,"height":30}}}}"#);
    let sent = server.post("/v1/render?style=wire&size=40x30", CUBE_OBJ).body;
    let mut drawn = 0;
    // Whatever curl calls it.
    for media_type in [JSON, "Content-Type: application/json; charset=utf-8", "Content-Type: text/plain", "X-None: 1"] {
        assert_eq!(server.request("POST", "/v1/render", &[media_type], document.as_bytes()).body, sent, "{media_type}");
        drawn += 1;
    }
    assert_eq!(drawn, 4);
    let wide = server.request("POST", "/v1/render?image.height=20", &[JSON], document.as_bytes());
    wide.picture(40, 20);
    // A key of the document may stand on one of the query.
    let eye = format!(r#"{{"mesh":"{digest}","camera":{{"eye":[9,9,9]}}}}"#);
    server.request("POST", "/v1/render?size=16&camera.target=0,0,0", &[JSON], eye.as_bytes()).picture(16, 16);

    let accepted = server.request("POST", "/v1/jobs", &[JSON], document.as_bytes());
    assert_eq!(accepted.status, 202);
    let location = accepted.header("location").unwrap();
    assert_eq!(server.request("GET", location, &["Prefer: wait=30"], b"").json()["state"], "done");
    assert_eq!(server.get(&format!("{location}/result")).body, sent);
    let later = server.request("POST", "/v1/render", &[JSON, "Prefer: respond-async"], document.as_bytes());
    assert_eq!(later.status, 202);
    assert_eq!(
        server.request("POST", "/v1/render", &[JSON, "Accept: image/webp"], document.as_bytes()).header("content-type"),
        Some("image/webp")
    );
}

/// A picture that is made from a document is one that GET finds.
#[test]
fn a_picture_of_a_stored_mesh_says_where_it_is() {
    let server = Server::start(&[]);
    let two = zipped(&[("a.obj", CUBE_OBJ), ("b.obj", Solid::cuboid().obj().as_bytes())]);
    server.post("/v1/meshes", CUBE_OBJ);
    server.post("/v1/meshes?entry=a.obj", &two);
    let (cube, pair) = (Digest::of(CUBE_OBJ), Digest::of(&two));
    let cases = [
        (cube, r#""size":24"#, "", ".png?size=24"),
        (
            cube,
            r##""style":"wire","size":24,"wire":{"color":"#f00"},"format":"webp""##,
            "",
            ".webp?size=24&style=wire&wire.color=%23f00",
        ),
        (cube, r#""style":"wire","size":24"#, "?style=flat", ".png?size=24&style=flat"),
        (
            cube,
            r#""size":24,"camera":{"eye":[3,2,1],"target":[0,0,0]}"#,
            "?format=jpeg",
            ".jpg?camera.eye=%5B3,2,1%5D&camera.target=%5B0,0,0%5D&size=24",
        ),
        (
            pair,
            r#""size":24,"materials":{"Ä&=1":{"wire":{}}}"#,
            "?entry=b.obj",
            ".png?materials.%C3%84%26%3D1.wire=%7B%7D&size=24&entry=b.obj",
        ),
        (cube, r#""size":24"#, "?format_in=obj", ".png?size=24&format_in=obj"),
    ];
    for (digest, document, query, expected) in cases {
        let document = format!(r#"{{"mesh":"{digest}",{document}}}"#);
        let drawn = server.request("POST", &format!("/v1/render{query}"), &[JSON], document.as_bytes());
        drawn.picture(24, 24);
        let location = drawn.header("content-location").expect("Content-Location").to_owned();
        assert_eq!(location, format!("/v1/meshes/{digest}/render{expected}"));
        let there = server.get(&location);
        assert_eq!((there.status, &there.body), (200, &drawn.body), "{location}");
        assert_eq!(there.header("etag"), drawn.header("etag"), "{location}");
        assert_eq!(there.header("content-type"), drawn.header("content-type"), "{location}");
    }
    assert_eq!(cases.len(), 6);
    // No query says this, and what was sent is nowhere.
    let document = format!(r#"{{"mesh":"{cube}","size":24}}"#);
    let mixed = server.request("POST", "/v1/render?image.width=16", &[JSON], document.as_bytes());
    mixed.picture(16, 24);
    assert_eq!(mixed.header("content-location"), None);
    assert_eq!(server.post("/v1/render?size=24", CUBE_OBJ).header("content-location"), None);
}

#[test]
fn documents_that_name_no_stored_mesh() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let digest = Digest::of(CUBE_OBJ).to_string();
    let cases = [
        (format!(r#"{{"mesh":"{}"}}"#, Digest::of(b"")), 404, "mesh_unknown"),
        (format!(r#"{{"mesh":"{}"}}"#, digest.to_uppercase()), 400, "out_of_range"),
        (r#"{"mesh":"../../etc/passwd"}"#.to_owned(), 400, "out_of_range"),
        (format!(r#"{{"mesh":"{digest}","sise":8}}"#), 400, "unknown_key"),
        (format!(r#"{{"mesh":"{digest}","image":{{"width":0}}}}"#), 400, "out_of_range"),
        (format!(r#"{{"mesh":"{digest}","mesh":"{digest}"}}"#), 400, "conflicting_keys"),
        (format!(r#"{{"mesh":"{digest}","asset":{{}}}}"#), 400, "unknown_key"),
        (format!(r#"{{"mesh":"{digest}","x":{}1{}}}"#, "[".repeat(100), "]".repeat(100)), 400, "not_json"),
        (format!(r#"{{"mesh":"{digest}""#), 400, "not_json"),
        (r#"{"mesh":7}"#.to_owned(), 400, "wrong_type"),
        (r#"{"mesh":null}"#.to_owned(), 400, "wrong_type"),
        (r#"{"style":"wire"}"#.to_owned(), 400, "missing_key"),
    ];
    for (document, status, code) in &cases {
        server.request("POST", "/v1/render", &[JSON], document.as_bytes()).problem(*status, code);
        server.request("POST", "/v1/jobs", &[JSON], document.as_bytes()).problem(*status, code);
        // Whatever curl calls it, if it speaks of a mesh.
        if document.contains("mesh") {
            server.post("/v1/render", document.as_bytes()).problem(*status, code);
        }
    }
    assert_eq!(cases.len(), 12);
    server.request("POST", "/v1/render?sise=8", &[JSON], CUBE_OBJ).problem(400, "unknown_key");
}

#[test]
fn a_gltf_file_is_a_mesh_whatever_it_is_called() {
    let server = Server::start(&[]);
    let gltf = Solid::cuboid().gltf().gltf();
    let mut odd: serde_json::Value = serde_json::from_str(&gltf).unwrap();
    odd["mesh"] = "a key of somebody's own".into();
    let odd = odd.to_string();
    let mut drawn = 0;
    for body in [&gltf, &odd] {
        for media_type in [JSON, "Content-Type: model/gltf+json", "X-None: 1"] {
            server.request("POST", "/v1/render?size=24", &[media_type], body.as_bytes()).picture(24, 24);
            drawn += 1;
        }
        let stored = server.request("POST", "/v1/meshes", &[JSON], body.as_bytes());
        assert_eq!(stored.status, 201);
        let document = format!(r#"{{"mesh":{},"image":{{"width":24,"height":24}}}}"#, stored.json()["sha256"]);
        let by_name = server.request("POST", "/v1/render", &[JSON], document.as_bytes());
        assert_eq!(by_name.body, server.post("/v1/render?size=24", gltf.as_bytes()).body);
    }
    assert_eq!(drawn, 6);
}
