//! Small uploads made to cost a lot, sent to a server: each is refused at once, and costs next to nothing.
//!
//!     cargo test --release --test suite bombs -- --nocapture
//!
//! prints what each costs. Memory is held by every build, time by one with optimisation.

use crate::formats::bundles::names::zipped;
use crate::support::bomb_files::{Bomb, all};
use crate::support::server::{Answer, CUBE_OBJ, Server};
use std::time::{Duration, Instant};

/// What an answer may take. A build without optimisation, on a machine that does other things, is no measure.
const TIME_MAX: Duration = Duration::from_millis(if cfg!(debug_assertions) { 1000 } else { 50 });
/// What the server may grow by, at its largest, bytes.
const MEMORY_MAX: u64 = 64 << 20;
/// Of so many answers the fastest counts: whatever else the machine does adds to time, and never takes from it.
const TRIES: usize = 5;

#[test]
fn bombs_are_refused_in_no_time_and_no_memory() {
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
        let (mut best, mut answer): (Duration, Option<Answer>) = (Duration::MAX, None);
        for _ in 0..TRIES {
            let began = Instant::now();
            answer = Some(server.post("/v1/render?size=16", body));
            best = best.min(began.elapsed());
        }
        let answer = answer.unwrap();
        // From what it held before all of them: what an earlier one has left to the allocator counts.
        let grown = server.peak_bytes().saturating_sub(idle);
        let said = if answer.status == 200 { "".into() } else { answer.json()["code"].as_str().unwrap().to_owned() };
        println!(
            "| {name} | {} | {} {said} | {:.1} | {:.1} |",
            body.len(),
            answer.status,
            best.as_secs_f64() * 1e3,
            megabytes(grown)
        );
        if !matches!(answer.status, 413 | 422) || said != *code {
            faults.push(format!("{name}: {} {said}, and not {code}", answer.status));
        }
        if best >= TIME_MAX || grown >= MEMORY_MAX {
            faults.push(format!("{name}: {best:?}, {:.1} MB", megabytes(grown)));
        }
        (slowest, largest) = (slowest.max(best), largest.max(grown));
    }
    println!("\n{} bombs; slowest {slowest:.1?}, largest {:.1} MB", cases.len(), megabytes(largest));
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(cases.len(), 37);
    assert!(largest > 0, "the measure of memory is broken");
    warm();
}

/// The measure itself: a body that is kept while it is read shows up in the peak, and is gone from it once the peak is reset.
#[test]
fn the_measure_of_bombs_sees_memory() {
    let server = Server::start(&["--workers", "1"]);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    let idle = server.resident_bytes();
    let mut body = CUBE_OBJ.to_vec();
    body.resize(48 << 20, b'\n');
    server.post("/v1/render?size=16", &body).picture(16, 16);
    let grown = server.peak_bytes() - idle;
    assert!(grown >= 48 << 20, "{grown} bytes");
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
