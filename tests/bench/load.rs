//! Load: many connections post a mesh for a while; prints what came back, how fast, and whether
//! memory stays flat.
//!
//!     cargo bench --bench load                                # 64 connections, 30 s, api/examples/knot.obj
//!     cargo bench --bench load -- --mesh model.obj --seconds 10 --query 'style=wire&size=256'
//!     cargo bench --bench load -- --url 127.0.0.1:8080        # a server that runs already (no memory is sampled)
//!
//! Starts a server of its own unless told where one is. Ends with a failure if anything but 200 and
//! 429 came back, if a connection broke, or if memory grew by more than 15 % from the second third
//! of the time to the last.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod served;

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use served::{exchange, resident_bytes, start};

/// Memory may still grow by this much after warm-up: allocators keep what their busiest moment
/// needed.
const GROWTH_MAX: f64 = 1.15;

struct Options {
    mesh: String,
    query: String,
    connections: usize,
    seconds: u64,
    url: Option<String>,
    serve: Vec<String>,
}

#[derive(Default)]
struct Seen {
    statuses: BTreeMap<u16, u64>,
    drawn: Vec<Duration>,
    broken: u64,
}

fn main() -> ExitCode {
    let options = options();
    let mesh = std::fs::read(&options.mesh).unwrap_or_else(|e| panic!("{}: {e}", options.mesh));
    let (mut child, address) = match &options.url {
        Some(url) => (None, url.clone()),
        None => {
            let (child, address) = start(&options.serve);
            println!("server idle: {} kB resident", resident_bytes(&child).unwrap_or(0) / 1024);
            (Some(child), address)
        }
    };
    let head = format!(
        "POST /v1/render?{} HTTP/1.1\r\nHost: {address}\r\nContent-Length: {}\r\n\r\n",
        options.query,
        mesh.len()
    );
    let request = [head.as_bytes(), &mesh].concat();
    println!(
        "{} connections post {} ({} bytes) with {} for {} s",
        options.connections,
        options.mesh,
        mesh.len(),
        options.query,
        options.seconds
    );

    let stop = AtomicBool::new(false);
    let mut resident = Vec::new();
    let began = Instant::now();
    let seen: Vec<Seen> = std::thread::scope(|scope| {
        let clients: Vec<_> =
            (0..options.connections).map(|_| scope.spawn(|| client(&address, &request, &stop))).collect();
        while began.elapsed() < Duration::from_secs(options.seconds) {
            std::thread::sleep(Duration::from_millis(500));
            if let Some(bytes) = child.as_ref().and_then(resident_bytes) {
                resident.push(bytes);
            }
        }
        stop.store(true, Ordering::Relaxed);
        clients.into_iter().map(|c| c.join().expect("a client ends")).collect()
    });
    let took = began.elapsed();
    if let Some(child) = &mut child {
        let _ = child.kill();
        let _ = child.wait();
    }
    report(seen, took, &resident)
}

fn options() -> Options {
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/api/examples/knot.obj");
    let mut options = Options {
        mesh: example.into(),
        query: "style=wire".into(),
        connections: 64,
        seconds: 30,
        url: None,
        serve: Vec::new(),
    };
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--mesh" => options.mesh = value(),
            "--query" => options.query = value(),
            "--connections" => options.connections = value().parse().expect("a number"),
            "--seconds" => options.seconds = value().parse().expect("a number"),
            "--url" => options.url = Some(value().trim_start_matches("http://").trim_end_matches('/').to_owned()),
            // Everything after it goes to `meshsnap serve`.
            "--serve" => options.serve = std::iter::once(value()).chain(arguments.by_ref()).collect(),
            other => panic!("there is no option {other}"),
        }
    }
    options
}

fn client(address: &str, request: &[u8], stop: &AtomicBool) -> Seen {
    let mut seen = Seen::default();
    let mut stream = None;
    while !stop.load(Ordering::Relaxed) {
        let began = Instant::now();
        match exchange(&mut stream, address, request) {
            Ok((status, _)) => {
                *seen.statuses.entry(status).or_default() += 1;
                if status == 200 {
                    seen.drawn.push(began.elapsed());
                } else if status == 429 {
                    // A polite client would wait as long as Retry-After says; this one only avoids
                    // spinning.
                    std::thread::sleep(Duration::from_millis(20));
                }
            }
            Err(_) => {
                seen.broken += 1;
                stream = None;
            }
        }
    }
    seen
}

fn report(seen: Vec<Seen>, took: Duration, resident: &[u64]) -> ExitCode {
    let (mut statuses, mut drawn, mut broken) = (BTreeMap::<u16, u64>::new(), Vec::new(), 0);
    for one in seen {
        one.statuses.into_iter().for_each(|(status, count)| *statuses.entry(status).or_default() += count);
        drawn.extend(one.drawn);
        broken += one.broken;
    }
    drawn.sort();
    let quantile = |q: f64| drawn.get(((drawn.len() as f64 - 1.0) * q).round() as usize).copied().unwrap_or_default();
    let total: u64 = statuses.values().sum();
    println!(
        "requests   {total} in {:.1} s, {:.0} pictures a second",
        took.as_secs_f64(),
        drawn.len() as f64 / took.as_secs_f64()
    );
    println!("statuses   {statuses:?}, broken connections {broken}");
    let ms = |d: Duration| d.as_secs_f64() * 1e3;
    println!(
        "latency    p50 {:.1} ms, p99 {:.1} ms, longest {:.1} ms",
        ms(quantile(0.5)),
        ms(quantile(0.99)),
        ms(quantile(1.0))
    );

    let mut failed = broken > 0 || drawn.is_empty() || statuses.keys().any(|s| ![200, 429].contains(s));
    if resident.len() >= 6 {
        let third = resident.len() / 3;
        let mean = |part: &[u64]| part.iter().sum::<u64>() as f64 / part.len() as f64;
        let (early, late) = (mean(&resident[third..2 * third]), mean(&resident[2 * third..]));
        let samples: Vec<String> =
            resident.iter().step_by(resident.len().div_ceil(12)).map(|b| (b >> 20).to_string()).collect();
        println!("resident   {} MiB over time", samples.join(" "));
        println!("growth     {:.3} from the second third to the last", late / early);
        failed |= late > early * GROWTH_MAX;
    }
    println!("{}", if failed { "FAILED" } else { "passed" });
    ExitCode::from(u8::from(failed))
}
