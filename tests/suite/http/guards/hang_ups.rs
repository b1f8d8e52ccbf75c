//! Clients that hang up in each phase of a request: nothing of what they held stays.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use crate::support::server::{CUBE_OBJ, PATIENCE, Server};

/// Hang-ups in each phase.
const TIMES: usize = 24;

/// A request, and how far the client goes with it before it hangs up.
struct Phase {
    name: &'static str,
    /// The share of the bytes that it sends.
    sent: f64,
    head: &'static str,
    /// Time that it stays after that.
    stays_ms: u64,
    /// Bytes of the answer that it reads.
    reads: usize,
}

const RENDER: &str = "POST /v1/render?size=64 HTTP/1.1\r\nHost: localhost\r\n";
const LARGE: &str = "POST /v1/render?size=1024&samples=16 HTTP/1.1\r\nHost: localhost\r\n";

const PHASES: [Phase; 8] = [
    Phase { name: "within the header", sent: 0.1, head: RENDER, stays_ms: 0, reads: 0 },
    Phase { name: "within the body", sent: 0.7, head: RENDER, stays_ms: 2, reads: 0 },
    Phase { name: "after the body", sent: 1.0, head: RENDER, stays_ms: 0, reads: 0 },
    Phase { name: "while it waits", sent: 1.0, head: LARGE, stays_ms: 1, reads: 0 },
    Phase { name: "while it is drawn", sent: 1.0, head: LARGE, stays_ms: 20, reads: 0 },
    Phase { name: "within the answer", sent: 1.0, head: RENDER, stays_ms: 0, reads: 20 },
    Phase {
        name: "as a mesh is stored",
        sent: 1.0,
        head: "POST /v1/meshes HTTP/1.1\r\nHost: localhost\r\n",
        stays_ms: 1,
        reads: 0,
    },
    Phase {
        name: "as a verdict is made",
        sent: 1.0,
        head: "POST /v1/check HTTP/1.1\r\nHost: localhost\r\n",
        stays_ms: 1,
        reads: 0,
    },
];

fn hang_up(server: &Server, phase: &Phase) {
    let head = format!("{}Content-Length: {}\r\n\r\n", phase.head, CUBE_OBJ.len());
    let request = [head.as_bytes(), CUBE_OBJ].concat();
    let mut stream = server.connect();
    stream.write_all(&request[..(request.len() as f64 * phase.sent) as usize]).unwrap();
    std::thread::sleep(Duration::from_millis(phase.stays_ms));
    if phase.reads > 0 {
        stream.read_exact(&mut vec![0; phase.reads]).unwrap();
    }
    let _ = stream.shutdown(Shutdown::Both);
}

fn descriptors(server: &Server) -> usize {
    std::fs::read_dir(format!("/proc/{}/fd", server.pid())).unwrap().count()
}

/// True once nothing waits, runs, or holds memory but stored meshes.
fn is_idle(server: &Server) -> bool {
    let text = String::from_utf8(server.get("/metrics").body).unwrap();
    let value = |name: &str| -> u64 {
        let line = text.lines().find_map(|line| line.strip_prefix(name));
        line.unwrap_or_else(|| panic!("{name} is missing")).trim().parse().unwrap()
    };
    ["jobs", "uploads", "answers"]
        .iter()
        .all(|account| value(&format!("meshsnap_memory_bytes{{account=\"{account}\"}}")) == 0)
        && value("meshsnap_workers{state=\"busy\"}") == 0
        && value("meshsnap_queue_jobs{class=\"interactive\"}") == 0
}

#[test]
fn nothing_stays_of_clients_that_hang_up() {
    let server = Server::start(&["--workers", "2", "--queue", "500"]);
    // Once each, so that what is made once is there.
    PHASES.iter().for_each(|phase| hang_up(&server, phase));
    server.post("/v1/render?size=1024&samples=16", CUBE_OBJ).picture(1024, 1024);
    server.wait_for_load(|load| load["running"] == 0 && load["queued"] == 0);
    let (before, memory) = (descriptors(&server), server.resident_bytes());
    let mut slowest = Duration::ZERO;
    for phase in &PHASES {
        for _ in 0..TIMES {
            hang_up(&server, phase);
        }
        let began = Instant::now();
        while !is_idle(&server) {
            assert!(began.elapsed() < PATIENCE, "{}: something stays", phase.name);
        }
        slowest = slowest.max(began.elapsed());
        server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    }
    let began = Instant::now();
    while descriptors(&server) > before {
        assert!(began.elapsed() < PATIENCE, "{before} descriptors before, {} now", descriptors(&server));
        std::thread::sleep(Duration::from_millis(10));
    }
    let grown = server.resident_bytes().saturating_sub(memory);
    println!(
        "{} hang-ups in {} phases: idle after {slowest:?} at most, {before} descriptors, {} KiB more memory",
        TIMES * PHASES.len(),
        PHASES.len(),
        grown / 1024
    );
    assert!(grown < 32 << 20, "{grown} bytes");
}

/// Time from a hang-up to the moment at which the one worker is free.
fn time_to_free(server: &Server, stream: TcpStream) -> Duration {
    server.wait_for_load(|load| load["running"] == 1);
    let began = Instant::now();
    drop(stream);
    while server.get("/v1/capabilities").json()["load"]["running"] != 0 {
        assert!(began.elapsed() < PATIENCE, "the worker stays busy");
    }
    began.elapsed()
}

#[test]
fn the_place_of_a_client_that_hangs_up_is_free_at_once() {
    const ROUNDS: usize = 10;
    let server = Server::start(&["--workers", "1"]);
    let mut times: Vec<Duration> = (0..ROUNDS)
        .map(|_| {
            let mut stream = server.connect();
            let path = "/v1/render?size=2048&samples=16&style=technical";
            write!(stream, "POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", CUBE_OBJ.len())
                .unwrap();
            stream.write_all(CUBE_OBJ).unwrap();
            time_to_free(&server, stream)
        })
        .collect();
    times.sort();
    println!("free after {:?} at most, {:?} in the middle of {}", times[ROUNDS - 1], times[ROUNDS / 2], times.len());
    // A machine that is busy with other tests may take longer now and then.
    assert!(times[ROUNDS / 2] < Duration::from_millis(100), "{times:?}");
}
