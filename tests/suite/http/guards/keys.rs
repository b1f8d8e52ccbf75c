//! API keys in a file: scopes, owners, SIGHUP, and attempts to get in without a key.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use sha2::{Digest as _, Sha256};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server, meshsnap};

fn sha256(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A file with these names, keys and scopes.
fn write(path: &Path, keys: &[(&str, &str, &str)]) {
    let tables = keys.iter().map(|(name, key, scopes)| {
        format!("[[keys]]\nname = \"{name}\"\nsha256 = \"{}\"\nscopes = [{scopes}]\n", sha256(key))
    });
    std::fs::write(path, tables.collect::<String>()).unwrap();
}

const KEYS: &[(&str, &str, &str)] = &[
    ("ci", "key-of-ci", "\"render\", \"store\""),
    ("other", "key-of-other", "\"render\", \"store\""),
    ("viewer", "key-of-viewer", "\"render\""),
    ("uploader", "key-of-uploader", "\"store\""),
    ("prometheus", "key-of-prometheus", "\"metrics\""),
    ("boss", "key-of-boss", "\"admin\""),
];

fn start(file: &Path, arguments: &[&str]) -> Server {
    Server::start(&[&["--api-keys-file", file.to_str().unwrap()], arguments].concat())
}

fn by(key: &str) -> String {
    format!("Authorization: Bearer key-of-{key}")
}

fn ask(server: &Server, key: &str, method: &str, path: &str, body: &[u8]) -> Answer {
    server.request(method, path, &[&by(key)], body)
}

/// A server, and what the key `ci` has on it: a stored mesh and a job with its result.
fn furnished(file: &Path) -> (Server, String, String) {
    write(file, KEYS);
    let server = start(file, &[]);
    let mesh = ask(&server, "ci", "POST", "/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
    let job = ask(&server, "ci", "POST", "/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned();
    server.request("GET", &job, &[&by("ci"), "Prefer: wait=30"], b"");
    (server, mesh, job)
}

/// Method, path and body of everything that shows or changes what a key has.
fn requests(mesh: &str, job: &str) -> Vec<(&'static str, String, Vec<u8>)> {
    let named = format!("{{\"mesh\":\"{}\",\"size\":16}}", mesh.rsplit('/').next().unwrap()).into_bytes();
    vec![
        ("POST", "/v1/render?size=16".to_owned(), CUBE_OBJ.to_vec()),
        ("POST", "/v1/render".to_owned(), named.clone()),
        ("POST", "/v1/jobs".to_owned(), named),
        ("POST", "/v1/meshes".to_owned(), CUBE_OBJ.to_vec()),
        ("GET", job.to_owned(), Vec::new()),
        ("GET", format!("{job}/result"), Vec::new()),
        ("GET", format!("{job}/events"), Vec::new()),
        ("DELETE", job.to_owned(), Vec::new()),
        ("GET", mesh.to_owned(), Vec::new()),
        ("HEAD", mesh.to_owned(), Vec::new()),
        ("GET", format!("{mesh}/render.png?size=16"), Vec::new()),
        ("HEAD", format!("{mesh}/render.png?size=16"), Vec::new()),
        ("PUT", mesh.to_owned(), CUBE_OBJ.to_vec()),
        ("DELETE", mesh.to_owned(), Vec::new()),
        ("GET", "/metrics".to_owned(), Vec::new()),
        ("GET", "/v1/status".to_owned(), Vec::new()),
        ("GET", "/v1/capabilities".to_owned(), Vec::new()),
    ]
}

/// An answer that gives nothing away.
#[track_caller]
fn is_refusal(answer: &Answer, allowed: &[u16], what: &str) {
    assert!(allowed.contains(&answer.status), "{what}: {}", answer.status);
    assert_ne!(answer.header("content-type").map(|kind| &kind[..6]), Some("image/"), "{what}");
    assert!(image::guess_format(&answer.body).is_err(), "{what}");
}

#[test]
fn nobody_gets_in_without_a_key() {
    let folder = tempfile::tempdir().unwrap();
    let (server, mesh, job) = furnished(&folder.path().join("keys.toml"));
    let digest = format!("Authorization: Bearer {}", sha256("key-of-ci"));
    let credentials: [&[&str]; 16] = [
        &[],
        &["Authorization: Bearer key-of-nobody"],
        &["Authorization: Bearer key-of-c"],
        &["Authorization: Bearer key-of-ci2"],
        &["Authorization: Bearer KEY-OF-CI"],
        &["Authorization: Bearer"],
        &["Authorization: Bearer "],
        &["Authorization: Basic key-of-ci"],
        &["Authorization: Basic a2V5LW9mLWNpOg=="],
        &["Authorization: key-of-ci"],
        &["Authorization: Bearer ci"],
        &["Authorization: Bearer key-of-ci key-of-other"],
        &["Authorization: Bearer key-of-nobody", "Authorization: Bearer key-of-ci"],
        &["X-Api-Key: key-of-ci", "Cookie: key=key-of-ci"],
        &["Proxy-Authorization: Bearer key-of-ci", "X-Forwarded-For: 127.0.0.1"],
        // The file has it, and it opens nothing.
        &[&digest],
    ];
    let mut attempts = 0;
    for headers in credentials {
        for (method, path, body) in requests(&mesh, &job) {
            let answer = server.request(method, &path, headers, &body);
            is_refusal(&answer, &[401], &format!("{method} {path} {headers:?}"));
            assert_eq!(answer.header("www-authenticate"), Some("Bearer"));
            attempts += 1;
        }
    }
    let picture = format!("{mesh}/render.png");
    let paths = [
        format!("{picture}?key=key-of-ci"),
        format!("{picture}?access_token=key-of-ci"),
        format!("/{picture}"),
        format!("{picture}/"),
        format!("{mesh}/x/../render.png"),
        format!("/healthz/..{picture}"),
        format!("/%76{}", &picture[2..]),
        picture.to_uppercase(),
        format!("{picture};a=b"),
        format!("{job}/result/"),
        format!("{job}%2fresult"),
        "//metrics".to_owned(),
    ];
    for path in &paths {
        is_refusal(&server.get(path), &[400, 401, 404], path);
        attempts += 1;
    }
    assert!(attempts > 250, "{attempts}");
    // Nothing has changed by that, and who has the key gets it all.
    assert_eq!(ask(&server, "ci", "HEAD", &mesh, b"").status, 200);
    ask(&server, "ci", "GET", &format!("{job}/result"), b"").picture(16, 16);
    ask(&server, "ci", "GET", &format!("{picture}?size=16"), b"").picture(16, 16);
}

#[test]
fn a_signature_opens_one_picture_of_its_key_until_it_expires() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.toml");
    let (server, mesh, job) = furnished(&file);
    let sign = |key: &str, url: &str, expires: &str| {
        let mut command = meshsnap();
        let output = command.args(["sign", url, "--expires", expires]).env("MESHSNAP_API_KEYS", key).output().unwrap();
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    let plain = format!("{mesh}/render.png?size=16");
    let signed = sign("key-of-ci", &plain, "1h");
    server.get(&signed).picture(16, 16);
    let (text, signature) = signed.rsplit_once("&sig=").unwrap();
    let forged = [
        format!("{text}&sig={}", "0".repeat(64)),
        format!("{text}&sig="),
        format!("{text}&sig={}", &signature[..62]),
        format!("{text}&sig={signature}00"),
        signed.replace("size=16", "size=17"),
        signed.replace("render.png", "render.webp"),
        signed.replace("exp=", "exp=9"),
        sign("key-of-ci", &plain, "0s"),
        sign("key-of-nobody", &plain, "1h"),
        sign(&sha256("key-of-ci"), &plain, "1h"),
    ];
    for url in &forged {
        is_refusal(&server.get(url), &[401, 403], url);
    }
    // The key must see the mesh, and draw.
    is_refusal(&server.get(&sign("key-of-other", &plain, "1h")), &[404], "another's mesh");
    is_refusal(&server.get(&sign("key-of-uploader", &plain, "1h")), &[401], "a key that draws nothing");
    is_refusal(&server.get(&sign("key-of-prometheus", &plain, "1h")), &[401], "a key that draws nothing");
    let exp = &text[text.find("exp=").unwrap()..];
    for path in [job.clone(), format!("{job}/result"), mesh.clone(), "/metrics".to_owned()] {
        is_refusal(&server.get(&format!("{path}?{exp}&sig={signature}")), &[401], &path);
    }
    is_refusal(&server.request("DELETE", &signed, &[], b""), &[401, 405], "only seen");
}

#[test]
fn a_key_does_what_its_scopes_permit_and_sees_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let (server, mesh, job) = furnished(&folder.path().join("keys.toml"));
    let forbidden = |key: &str| -> Vec<String> {
        let mut forbidden = Vec::new();
        for (method, path, body) in requests(&mesh, &job) {
            // What is stored or deleted would change what the next one finds.
            if matches!((method, key), ("PUT", "boss" | "other") | ("DELETE", "boss"))
                || path == "/v1/meshes" && key == "other"
            {
                continue;
            }
            let answer = server.request(method, &path, &[&by(key), "Content-Type: application/json"], &body);
            if answer.status == 403 {
                if method != "HEAD" {
                    let detail = answer.problem(403, "scope_missing");
                    assert!(detail.contains(key), "{detail}");
                }
                forbidden.push(format!("{method} {}", path.split('?').next().unwrap()));
            } else if !["GET /metrics", "GET /v1/capabilities", "POST /v1/render?size=16"]
                .contains(&format!("{method} {path}").as_str())
                && !["boss", "uploader"].contains(&key)
            {
                is_refusal(&answer, &[404], &format!("{key}: {method} {path}"));
            }
        }
        forbidden
    };
    let operating = ["GET /metrics", "GET /v1/status"].map(str::to_owned);
    assert_eq!(forbidden("other"), operating);
    let storing = ["POST /v1/meshes".to_owned(), format!("PUT {mesh}"), format!("DELETE {mesh}")];
    assert_eq!(forbidden("viewer"), [&storing[..], &operating].concat());
    assert_eq!(forbidden("prometheus").len(), requests(&mesh, &job).len() - 2, "metrics and capabilities remain");
    assert_eq!(forbidden("boss"), [""; 0]);
    let uploader = forbidden("uploader");
    assert!(
        uploader.contains(&format!("GET {job}/result")) && !uploader.contains(&format!("HEAD {mesh}")),
        "{uploader:?}"
    );
    assert_eq!(uploader.len(), 11, "{uploader:?}");
    // What the uploader has stored and deleted under the same name is still there for its first owner.
    assert_eq!(ask(&server, "ci", "HEAD", &mesh, b"").status, 200);
    assert_eq!(ask(&server, "boss", "DELETE", &mesh, b"").status, 204);
    ask(&server, "ci", "GET", &mesh, b"").problem(404, "mesh_unknown");
    assert_eq!(ask(&server, "boss", "DELETE", &job, b"").status, 200);
    ask(&server, "ci", "GET", &job, b"").problem(404, "not_found");
}

#[test]
fn a_mesh_of_two_keys_goes_with_the_second_also_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.toml");
    write(&file, KEYS);
    let data = folder.path().join("data");
    let run = || {
        let mut command = meshsnap();
        command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir", data.to_str().unwrap()]);
        command.args(["--api-keys-file", file.to_str().unwrap()]).env_remove("MESHSNAP_EPHEMERAL");
        Server::start_with(&mut command)
    };
    let mesh;
    {
        let server = run();
        let stored = ask(&server, "ci", "POST", "/v1/meshes?format_in=obj", CUBE_OBJ);
        mesh = stored.header("location").unwrap().to_owned();
        assert_eq!(ask(&server, "other", "POST", "/v1/meshes", CUBE_OBJ).status, 201, "it is new to this key");
        assert_eq!(ask(&server, "uploader", "POST", "/v1/meshes", CUBE_OBJ).status, 201);
        assert_eq!(ask(&server, "other", "POST", "/v1/meshes", CUBE_OBJ).status, 200);
        assert_eq!(ask(&server, "uploader", "DELETE", &mesh, b"").status, 204);
        // A commit that is waited for comes after those that are not.
        ask(&server, "ci", "POST", "/v1/jobs?size=16", CUBE_OBJ);
        server.kill_9();
    }
    {
        let server = run();
        for (key, status) in [("ci", 200), ("other", 200), ("uploader", 404), ("viewer", 404), ("boss", 200)] {
            assert_eq!(ask(&server, key, "HEAD", &mesh, b"").status, status, "{key}");
        }
        assert_eq!(ask(&server, "ci", "DELETE", &mesh, b"").status, 204);
        ask(&server, "ci", "DELETE", &mesh, b"").problem(404, "mesh_unknown");
        ask(&server, "other", "POST", "/v1/jobs?size=16", CUBE_OBJ);
        server.kill_9();
    }
    let server = run();
    assert_eq!(ask(&server, "ci", "HEAD", &mesh, b"").status, 404);
    ask(&server, "other", "GET", &format!("{mesh}/render.png?size=16"), b"").picture(16, 16);
    assert_eq!(ask(&server, "other", "DELETE", &mesh, b"").status, 204);
    assert_eq!(ask(&server, "boss", "HEAD", &mesh, b"").status, 404);
}

#[test]
fn a_hang_up_reads_the_file_again_and_a_broken_one_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (file, log) = (folder.path().join("keys.toml"), folder.path().join("log"));
    write(&file, KEYS);
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--log-format", "json"]);
    command.args(["--api-keys-file", file.to_str().unwrap()]);
    let server = Server::start_logging(&mut command, &log);
    let hang_up = || {
        let status = Command::new("sh").arg("-c").arg(format!("kill -HUP {}", server.pid())).status().unwrap();
        assert!(status.success());
    };
    let wait_for_log = |text: &str| {
        let began = Instant::now();
        while !std::fs::read_to_string(&log).unwrap().contains(text) {
            assert!(began.elapsed() < PATIENCE, "{text} is not in the log");
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let status = |key: &str| ask(&server, key, "GET", "/v1/capabilities", b"").status;
    assert_eq!((status("ci"), status("new")), (200, 401));
    let job = ask(&server, "ci", "POST", "/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned();

    std::fs::write(&file, "[[keys]]\nname = \"ci\"\nsha256 = \"key-of-ci\"\n").unwrap();
    hang_up();
    wait_for_log("the API keys stay as they are");
    assert!(!std::fs::read_to_string(&log).unwrap().contains("key-of-ci"), "a key by mistake is not in the log");
    assert_eq!((status("ci"), status("new")), (200, 401));

    // The key of `ci` is replaced. Its jobs stay its own.
    write(&file, &[("ci", "key-of-new", "\"render\"")]);
    hang_up();
    wait_for_log("the API keys are read again");
    assert_eq!((status("ci"), status("other"), status("new")), (401, 401, 200));
    let ended = server.request("GET", &job, &[&by("new"), "Prefer: wait=30"], b"");
    assert_eq!(ended.json()["state"], "done");
}

#[test]
fn a_file_that_is_none_does_not_open_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("keys.toml");
    let name = file.to_str().unwrap();
    let refused = |part: &str, variable: &str| {
        let mut command = meshsnap();
        let output = command.args(["serve", "--listen", "127.0.0.1:0"]).env("MESHSNAP_API_KEYS_FILE", variable);
        let output = output.output().unwrap();
        let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && sentence.contains(part), "{variable}: {sentence}");
    };
    refused("the path of a file", "");
    refused("cannot be read", name);
    for (text, part) in [("", "no key"), ("keys = 1", "line 1"), ("[[keys]]\nname = \"a\"", "sha256")] {
        std::fs::write(&file, text).unwrap();
        refused(part, name);
    }
    write(&file, KEYS);
    // With keys, other machines may ask.
    let mut command = meshsnap();
    command.args(["serve", "--listen", "0.0.0.0:0", "--backend", "cpu", "--api-keys-file", name]);
    let open = Server::start_with(&mut command);
    assert!(open.curl_line.contains("Bearer $KEY"), "{}", open.curl_line);
}
