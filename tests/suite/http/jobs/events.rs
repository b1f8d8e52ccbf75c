//! `GET /v1/jobs/{id}/events`: the event stream by which a client follows a job.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::Instant;

use serde_json::Value;

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server, meshsnap};

/// An event: its name, its id and its data.
type Event = (String, String, Value);

fn events(text: &[u8]) -> Vec<Event> {
    let text = std::str::from_utf8(text).unwrap();
    let blocks = text.split("\n\n").filter(|block| block.contains("event: "));
    let field = |block: &str, name: &str| {
        let line = block.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
        line.unwrap_or_else(|| panic!("{name} in {block}")).to_owned()
    };
    blocks
        .map(|block| (field(block, "event"), field(block, "id"), serde_json::from_str(&field(block, "data")).unwrap()))
        .collect()
}

fn submit(server: &Server, query: &str) -> String {
    submit_mesh(server, query, CUBE_OBJ)
}

fn submit_mesh(server: &Server, query: &str, mesh: &[u8]) -> String {
    let accepted = server.post(&format!("/v1/jobs?{query}"), mesh);
    assert_eq!(accepted.status, 202, "{}", String::from_utf8_lossy(&accepted.body));
    accepted.header("location").unwrap().to_owned()
}

/// A job that has the only worker until its deadline of 30 s, or until it is cancelled. A short job that came before the
/// worker had begun would overtake it.
fn occupy(server: &Server) -> String {
    let job = submit_mesh(server, "size=4096&samples=16&style=xray", &nested_cubes(120));
    server.wait_for_load(|load| load["running"] == 1);
    job
}

/// Cubes one in another: an x-ray picture of them has twice as many layers.
fn nested_cubes(count: usize) -> Vec<u8> {
    let cube = |number: usize| {
        let a = 1.0 - number as f32 / (2 * count) as f32;
        format!(
            "v -{a} -{a} -{a}\nv {a} -{a} -{a}\nv {a} {a} -{a}\nv -{a} {a} -{a}\nv -{a} -{a} {a}\nv {a} -{a} {a}\n\
             v {a} {a} {a}\nv -{a} {a} {a}\nf -8 -5 -6 -7\nf -4 -3 -2 -1\nf -8 -7 -3 -4\nf -7 -6 -2 -3\n\
             f -6 -5 -1 -2\nf -5 -8 -4 -1\n"
        )
    };
    (0..count).map(cube).collect::<String>().into_bytes()
}

/// Reads a stream to its end.
pub fn read_all(server: &Server, job: &str, headers: &str) -> Answer {
    let mut stream = server.connect();
    write!(stream, "GET {job}/events HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{headers}\r\n").unwrap();
    let mut answer = Answer::read(&mut stream);
    let mut chunks = Vec::new();
    stream.read_to_end(&mut chunks).unwrap();
    let mut rest = &*chunks;
    while let Some(end) = rest.windows(2).position(|pair| pair == b"\r\n") {
        let length = usize::from_str_radix(std::str::from_utf8(&rest[..end]).unwrap(), 16).unwrap();
        answer.body.extend(&rest[end + 2..][..length]);
        rest = &rest[end + 4 + length..];
    }
    answer
}

/// Opens a stream and reads its head.
fn follow(server: &Server, job: &str) -> TcpStream {
    let mut stream = server.connect();
    write!(stream, "GET {job}/events HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let mut head = Vec::new();
    while !head.ends_with(b"event: queued") {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        head.push(byte[0]);
        assert!(head.len() < 4096, "{}", String::from_utf8_lossy(&head));
    }
    assert!(head.starts_with(b"HTTP/1.1 200"));
    stream
}

#[test]
fn a_job_is_followed_from_the_queue_to_its_end() {
    let server = Server::start(&["--workers", "1"]);
    let blocker = submit(&server, "size=2048&samples=16");
    let job = submit(&server, "size=256&sheet.views=front,left,top,iso");
    let answer = read_all(&server, &job, "");
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("text/event-stream")));
    assert_eq!((answer.header("cache-control"), answer.header("x-accel-buffering")), (Some("no-store"), Some("no")));
    let seen = events(&answer.body);
    let mut names: Vec<&str> = seen.iter().map(|(name, ..)| name.as_str()).collect();
    names.dedup();
    assert_eq!(names, ["queued", "importing", "drawing", "encoding", "done"], "{seen:?}");
    let drawing: Vec<(u64, u64)> = seen
        .iter()
        .filter(|(name, ..)| name == "drawing")
        .map(|(_, _, data)| (data["drawn"].as_u64().unwrap(), data["views"].as_u64().unwrap()))
        .collect();
    assert!(drawing.is_sorted() && drawing.iter().all(|&(drawn, views)| drawn <= 4 && views == 4), "{drawing:?}");
    let (_, _, last) = seen.last().unwrap();
    assert_eq!(*last, server.get(&job).json());
    // The short job may have overtaken it.
    read_all(&server, &blocker, "");
    assert_eq!(server.get(&blocker).json()["state"], "done");

    // A client that connects again gets what it has not seen.
    let after = |id: &str| {
        let answer = read_all(&server, &job, &format!("Last-Event-ID: {id}\r\n"));
        (answer.status, events(&answer.body).into_iter().map(|(name, ..)| name).collect::<Vec<_>>())
    };
    assert_eq!(after("importing"), (200, vec!["drawing".into(), "encoding".into(), "done".into()]));
    assert_eq!(after("encoding"), (200, vec!["done".into()]));
    assert_eq!(after("done"), (204, Vec::new()));
    for unknown in ["", "drawing-x", "drawing--1", "99999999999999999999", "drawing"] {
        assert_eq!(after(unknown).1.len(), 5, "{unknown}");
    }
    server.get("/v1/jobs/x/events").problem(404, "not_found");
}

#[test]
fn failed_and_cancelled_jobs_end_their_streams() {
    let server = Server::start(&["--workers", "1"]);
    let failed = server.post("/v1/jobs", b"no mesh").header("location").unwrap().to_owned();
    let seen = events(&read_all(&server, &failed, "").body);
    let (name, id, data) = seen.last().unwrap();
    assert_eq!(
        (name.as_str(), id.as_str(), data["error"]["code"].as_str()),
        ("failed", "failed", Some("mesh_unrecognised"))
    );
    let blocker = occupy(&server);
    let job = submit(&server, "size=64");
    let mut stream = follow(&server, &job);
    server.request("DELETE", &job, &[], b"");
    server.request("DELETE", &blocker, &[], b"");
    let mut rest = Vec::new();
    let mut part = [0; 4096];
    while !String::from_utf8_lossy(&rest).ends_with("0\r\n\r\n") {
        let length = stream.read(&mut part).unwrap();
        assert!(length > 0);
        rest.extend(&part[..length]);
    }
    assert!(String::from_utf8_lossy(&rest).contains("event: cancelled"));
}

#[test]
fn streams_are_few_and_one_that_goes_away_frees_its_place() {
    let server = Server::start(&["--workers", "1"]);
    let blocker = occupy(&server);
    let job = submit(&server, "size=64");
    let mut streams: Vec<TcpStream> = (0..32).map(|_| follow(&server, &job)).collect();
    let full = server.get(&format!("{job}/events"));
    full.problem(429, "streams_full");
    assert!(full.header("retry-after").is_some());
    assert_eq!(server.get(&job).status, 200);
    streams.pop();
    let began = Instant::now();
    loop {
        let mut stream = server.connect();
        write!(stream, "GET {job}/events HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
        let mut status = [0; 12];
        stream.read_exact(&mut status).unwrap();
        if status.ends_with(b"200") {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "no place is free");
    }
    server.request("DELETE", &blocker, &[], b"");
}

#[test]
fn a_server_that_ends_closes_its_streams() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--ephemeral=false", "--workers", "1"]);
    let mut server = Server::start_with(command.arg("--data-dir").arg(folder.path()));
    for _ in 0..6 {
        submit(&server, "size=4096&samples=16");
    }
    let mut stream = follow(&server, &submit(&server, "size=64"));
    let began = Instant::now();
    server.terminate();
    // Told twice, it abandons what runs; the next start does it again.
    std::thread::sleep(std::time::Duration::from_millis(100));
    server.terminate();
    let mut rest = Vec::new();
    stream.read_to_end(&mut rest).unwrap();
    assert!(String::from_utf8_lossy(&rest).ends_with("0\r\n\r\n"), "{}", String::from_utf8_lossy(&rest));
    server.wait();
    assert!(began.elapsed() < PATIENCE);
}
