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
