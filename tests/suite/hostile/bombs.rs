//! Small uploads made to cost a lot, sent to a server: each is refused, or drawn without the part
//! that costs, and the server grows by less than 64 MiB.
//!
//!     cargo test --release --test suite bombs -- --nocapture
//!
//! prints what each costs. Memory is asserted; time is only printed, because it depends on the
//! machine.

use crate::support::files::bombs::{Bomb, DRAWN, all};
use crate::support::files::bundle::zipped;
use crate::support::server::{CUBE_OBJ, PATIENCE, Server};
use std::time::{Duration, Instant};

/// The largest growth of the server, bytes.
const MEMORY_MAX: u64 = 64 << 20;

#[test]
fn bombs_are_refused_in_little_memory() {
    let cases = all();
    let server = Server::start(&["--workers", "1"]);
    // A first picture opens everything that stays open.
    let warm = || server.post("/v1/render?size=16", &zipped(&[("cube.obj", CUBE_OBJ)])).picture(16, 16);
    warm();
    let idle = server.resident_bytes();
    println!(
        "\nidle: {:.1} MB\n\n| case | bytes sent | answer | ms | extra memory, MB |\n|---|---|---|---|---|",
        megabytes(idle)
    );
    let (mut slowest, mut largest) = (Duration::ZERO, 0);
    let mut faults = Vec::new();
    for Bomb { name, body, code } in &cases {
        reset_peak(&server);
        let began = Instant::now();
        let answer = server.post("/v1/render?size=16", body);
        let took = began.elapsed();
        // From what it held before all of them: what an earlier one has left to the allocator
        // counts.
        let grown = server.peak_bytes().saturating_sub(idle);
        let said = if answer.status == 200 { "".into() } else { answer.json()["code"].as_str().unwrap().to_owned() };
        println!(
            "| {name} | {} | {} {said} | {:.1} | {:.1} |",
            body.len(),
            answer.status,
            took.as_secs_f64() * 1e3,
            megabytes(grown)
        );
        let is_expected = if *code == DRAWN { answer.status == 200 } else { matches!(answer.status, 413 | 422) };
        if !is_expected || said != *code {
            faults.push(format!("{name}: {} {said}, and not {code}", answer.status));
        }
        if grown >= MEMORY_MAX {
            faults.push(format!("{name}: {:.1} MB", megabytes(grown)));
        }
        (slowest, largest) = (slowest.max(took), largest.max(grown));
    }
    println!("\n{} bombs; slowest {slowest:.1?}, largest {:.1} MB", cases.len(), megabytes(largest));
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(cases.len(), 37);
    assert!(largest > 0, "the measure of memory is broken");
    warm();
}

/// The measure itself: a body that is kept while it is read shows up in the peak, and is gone from
/// it once the peak is reset.
#[test]
fn the_measure_of_bombs_sees_memory() {
    let server = Server::start(&["--workers", "1"]);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    let idle = server.resident_bytes();
    let mut body = CUBE_OBJ.to_vec();
    body.resize(48 << 20, b'\n');
    server.post("/v1/render?size=16", &body).picture(16, 16);
    let grown = server.peak_bytes() - idle;
    // Some of it fits into what the allocator has left from before.
    assert!(grown >= 40 << 20, "{grown} bytes");
    // The thread that has read the body may let go of it after the answer.
    let began = Instant::now();
    while server.resident_bytes().saturating_sub(idle) >= 16 << 20 {
        assert!(began.elapsed() < PATIENCE, "the body is kept");
        std::thread::sleep(Duration::from_millis(5));
    }
    reset_peak(&server);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    let after = server.peak_bytes().saturating_sub(idle);
    assert!(after < 24 << 20, "{after} bytes");
}

/// Linux: the largest that the process has been becomes what it is now.
fn reset_peak(server: &Server) {
    std::fs::write(format!("/proc/{}/clear_refs", server.pid()), "5").unwrap();
}

fn megabytes(bytes: u64) -> f64 {
    bytes as f64 / 1e6
}
