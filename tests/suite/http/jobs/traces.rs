//! Traces that the server sends to an OpenTelemetry collector. Only builds with the feature `otel`
//! have them: `cargo xtask features` runs these tests with it.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::process::Command;
use std::sync::{Arc, Mutex};

use crate::http::jobs::durable::end_of;
use crate::http::shared_queue::{Service, job_of};
use crate::support::server::{CUBE_OBJ, Server, meshsnap};

/// A collector on a free port of loopback, which answers with one status.
struct Collector {
    endpoint: String,
    /// Bodies that were sent to `/v1/traces`.
    bodies: Arc<Mutex<Vec<Vec<u8>>>>,
}

impl Collector {
    fn start(status: &'static str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        let bodies = Arc::new(Mutex::new(Vec::new()));
        let taken = bodies.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let (mut stream, mut head, mut byte) = (stream.unwrap(), Vec::new(), [0]);
                while !head.ends_with(b"\r\n\r\n") && stream.read_exact(&mut byte).is_ok() {
                    head.push(byte[0]);
                }
                let head = String::from_utf8(head).unwrap().to_ascii_lowercase();
                assert!(head.starts_with("post /v1/traces http/1.1\r\n"), "{head}");
                assert!(head.contains("\r\ncontent-type: application/x-protobuf\r\n"), "{head}");
                let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")).unwrap();
                let mut body = vec![0; length.parse().unwrap()];
                stream.read_exact(&mut body).unwrap();
                taken.lock().unwrap().push(body);
                let answer = format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
                stream.write_all(answer.as_bytes()).unwrap();
            }
        });
        Self { endpoint, bodies }
    }

    fn serve(&self) -> Command {
        let mut command = meshsnap();
        command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]);
        command.env("OTEL_EXPORTER_OTLP_ENDPOINT", &self.endpoint).env("OTEL_BSP_SCHEDULE_DELAY", "100");
        command
    }

    /// All spans so far, and the name of the service.
    fn spans(&self) -> (Vec<Span>, String) {
        let (mut spans, mut service) = (Vec::new(), String::new());
        for body in self.bodies.lock().unwrap().iter() {
            for of_resource in messages(body, 1) {
                for attribute in messages(of_resource, 1).iter().flat_map(|resource| messages(resource, 1)) {
                    if let (name, Value::Text(value)) = pair(attribute)
                        && name == "service.name"
                    {
                        service = value;
                    }
                }
                let scopes = messages(of_resource, 2);
                spans.extend(scopes.iter().flat_map(|scope| messages(scope, 2)).map(Span::read));
            }
        }
        (spans, service)
    }
}

#[derive(Debug, PartialEq)]
enum Value {
    Text(String),
    Number(u64),
    Other,
}

/// What a trace says of one span.
#[derive(Debug)]
struct Span {
    trace: Vec<u8>,
    id: Vec<u8>,
    parent: Vec<u8>,
    name: String,
    kind: u64,
    began: u64,
    ended: u64,
    status: u64,
    attributes: Vec<(String, Value)>,
}

impl Span {
    fn read(bytes: &[u8]) -> Self {
        let first = |field| messages(bytes, field).first().map(|bytes| bytes.to_vec()).unwrap_or_default();
        let number = |field| numbers(bytes, field).first().copied().unwrap_or(0);
        Self {
            trace: first(1),
            id: first(2),
            parent: first(4),
            name: String::from_utf8(first(5)).unwrap(),
            kind: number(6),
            began: number(7),
            ended: number(8),
            status: numbers(&first(15), 3).first().copied().unwrap_or(0),
            attributes: messages(bytes, 9).iter().map(|attribute| pair(attribute)).collect(),
        }
    }

    fn attribute(&self, name: &str) -> &Value {
        self.attributes.iter().find(|(key, _)| key == name).map_or(&Value::Other, |(_, value)| value)
    }
}

/// A key and a value of OpenTelemetry.
fn pair(bytes: &[u8]) -> (String, Value) {
    let key = String::from_utf8(messages(bytes, 1)[0].to_vec()).unwrap();
    let value = messages(bytes, 2)[0];
    let text = messages(value, 1).first().map(|text| Value::Text(String::from_utf8(text.to_vec()).unwrap()));
    (key, text.or_else(|| numbers(value, 3).first().map(|number| Value::Number(*number))).unwrap_or(Value::Other))
}

/// What a field of this number holds, as often as it is there, in a message of Protocol Buffers.
fn messages(bytes: &[u8], wanted: u64) -> Vec<&[u8]> {
    fields(bytes).into_iter().filter(|field| field.0 == wanted).filter_map(|field| field.2).collect()
}

fn numbers(bytes: &[u8], wanted: u64) -> Vec<u64> {
    let of_field = fields(bytes).into_iter().filter(|field| field.0 == wanted && field.2.is_none());
    of_field.map(|field| field.1).collect()
}

/// Number of the field, its number if it is one, and its bytes if it has any.
fn fields(mut bytes: &[u8]) -> Vec<(u64, u64, Option<&[u8]>)> {
    fn varint(bytes: &mut &[u8]) -> u64 {
        let (mut value, mut shift) = (0, 0);
        loop {
            let byte = bytes[0];
            *bytes = &bytes[1..];
            value |= u64::from(byte & 0x7F) << shift;
            shift += 7;
            if byte < 0x80 {
                return value;
            }
        }
    }
    fn split<'b>(bytes: &mut &'b [u8], length: usize) -> &'b [u8] {
        let (head, rest) = bytes.split_at(length);
        *bytes = rest;
        head
    }
    let mut all = Vec::new();
    while !bytes.is_empty() {
        let tag = varint(&mut bytes);
        let (field, kind) = (tag >> 3, tag & 7);
        all.push(match kind {
            0 => (field, varint(&mut bytes), None),
            1 => (field, u64::from_le_bytes(split(&mut bytes, 8).try_into().unwrap()), None),
            5 => (field, u64::from(u32::from_le_bytes(split(&mut bytes, 4).try_into().unwrap())), None),
            2 => {
                let length = varint(&mut bytes) as usize;
                (field, 0, Some(split(&mut bytes, length)))
            }
            kind => panic!("no field is of kind {kind}"),
        });
    }
    all
}

const TRACE: &str = "4bf92f3577b34da6a3ce929d0e0e4736";
const CALLER: &str = "00f067aa0ba902b7";

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn requests_jobs_and_stages_are_spans_of_the_callers_trace() {
    let collector = Collector::start("200 OK");
    // The log is silent, and the traces are whole.
    let mut server = Server::start_with(collector.serve().env("MESHSNAP_LOG", "off"));
    let caller = format!("traceparent: 00-{TRACE}-{CALLER}-01");
    let headers = [caller.as_str(), "X-Request-Id: drawn"];
    server.request("POST", "/v1/render?size=32", &headers, CUBE_OBJ).picture(32, 32);
    let job = server.request("POST", "/v1/jobs?size=32", &["X-Request-Id: later"], CUBE_OBJ).json();
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    assert_eq!(server.request("GET", &path, &["Prefer: wait=30"], b"").json()["state"], "done");
    let broken = server.request("POST", "/v1/render", &["X-Request-Id: broken"], b"v 0 0 0\nf 1 2 3\n");
    assert_eq!(broken.status, 422);
    server.terminate();
    assert!(server.wait().success());

    let (spans, service) = collector.spans();
    assert_eq!(service, "meshsnap");
    let text = |text: &str| Value::Text(text.to_owned());
    let of = |name: &str, request: &str| {
        let found: Vec<&Span> =
            spans.iter().filter(|s| s.name == name && *s.attribute("request_id") == text(request)).collect();
        assert_eq!(found.len(), 1, "{name} of {request} in {spans:#?}");
        found[0]
    };
    let request = of("POST /v1/render", "drawn");
    assert_eq!((hex(&request.trace), hex(&request.parent)), (TRACE.to_owned(), CALLER.to_owned()));
    assert_eq!((request.kind, request.status), (2, 0), "a server's");
    assert_eq!(*request.attribute("http.route"), text("/v1/render"));
    assert_eq!(*request.attribute("http.response.status_code"), Value::Number(200));
    let mut stages = 0;
    for (request, job, state, names) in [
        (request, of("job", "drawn"), "done", &["queue", "parse", "plan", "render", "encode"][..]),
        (of("POST /v1/jobs", "later"), of("job", "later"), "done", &["queue", "parse", "plan", "render", "encode"]),
        (of("POST /v1/render", "broken"), of("job", "broken"), "failed", &["queue"]),
    ] {
        assert_eq!((&job.trace, &job.parent), (&request.trace, &request.id), "{state}");
        assert_eq!(*job.attribute("job.state"), text(state));
        assert_eq!(job.status, if state == "failed" { 2 } else { 0 });
        let mut parts: Vec<&Span> = spans.iter().filter(|span| span.parent == job.id).collect();
        parts.sort_by_key(|part| part.began);
        assert_eq!(parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>(), names);
        for part in &parts {
            assert!(part.trace == job.trace && part.began <= part.ended && part.ended <= job.ended, "{part:?} {job:?}");
        }
        stages += parts.len();
    }
    assert_eq!(stages, 11);
    assert!(of("POST /v1/jobs", "later").trace != request.trace, "a trace of its own");
}

/// A job that was accepted by one server, and done by another.
#[test]
fn traces_go_on_at_other_servers() {
    let Some(service) = Service::new() else { return };
    let collector = Collector::start("200 OK");
    let start = |name: &str| {
        let mut command = service.command(&[]);
        command.env("OTEL_EXPORTER_OTLP_ENDPOINT", &collector.endpoint).env("OTEL_BSP_SCHEDULE_DELAY", "100");
        Server::start_with(command.env("OTEL_RESOURCE_ATTRIBUTES", format!("host.name={name}")))
    };
    let mut servers = [start("a"), start("b")];
    let caller = format!("traceparent: 00-{TRACE}-{CALLER}-01");
    let jobs: Vec<String> = (0..6)
        .map(|i| {
            let path = format!("/v1/jobs?size={}", 32 + i);
            job_of(&servers[i % 2].request("POST", &path, &[&caller, &format!("X-Request-Id: job-{i}")], CUBE_OBJ))
        })
        .collect();
    for job in &jobs {
        assert_eq!(end_of(&servers[0], job)["state"], "done");
    }
    for server in &mut servers {
        server.terminate();
        assert!(server.wait().success());
    }
    let (spans, _) = collector.spans();
    for i in 0..6 {
        let of = |name: &str| {
            let is_meant = |s: &&Span| s.name == name && *s.attribute("request_id") == Value::Text(format!("job-{i}"));
            spans.iter().find(is_meant).unwrap_or_else(|| panic!("{name} of {i} in {spans:#?}"))
        };
        let [request, shared, job] = ["POST /v1/jobs", "shared job", "job"].map(of);
        assert_eq!((hex(&request.trace), hex(&request.parent)), (TRACE.to_owned(), CALLER.to_owned()));
        assert_eq!((&shared.trace, &shared.parent), (&request.trace, &request.id));
        assert_eq!((&job.trace, &job.parent), (&request.trace, &shared.id));
    }
}

#[test]
fn a_collector_that_is_ill_costs_one_line_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    for (name, status) in [("ill", "503 Service Unavailable"), ("refusing", "400 Bad Request")] {
        let collector = Collector::start(status);
        let log = folder.path().join(name);
        let mut server = Server::start_logging(collector.serve().env("MESHSNAP_LOG", "warn"), &log);
        for _ in 0..4 {
            server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
            std::thread::sleep(std::time::Duration::from_millis(150));
        }
        server.terminate();
        assert!(server.wait().success());
        assert!(!collector.bodies.lock().unwrap().is_empty(), "{name}: nothing was sent");
        let log = std::fs::read_to_string(&log).unwrap();
        assert_eq!(log.matches("the collector does not take traces").count(), 1, "{name}: {log}");
    }
}

#[test]
fn without_a_collector_nothing_is_sent() {
    let collector = Collector::start("200 OK");
    for (variable, value) in
        [("OTEL_EXPORTER_OTLP_ENDPOINT", ""), ("OTEL_SDK_DISABLED", "true"), ("OTEL_TRACES_EXPORTER", "none")]
    {
        let mut server = Server::start_with(collector.serve().env(variable, value));
        server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
        server.terminate();
        assert!(server.wait().success());
    }
    assert_eq!(collector.bodies.lock().unwrap().len(), 0);
}
