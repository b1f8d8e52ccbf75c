//! Bundles through the real program: forms, archives and command lines give the same pictures and
//! the same warnings, and hostile forms are refused.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::process::Output;

use crate::http::answers::FORM;
use crate::render::textures::levels::encode;
use crate::support::files::bundle::{Model, files, read_bundle, zipped};
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};
use meshsnap_render::import::Bundle;

/// A form of parts: name, file name if any, content.
fn form_of(parts: &[(&str, Option<&str>, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, filename, content) in parts {
        let filename = filename.map(|f| format!("; filename=\"{f}\"")).unwrap_or_default();
        body.extend(format!("--XX\r\nContent-Disposition: form-data; name=\"{name}\"{filename}\r\n\r\n").bytes());
        body.extend(*content);
        body.extend(b"\r\n");
    }
    body.extend(b"--XX--\r\n");
    body
}

fn files_form(files: &[(&str, &[u8])]) -> Vec<u8> {
    let parts: Vec<_> = files.iter().map(|(name, bytes)| ("file", Some(*name), *bytes)).collect();
    form_of(&parts)
}

fn run(arguments: &[&str]) -> Output {
    let output = meshsnap().args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// The codes of a job's warnings, once it is done.
fn warnings_of_job(server: &Server, content_type: &str, body: &[u8]) -> Vec<String> {
    let accepted = server.request("POST", "/v1/jobs?size=16", &[content_type], body);
    let location = accepted.header("location").unwrap().to_owned();
    let done = server.request("GET", &location, &["Prefer: wait=60"], b"").json();
    let warnings = done["result"]["warnings"].as_array().unwrap_or_else(|| panic!("{done}"));
    warnings.iter().map(|w| w["code"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_form_an_archive_and_a_command_line_are_the_same_bundle() {
    let models = Model::all();
    let server = Server::start(&[]);
    let directory = tempfile::tempdir().unwrap();
    for model in &models {
        let parts = model.files();
        let query = "/v1/render?size=64&style=smooth";
        let from_form = server.request("POST", query, &[FORM], &files_form(&parts));
        let picture = from_form.picture(64, 64);
        let archive = zipped(&parts);
        for headers in [&["Content-Type: application/zip"][..], &[]] {
            assert_eq!(server.request("POST", query, headers, &archive).body, from_form.body);
        }
        let mut paths = Vec::new();
        for (name, bytes) in parts.iter().chain(&[("all.zip", archive.as_slice())]) {
            let path = directory.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            paths.push(path.to_str().unwrap().to_owned());
        }
        let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
        let rest = ["-o", "-", "--size", "64", "--style", "smooth", "--backend", "cpu"];
        for meshes in [&paths[..3], &paths[3..]] {
            let output = run(&[&["render"], meshes, &rest].concat());
            assert_eq!(output.stdout, from_form.body, "{meshes:?}");
            assert!(!String::from_utf8_lossy(&output.stderr).contains("does not name"));
        }
        assert!(picture.pixels().any(|p| p.0[3] == 255));

        let mesh = read_bundle(&Bundle::of_files(files(&parts))).unwrap();
        let expected: Vec<&str> = mesh.report.warnings.iter().map(|w| w.code).collect();
        assert_eq!(warnings_of_job(&server, FORM, &files_form(&parts)), expected);
        assert_eq!(warnings_of_job(&server, "Content-Type: application/zip", &archive), expected);
        let report = run(&[&["inspect", "--json"], &paths[..3]].concat()).stdout;
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let codes: Vec<&str> =
            report["warnings"].as_array().unwrap().iter().map(|w| w["code"].as_str().unwrap()).collect();
        assert_eq!((codes, &report["materials"][0]), (expected, &model.material.into()));

        // Its neighbours on disk are not read unless they are named, but the warning says which to
        // name.
        let output = run(&[&["render"], &paths[..1], &rest].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(stderr.contains(parts[1].0) && stderr.contains("beside it: meshsnap render"), "{stderr}");
        let alone = warnings_of_job(&server, "Content-Type: model/obj", parts[0].1);
        assert!(alone.contains(&"mtl_ignored".to_owned()), "{alone:?}");
    }
    assert_eq!(models.len(), 2);
}

#[test]
fn the_entry_is_found_or_asked_for() {
    let server = Server::start(&[]);
    let small: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let two = files_form(&[("a/cube.obj", CUBE_OBJ), ("tri.obj", small), ("readme.txt", b"hello")]);
    let detail = server.request("POST", "/v1/render?size=16", &[FORM], &two).problem(422, "entry_unclear");
    assert!(detail.contains("\"a/cube.obj\", \"tri.obj\"") && !detail.contains("readme"), "{detail}");
    let get = |query: &str| server.request("POST", &format!("/v1/render?size=16&{query}"), &[FORM], &two);
    let (cube, triangle) = (get("entry=a/cube.obj"), get("entry=tri.obj"));
    cube.picture(16, 16);
    triangle.picture(16, 16);
    assert_ne!(cube.body, triangle.body);
    assert_eq!(get("entry=cube.obj").body, cube.body);
    get("entry=tri.obj&entry=cube.obj").problem(400, "conflicting_keys");
    get("entry=gone.obj").problem(422, "entry_unclear");
    get("entry=%00").problem(422, "entry_unclear");
    get("entry=../../etc/passwd").problem(422, "entry_unclear");
    get("entry=readme.txt").problem(415, "mesh_unrecognised");
    let none = files_form(&[("a.txt", b"a"), ("b.txt", b"b")]);
    server.request("POST", "/v1/render", &[FORM], &none).problem(415, "mesh_unrecognised");

    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir(path("a")).unwrap();
    std::fs::write(path("a/cube.obj"), CUBE_OBJ).unwrap();
    std::fs::write(path("tri.obj"), small).unwrap();
    let (first, second) = (path("a/cube.obj"), path("tri.obj"));
    let arguments = ["render", &first, &second, "-o", "-", "--size", "16", "--backend", "cpu"];
    let output = meshsnap().args(arguments).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && stderr.contains("\"a/cube.obj\", \"tri.obj\""), "{stderr}");
    assert_eq!(run(&[&arguments[..], &["--entry", "tri.obj"]].concat()).stdout, triangle.body);
    assert_eq!(run(&[&arguments[..], &["--entry", "a/cube.obj"]].concat()).stdout, cube.body);
}

#[test]
fn folders_on_the_command_line_are_those_of_the_bundle() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let picture = encode(&image::RgbImage::new(2, 2).into(), image::ImageFormat::Png);
    let obj = "mtllib ../lib/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl A\nf 1 2 3\n";
    let files = [
        write("models/m.obj", obj.as_bytes()),
        write("lib/m.mtl", b"newmtl A\nmap_Kd tex/same.png\nnorm ../models/same.png\n"),
        write("lib/tex/same.png", &picture),
        write("models/same.png", &picture),
    ];
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let warnings = |files: &[&str]| {
        let report = run(&[&["inspect", "--json"], files].concat()).stdout;
        serde_json::from_slice::<serde_json::Value>(&report).unwrap()["warnings"].take()
    };
    assert_eq!(warnings(&files), serde_json::json!([]));
    assert_eq!(warnings(&files[..1])[0]["code"], "mtl_ignored");
    // The other picture of that name lies elsewhere, but it is the only one.
    assert_eq!(warnings(&files[..3]), serde_json::json!([]));
    assert_eq!(warnings(&files[..2])[0]["code"], "textures_missing");
}

/// A form may be as large as any other upload, and no larger.
#[test]
fn forms_are_limited_as_all_uploads_are() {
    let server = Server::start(&["--limit-body-bytes", "6000000"]);
    let mut large = CUBE_OBJ.to_vec();
    large.extend(b"# a comment line of forty-two characters .\n".repeat(120_000));
    assert!((5_000_000..6_000_000).contains(&large.len()));
    let form =
        |bytes: &[u8]| server.request("POST", "/v1/render?size=16", &[FORM], &files_form(&[("cube.obj", bytes)]));
    assert_eq!(form(&large).body, form(CUBE_OBJ).body);
    large.resize(7_000_000, b'\n');
    form(&large).problem(413, "body_too_large");
    // The search for a part's beginning ends soon.
    for beginning in ["-", "--XX\r\nX: "] {
        let endless = [beginning.as_bytes(), &vec![b'-'; 5_000_000]].concat();
        let detail = server.request("POST", "/v1/render", &[FORM], &endless).problem(400, "bad_form");
        assert!(detail.contains("no part within") || detail.contains("cannot be read"), "{detail}");
    }
}

#[test]
fn hostile_forms_are_refused_precisely() {
    let server = Server::start(&["--limit-bundle-entries", "5"]);
    let long = "x".repeat(2000);
    let names = ["/etc/x.obj", "C:\\\\x.obj", "../x.obj", "a/../../x.obj", "a\0.obj", &long];
    for name in names {
        let answer = server.request("POST", "/v1/render", &[FORM], &files_form(&[(name, CUBE_OBJ)]));
        answer.problem(400, "bad_form");
    }
    assert_eq!(names.len(), 6);
    let send = |parts: &[(&str, Option<&str>, &[u8])]| -> Answer {
        server.request("POST", "/v1/render?size=16", &[FORM], &form_of(parts))
    };
    let a = ("file", Some("a.obj"), CUBE_OBJ);
    let detail = send(&[a, a]).problem(400, "bad_form");
    assert!(detail.contains("two files are named \"a.obj\""), "{detail}");
    send(&[a, ("file", Some("./a.obj"), CUBE_OBJ)]).problem(400, "bad_form");
    let detail = send(&[a, ("file", None, b"x")]).problem(400, "bad_form");
    assert!(detail.contains("part 2"), "{detail}");
    send(&[a, ("request", None, b"{}"), ("request", None, b"{}")]).problem(400, "bad_form");
    let six: Vec<String> = (0..6).map(|i| format!("{i}.obj")).collect();
    let six: Vec<_> = six.iter().map(|name| ("file", Some(name.as_str()), CUBE_OBJ)).collect();
    let answer = send(&six);
    answer.problem(422, "limit_exceeded");
    assert_eq!(answer.json()["flag"], "--limit-bundle-entries");
    send(&[("file", None, CUBE_OBJ)]).picture(16, 16);
    send(&[a, ("file", Some("b.mtl"), b"newmtl A\nKd 0.5\n"), ("request", None, b"{\"style\":\"wire\"}")])
        .picture(16, 16);
    // An archive in a form is the same archive; beside other files it stays closed.
    let zip = zipped(&[("cube.obj", CUBE_OBJ)]);
    send(&[("file", Some("x.zip"), &zip)]).picture(16, 16);
    send(&[("file", Some("x.zip"), &zip), ("file", Some("b.txt"), b"b")]).problem(422, "bundle_broken");
    send(&[("file", Some("x.zip"), &zip), a]).picture(16, 16);
}

#[test]
fn upload_memory_is_given_back() {
    let server = Server::start(&["--uploads-bytes", "2000000", "--workers", "1"]);
    let padding = vec![b' '; 900_000];
    let body = files_form(&[("a.obj", CUBE_OBJ), ("b.txt", &padding), ("c.txt", &padding)]);
    let large = vec![b' '; 2_100_000];
    for _ in 0..10 {
        server.request("POST", "/v1/render?size=16", &[FORM], &body).picture(16, 16);
        let too_much = files_form(&[("a.obj", CUBE_OBJ), ("b.txt", &large)]);
        server.request("POST", "/v1/render?size=16", &[FORM], &too_much).problem(413, "body_too_large");
        server.request("POST", "/v1/render?size=16", &[FORM], &body[..body.len() - 30]).problem(400, "bad_form");
    }
}
