//! Guards of the server: against pages of other sites, clients that hold what others need, forged
//! signatures and empty keys. Also SIGHUP, and failed jobs in the log.

mod cors;
mod hang_ups;
mod keys;
mod rates;
mod slow;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server, meshsnap};

#[test]
fn a_page_of_another_site_gets_nothing_from_a_server_on_loopback() {
    let server = Server::start(&[]);
    let foreign = |path: &str| {
        server.send(&format!("GET {path} HTTP/1.1\r\nHost: evil.example:8080\r\nConnection: close\r\n\r\n"), b"")
    };
    foreign("/v1/capabilities").problem(403, "foreign_host");
    foreign("/metrics").problem(403, "foreign_host");
    assert_eq!(foreign("/healthz").status, 200, "probes ask under any name");
    for header in ["Origin: https://evil.example", "Origin: null", "Sec-Fetch-Site: cross-site"] {
        let posted = server.request("POST", "/v1/render?size=16", &[header, "Content-Type: text/plain"], CUBE_OBJ);
        posted.problem(403, "cross_site");
    }
    for header in ["Origin: http://localhost:3000", "Origin: http://127.0.0.1:80", "Sec-Fetch-Site: same-origin"] {
        server.request("POST", "/v1/render?size=16", &[header], CUBE_OBJ).picture(16, 16);
    }
    // With keys, a page cannot do anything without one.
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one");
    let keyed = Server::start_with(&mut command);
    let head = "GET /v1/capabilities HTTP/1.1\r\nHost: meshes.example\r\nAuthorization: Bearer one\r\nConnection: close\r\n\r\n";
    assert_eq!(keyed.send(head, b"").status, 200);
}

#[test]
fn an_answer_says_when_it_depends_on_accept() {
    let server = Server::start(&[]);
    let post =
        |query: &str, accept: &str| server.request("POST", &format!("/v1/render?size=16{query}"), &[accept], CUBE_OBJ);
    let browser = "Accept: image/avif,image/webp,image/apng,image/svg+xml,image/*,*/*;q=0.8";
    let answer = post("", browser);
    assert_eq!((answer.header("content-type"), answer.header("vary")), (Some("image/webp"), Some("accept")));
    assert_eq!(post("&format=png", browser).header("vary"), None);
    let refused = post("", "Accept: text/html");
    refused.problem(406, "not_acceptable");
    assert_eq!(refused.header("vary"), Some("accept"));
}

#[test]
fn keys_that_are_none_do_not_open_the_server() {
    for keys in [" , ", ",", " ", ""] {
        let output =
            meshsnap().args(["serve", "--listen", "127.0.0.1:0"]).env("MESHSNAP_API_KEYS", keys).output().unwrap();
        let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && sentence.contains("at least one key"), "{keys:?}: {sentence}");
    }
}

#[test]
fn a_hang_up_does_not_end_the_server() {
    let server = Server::start(&[]);
    for _ in 0..3 {
        let status = Command::new("sh").arg("-c").arg(format!("kill -HUP {}", server.pid())).status().unwrap();
        assert!(status.success());
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(server.get("/healthz").status, 200);
    }
}

#[test]
fn a_failed_job_is_in_the_log_with_its_requests_id() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--log", "warning", "--log-format", "json"]);
    let server = Server::start_logging(&mut command, &log);
    let accepted = server.request("POST", "/v1/jobs", &["X-Request-Id: the-one"], b"no mesh");
    let job = accepted.json()["id"].as_str().unwrap().to_owned();
    server.request("GET", accepted.header("location").unwrap(), &["Prefer: wait=30"], b"");
    let began = Instant::now();
    loop {
        let text = std::fs::read_to_string(&log).unwrap();
        if let Some(line) = text.lines().find(|line| line.contains("a job failed")) {
            let line: serde_json::Value = serde_json::from_str(line).unwrap();
            assert_eq!(
                (line["request_id"].as_str(), line["job"].as_str()),
                (Some("the-one"), Some(job.as_str())),
                "{line}"
            );
            assert_eq!(line["level"], "WARN");
            assert!(!text.contains("\"INFO\""), "{text}");
            return;
        }
        assert!(began.elapsed() < PATIENCE, "not in the log: {text}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_stalled_upload_makes_room_for_others() {
    let server = Server::start(&["--uploads-bytes", "1MiB"]);
    let mut stalled = server.connect();
    let body = vec![b'#'; (1 << 20) - 1000];
    write!(stalled, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", body.len() + 10)
        .unwrap();
    stalled.write_all(&body).unwrap();
    let began = Instant::now();
    // It holds the memory once all of it has arrived.
    let held = format!("meshsnap_memory_bytes{{account=\"uploads\"}} {}", body.len());
    while !String::from_utf8_lossy(&server.get("/metrics").body).contains(&held) {
        assert!(began.elapsed() < PATIENCE, "the upload does not arrive");
        std::thread::sleep(Duration::from_millis(5));
    }
    let large = [CUBE_OBJ, &vec![b'#'; 100_000]].concat();
    let mut refused = 0;
    loop {
        let answer = server.post("/v1/render?size=16", &large);
        if answer.status == 200 && refused > 0 {
            break;
        }
        if answer.status == 429 {
            answer.problem(429, "uploads_full");
            refused += 1;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "{refused} refusals, and no end");
        std::thread::sleep(Duration::from_millis(100));
    }
    Answer::read(&mut stalled).problem(408, "body_timeout");
}

/// An HTTP/2 connection without requests, which is kept alive by pings.
struct Pinging(TcpStream);

impl Pinging {
    fn open(server: &Server) -> Self {
        let mut stream = server.connect();
        stream.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").unwrap();
        // Settings, none.
        stream.write_all(&[0, 0, 0, 4, 0, 0, 0, 0, 0]).unwrap();
        // Ours are acknowledged.
        stream.write_all(&[0, 0, 0, 4, 1, 0, 0, 0, 0]).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
        Self(stream)
    }

    /// Sends a ping and reads what came. False once the server has closed.
    fn ping(&mut self) -> bool {
        let ping = [0, 0, 8, 6, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8];
        if self.0.write_all(&ping).is_err() {
            return false;
        }
        let mut scratch = [0; 4096];
        match self.0.read(&mut scratch) {
            Ok(0) => false,
            Ok(_) => true,
            Err(error) => matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut),
        }
    }
}

#[test]
fn idle_http2_connections_do_not_keep_others_out() {
    let server = Server::start(&["--connections", "6", "--connections-per-address", "6", "--header-timeout-ms", "500"]);
    let mut idle: Vec<Pinging> = (0..6).map(|_| Pinging::open(&server)).collect();
    let began = Instant::now();
    let (mut pings, mut refused) = (0, 0);
    loop {
        pings += idle.iter_mut().filter_map(|connection| connection.ping().then_some(())).count();
        assert_eq!(server.get("/healthz").status, 200, "health has places of its own");
        let answer = server.get("/");
        if answer.status == 200 && refused > 0 {
            break;
        }
        refused += usize::from(answer.status == 503);
        assert!(began.elapsed() < Duration::from_secs(20), "{refused} refusals, and no end");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(pings > 6 && began.elapsed() > Duration::from_secs(1), "{pings} pings");
}

#[test]
fn a_signed_address_shows_its_picture_and_nothing_else() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one,two");
    let server = Server::start_with(&mut command);
    let mesh = server.request("POST", "/v1/meshes", &["Authorization: Bearer two"], CUBE_OBJ);
    let mesh = mesh.header("location").unwrap().to_owned();
    let sign = |url: &str, keys: &str, expires: &str| {
        let output =
            meshsnap().args(["sign", url, "--expires", expires]).env("MESHSNAP_API_KEYS", keys).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    let plain = format!("{mesh}/render.png?style=wire&size=24");
    server.get(&plain).problem(401, "unauthorized");
    let url = sign(&format!("http://pictures.example{plain}"), "two,three", "1h");
    let path = url.strip_prefix("http://pictures.example").unwrap();
    let signed = server.get(path);
    signed.picture(24, 24);
    let keyed = server.request("GET", &plain, &["Authorization: Bearer two"], b"");
    server.request("GET", &plain, &["Authorization: Bearer one"], b"").problem(404, "mesh_unknown");
    assert_eq!((&signed.body, signed.header("etag")), (&keyed.body, keyed.header("etag")), "the same address");
    assert_eq!(server.request("HEAD", path, &[], b"").status, 200);
    // Another picture, another path, another method, another key, another time.
    for changed in [path.replace("wire", "flat"), path.replace("png", "jpg"), path.replace("exp=", "exp=9")] {
        server.get(&changed).problem(403, "bad_signature");
    }
    server.get(&sign(&plain, "three", "1h")).problem(403, "bad_signature");
    let expired = sign(&plain, "one", "0s");
    let detail = server.get(&expired).problem(403, "bad_signature");
    assert!(detail.contains("expired"), "{detail}");
    server.get(&sign(&mesh, "one", "1h")).problem(401, "unauthorized");
    assert!(matches!(server.request("DELETE", path, &[], b"").status, 401 | 405));
    assert_eq!(server.get(&plain).status, 401);

    for (url, keys) in [("http://x/v1/jobs/1", "one"), ("x", "one"), (plain.as_str(), "")] {
        let output = meshsnap().args(["sign", url]).env("MESHSNAP_API_KEYS", keys).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{url} {keys}");
    }
}
