//! Webhooks: the server reports the end of a job once, signed, and again after a restart if the
//! receiver did not take it. Also the certificates that it trusts, and the addresses that it
//! refuses.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use base64::Engine as _;
use hmac::{Hmac, KeyInit as _, Mac as _};
use serde_json::Value;
use sha2::Sha256;

use crate::support::server::{CUBE_OBJ, PATIENCE, Server, meshsnap};

pub const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

/// A receiver that takes what comes, or answers with 503, and passes on what it has heard.
pub struct Hook {
    pub address: String,
    heard: Receiver<(bool, String)>,
    takes: Arc<AtomicBool>,
}

impl Hook {
    pub fn new(takes: bool) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/hook", listener.local_addr().unwrap());
        let (takes, (sender, heard)) = (Arc::new(AtomicBool::new(takes)), channel());
        let does_take = takes.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let mut stream = stream.unwrap();
                stream.set_read_timeout(Some(PATIENCE)).unwrap();
                let (mut text, mut buffer) = (Vec::new(), [0; 4096]);
                // The JSON of a job ends as no part of it before does.
                while serde_json::from_str::<Value>(body(&String::from_utf8_lossy(&text))).is_err() {
                    match stream.read(&mut buffer) {
                        Ok(count) if count > 0 => text.extend(&buffer[..count]),
                        _ => break,
                    }
                }
                let takes = does_take.load(Ordering::Relaxed);
                let status = if takes { "200 OK" } else { "503 Later" };
                let _ = write!(stream, "HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: 0\r\n\r\n");
                let _ = sender.send((takes, String::from_utf8(text).unwrap()));
            }
        });
        Self { address, heard, takes }
    }

    /// From now on it takes what comes, or refuses it.
    pub fn set_takes(&self, takes: bool) {
        self.takes.store(takes, Ordering::Relaxed);
    }

    /// Waits until it has refused something.
    pub fn refused(&self) {
        while self.heard.recv_timeout(PATIENCE).expect("something comes").0 {}
    }

    /// Checks that nothing comes for a while.
    pub fn hears_nothing(&self, time: Duration) {
        assert!(self.heard.recv_timeout(time).is_err());
    }

    /// The next job that it has taken. Checks the signature.
    pub fn taken(&self) -> Value {
        let began = Instant::now();
        while let Ok((takes, text)) = self.heard.recv_timeout(PATIENCE.saturating_sub(began.elapsed())) {
            check(&text);
            if takes {
                return serde_json::from_str(body(&text)).unwrap();
            }
        }
        panic!("nothing came")
    }
}

fn body(text: &str) -> &str {
    text.split_once("\r\n\r\n").map_or("", |(_, body)| body)
}

fn header<'t>(text: &'t str, name: &str) -> &'t str {
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
    line.unwrap_or_else(|| panic!("no {name} in {text}"))
}

/// Verifies the signature as a receiver does.
fn check(text: &str) {
    let (id, time) = (header(text, "webhook-id"), header(text, "webhook-timestamp"));
    let base64 = base64::prelude::BASE64_STANDARD;
    let key = base64.decode(SECRET.strip_prefix("whsec_").unwrap()).unwrap();
    let mut mac = Hmac::<Sha256>::new_from_slice(&key).unwrap();
    mac.update(format!("{id}.{time}.{}", body(text)).as_bytes());
    let signature = header(text, "webhook-signature").strip_prefix("v1,").unwrap();
    mac.verify_slice(&base64.decode(signature).unwrap()).expect("the signature is right");
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs();
    assert!(now.abs_diff(time.parse().unwrap()) < 60);
}

fn start(arguments: &[&str]) -> Server {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_WEBHOOK_SECRET", SECRET);
    Server::start_with(command.args(arguments))
}

fn metric(server: &Server, name: &str) -> f64 {
    let text = String::from_utf8(server.get("/metrics").body).unwrap();
    text.lines().find_map(|line| line.strip_prefix(name)?.trim().parse().ok()).unwrap_or(0.0)
}

#[test]
fn a_receiver_hears_of_each_end_once() {
    let server = start(&["--webhooks-to-private", "--webhook-retry-ms", "1"]);
    let hook = Hook::new(true);
    let webhook = format!("Webhook: {}", hook.address);
    let done = server.request("POST", "/v1/jobs?size=16", &[&webhook], CUBE_OBJ);
    let failed = server.request("POST", "/v1/jobs?size=16", &[&webhook], b"no mesh");
    let judged = server.request("POST", "/v1/check", &[&webhook, "Prefer: respond-async"], CUBE_OBJ);
    let form = b"--b\r\nContent-Disposition: form-data; name=\"mesh\"; filename=\"a.obj\"\r\n\r\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n\r\n--b\r\n\
        Content-Disposition: form-data; name=\"mesh\"; filename=\"b.obj\"\r\n\r\nv 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n\r\n--b--\r\n";
    let several =
        server.request("POST", "/v1/jobs?size=16", &[&webhook, "Content-Type: multipart/form-data; boundary=b"], form);
    let mut expected = vec![
        (done.json()["id"].clone(), "job.done"),
        (failed.json()["id"].clone(), "job.failed"),
        (judged.json()["id"].clone(), "job.done"),
    ];
    expected
        .extend(several.json()["jobs"].as_array().unwrap().iter().map(|job| (job["job"]["id"].clone(), "job.done")));
    assert_eq!(expected.len(), 5);
    for _ in 0..5 {
        let payload = hook.taken();
        let id = &payload["data"]["id"];
        let at = expected.iter().position(|(expected, _)| expected == id).expect("each comes once");
        let (_, kind) = expected.swap_remove(at);
        assert_eq!(payload["type"], kind);
        // What it hears is what a client sees that asks.
        let job = server.get(&format!("/v1/jobs/{}", id.as_str().unwrap())).json();
        assert_eq!(payload["data"], job);
        assert!(payload["timestamp"].as_str().unwrap().ends_with('Z'));
    }
    let began = Instant::now();
    while metric(&server, "meshsnap_webhooks_total{outcome=\"delivered\"}") < 5.0 {
        assert!(began.elapsed() < PATIENCE);
    }
    assert_eq!(metric(&server, "meshsnap_webhooks_waiting"), 0.0);
    assert!(hook.heard.try_recv().is_err());
}

/// The certificate of the receiver is of an authority that nobody else knows. Its private key is for tests alone.
#[test]
fn receivers_are_trusted_by_the_certificates_of_a_file() {
    use rustls::pki_types::pem::PemObject as _;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    let data = |name: &str| format!("{}/tests/data/tls/{name}", env!("CARGO_MANIFEST_DIR"));
    let chain = vec![CertificateDer::from_pem_file(data("server.pem")).unwrap()];
    let key = PrivateKeyDer::from_pem_file(data("server.key")).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let config = Arc::new(config.with_no_client_auth().with_single_cert(chain, key).unwrap());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("Webhook: https://localhost:{}/hook", listener.local_addr().unwrap().port());
    let (sender, heard) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let connection = rustls::ServerConnection::new(config.clone()).unwrap();
            let mut stream = rustls::StreamOwned::new(connection, stream.unwrap());
            let mut buffer = [0; 4096];
            // A client that does not trust it hangs up.
            let heard_more = stream.read(&mut buffer).is_ok_and(|count| count > 0);
            let _ = stream.write_all(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n");
            let _ = sender.send(heard_more);
        }
    });
    for (arguments, is_trusted) in [(vec![], false), (vec!["--webhooks-ca".to_owned(), data("ca.pem")], true)] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let server = start(&[&["--webhooks-to-private", "--webhook-retry-ms", "600000"], &arguments[..]].concat());
        assert_eq!(server.request("POST", "/v1/jobs?size=16", &[&address], CUBE_OBJ).status, 202);
        assert_eq!(heard.recv_timeout(PATIENCE), Ok(is_trusted));
        let outcome = if is_trusted { "delivered" } else { "failed_attempt" };
        let began = Instant::now();
        while metric(&server, &format!("meshsnap_webhooks_total{{outcome=\"{outcome}\"}}")) < 1.0 {
            assert!(began.elapsed() < PATIENCE, "{outcome}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    for (file, why) in [("server.key", "no certificates"), ("missing.pem", "No such file")] {
        let mut command = meshsnap();
        command
            .args(["serve", "--listen", "127.0.0.1:0", "--webhooks-ca", &data(file)])
            .env("MESHSNAP_WEBHOOK_SECRET", SECRET);
        let output = command.output().unwrap();
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && printed.contains(why), "{file}: {printed}");
    }
}

#[test]
fn a_restart_tries_again_what_was_not_taken() {
    let (folder, hook) = (tempfile::tempdir().unwrap(), Hook::new(false));
    let data = folder.path().to_str().unwrap();
    let arguments = [
        "--ephemeral=false",
        "--data-dir",
        data,
        "--webhooks-to-private",
        "--webhook-retry-ms",
        "1h",
        "--workers",
        "1",
    ];
    let server = start(&arguments);
    let webhook = format!("Webhook: {}", hook.address);
    let mut ids = Vec::new();
    for size in 16..20 {
        let answer = server.request("POST", &format!("/v1/jobs?size={size}"), &[&webhook], CUBE_OBJ);
        ids.push(answer.json()["id"].clone());
    }
    // Each has failed once, and would be tried again in an hour.
    let refused: Vec<_> = (0..4).map(|_| hook.heard.recv_timeout(PATIENCE).unwrap().0).collect();
    assert_eq!(refused, [false; 4]);
    assert_eq!(metric(&server, "meshsnap_webhooks_waiting"), 4.0);
    server.kill_9();
    drop(server);
    hook.takes.store(true, Ordering::Relaxed);
    let server = start(&arguments);
    let mut taken: Vec<_> = (0..4).map(|_| hook.taken()["data"]["id"].clone()).collect();
    taken.sort_by_key(Value::to_string);
    ids.sort_by_key(Value::to_string);
    assert_eq!(taken, ids);
    // What was taken is not sent again, once that is written down.
    let began = Instant::now();
    while metric(&server, "meshsnap_webhooks_total{outcome=\"delivered\"}") < 4.0 {
        assert!(began.elapsed() < PATIENCE);
    }
    server.terminate();
    let mut server = server;
    server.wait();
    let server = start(&arguments);
    assert_eq!(server.get("/v1/capabilities").json()["load"]["kept_results"], 4);
    std::thread::sleep(Duration::from_millis(300));
    assert!(hook.heard.try_recv().is_err());
    assert_eq!(metric(&server, "meshsnap_webhooks_waiting"), 0.0);
}

#[test]
fn what_is_no_address_for_a_webhook_is_refused() {
    let server = start(&[]);
    let post = |path: &str, headers: &[&str]| server.request("POST", path, headers, CUBE_OBJ);
    let mut refused = 0;
    for bad in [
        "",
        "nonsense",
        "ftp://a.example/",
        "https://u:p@a.example/",
        "http://127.0.0.1:1/",
        "http://[::1]/",
        "http://10.0.0.1/",
        "http://localhost:80/",
        "https://a.example/#x",
        "http://169.254.169.254/latest/meta-data/",
    ] {
        post("/v1/jobs?size=16", &[&format!("Webhook: {bad}")]).problem(400, "bad_webhook");
        refused += 1;
    }
    assert_eq!(refused, 10);
    post("/v1/jobs?size=16", &["Webhook: https://a.example/", "Webhook: https://b.example/"])
        .problem(400, "bad_webhook");
    // Nobody waits for a webhook who waits for the picture.
    post("/v1/render?size=16", &["Webhook: https://a.example/"]).problem(400, "bad_webhook");
    post("/v1/check", &["Webhook: https://a.example/"]).problem(400, "bad_webhook");
    assert_eq!(metric(&server, "meshsnap_queue_jobs{class=\"batch\"}"), 0.0);
    let plain = Server::start(&[]);
    plain.request("POST", "/v1/jobs", &["Webhook: https://a.example/"], CUBE_OBJ).problem(422, "webhooks_off");
    for (secret, what) in [("hunter2", "whsec_"), ("whsec_????????????????????????????????", "base64")] {
        let mut command = meshsnap();
        let output = command.args(["serve", "--listen", "127.0.0.1:0"]).env("MESHSNAP_WEBHOOK_SECRET", secret);
        let output = output.output().unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains(what) && !text.contains("????"), "{text}");
    }
}
