//! Clients that take places, time or memory from others: too many connections, old ones, and bytes that dribble.

use std::io::{Read as _, Write as _};
use std::time::{Duration, Instant};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server};

#[test]
fn health_is_answered_while_all_places_are_taken() {
    let server = Server::start(&["--connections", "2", "--connections-per-address", "2"]);
    let held = [server.connect(), server.connect()];
    let began = Instant::now();
    // The server may not have accepted them yet.
    while server.get("/").status != 503 {
        assert!(began.elapsed() < PATIENCE);
    }
    let mut answers = 0;
    for path in ["/healthz", "/readyz", "/version"] {
        let answer = server.request("GET", path, &[], b"");
        assert_eq!((answer.status, answer.header("connection")), (200, Some("close")), "{path}");
        answers += 1;
    }
    assert_eq!(answers, 3);
    server.get("/metrics").problem(503, "connections_full");
    server.post("/v1/render", CUBE_OBJ).problem(503, "connections_full");
    drop(held);
}

#[test]
fn one_address_does_not_have_all_places() {
    let server = Server::start(&["--connections", "4"]);
    let held: Vec<_> = (0..3).map(|_| server.connect()).collect();
    let began = Instant::now();
    let answer = loop {
        let answer = server.get("/");
        if answer.status != 200 {
            break answer;
        }
        assert!(began.elapsed() < PATIENCE);
    };
    answer.problem(503, "connections_full");
    assert_eq!(answer.json()["flag"], "--connections-per-address");
    drop(held);
}

#[test]
fn old_connections_are_asked_to_end() {
    let server = Server::start(&["--connection-age-ms", "400"]);
    let mut old = server.connect();
    write!(old, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let answer = Answer::read(&mut old);
    assert_eq!((answer.status, answer.header("connection")), (200, None));
    // It is idle, and the server closes it long before its time of idleness is over.
    assert_eq!(old.read(&mut [0; 16]).unwrap(), 0);
    // A job that takes longer is answered.
    let answer = server.post("/v1/render?size=32", CUBE_OBJ);
    answer.picture(32, 32);
}

/// Sends a byte every 50 ms, and returns the answer that comes in spite of it.
fn dribble(mut stream: std::net::TcpStream) -> Answer {
    stream.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
    let began = Instant::now();
    loop {
        assert!(began.elapsed() < PATIENCE, "it may dribble for ever");
        // The server may have closed its side.
        let _ = stream.write_all(b"\n");
        if stream.peek(&mut [0; 12]).is_ok_and(|bytes| bytes > 0) {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
            return Answer::read(&mut stream);
        }
    }
}

#[test]
fn a_body_that_dribbles_is_ended() {
    let server = Server::start(&["--least-rate-bytes", "1000"]);
    let mut stream = server.connect();
    write!(stream, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n").unwrap();
    let answer = dribble(stream);
    answer.problem(408, "body_timeout");
    assert_eq!(answer.json()["flag"], "--least-rate-bytes");
    // Without a least rate it has the time of a body.
    let server = Server::start(&["--least-rate-bytes", "0", "--body-timeout-ms", "500"]);
    let mut stream = server.connect();
    write!(stream, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n").unwrap();
    assert_eq!(dribble(stream).json()["flag"], "--body-timeout-ms");
}

#[test]
fn an_upload_that_dribbles_makes_room_for_others() {
    let server = Server::start(&["--uploads-bytes", "1MiB", "--least-rate-bytes", "1000"]);
    let mut stream = server.connect();
    write!(stream, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1040000\r\n\r\n").unwrap();
    stream.write_all(&vec![b'#'; 1_000_000]).unwrap();
    let (began, mut refused) = (Instant::now(), 0);
    while !server
        .get("/metrics")
        .body
        .windows(48)
        .any(|text| text == b"meshsnap_memory_bytes{account=\"uploads\"} 1000000")
    {
        assert!(began.elapsed() < PATIENCE, "the upload does not arrive");
    }
    let holder = std::thread::spawn(move || dribble(stream));
    let large = [CUBE_OBJ, &vec![b'\n'; 100_000]].concat();
    loop {
        // Accepting a job needs no drawing.
        let answer = server.post("/v1/jobs?size=16", &large);
        match answer.status {
            429 => refused += 1,
            202 if refused > 0 => break,
            other => panic!("{other}"),
        }
        assert!(began.elapsed() < PATIENCE, "{refused} refusals");
        std::thread::sleep(Duration::from_millis(20));
    }
    let answer = holder.join().unwrap();
    answer.problem(408, "body_timeout");
    assert_eq!(answer.json()["flag"], "--uploads-bytes");
}
