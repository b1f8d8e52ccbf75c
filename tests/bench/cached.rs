//! The server with pictures that are in memory: its requests per second over those of a bare axum
//! handler that answers with the same bytes. The two are measured in turns.
//!
//!     cargo bench --bench cached                              # api/examples/knot.obj, 256 px, 16 connections
//!     cargo bench --bench cached -- --mesh bunny.obj --query 'style=wire&size=512' --rounds 20

// A tool for developers: giving up loudly is fine.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod served;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::http::header;
use axum::routing::get;
use bytes::Bytes;
use served::{exchange, start};

/// The time of a server's turn.
const TURN: Duration = Duration::from_millis(500);
/// Clients at once.
const CONNECTIONS: usize = 16;

fn main() {
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/api/examples/knot.obj");
    let (mut file, mut query, mut rounds) = (example.to_owned(), "style=wire&size=256".to_owned(), 10_usize);
    let mut arguments = std::env::args().skip(1).filter(|argument| argument != "--bench");
    while let Some(name) = arguments.next() {
        let value = arguments.next().unwrap_or_else(|| panic!("{name} needs a value"));
        match name.as_str() {
            "--mesh" => file = value,
            "--query" => query = value,
            "--rounds" => rounds = value.parse().expect("a number"),
            other => panic!("there is no option {other}"),
        }
    }
    let mesh = std::fs::read(&file).unwrap_or_else(|error| panic!("{file}: {error}"));
    let (mut child, address) = start(&[]);
    let post = format!("POST /v1/meshes HTTP/1.1\r\nHost: {address}\r\nContent-Length: {}\r\n\r\n", mesh.len());
    let (status, answer) = exchange(&mut None, &address, &[post.as_bytes(), &mesh].concat()).expect("an answer");
    assert_eq!(status, 201, "{}", String::from_utf8_lossy(&answer));
    let answer: serde_json::Value = serde_json::from_slice(&answer).expect("JSON");
    let path = format!("{}/render.png?{query}", answer["url"].as_str().expect("an address"));
    let ask = |address: &str| format!("GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n").into_bytes();
    let (status, picture) = exchange(&mut None, &address, &ask(&address)).expect("an answer");
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&picture));
    println!("{file}, {query}: {} bytes", picture.len());

    let bare = bare(picture.into());
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        ours.push(rate(&address, &ask(&address)));
        theirs.push(rate(&bare, &ask(&bare)));
    }
    let _ = child.kill();
    let _ = child.wait();
    let median = |rates: &mut Vec<f64>| {
        rates.sort_by(f64::total_cmp);
        rates[rates.len() / 2]
    };
    let (ours, theirs) = (median(&mut ours), median(&mut theirs));
    println!("{ours:.0} pictures a second, bare handler {theirs:.0}, ratio {:.2}", ours / theirs);
}

/// Starts a server that answers everything with these bytes. Its address.
fn bare(picture: Bytes) -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.set_nonblocking(true).expect("a listener");
    let address = listener.local_addr().expect("an address").to_string();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let answer = move || {
                let picture = picture.clone();
                async move { ([(header::CONTENT_TYPE, "image/png")], picture) }
            };
            let listener = tokio::net::TcpListener::from_std(listener).expect("a listener");
            axum::serve(listener, Router::new().fallback(get(answer))).await.expect("it serves");
        });
    });
    address
}

/// Answers a second.
fn rate(address: &str, request: &[u8]) -> f64 {
    let is_over = AtomicBool::new(false);
    let client = || {
        let (mut stream, mut count) = (None, 0_u64);
        while !is_over.load(Ordering::Relaxed) {
            let (status, _) = exchange(&mut stream, address, request).expect("an answer");
            assert_eq!(status, 200);
            count += 1;
        }
        count
    };
    let began = Instant::now();
    let count: u64 = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..CONNECTIONS).map(|_| scope.spawn(client)).collect();
        std::thread::sleep(TURN);
        is_over.store(true, Ordering::Relaxed);
        clients.into_iter().map(|client| client.join().expect("a client ends")).sum()
    });
    count as f64 / began.elapsed().as_secs_f64()
}
