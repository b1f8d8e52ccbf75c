//! `Idempotency-Key`: a request that is sent again makes no second job.

use std::collections::BTreeSet;

use super::durable::start;
use crate::http::answers::{FORM, form};
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};

fn send(server: &Server, path: &str, headers: &[&str], body: &[u8]) -> Answer {
    server.request("POST", path, headers, body)
}

#[track_caller]
fn job(answer: &Answer) -> String {
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    answer.header("location").unwrap().to_owned()
}

#[test]
fn the_same_request_is_the_same_job_and_another_is_refused() {
    let server = Server::start(&[]);
    let (key, path) = ("Idempotency-Key: 8e03978e-40d5-43dd-bc93-6894a57f9324", "/v1/jobs?size=16");
    let first = job(&send(&server, path, &[key], CUBE_OBJ));
    assert_eq!(job(&send(&server, path, &[key], CUBE_OBJ)), first);
    server.request("GET", &first, &["Prefer: wait=30"], b"");
    let again = send(&server, path, &[key], CUBE_OBJ);
    assert_eq!((job(&again), again.json()["state"].as_str()), (first.clone(), Some("done")));
    let respond = ["Prefer: respond-async", key];
    let again = send(&server, "/v1/render?size=16", &respond, CUBE_OBJ);
    assert_eq!((job(&again), again.header("preference-applied")), (first.clone(), Some("respond-async")));

    let other_mesh = [CUBE_OBJ, b"# other\n"].concat();
    let form = form(&[("file", CUBE_OBJ)]);
    let others: [(&str, &[&str], &[u8]); 6] = [
        ("/v1/jobs?size=17", &[key], CUBE_OBJ),
        (path, &[key], &other_mesh),
        ("/v1/jobs?size=16&format_in=obj", &[key], CUBE_OBJ),
        ("/v1/jobs?size=16&entry=a.obj", &[key], CUBE_OBJ),
        (path, &[key, "Accept: image/webp"], CUBE_OBJ),
        (path, &[key, FORM], &form),
    ];
    for (path, headers, body) in others {
        send(&server, path, headers, body).problem(422, "idempotency_key_reused");
    }
    // A key stands for nothing once its job is forgotten, and a picture that is waited for needs none.
    assert_eq!(send(&server, "/v1/render?size=17", &[key], CUBE_OBJ).status, 200);
    assert_ne!(job(&send(&server, path, &["Idempotency-Key: other"], CUBE_OBJ)), first);
    server.request("DELETE", &first, &[], b"");
    let second = job(&send(&server, "/v1/jobs?size=17", &[key], CUBE_OBJ));
    assert_ne!(second, first);
}

#[test]
fn keys_are_bounded_and_bad_ones_are_a_400() {
    let server = Server::start(&["--result-count", "2"]);
    let (longest, too_long) =
        (format!("Idempotency-Key: {}", "k".repeat(255)), format!("Idempotency-Key: {}", "k".repeat(256)));
    assert_eq!(send(&server, "/v1/jobs?size=16", &[&longest], CUBE_OBJ).status, 202);
    let bad: [&[&str]; 5] = [
        &[&too_long],
        &["Idempotency-Key:"],
        &["Idempotency-Key: a b"],
        &["Idempotency-Key: é"],
        &["Idempotency-Key: a", "Idempotency-Key: a"],
    ];
    for headers in bad {
        send(&server, "/v1/jobs?size=16", headers, CUBE_OBJ).problem(400, "bad_idempotency_key");
    }
    // A request that was refused leaves its key free.
    let key = "Idempotency-Key: once";
    send(&server, "/v1/jobs?size=0", &[key], CUBE_OBJ).problem(400, "out_of_range");
    let unknown = format!("{{\"mesh\":\"{:064}\"}}", 0);
    send(&server, "/v1/jobs", &[key, "Content-Type: application/json"], unknown.as_bytes())
        .problem(404, "mesh_unknown");
    let first = job(&send(&server, "/v1/jobs?size=16", &[key], CUBE_OBJ));
    // Later jobs make room, and the key goes with its job.
    for _ in 0..4 {
        let later = job(&server.post("/v1/jobs?size=16", CUBE_OBJ));
        server.request("GET", &later, &["Prefer: wait=30"], b"");
    }
    server.get(&first).problem(404, "not_found");
    assert_ne!(job(&send(&server, "/v1/jobs?size=18", &[key], CUBE_OBJ)), first);
}

#[test]
fn an_owner_has_its_own_keys_and_a_full_queue_knows_them() {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--workers", "1", "--queue", "1"]);
    let server = Server::start_with(command.env("MESHSNAP_API_KEYS", "one,two"));
    let key = "Idempotency-Key: a";
    let path = "/v1/jobs?size=4096&samples=16";
    let (one, two) = (["Authorization: Bearer one", key], ["Authorization: Bearer two", key]);
    let first = job(&send(&server, path, &one, CUBE_OBJ));
    let mut filled = 0;
    let full = (0..20).map(|_| send(&server, path, &one[..1], CUBE_OBJ)).inspect(|_| filled += 1);
    let full = { full }.find(|answer| answer.status != 202).expect("a full queue");
    full.problem(429, "queue_full");
    assert_eq!(job(&send(&server, path, &one, CUBE_OBJ)), first, "after {filled}");
    // The other owner's key is another one, so that its request is a new one.
    let other = send(&server, "/v1/jobs?size=16", &two, CUBE_OBJ);
    assert!(other.status == 429 || job(&other) != first);
    server.get(&first).problem(401, "unauthorized");
}

#[test]
fn one_of_many_that_are_sent_at_once_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let server = start(folder.path(), &[]);
    let answers: Vec<Answer> = std::thread::scope(|scope| {
        let send = || send(&server, "/v1/jobs?size=16", &["Idempotency-Key: a"], CUBE_OBJ);
        let clients: Vec<_> = (0..16).map(|_| scope.spawn(send)).collect();
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    let (accepted, early): (Vec<_>, Vec<_>) = answers.iter().partition(|answer| answer.status == 202);
    for answer in &early {
        answer.problem(409, "idempotency_key_in_use");
        assert_eq!(answer.header("retry-after"), Some("1"));
    }
    let jobs: BTreeSet<String> = accepted.iter().map(|answer| job(answer)).collect();
    assert_eq!(jobs.len(), 1, "{jobs:?}");
}

#[test]
fn keys_outlive_the_process_with_their_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let (done, waiting) = ("Idempotency-Key: done", "Idempotency-Key: waiting");
    let slow = "/v1/jobs?size=2048&samples=16";
    let (first, second);
    {
        let server = start(folder.path(), &["--workers", "1"]);
        first = job(&send(&server, "/v1/jobs?size=16", &[done], CUBE_OBJ));
        server.request("GET", &first, &["Prefer: wait=30"], b"");
        for _ in 0..4 {
            job(&server.post(slow, CUBE_OBJ));
        }
        second = job(&send(&server, slow, &[waiting], CUBE_OBJ));
        server.kill_9();
    }
    for _ in 0..2 {
        let server = start(folder.path(), &["--workers", "1"]);
        assert_eq!(job(&send(&server, "/v1/jobs?size=16", &[done], CUBE_OBJ)), first);
        assert_eq!(job(&send(&server, slow, &[waiting], CUBE_OBJ)), second);
        send(&server, slow, &[done], CUBE_OBJ).problem(422, "idempotency_key_reused");
        send(&server, "/v1/jobs?size=16", &[waiting], CUBE_OBJ).problem(422, "idempotency_key_reused");
        server.kill_9();
    }
}
