//! Rate limits and daily quotas: how much a client may ask for.

use std::time::{Duration, Instant};

use crate::support::server::{CUBE_OBJ, Server, meshsnap};

fn start(arguments: &[&str]) -> Server {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu"]).args(arguments);
    Server::start_with(command.env("MESHSNAP_API_KEYS", "one,two"))
}

#[test]
fn a_client_that_asks_too_fast_is_told_when_to_come_again() {
    let server = start(&["--rate-per-s", "1", "--rate-burst", "5"]);
    let one = ["Authorization: Bearer one"];
    let ask = || server.request("GET", "/v1/capabilities", &one, b"");
    let began = Instant::now();
    let answers: Vec<_> = (0..30).map(|_| ask()).collect();
    let accepted = answers.iter().filter(|answer| answer.status == 200).count();
    let most = 5 + began.elapsed().as_secs() as usize + 1;
    assert!((5..=most).contains(&accepted), "{accepted} of at most {most}");
    let refused = answers.iter().find(|answer| answer.status != 200).expect("some are refused");
    let detail = refused.problem(429, "rate_limited");
    assert_eq!(
        (refused.header("retry-after"), &refused.json()["flag"]),
        (Some("1"), &"--rate-per-s".into()),
        "{detail}"
    );
    // Others go on, with another key and without.
    assert_eq!(server.request("GET", "/metrics", &["Authorization: Bearer two"], b"").status, 200);
    for _ in 0..20 {
        assert_eq!(server.get("/healthz").status, 200);
        server.get("/v1/capabilities").problem(401, "unauthorized");
    }
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(ask().status, 200, "as Retry-After said");
    let metrics = server.request("GET", "/metrics", &["Authorization: Bearer two"], b"");
    let counted = "meshsnap_rejections_total{code=\"rate_limited\",status=\"429\"}";
    assert!(String::from_utf8_lossy(&metrics.body).contains(counted));
}

#[test]
fn work_of_a_day_is_counted_and_looking_is_not() {
    let server = Server::start(&["--quota-per-day", "2"]);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    let mesh = server.post("/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
    let refused = server.post("/v1/jobs?size=16", CUBE_OBJ);
    refused.problem(429, "quota_exceeded");
    let wait: u64 = refused.header("retry-after").unwrap().parse().unwrap();
    assert!((42_000..=43_200).contains(&wait), "the next one comes in half a day, not in {wait} s");
    assert_eq!(refused.json()["flag"], "--quota-per-day");
    for _ in 0..5 {
        server.get(&format!("{mesh}/render.png?size=16")).picture(16, 16);
    }
}
