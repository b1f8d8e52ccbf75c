//! `/metrics`, read by a parser that is not ours.

use std::collections::BTreeMap;

use prometheus_parse::{Scrape, Value};

use crate::support::server::{CUBE_OBJ, Server, meshsnap};

/// The values by name and labels; of a histogram, the number of its observations.
fn scrape(server: &Server) -> BTreeMap<String, f64> {
    let answer = server.get("/metrics");
    assert_eq!((answer.status, answer.header("cache-control")), (200, Some("no-store")));
    assert!(answer.header("content-type").unwrap().starts_with("text/plain; version=0.0.4"), "{:?}", answer.headers);
    let text = String::from_utf8(answer.body).unwrap();
    let parsed = Scrape::parse(text.lines().map(|line| Ok(line.to_owned()))).unwrap();
    // The parser passes over what it does not understand.
    let names = text.lines().filter(|line| line.starts_with("# TYPE")).map(|line| line.split(' ').nth(2).unwrap());
    for name in names {
        assert!(parsed.samples.iter().any(|sample| sample.metric.starts_with(name)), "{name} was not understood");
        assert!(parsed.docs.contains_key(name), "{name} has no help");
    }
    let mut values = BTreeMap::new();
    for sample in &parsed.samples {
        let labels: BTreeMap<_, _> = sample.labels.iter().collect();
        let labels = labels.iter().map(|(key, value)| format!("{key}={value}")).collect::<Vec<_>>().join(",");
        let value = match &sample.value {
            Value::Counter(number) | Value::Gauge(number) | Value::Untyped(number) => *number,
            Value::Histogram(buckets) => buckets.last().unwrap().count,
            Value::Summary(_) => panic!("{} is a summary", sample.metric),
        };
        values.insert(format!("{}{{{labels}}}", sample.metric), value);
    }
    values
}

#[test]
fn metrics_count_what_happens() {
    let server = Server::start(&["--workers", "2"]);
    assert!(!scrape(&server).is_empty());
    for _ in 0..3 {
        server.post("/v1/render?size=16&backend=cpu", CUBE_OBJ).picture(16, 16);
    }
    let job = server.post("/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned();
    server.request("GET", &job, &["Prefer: wait=30"], b"");
    let mesh = server.post("/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
    for _ in 0..2 {
        server.get(&format!("{mesh}/render.png?size=16")).picture(16, 16);
    }
    server.post("/v1/render?sise=16", CUBE_OBJ).problem(400, "unknown_key");
    server.post("/v1/render", b"no mesh").problem(415, "mesh_unrecognised");
    let values = scrape(&server);
    let expected = [
        ("meshsnap_stage_seconds{backend=cpu,stage=render}", 5.0),
        ("meshsnap_stage_seconds{backend=cpu,stage=encode}", 5.0),
        ("meshsnap_queue_wait_seconds{class=batch}", 1.0),
        ("meshsnap_jobs_total{class=batch,end=done}", 1.0),
        ("meshsnap_jobs_total{class=interactive,end=failed}", 1.0),
        ("meshsnap_rejections_total{code=unknown_key,status=400}", 1.0),
        ("meshsnap_rejections_total{code=mesh_unrecognised,status=415}", 1.0),
        ("meshsnap_pictures_total{outcome=miss}", 1.0),
        ("meshsnap_pictures_total{outcome=hit}", 1.0),
        ("meshsnap_queue_jobs{class=interactive}", 0.0),
        ("meshsnap_workers{state=all}", 2.0),
        ("meshsnap_kept_entries{account=meshes}", 1.0),
        ("meshsnap_kept_entries{account=pictures}", 1.0),
        ("meshsnap_gpu_losses_total{}", 0.0),
    ];
    for (name, value) in expected {
        assert_eq!(values.get(name), Some(&value), "{name}; there are {:?}", values.keys());
    }
    assert!(values["meshsnap_memory_bytes{account=meshes}"] >= CUBE_OBJ.len() as f64);
    assert!(values["process_resident_memory_bytes{}"] > 1e6);
    assert!(values["meshsnap_http_answers_total{status=200}"] >= 6.0);
}

#[test]
fn metrics_want_a_key_where_keys_are_configured() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).env("MESHSNAP_API_KEYS", "one");
    let server = Server::start_with(&mut command);
    server.get("/metrics").problem(401, "unauthorized");
    assert_eq!(server.request("GET", "/metrics", &["Authorization: Bearer one"], b"").status, 200);
}

/// The JSON for operators has the numbers of the metrics, and says what failed without a word of the client's.
#[test]
fn the_status_agrees_with_the_metrics() {
    let server = Server::start(&["--workers", "2"]);
    let mesh = server.post("/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
    for _ in 0..3 {
        server.get(&format!("{mesh}/render.png?size=16")).picture(16, 16);
        server.post("/v1/render?secret=1", CUBE_OBJ).problem(400, "unknown_key");
    }
    server.request("SECRET", "/secret", &[], b"").problem(404, "not_found");
    let job = server.post("/v1/jobs", b"secret").header("location").unwrap().to_owned();
    server.request("GET", &job, &["Prefer: wait=30"], b"");
    let answer = server.get("/v1/status");
    assert_eq!((answer.status, answer.header("cache-control")), (200, Some("no-store")));
    assert!(!String::from_utf8_lossy(&answer.body).contains("secret"));
    let (status, values) = (answer.json(), scrape(&server));
    let mut compared = 0;
    let mut agree = |name: String, number: &serde_json::Value| {
        assert_eq!(number.as_f64(), Some(values[&name]), "{name}");
        compared += 1;
    };
    for queue in status["queue"].as_array().unwrap() {
        agree(format!("meshsnap_queue_jobs{{class={}}}", queue["class"].as_str().unwrap()), &queue["queued"]);
    }
    for (key, metric) in [
        ("workers", "meshsnap_workers{state="),
        ("kept", "meshsnap_kept_entries{account="),
        ("pictures", "meshsnap_pictures_total{outcome="),
    ] {
        for (label, number) in status[key].as_object().unwrap() {
            agree(format!("{metric}{label}}}"), number);
        }
    }
    for account in status["memory"]["accounts"].as_array().unwrap() {
        let label = account["account"].as_str().unwrap();
        agree(format!("meshsnap_memory_limit_bytes{{account={label}}}"), &account["limit_bytes"]);
    }
    assert!(compared > 12, "{compared}");
    assert_eq!((&status["pictures"]["miss"], &status["pictures"]["hit"]), (&1.into(), &2.into()));
    let failures = status["failures"].as_array().unwrap().iter();
    let failures: Vec<_> = failures
        .map(|f| {
            (
                f["place"].as_str().unwrap(),
                f["status"].as_u64(),
                f["code"].as_str().unwrap(),
                f["count"].as_u64().unwrap(),
            )
        })
        .collect();
    let want = [
        ("job", None, "mesh_unrecognised", 1),
        ("other elsewhere", Some(404), "not_found", 1),
        ("POST /v1/render", Some(400), "unknown_key", 3),
    ];
    assert_eq!(failures, want);
}

#[test]
fn the_status_is_for_administrators() {
    let keys = tempfile::NamedTempFile::new().unwrap();
    let digest = |key: &str| meshsnap_server::digest::Digest::of(key.as_bytes()).to_string();
    let line = |name: &str, key: &str, scopes: &str| {
        format!("[[keys]]\nname = \"{name}\"\nsha256 = \"{}\"\nscopes = {scopes}\n", digest(key))
    };
    let text = line("boss", "one", "[\"admin\"]") + &line("ci", "two", "[\"render\", \"store\", \"metrics\"]");
    std::fs::write(keys.path(), text).unwrap();
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--api-keys-file"]).arg(keys.path());
    let server = Server::start_with(&mut command);
    let ask = |key: &str| server.request("GET", "/v1/status", &[&format!("Authorization: Bearer {key}")], b"");
    assert_eq!(ask("one").status, 200);
    ask("two").problem(403, "scope_missing");
    server.get("/v1/status").problem(401, "unauthorized");
}
