//! Tools that read `/openapi.json`: a validator, a generator of clients, and a tester that makes requests from it.
//! They are Python, and `tests/run` installs them into `target/python`.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use crate::support::skip::{Need, skip};

/// A program of `target/python`. None, and the test counts as skipped, where it is missing.
#[track_caller]
fn tool(name: &str) -> Option<Command> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin").join(name);
    if !path.is_file() {
        skip(Need::Python, &path.display().to_string());
        return None;
    }
    let mut command = Command::new(path);
    command.env("PYTHONDONTWRITEBYTECODE", "1");
    Some(command)
}

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python")
}

/// Runs a command and returns what it prints.
#[track_caller]
fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let printed = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{command:?}: {}\n{printed}", output.status);
    printed
}

/// The served document, as a file.
fn stored_document(server: &Server, folder: &Path) -> PathBuf {
    let path = folder.join("openapi.json");
    std::fs::write(&path, server.get("/openapi.json").body).unwrap();
    path
}

#[test]
fn the_served_document_is_valid() {
    let Some(mut validator) = tool("openapi-spec-validator") else { return };
    let (server, folder) = (Server::start(&[]), tempfile::tempdir().unwrap());
    let document = stored_document(&server, folder.path());
    assert!(run(validator.arg(&document)).contains("OK"));
    // The validator sees faults.
    let text = std::fs::read_to_string(&document).unwrap();
    std::fs::write(&document, text.replace("\"operationId\": \"getJob\"", "\"operationId\": 7")).unwrap();
    assert!(!tool("openapi-spec-validator").unwrap().arg(&document).output().unwrap().status.success());
}

#[test]
fn a_generated_client_draws() {
    let (Some(mut generator), Some(mut python)) = (tool("openapi-python-client"), tool("python")) else { return };
    let (server, folder) = (Server::start(&[]), tempfile::tempdir().unwrap());
    let (document, client) = (stored_document(&server, folder.path()), folder.path().join("client"));
    generator.arg("generate").arg("--path").arg(&document).arg("--config").arg(scripts().join("client.yml"));
    // A part that it does not understand would be a warning, and be missing.
    run(generator.arg("--output-path").arg(&client).arg("--fail-on-warning"));
    let mesh = folder.path().join("cube.obj");
    std::fs::write(&mesh, CUBE_OBJ).unwrap();
    python.arg(scripts().join("draw.py")).arg(&client).arg(format!("http://{}", server.address));
    assert_eq!(run(python.arg(&mesh).arg(folder.path())).trim(), "5 answers");
    let mut pictures = 0;
    for name in ["body.png", "stored.png", "thumbnail.webp", "job.png"] {
        let picture = image::load_from_memory(&std::fs::read(folder.path().join(name)).unwrap()).unwrap().to_rgba8();
        assert_eq!(picture.dimensions(), (48, 48), "{name}");
        assert!(picture.pixels().any(|pixel| pixel != picture.get_pixel(0, 0)), "{name} is blank");
        pictures += 1;
    }
    assert_eq!(pictures, 4);
}

/// The number of pairs of a path and a method in a document, without that of the document itself, which schemathesis
/// leaves out.
fn operations(document: &serde_json::Value) -> usize {
    let methods = ["get", "head", "post", "put", "delete", "patch", "options"];
    let paths = document["paths"].as_object().unwrap().iter().filter(|(path, _)| *path != "/openapi.json");
    paths.map(|(_, path)| methods.iter().filter(|method| path.get(**method).is_some()).count()).sum()
}

/// The address of a receiver of webhooks, and how many it has heard.
fn receiver() -> (String, Arc<AtomicU32>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/", listener.local_addr().unwrap());
    let heard = Arc::new(AtomicU32::new(0));
    let count = heard.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            // The signature is tried in `jobs::webhooks`.
            let _ = stream.read(&mut [0; 4096]);
            let _ = stream.write_all(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n");
            count.fetch_add(1, Ordering::Relaxed);
        }
    });
    (address, heard)
}

/// All checks of schemathesis, on requests that keep the document and on such that break it. What a schema cannot
/// express is listed by name in `tests/python/hooks.py`.
#[test]
fn schemathesis_finds_nothing() {
    let Some(mut tester) = tool("schemathesis") else { return };
    let folder = tempfile::tempdir().unwrap();
    // Small pictures: this is about requests.
    let (receiver, heard) = receiver();
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--limit-image-px", "64"]);
    command.arg("--webhooks-to-private").env("MESHSNAP_WEBHOOK_SECRET", format!("whsec_{}", "A".repeat(32)));
    let server = Server::start_with(&mut command);
    tester.env("WEBHOOK_RECEIVER", receiver);
    tester.current_dir(folder.path()).env("PYTHONPATH", scripts()).env("SCHEMATHESIS_HOOKS", "hooks");
    tester.arg("run").arg(format!("http://{}/openapi.json", server.address));
    let printed =
        run(tester.args(["--checks", "all", "--mode", "all", "--seed", "1", "--max-examples", "10", "--no-color"]));
    let summary = printed.lines().rev().find(|line| line.contains("generated")).expect(&printed).trim();
    println!("{summary}");
    let cases: u32 = summary.split(' ').next().unwrap().parse().unwrap();
    assert!(cases > 3_000, "{summary}");
    let heard = heard.load(Ordering::Relaxed);
    println!("{heard} webhooks");
    // Few requests name an address and are of an accepted job.
    assert!(heard >= 1, "{heard} webhooks");
    let tested = printed.lines().find_map(|line| line.trim().strip_prefix("Tested: ")).expect(&printed);
    assert_eq!(tested.parse(), Ok(operations(&server.get("/openapi.json").json())), "every operation");
}
