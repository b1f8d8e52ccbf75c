//! Latency of jobs beside a decoder that crashes, against the same beside one that does its work.
//!
//!     cargo bench --profile dev --bench crashes                  # 10 rounds of two halves, 2 s each
//!     cargo bench --profile dev --bench crashes -- --rounds 30
//!
//! A mark in the file asks for the crash. Only builds with debug assertions understand it: hence
//! the profile. Two connections post a cube without a pause. A third posts an FBX file, with pauses
//! of 25 ms: in one half of a round a good one, in the other half one that makes the decoding
//! process abort. The halves take turns, so that the machine's other load meets both. Ends with a
//! failure if p99 beside crashes is more than 1.2 times the other, or if fewer than 100 files of
//! either kind were posted.

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod served;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use served::{exchange, start};

const RATIO_MAX: f64 = 1.2;
const HALF: Duration = Duration::from_secs(2);
const PAUSE: Duration = Duration::from_millis(25);
const CONNECTIONS: usize = 2;
const MARK: &[u8] = b"; FBX 7.4.0 project file\n; meshsnap-test-misbehave:abort\n";
const FBX: &[u8] = include_bytes!("../../fuzz/seeds/fbx/cube.fbx");
const CUBE: &[u8] = b"v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn main() -> ExitCode {
    if !cfg!(debug_assertions) {
        println!("this build makes no decoder crash: cargo bench --profile dev --bench crashes");
        return ExitCode::FAILURE;
    }
    let mut rounds = 10;
    let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(name) = arguments.next() {
        match name.as_str() {
            "--rounds" => rounds = arguments.next().expect("--rounds needs a value").parse().expect("a number"),
            other => panic!("there is no option {other}"),
        }
    }
    let (mut child, address) = start(&["--workers", "3"].map(str::to_owned));
    let good = [b"; FBX 7.4.0 project file\n".as_slice(), FBX].concat();
    let bad = [MARK, FBX].concat();
    // The first half warms up.
    half(&address, &good, 200);
    let (mut beside_good, mut beside_bad) = (Half::default(), Half::default());
    for _ in 0..rounds {
        beside_good.add(half(&address, &good, 200));
        beside_bad.add(half(&address, &bad, 422));
    }
    let _ = child.kill();
    let _ = child.wait();
    report(beside_good, beside_bad)
}

/// Times of a cube's pictures, and the FBX files that were posted meanwhile.
#[derive(Default)]
struct Half {
    took: Vec<Duration>,
    files: u32,
}

impl Half {
    fn add(&mut self, other: Self) {
        self.took.extend(other.took);
        self.files += other.files;
    }

    fn ms(&mut self, quantile: f64) -> f64 {
        self.took.sort();
        let at = ((self.took.len() as f64 - 1.0) * quantile).round() as usize;
        self.took.get(at).map_or(0.0, |took| took.as_secs_f64() * 1e3)
    }
}

/// Posts for two seconds. Every FBX file is answered with `expected`.
fn half(address: &str, fbx: &[u8], expected: u16) -> Half {
    let (cube, fbx) = (request(address, CUBE), request(address, fbx));
    let stop = AtomicBool::new(false);
    let post_cubes = || {
        let (mut stream, mut took) = (None, Vec::new());
        while !stop.load(Ordering::Relaxed) {
            let began = Instant::now();
            let (status, _) = exchange(&mut stream, address, &cube).expect("the server answers");
            assert_eq!(status, 200);
            took.push(began.elapsed());
        }
        took
    };
    let post_files = || {
        let (mut stream, mut files) = (None, 0);
        while !stop.load(Ordering::Relaxed) {
            let (status, _) = exchange(&mut stream, address, &fbx).expect("the server answers");
            assert_eq!(status, expected);
            files += 1;
            std::thread::sleep(PAUSE);
        }
        files
    };
    std::thread::scope(|scope| {
        let clients: Vec<_> = (0..CONNECTIONS).map(|_| scope.spawn(post_cubes)).collect();
        let files = scope.spawn(post_files);
        std::thread::sleep(HALF);
        stop.store(true, Ordering::Relaxed);
        let took = clients.into_iter().flat_map(|client| client.join().expect("a client ends")).collect();
        Half { took, files: files.join().expect("a client ends") }
    })
}

fn request(address: &str, body: &[u8]) -> Vec<u8> {
    let length = body.len();
    let head = format!("POST /v1/render?size=128 HTTP/1.1\r\nHost: {address}\r\nContent-Length: {length}\r\n\r\n");
    [head.as_bytes(), body].concat()
}

fn report(mut good: Half, mut bad: Half) -> ExitCode {
    for (name, half) in [("good files", &mut good), ("crashes", &mut bad)] {
        println!(
            "beside {name:10} {:5} pictures, p50 {:.2} ms, p99 {:.2} ms, longest {:.2} ms; {} FBX files",
            half.took.len(),
            half.ms(0.5),
            half.ms(0.99),
            half.ms(1.0),
            half.files
        );
    }
    let ratio = bad.ms(0.99) / good.ms(0.99);
    let failed = ratio.is_nan() || ratio > RATIO_MAX || good.files.min(bad.files) < 100;
    println!("p99 beside crashes / beside good files: {ratio:.2}, at most {RATIO_MAX}");
    println!("{}", if failed { "FAILED" } else { "passed" });
    ExitCode::from(u8::from(failed))
}
