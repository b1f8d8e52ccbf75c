//! Jobs of the daemon: queue, deadline, cancellation, drain, and the time for which results are
//! kept.

pub mod disk;
pub mod durable;
pub mod events;
mod idempotency;
mod listing;
mod several;
#[cfg(feature = "otel")]
mod traces;
pub mod webhooks;

use std::io::Write as _;
use std::time::{Duration, Instant};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server, meshsnap};

/// The largest picture: slow enough to be caught at it.
const SLOW: &str = "/v1/render?size=4096";

#[test]
fn a_job_is_accepted_watched_and_fetched() {
    let server = Server::start(&[]);
    let accepted = server.post("/v1/jobs?style=wire&size=64", CUBE_OBJ);
    assert_eq!(accepted.status, 202);
    let location = accepted.header("location").unwrap().to_owned();
    assert_eq!(location, format!("/v1/jobs/{}", accepted.json()["id"].as_str().unwrap()));

    let waited = server.request("GET", &location, &["Prefer: wait=30"], b"");
    assert_eq!(waited.header("preference-applied"), Some("wait=30"));
    let state = waited.json();
    assert_eq!(state["state"], "done", "{state}");
    assert_eq!(state["result"]["content_type"], "image/png");
    assert_eq!(state["result"]["url"], format!("{location}/result"));

    let result = server.get(&format!("{location}/result"));
    result.picture(64, 64);
    let same = server.post("/v1/render?style=wire&size=64", CUBE_OBJ);
    assert_eq!(result.body, same.body);
    assert_eq!(result.header("etag"), same.header("etag"));
    assert!(state["accepted_at"].as_str().is_some_and(|at| at.len() == 24 && at.ends_with('Z')), "{state}");
    assert_eq!(server.request("DELETE", &location, &[], b"").json()["state"], "done", "nothing left to cancel");
    server.get(&location).problem(404, "not_found");
    server.wait_for_load(|load| load["kept_results"] == 0 && load["kept_result_bytes"] == 0);
}

#[test]
fn a_failed_job_says_why_as_the_waiting_client_would_have_heard() {
    let server = Server::start(&[]);
    let location = server.post("/v1/jobs", b"no mesh").header("location").unwrap().to_owned();
    let state = server.request("GET", &location, &["Prefer: wait=30"], b"").json();
    assert_eq!((state["state"].as_str(), state["error"]["status"].as_u64()), (Some("failed"), Some(415)), "{state}");
    server.get(&format!("{location}/result")).problem(415, "mesh_unrecognised");
    server.post("/v1/jobs?size=0", CUBE_OBJ).problem(400, "out_of_range");
}

#[test]
fn respond_async_turns_a_render_into_a_job() {
    let server = Server::start(&[]);
    let answer = server.request("POST", "/v1/render?size=32", &["Prefer: respond-async"], CUBE_OBJ);
    assert_eq!((answer.status, answer.header("preference-applied")), (202, Some("respond-async")));
    let location = answer.header("location").unwrap();
    server.request("GET", location, &["Prefer: wait=30"], b"");
    server.get(&format!("{location}/result")).picture(32, 32);
}

#[test]
fn unfinished_and_cancelled_results_are_a_409() {
    let server = Server::start(&["--workers", "1"]);
    let jobs = [0; 4].map(|_| {
        server.post("/v1/jobs?size=4096", CUBE_OBJ).header("location").expect("a free place in the queue").to_owned()
    });
    let unfinished = server.get(&format!("{}/result", jobs[3]));
    unfinished.problem(409, "not_finished");
    assert!(unfinished.header("retry-after").is_some());
    for job in &jobs {
        let state = server.request("DELETE", job, &[], b"").json();
        assert!(state["state"] == "cancelled" || *job == jobs[0] && state["state"] == "done", "{state}");
    }
    server.get(&format!("{}/result", jobs[3])).problem(409, "cancelled");
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn a_full_queue_is_a_429_at_once_and_loses_nothing() {
    let server = Server::start(&["--workers", "1", "--queue", "1"]);
    let answers: Vec<Answer> = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..12).map(|_| scope.spawn(|| server.post(SLOW, CUBE_OBJ))).collect();
        clients.into_iter().map(|c| c.join().unwrap()).collect()
    });
    let (mut drawn, mut refused) = (0, 0);
    for answer in &answers {
        if answer.status == 200 {
            drawn += 1;
        } else {
            let detail = answer.problem(429, "queue_full");
            let seconds: u64 = answer.header("retry-after").unwrap().parse().unwrap();
            assert!((1..=30).contains(&seconds), "{detail}");
            refused += 1;
        }
    }
    assert!(drawn >= 2 && refused >= 1 && drawn + refused == 12, "{drawn} drawn, {refused} refused");
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn health_answers_while_every_worker_is_busy() {
    let server = Server::start(&["--workers", "1"]);
    let slow = SLOW.replace("/v1/render", "/v1/jobs");
    let jobs: Vec<String> =
        (0..8).map(|_| server.post(&slow, CUBE_OBJ).header("location").unwrap().to_owned()).collect();
    server.wait_for_load(|load| load["running"] == 1);
    assert_eq!(server.get("/healthz").status, 200);
    assert_eq!(server.get("/readyz").status, 200);
    // Both answers came before the worker was free.
    assert!(server.get("/v1/capabilities").json()["load"]["queued"].as_u64().unwrap() > 0);
    for job in &jobs {
        server.request("DELETE", job, &[], b"");
    }
}

#[test]
fn a_job_out_of_time_is_a_504() {
    let server = Server::start(&["--limit-job-ms", "1"]);
    let answer = server.post(SLOW, CUBE_OBJ);
    let detail = answer.problem(504, "deadline");
    assert!(answer.json()["flag"] == "--limit-job-ms" && detail.contains("1 ms"), "{detail}");
    let patient = Server::start(&["--workers", "1", "--limit-job-ms", "20000"]);
    patient.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

/// Waiting takes nothing from a job's time: what would wait for too long is refused when it comes.
#[test]
fn many_jobs_at_one_worker_end_although_they_wait_for_longer_than_a_job_may_take() {
    // On a busy machine a job takes longer, and then it may: 16 times as long as the first one did.
    let slow = "/v1/jobs?size=1500";
    let first = Server::start(&["--workers", "1"]);
    let began = Instant::now();
    first.post("/v1/render?size=1500", CUBE_OBJ).picture(1500, 1500);
    let limit_ms = 16 * began.elapsed().as_millis().max(100);
    let server = Server::start(&["--workers", "1", "--limit-job-ms", &limit_ms.to_string()]);
    let began = Instant::now();
    let jobs: Vec<String> =
        (0..48).map(|_| server.post(slow, CUBE_OBJ).header("location").expect("a 202").to_owned()).collect();
    for job in &jobs {
        let mut state = server.get(job).json();
        while matches!(state["state"].as_str(), Some("queued" | "running")) {
            state = server.request("GET", job, &["Prefer: wait=30"], b"").json();
        }
        assert_eq!(state["state"], "done", "{state}");
    }
    println!("48 jobs at one worker in {:?}, {limit_ms} ms for each", began.elapsed());
    // And with little patience: a 429 that says when.
    let hasty = Server::start(&["--workers", "1", "--batch-wait-ms", "100"]);
    let refused = (0..64).map(|_| hasty.post(slow, CUBE_OBJ)).find(|answer| answer.status != 202);
    let refused = refused.expect("more than 100 ms of work");
    let detail = refused.problem(429, "too_late");
    assert_eq!(refused.json()["flag"], "--batch-wait-ms", "{detail}");
    let seconds: u64 = refused.header("retry-after").unwrap().parse().unwrap();
    assert!((1..60).contains(&seconds), "{detail}");
}

/// Several batch jobs wait, and a thumbnail is drawn before they are.
#[test]
fn a_thumbnail_does_not_wait_behind_batch_jobs() {
    let server = Server::start(&["--workers", "2"]);
    let mesh = server.post("/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
    let slow = SLOW.replace("/v1/render", "/v1/jobs");
    let jobs: Vec<String> =
        (0..12).map(|_| server.post(&slow, CUBE_OBJ).header("location").unwrap().to_owned()).collect();
    server.get(&format!("{mesh}/render.png?size=32")).picture(32, 32);
    let ended = jobs.iter().filter(|job| server.get(job).json()["state"] == "done").count();
    assert!(ended < 12, "the thumbnail came after all of them");
    for job in &jobs {
        server.request("DELETE", job, &[], b"");
    }
}

#[test]
fn a_client_that_hangs_up_frees_its_worker() {
    let server = Server::start(&["--workers", "1"]);
    for _ in 0..5 {
        let mut stream = server.connect();
        let length = CUBE_OBJ.len();
        write!(stream, "POST {SLOW} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n").unwrap();
        stream.write_all(CUBE_OBJ).unwrap();
        drop(stream);
    }
    server.wait_for_load(|load| load["queued"] == 0 && load["running"] == 0);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
}

#[test]
fn a_server_that_leaves_takes_work_for_a_while() {
    let mut server = Server::start(&["--drain-delay-ms", "1h"]);
    assert_eq!(server.get("/readyz").status, 200);
    let began = Instant::now();
    server.terminate();
    while server.get("/readyz").status != 503 {
        assert!(began.elapsed() < PATIENCE, "still ready");
    }
    server.get("/readyz").problem(503, "draining");
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    // Who tells it twice does not wait.
    server.terminate();
    assert_eq!(server.wait().code(), Some(0));

    let mut server = Server::start(&["--drain-delay-ms", "300ms"]);
    let began = Instant::now();
    server.terminate();
    assert_eq!(server.wait().code(), Some(0));
    assert!(began.elapsed() >= Duration::from_millis(300), "{:?}", began.elapsed());
}

#[test]
fn answers_say_to_browsers_what_they_are() {
    let server = Server::start(&[]);
    let answers = [
        (server.post("/v1/render?size=16", CUBE_OBJ), 200, "cross-origin"),
        (server.post("/v1/jobs?size=16", CUBE_OBJ), 202, "same-origin"),
        (server.get("/"), 200, "same-origin"),
        (server.get("/nothing"), 404, "same-origin"),
        (server.get("/metrics"), 200, "same-origin"),
    ];
    for (answer, status, policy) in &answers {
        assert_eq!((answer.status, answer.header("x-content-type-options")), (*status, Some("nosniff")));
        assert_eq!(answer.header("cross-origin-resource-policy"), Some(*policy), "{status}");
    }
    assert_eq!(answers.len(), 5);
}

#[test]
fn a_terminated_server_finishes_what_it_accepted() {
    let mut server = Server::start(&["--workers", "1"]);
    let kept = server.connect();
    std::thread::scope(|scope| {
        let clients: Vec<_> = (0..3).map(|_| scope.spawn(|| server.post(SLOW, CUBE_OBJ))).collect();
        server.wait_for_load(|load| load["running"] == 1 && load["queued"] == 2);
        server.terminate();
        let began = Instant::now();
        loop {
            let ready = server.get("/readyz");
            if ready.status == 503 {
                ready.problem(503, "draining");
                assert!(ready.header("retry-after").is_some());
                break;
            }
            assert!(began.elapsed() < PATIENCE, "still ready");
        }
        let refused = server.post("/v1/render?size=16", CUBE_OBJ);
        refused.problem(503, "draining");
        assert!(refused.header("retry-after").is_some());
        assert_eq!(server.get("/healthz").status, 200);
        for client in clients {
            client.join().unwrap().picture(4096, 4096);
        }
    });
    assert_eq!(server.wait().code(), Some(0));
    drop(kept);
}

#[test]
fn results_are_forgotten_in_time() {
    let server = Server::start(&["--unfetched-ttl-ms", "100"]);
    let location = server.post("/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned();
    let began = Instant::now();
    while server.get(&location).status != 404 {
        assert!(began.elapsed() < PATIENCE, "still there");
        std::thread::sleep(Duration::from_millis(10));
    }
    server.get(&format!("{location}/result")).problem(404, "not_found");
}

#[test]
fn a_fetched_result_is_kept_for_less_long_than_one_that_nobody_fetched() {
    let server = Server::start(&["--result-ttl-ms", "100"]);
    let jobs = [0, 1].map(|_| server.post("/v1/jobs?size=16", CUBE_OBJ).header("location").unwrap().to_owned());
    for job in &jobs {
        server.request("GET", job, &["Prefer: wait=30"], b"");
    }
    server.get(&format!("{}/result", jobs[0])).picture(16, 16);
    let began = Instant::now();
    while server.get(&jobs[0]).status != 404 {
        assert!(began.elapsed() < PATIENCE, "still there");
        std::thread::sleep(Duration::from_millis(10));
    }
    server.get(&format!("{}/result", jobs[1])).picture(16, 16);
}

/// The whole program from a cold start; the best of a few, because other tests run beside this one.
#[test]
fn it_starts_and_idles_small() {
    let smallest = (0..5)
        .map(|_| {
            let server = Server::start_with(meshsnap().args(["serve", "--listen", "127.0.0.1:0"]));
            assert_eq!(server.get("/readyz").status, 200);
            server.resident_bytes()
        })
        .min()
        .unwrap();
    println!("resident {} kB", smallest / 1024);
    assert!(smallest < 40_000_000, "{smallest} bytes");
}
