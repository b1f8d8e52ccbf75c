//! `/v1/meshes` of the real server: a mesh is stored once, under its digest, and its report is what
//! `inspect --json` prints.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::io::Read as _;
use std::io::Write as _;

use crate::http::answers::FORM;
use crate::support::files::bundle::zipped;
use crate::support::files::mesh::Solid;
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};
use meshsnap_server::digest::Digest;

/// The path of a stored mesh of these bytes.
pub fn url(bytes: &[u8]) -> String {
    format!("/v1/meshes/{}", Digest::of(bytes))
}

/// A form of files under names.
pub fn form_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut body = Vec::new();
    for (name, content) in files {
        body.extend(
            format!("--XX\r\nContent-Disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\r\n").bytes(),
        );
        body.extend(*content);
        body.extend(b"\r\n");
    }
    body.extend(b"--XX--\r\n");
    body
}

/// Asks with HEAD: the answer's status and headers, and that nothing follows them.
pub fn head(server: &Server, path: &str, headers: &[&str]) -> Answer {
    let mut stream = server.connect();
    let more: String = headers.iter().map(|h| format!("{h}\r\n")).collect();
    write!(stream, "HEAD {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{more}\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    assert!(text.ends_with("\r\n\r\n") && text.matches("\r\n\r\n").count() == 1, "a body after {text}");
    let status = text.split(' ').nth(1).unwrap().parse().unwrap();
    let pair = |line: &str| line.split_once(':').map(|(k, v)| (k.to_ascii_lowercase(), v.trim().to_owned()));
    Answer { status, headers: text.lines().skip(1).filter_map(pair).collect(), body: Vec::new() }
}

/// The program's output for these files.
fn inspected(files: &[(&str, &[u8])], arguments: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    let mut command = meshsnap();
    command.current_dir(folder.path()).args(["inspect", "--json"]).args(arguments).args(&names);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_mesh_is_stored_found_reported_and_forgotten() {
    let server = Server::start(&[]);
    let (url, digest) = (url(CUBE_OBJ), Digest::of(CUBE_OBJ).to_string());
    assert_eq!(head(&server, &url, &[]).status, 404);
    let tag = format!("\"{digest}\"");
    for (round, status) in [201, 200].into_iter().enumerate() {
        let stored = server.post("/v1/meshes", CUBE_OBJ);
        assert_eq!(stored.status, status, "round {round}: {}", String::from_utf8_lossy(&stored.body));
        assert_eq!(stored.header("location"), Some(url.as_str()));
        assert_eq!(stored.header("etag"), Some(tag.as_str()));
        assert_eq!(stored.header("cache-control"), Some("no-store"));
        let json = stored.json();
        assert_eq!((&json["sha256"], &json["url"]), (&digest.as_str().into(), &url.as_str().into()));
        assert_eq!((&json["size_bytes"], &json["files"]), (&CUBE_OBJ.len().into(), &1.into()));
        server.get(json["render_url"].as_str().unwrap()).picture(512, 512);
    }

    let report = server.get(&url);
    assert_eq!((report.status, report.header("content-type")), (200, Some("application/json")));
    assert_eq!(report.header("etag"), Some(tag.as_str()));
    assert_eq!(report.header("cache-control"), Some("public, max-age=86400, immutable"));
    let there = head(&server, &url, &[]);
    assert_eq!((there.status, there.header("etag")), (200, Some(tag.as_str())));
    assert_eq!(there.header("content-length"), Some(report.body.len().to_string().as_str()));

    let mut unmodified = 0;
    for known in [tag.clone(), format!("W/{tag}"), "*".to_owned(), format!("\"x\", {tag}")] {
        let header = format!("If-None-Match: {known}");
        let answer = server.request("GET", &url, &[&header], b"");
        assert_eq!((answer.status, answer.body.len(), answer.header("etag")), (304, 0, Some(tag.as_str())), "{known}");
        assert_eq!(head(&server, &url, &[&header]).status, 304);
        unmodified += 1;
    }
    assert_eq!(unmodified, 4);
    assert_eq!(server.request("GET", &url, &["If-None-Match: \"x\""], b"").body, report.body);

    let forgotten = server.request("DELETE", &url, &[], b"");
    assert_eq!((forgotten.status, forgotten.body.len()), (204, 0));
    for (method, path) in [("GET", url.clone()), ("DELETE", url.clone()), ("GET", format!("{url}/render.png"))] {
        let answer = server.request(method, &path, &[&format!("If-None-Match: {tag}")], b"");
        answer.problem(404, "mesh_unknown");
    }
    assert_eq!(head(&server, &url, &[]).status, 404);
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201, "and new again");
}

#[test]
fn the_report_is_what_inspect_prints() {
    let server = Server::start(&[]);
    let solid = Solid::cuboid();
    let (obj, text) = (solid.obj(), solid.stl_ascii());
    let (binary, glb, gltf) = (solid.stl_binary(), solid.gltf().glb(), solid.gltf().gltf());
    let two = zipped(&[("a.obj", CUBE_OBJ), ("b.obj", obj.as_bytes())]);
    let cases: [(&str, &[u8], &str, &[&str]); 9] = [
        ("mesh.obj", obj.as_bytes(), "", &[]),
        ("mesh.stl", text.as_bytes(), "", &[]),
        ("mesh.stl", &binary, "", &[]),
        ("mesh.glb", &glb, "", &[]),
        ("mesh.gltf", gltf.as_bytes(), "", &[]),
        ("mesh.zip", &zipped(&[("x/a.obj", CUBE_OBJ)]), "", &[]),
        ("mesh.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "?format_in=obj", &["--format-in", "obj"]),
        ("mesh.zip", &two, "?entry=a.obj", &["--entry", "a.obj"]),
        ("mesh.zip", &two, "?entry=b.obj", &["--entry", "b.obj"]),
    ];
    let mut reports = 0;
    for (name, bytes, query, arguments) in cases {
        let stored = server.post(&format!("/v1/meshes{query}"), bytes);
        assert!([200, 201].contains(&stored.status), "{name}: {}", String::from_utf8_lossy(&stored.body));
        let expected = inspected(&[(name, bytes)], arguments);
        // The second time, the report is one that was not made with the upload.
        for query in [query, if query.is_empty() { "?format_in=" } else { query }] {
            let query =
                if query.ends_with('=') { format!("{query}{}", expected_format(&expected)) } else { query.into() };
            let report = server.get(&format!("{}{query}", url(bytes)));
            assert_eq!(String::from_utf8_lossy(&report.body), expected, "{name}{query}");
            reports += 1;
        }
    }
    assert_eq!(reports, 18);

    // The archive's two readings are two reports, with a tag each; without `entry` it is as unclear
    // as it was.
    let tags =
        ["a", "b"].map(|e| server.get(&format!("{}?entry={e}.obj", url(&two))).header("etag").unwrap().to_owned());
    assert_ne!(tags[0], tags[1]);
    let detail = server.get(&url(&two)).problem(422, "entry_unclear");
    assert!(detail.contains("a.obj") && detail.contains("b.obj"), "{detail}");
    server.post("/v1/meshes", &two).problem(422, "entry_unclear");
}

/// A format that the file can be said to have without a change.
fn expected_format(report: &str) -> String {
    serde_json::from_str::<serde_json::Value>(report).unwrap()["format"].as_str().unwrap().to_owned()
}

#[test]
fn a_form_is_named_by_the_list_of_its_files() {
    let server = Server::start(&[]);
    let mtl: &[u8] = b"newmtl Red\nKd 1 0 0\n";
    let obj = [b"mtllib sub dir/a.mtl\nusemtl Red\n", CUBE_OBJ].concat();
    let files: [(&str, &[u8]); 3] = [("b.obj", &obj), ("sub dir/a.mtl", mtl), ("z.txt", b"a note")];
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let answers = orders.map(|order| {
        let body = form_of(&order.map(|i| files[i]));
        server.request("POST", "/v1/meshes", &[FORM], &body)
    });
    let statuses = answers.iter().map(|a| a.status).collect::<Vec<_>>();
    assert_eq!(statuses, [201, 200, 200, 200, 200, 200]);
    let urls: Vec<_> = answers.iter().map(|a| a.header("location").unwrap().to_owned()).collect();
    assert!(urls.iter().all(|url| *url == urls[0]), "{urls:?}");
    assert_eq!((&answers[0].json()["files"], &answers[0].json()["size_bytes"]), (&3.into(), &(obj.len() + 26).into()));

    // As the documentation says that anybody can work it out.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("sub dir")).unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let line = "sha256sum z.txt 'sub dir/a.mtl' b.obj | LC_ALL=C sort -k 2";
    let shell = |line: &str| {
        let output = std::process::Command::new("sh").current_dir(folder.path()).args(["-c", line]).output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    assert_eq!(urls[0], format!("/v1/meshes/{}", shell(&format!("{line} | sha256sum")).split(' ').next().unwrap()));

    // Another name or another byte is another mesh.
    let renamed = [("c.obj", &*obj), files[1], files[2]];
    let changed: [(&str, &[u8]); 3] = [files[0], files[1], ("z.txt", b"a Note")];
    for files in [renamed, changed] {
        assert_eq!(server.request("POST", "/v1/meshes", &[FORM], &form_of(&files)).status, 201);
    }

    // The list itself, whose digest as a file would be the form's, is no mesh by any name.
    assert_eq!(server.request("DELETE", &urls[0], &[], b"").status, 204);
    let list = shell(line);
    assert_eq!(url(list.as_bytes()), urls[0]);
    let mut refused = 0;
    for format in ["obj", "gltf", "glb", "stl", "ply", "off", "fbx", "3mf"] {
        let answer = server.post(&format!("/v1/meshes?format_in={format}"), list.as_bytes());
        assert!([415, 422].contains(&answer.status), "{format}: {}", answer.status);
        refused += 1;
    }
    assert_eq!(refused, 8);
    server.post("/v1/meshes", list.as_bytes()).problem(415, "mesh_unrecognised");
    server.get(&urls[0]).problem(404, "mesh_unknown");
}

#[test]
fn put_stores_under_the_name_that_it_says() {
    let server = Server::start(&[]);
    let url = url(CUBE_OBJ);
    for status in [201, 200] {
        let answer = server.request("PUT", &url, &[], CUBE_OBJ);
        assert_eq!((answer.status, answer.header("location")), (status, Some(url.as_str())));
    }
    let mut other = CUBE_OBJ.to_vec();
    other.extend(b"# changed\n");
    let detail = server.request("PUT", &url, &[], &other).problem(422, "digest_mismatch");
    assert!(detail.contains(&Digest::of(&other).to_string()), "{detail}");
    server.get(&self::url(&other)).problem(404, "mesh_unknown");
    // A digest costs no worker's time; a mesh that is none is refused as such only under its own
    // name.
    server.request("PUT", &url, &[], b"no mesh").problem(422, "digest_mismatch");
    server.request("PUT", &self::url(b"no mesh"), &[], b"no mesh").problem(415, "mesh_unrecognised");
    // Any spelling of a path is the path.
    let spelt = format!("/v1/meshes/%{:02x}{}", url.as_bytes()[11], &url[12..]);
    assert_eq!(server.get(&spelt).status, 200, "{spelt}");
}

#[test]
fn capabilities_and_keys_know_of_meshes() {
    let mut command = meshsnap();
    let arguments = ["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--mesh-count", "7"];
    command.args(arguments).env("MESHSNAP_API_KEYS", "one").env("MESHSNAP_MESH_BYTES", "2MiB");
    let server = Server::start_with(&mut command);
    let url = url(CUBE_OBJ);
    let picture = format!("{url}/render.png?size=16");
    let cases = [
        ("POST", "/v1/meshes", 201),
        ("PUT", &url, 200),
        ("GET", &url, 200),
        ("GET", &picture, 200),
        ("DELETE", &url, 204),
    ];
    for (method, path, status) in cases {
        let body = if ["POST", "PUT"].contains(&method) { CUBE_OBJ } else { b"" };
        server.request(method, path, &[], body).problem(401, "unauthorized");
        let answer = server.request(method, path, &["Authorization: Bearer one"], body);
        assert_eq!(answer.status, status, "{method} {path}");
        if method == "GET" {
            assert_eq!(answer.header("cache-control"), Some("private, max-age=86400, immutable"));
        }
    }
    assert_eq!(cases.len(), 5);
    assert_eq!(head(&server, &url, &[]).status, 401);
    let capabilities = server.request("GET", "/v1/capabilities", &["Authorization: Bearer one"], b"").json();
    let limits = &capabilities["limits"];
    assert_eq!((&limits["mesh_bytes"], &limits["mesh_count"]), (&(2 << 20).into(), &7.into()));
    assert_eq!(capabilities["load"]["stored_meshes"], 0);
    let paths: Vec<&str> = capabilities["paths"].as_array().unwrap().iter().map(|p| p.as_str().unwrap()).collect();
    for path in
        ["/v1/meshes", "/v1/meshes/{sha256}", "/v1/meshes/{sha256}/render.{png|webp|jpg}", "/v1/render", "/v1/jobs"]
    {
        assert!(paths.contains(&path), "{path}: {paths:?}");
    }
}

#[test]
fn a_key_sees_its_own_meshes_and_jobs() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one,two");
    let server = Server::start_with(&mut command);
    let [one, two] = ["one", "two"].map(|key| format!("Authorization: Bearer {key}"));
    let mesh = server.request("POST", "/v1/meshes", &[&one], CUBE_OBJ).header("location").unwrap().to_owned();
    for (method, path) in [("GET", mesh.clone()), ("DELETE", mesh.clone()), ("GET", format!("{mesh}/render.png"))] {
        server.request(method, &path, &[&two], b"").problem(404, "mesh_unknown");
    }
    assert_eq!(server.request("POST", "/v1/meshes", &[&two], CUBE_OBJ).status, 201, "new to this key");
    assert_eq!(server.request("POST", "/v1/meshes", &[&two], CUBE_OBJ).status, 200, "known");
    assert_eq!(server.request("GET", &format!("{mesh}/render.png?size=16"), &[&two], b"").status, 200);
    let job = server.request("POST", "/v1/jobs?size=16", &[&one], CUBE_OBJ).header("location").unwrap().to_owned();
    for (method, path) in [("GET", job.clone()), ("DELETE", job.clone()), ("GET", format!("{job}/result"))] {
        server.request(method, &path, &[&two], b"").problem(404, "not_found");
    }
    assert_eq!(server.request("GET", &job, &[&one, "Prefer: wait=30"], b"").json()["state"], "done");
    assert_eq!(server.request("DELETE", &mesh, &[&one], b"").status, 204);
    server.request("GET", &mesh, &[&one], b"").problem(404, "mesh_unknown");
    assert_eq!(server.request("DELETE", &mesh, &[&two], b"").status, 204, "the other's is still there");
}
