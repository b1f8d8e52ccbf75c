//! Several servers with one shared store: what one stores, each of them finds, draws and deletes.

pub mod bucket;

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use self::bucket::Bucket;
use crate::http::jobs::durable::end_of;
use crate::http::meshes::{form_of, head, url};
use crate::support::files::mesh::Solid;
use crate::support::server::{CUBE_OBJ, PATIENCE, Server, meshsnap};
use meshsnap_server::digest::Digest;

/// The time for which a server trusts what it has last seen in the store, and a little more.
const TRUST: Duration = Duration::from_millis(5500);

fn command(store: &str, more: &[&str]) -> Command {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--store", store]).args(more);
    command
}

fn at_bucket(bucket: &Bucket, more: &[&str]) -> Command {
    let mut command = command(&Bucket::address(), more);
    bucket.introduce(&mut command);
    command
}

pub fn of_folder(folder: &Path) -> String {
    format!("file://{}", folder.display())
}

/// Waits until something is true.
pub fn wait(what: &str, mut is_true: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is_true() {
        assert!(began.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The life of a mesh at three servers. `pictures` is the number of pictures in the store.
fn story(start: impl Fn() -> Server, pictures: impl Fn() -> usize) {
    let [a, b] = [start(), start()];
    let (mesh, picture) = (url(CUBE_OBJ), format!("{}/render.png?style=wire&size=64", url(CUBE_OBJ)));
    assert_eq!(head(&b, &mesh, &[]).status, 404);
    let put = a.request("PUT", &mesh, &[&format!("Content-Length: {}", CUBE_OBJ.len())], CUBE_OBJ);
    assert_eq!(put.status, 201, "{}", String::from_utf8_lossy(&put.body));
    let reports = [&a, &b].map(|server| server.get(&mesh));
    assert_eq!((reports[0].status, reports[1].status), (200, 200));
    assert!(reports[0].body == reports[1].body && reports[0].header("etag") == reports[1].header("etag"));
    assert_eq!(b.post("/v1/meshes", CUBE_OBJ).status, 200, "it has it already");

    // What one has drawn, the others need not draw.
    let drawn = a.get(&picture);
    assert_eq!((drawn.status, drawn.header("x-cache")), (200, Some("miss")));
    wait("the picture is stored", || pictures() == 1);
    let c = start();
    for server in [&b, &c] {
        let found = server.get(&picture);
        assert_eq!((found.status, found.header("x-cache")), (200, Some("shared")));
        assert!(found.body == drawn.body && found.header("etag") == drawn.header("etag"));
        assert_eq!((found.header("age"), found.header("server-timing")), (Some("0"), None));
        assert_eq!(server.get(&picture).header("x-cache"), Some("hit"));
    }
    let document = format!(
        "{{\"mesh\": \"{}\", \"style\": \"wire\", \"image\": {{\"width\": 64, \"height\": 64, \"format\": \"png\"}}}}",
        Digest::of(CUBE_OBJ)
    );
    let json = ["Content-Type: application/json"];
    let posted = start().request("POST", "/v1/render", &json, document.as_bytes());
    assert_eq!((posted.status, posted.header("x-cache")), (200, Some("shared")), "the same picture by a document");
    assert!(posted.body == drawn.body);
    let job = start().request("POST", "/v1/jobs", &json, document.as_bytes());
    assert_eq!(job.status, 202, "{}", String::from_utf8_lossy(&job.body));

    // A form of two files, found by a server that has never seen it, and compared.
    let (obj, mtl) = ("mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "newmtl red\nKd 1 0 0\n");
    let form = form_of(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())]);
    let sent = a.request("POST", "/v1/meshes", &["Content-Type: multipart/form-data; boundary=XX"], &form);
    assert_eq!(sent.status, 201, "{}", String::from_utf8_lossy(&sent.body));
    let form_url = sent.header("location").unwrap().to_owned();
    let red = |server: &Server| server.get(&format!("{form_url}/render.png?style=flat&size=32"));
    let [of_a, of_b] = [red(&a), red(&b)];
    assert!(of_a.status == 200 && of_a.body == of_b.body);
    let sides = format!("{{\"a\": \"{}\", \"b\": \"{}\"}}", Digest::of(CUBE_OBJ), &form_url["/v1/meshes/".len()..]);
    let difference = c.request("POST", "/v1/diff", &json, sides.as_bytes());
    assert_eq!(difference.status, 200, "{}", String::from_utf8_lossy(&difference.body));

    // Deleted at one, it is gone at all: at once where it was not at hand, within seconds elsewhere.
    assert_eq!(b.request("DELETE", &mesh, &[], b"").status, 204);
    b.get(&mesh).problem(404, "mesh_unknown");
    start().get(&picture).problem(404, "mesh_unknown");
    wait("it is gone where it was stored", || a.get(&mesh).status == 404);
    a.get(&picture).problem(404, "mesh_unknown");
    a.request("DELETE", &mesh, &[], b"").problem(404, "mesh_unknown");
    assert_eq!(a.get(&form_url).status, 200, "the other one stays");
    assert_eq!(a.post("/v1/meshes", CUBE_OBJ).status, 201, "and new again");
}

#[test]
fn what_one_server_stores_all_find_in_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = || count_files(&folder.path().join("pictures").join(Digest::of(CUBE_OBJ).to_string()));
    story(|| Server::start_with(&mut command(&of_folder(folder.path()), &[])), pictures);
}

#[test]
fn what_one_server_stores_all_find_in_a_bucket() {
    let Some(bucket) = Bucket::start() else { return };
    let pictures = || bucket.names(&format!("team/a/pictures/{}", Digest::of(CUBE_OBJ))).len();
    story(|| Server::start_with(&mut at_bucket(&bucket, &[])), pictures);
    assert!(bucket.names("").iter().all(|name| name.starts_with("team/a/")), "{:?}", bucket.names(""));
}

pub fn count_files(folder: &Path) -> usize {
    // A file that is being written, or that a killed server has not written to its end, has a `#` in its name.
    let is_whole = |name: &std::ffi::OsStr| !name.to_string_lossy().contains('#');
    std::fs::read_dir(folder).map_or(0, |files| files.flatten().filter(|file| is_whole(&file.file_name())).count())
}

#[test]
fn each_key_has_its_own_meshes_at_every_server() {
    let folder = tempfile::tempdir().unwrap();
    let start = || Server::start_with(command(&of_folder(folder.path()), &[]).env("MESHSNAP_API_KEYS", "one,two"));
    let [a, b] = [start(), start()];
    let mesh = url(CUBE_OBJ);
    let ask = |server: &Server, key: &str, method: &str, path: &str, body: &[u8]| {
        server.request(method, path, &[&format!("Authorization: Bearer {key}")], body)
    };
    assert_eq!(ask(&a, "one", "POST", "/v1/meshes", CUBE_OBJ).status, 201);
    assert_eq!(ask(&b, "one", "GET", &mesh, b"").status, 200);
    for server in [&a, &b] {
        ask(server, "two", "GET", &mesh, b"").problem(404, "mesh_unknown");
        ask(server, "two", "DELETE", &mesh, b"").problem(404, "mesh_unknown");
    }
    assert_eq!(ask(&b, "two", "POST", "/v1/meshes", CUBE_OBJ).status, 201);
    assert_eq!(ask(&a, "two", "GET", &mesh, b"").status, 200);
    assert_eq!(ask(&a, "one", "DELETE", &mesh, b"").status, 204);
    ask(&a, "one", "GET", &mesh, b"").problem(404, "mesh_unknown");
    wait("it is gone at the other server", || ask(&b, "one", "GET", &mesh, b"").status == 404);
    std::thread::sleep(TRUST);
    for server in [&a, &b] {
        assert_eq!(ask(server, "two", "GET", &mesh, b"").status, 200, "the other key keeps it");
    }
}

#[test]
fn without_the_store_what_is_at_hand_is_drawn_and_nothing_is_accepted() {
    let Some(bucket) = Bucket::start() else { return };
    let server = Server::start_with(&mut at_bucket(&bucket, &[]));
    let (mesh, picture) = (url(CUBE_OBJ), format!("{}/render.png?size=32", url(CUBE_OBJ)));
    let other = Solid::cuboid().obj();
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    bucket.cut();
    // At once, before the server has noticed.
    let refused = server.post("/v1/meshes", other.as_bytes());
    refused.problem(503, "store_unavailable");
    assert_eq!(refused.header("retry-after"), Some("5"));
    server.get(&url(other.as_bytes())).problem(503, "store_unavailable");
    wait("it says that it is not ready", || server.get("/readyz").status == 503);
    std::thread::sleep(TRUST);
    assert_eq!(server.get(&picture).status, 200);
    assert_eq!(server.get(&mesh).status, 200);
    assert_eq!(server.post("/v1/render?size=16", CUBE_OBJ).status, 200, "an upload needs no store");
    server.post("/v1/meshes", other.as_bytes()).problem(503, "store_unavailable");
    server.get(&url(other.as_bytes())).problem(503, "store_unavailable");
    server.request("DELETE", &mesh, &[], b"").problem(503, "store_unavailable");
    assert_eq!(server.get("/healthz").status, 200);
    bucket.mend();
    wait("it is ready again", || server.get("/readyz").status == 200);
    assert_eq!(server.post("/v1/meshes", other.as_bytes()).status, 201);
    server.get(&format!("{}0", &mesh[..mesh.len() - 1])).problem(404, "mesh_unknown");
}

/// A folder that is not there any more, as one that was unmounted, is not made anew on this machine alone.
#[test]
fn nothing_is_written_where_a_folder_was() {
    let parent = tempfile::tempdir().unwrap();
    let [folder, away] = ["store", "away"].map(|name| parent.path().join(name));
    std::fs::create_dir(&folder).unwrap();
    let server = Server::start_with(&mut command(&of_folder(&folder), &[]));
    std::fs::rename(&folder, &away).unwrap();
    server.post("/v1/meshes", CUBE_OBJ).problem(503, "store_unavailable");
    assert!(!folder.exists());
    std::fs::rename(&away, &folder).unwrap();
    wait("it is back", || server.get("/readyz").status == 200);
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
}

/// Answers of the store that come late, and three connections that break: nothing fails, because an operation is tried four
/// times.
#[test]
fn a_slow_store_that_breaks_connections_loses_nothing() {
    let Some(bucket) = Bucket::start() else { return };
    bucket.hamper(Duration::from_millis(100), 3);
    let servers = [(); 3].map(|()| Server::start_with(&mut at_bucket(&bucket, &["--workers", "1"])));
    let meshes: Vec<String> = (0..12).map(|i| format!("{}v {i} 0 0\n", String::from_utf8_lossy(CUBE_OBJ))).collect();
    std::thread::scope(|scope| {
        for (i, mesh) in meshes.iter().enumerate() {
            let servers = &servers;
            scope.spawn(move || {
                assert_eq!(servers[i % 3].post("/v1/meshes", mesh.as_bytes()).status, 201);
                let path = format!("{}/render.png?size=24", url(mesh.as_bytes()));
                let pictures = [1, 2].map(|k| servers[(i + k) % 3].get(&path));
                assert!(pictures.iter().all(|picture| picture.status == 200) && pictures[0].body == pictures[1].body);
            });
        }
    });
    assert_eq!(bucket.names("team/a/meshes").len(), 12);
}

/// A store that takes requests and never answers: a server says so within seconds, and ends when it is told to.
#[test]
fn a_store_that_says_nothing_holds_nobody_up() {
    let Some(bucket) = Bucket::start() else { return };
    let mut server = Server::start_with(&mut at_bucket(&bucket, &[]));
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    bucket.mute();
    wait("it says that it is not ready", || server.get("/readyz").status == 503);
    std::thread::sleep(TRUST);
    assert_eq!(server.get(&format!("{}/render.png?size=32", url(CUBE_OBJ))).status, 200);
    server.post("/v1/meshes", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").problem(503, "store_unavailable");
    server.terminate();
    assert!(server.wait().success());
}

/// What another server deletes a moment before, and what is damaged, is stored anew by the next upload.
#[test]
fn an_upload_is_in_the_store_whatever_was_there() {
    let Some(bucket) = Bucket::start() else { return };
    let [a, b] = [(); 2].map(|()| Server::start_with(&mut at_bucket(&bucket, &[])));
    let mesh = url(CUBE_OBJ);
    assert_eq!(a.post("/v1/meshes", CUBE_OBJ).status, 201);
    assert_eq!(b.request("DELETE", &mesh, &[], b"").status, 204);
    assert_eq!(a.post("/v1/meshes", CUBE_OBJ).status, 201, "it is new, though this server has just seen it");
    assert_eq!(b.get(&mesh).status, 200);
    assert_eq!((bucket.damage("team/a/meshes"), bucket.names("team/a/meshsnap").len()), (1, 1));
    let c = Server::start_with(&mut at_bucket(&bucket, &[]));
    c.get(&mesh).problem(404, "mesh_unknown");
    assert_eq!(c.post("/v1/meshes", CUBE_OBJ).status, 200);
    let d = Server::start_with(&mut at_bucket(&bucket, &[]));
    assert_eq!(d.get(&mesh).status, 200, "it is whole again");
}

#[test]
fn stores_that_cannot_be_used_are_said_at_the_start() {
    let usage = |command: &mut Command, parts: &[&str]| {
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{text}");
        let last = text.lines().last().unwrap_or_default();
        assert!(parts.iter().all(|part| last.contains(part)), "{text}");
    };
    for address in ["models", "s3://", "http://localhost/models", "file://models", "s3://a b/c"] {
        usage(&mut command(address, &[]), &["--store", address, "s3://BUCKET/PREFIX"]);
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    usage(&mut command(&of_folder(file.path()), &[]), &["--store", "cannot be used"]);
    usage(&mut command("file:///nonexistent/x", &[]), &["--store", "/nonexistent/x", "cannot be used"]);
    for endpoint in ["127.0.0.1:9000", "localhost:9000", "http://bad host", "ftp://127.0.0.1", "http://"] {
        let mut wrong = command("s3://models/x", &[]);
        usage(wrong.env("AWS_ENDPOINT_URL", endpoint), &["AWS_ENDPOINT_URL", endpoint, "http://"]);
    }
    let Some(bucket) = Bucket::start() else { return };
    let mut missing = command("s3://others/x", &[]);
    bucket.introduce(&mut missing);
    usage(&mut missing, &["no shared store at s3://others/x", "NoSuchBucket"]);
    let Some(locked) = Bucket::start_locked() else { return };
    usage(&mut at_bucket(&locked, &[]), &["refuses the credentials", "s3://models/team/a"]);
}

#[test]
fn a_server_waits_for_its_store() {
    let Some(bucket) = Bucket::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    bucket.cut();
    let log = folder.path().join("log");
    let mut waiting = at_bucket(&bucket, &[]);
    let mut child = waiting.stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap();
    wait("it says what it waits for", || {
        std::fs::read_to_string(&log).is_ok_and(|text| text.contains("waiting for the shared store"))
    });
    Command::new("sh").arg("-c").arg(format!("kill -TERM {}", child.id())).status().unwrap();
    assert!(child.wait().unwrap().success(), "a signal ends it meanwhile");
    let server = std::thread::scope(|scope| {
        let starting = scope.spawn(|| Server::start_with(&mut at_bucket(&bucket, &[])));
        std::thread::sleep(Duration::from_millis(500));
        bucket.mend();
        starting.join().unwrap()
    });
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
}

/// A server that was alone, with meshes and a job in its data folder, becomes one of several.
#[test]
fn meshes_of_a_data_folder_are_handed_over() {
    let [data, shared] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let mesh = url(CUBE_OBJ);
    let with_data = |store: Option<&str>| {
        let mut command = meshsnap();
        command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--ephemeral=false", "--data-dir"]);
        command.arg(data.path());
        store.into_iter().for_each(|store| _ = command.args(["--store", store]));
        Server::start_with(&mut command)
    };
    let mut alone = with_data(None);
    assert_eq!(alone.post("/v1/meshes", CUBE_OBJ).status, 201);
    let job = alone.post("/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned();
    assert_eq!(end_of(&alone, &job)["state"], "done");
    // Larger than what the log itself keeps.
    let large = format!("{}{}", String::from_utf8_lossy(CUBE_OBJ), "# a comment\n".repeat(10_000));
    assert_eq!(alone.post("/v1/meshes", large.as_bytes()).status, 201);
    alone.terminate();
    assert!(alone.wait().success());
    let store = of_folder(shared.path());
    // A hand-over that fails leaves everything where it was: here a file is in the way.
    std::fs::write(shared.path().join("meshes"), "").unwrap();
    let mut failing = command(&store, &["--ephemeral=false", "--data-dir", data.path().to_str().unwrap()]);
    let output = failing.output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::remove_file(shared.path().join("meshes")).unwrap();
    let mut first = with_data(Some(&store));
    let second = Server::start_with(&mut command(&store, &[]));
    for server in [&first, &second] {
        for mesh in [&mesh, &url(large.as_bytes())] {
            assert_eq!(server.get(&format!("{mesh}/render.png?size=32")).status, 200);
        }
    }
    assert_eq!(first.get(&format!("{job}/result")).status, 200, "its jobs stay its own");
    // What is deleted stays deleted: the data folder does not have it any more.
    assert_eq!(second.request("DELETE", &mesh, &[], b"").status, 204);
    first.terminate();
    assert!(first.wait().success());
    let again = with_data(Some(&store));
    again.get(&mesh).problem(404, "mesh_unknown");
}
