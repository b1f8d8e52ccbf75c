//! What belongs to the service and not to one of its servers: clients' shares, meshes that are refused, jobs that ask for a
//! GPU, and dead letters.

use std::fmt::Write as _;

use super::{Service, job_of};
use crate::http::jobs::durable::end_of;
use crate::http::shared_store::wait;
use crate::support::gpus::gpus;
use crate::support::server::{CUBE_OBJ, Server, meshsnap};

#[test]
fn clients_have_one_share_of_all_servers() {
    let Some(service) = Service::new() else { return };
    let start = || service.server(&["--quota-per-day", "12"]);
    let [a, b] = [start(), start()];
    let ask = |server: &Server| server.post("/v1/check", CUBE_OBJ);
    for _ in 0..8 {
        assert_eq!(ask(&a).status, 200);
    }
    // While it has not heard of them, the other server admits its own share.
    let mut admitted = 8;
    let mut is_refused = |server: &Server| {
        let status = ask(server).status;
        admitted += u32::from(status == 200);
        assert!([200, 429].contains(&status), "{status}");
        status == 429
    };
    wait("the other server refuses, too", || is_refused(&b));
    wait("so does the first", || is_refused(&a));
    // A piece of work comes back in two hours, and what was admitted beyond the share is waited for.
    let right_s = 7200.0 * f64::from(admitted - 11);
    let waits_s = |server: &Server| {
        let refused = ask(server);
        refused.problem(429, "quota_exceeded");
        refused.header("retry-after").unwrap().parse::<f64>().unwrap()
    };
    let is_right = |waits_s: f64| (right_s - 120.0..=right_s).contains(&waits_s);
    wait("both know all", || is_right(waits_s(&a)) && is_right(waits_s(&b)));
    // A server that starts later learns what is known. No news is under way that it could miss or count twice.
    let c = start();
    let waits_s = waits_s(&c);
    assert!(is_right(waits_s), "{waits_s} s, and not {right_s} s");
    assert_eq!(c.get("/v1/capabilities").status, 200, "looking is no work");
}

/// A sheet of many faces, whose reading takes longer than a job may.
fn sheet() -> Vec<u8> {
    let side = 400;
    let mut obj = String::new();
    for i in 0..side * side {
        let _ = writeln!(obj, "v {} {} {}", i / side, i % side, i * 7 % 5);
    }
    for i in (0..side * (side - 1)).filter(|i| i % side < side - 1) {
        let _ = writeln!(obj, "f {} {} {}", i + 1, i + 2, i + side + 2);
    }
    obj.into_bytes()
}

#[test]
fn meshes_that_keep_workers_busy_are_refused_by_all_servers() {
    let Some(service) = Service::new() else { return };
    let start = || service.server(&["--limit-job-ms", "1", "--overdue-grace-ms", "1"]);
    let [a, b] = [start(), start()];
    let sheet = sheet();
    let refused = |server: &Server| {
        let text = String::from_utf8(server.get("/metrics").body).unwrap();
        text.lines().any(|line| line == "meshsnap_quarantined_meshes 1")
    };
    for server in [&a, &b] {
        server.post("/v1/render?size=64", &sheet).problem(504, "deadline");
    }
    // A worker that has stopped in time is no strike.
    wait("both refuse it", || {
        let are_refused = refused(&a) && refused(&b);
        if !are_refused {
            a.post("/v1/render?size=64", &sheet);
        }
        are_refused
    });
    let c = start();
    assert!(refused(&c), "a new one, too");
    for server in [&a, &b, &c] {
        server.post("/v1/render?size=64", &sheet).problem(422, "mesh_quarantined");
    }
}

#[test]
fn jobs_that_ask_for_a_gpu_find_a_server_that_has_one() {
    let Some(service) = Service::new() else { return };
    if gpus().is_none() {
        return;
    }
    let without = |more: &[&str]| {
        let mut command = service.command(more);
        Server::start_with(command.env("VK_DRIVER_FILES", "/dev/null").env("VK_ICD_FILENAMES", "/dev/null"))
    };
    let [a, b] = [without(&["--workers", "2"]), without(&[])];
    let send =
        |server: &Server, size: u32| job_of(&server.post(&format!("/v1/jobs?backend=gpu&size={size}"), CUBE_OBJ));
    // It waits for a server with a GPU, which may come.
    let early = [send(&a, 31), send(&b, 32)];
    let picture = |server: &Server, job: &str, backend: &str| {
        let end = end_of(server, job);
        assert_eq!(end["state"], "done", "{end}");
        let result = server.get(&format!("{job}/result"));
        assert_eq!(result.header("x-render-backend"), Some(backend));
        result.body
    };
    let with = service.server(&["--workers", "2"]);
    wait("the others know of the new one", || {
        [&a, &b].iter().all(|server| {
            let text = String::from_utf8(server.get("/metrics").body).unwrap();
            text.lines().any(|line| line == "meshsnap_servers 3")
        })
    });
    let later = [send(&a, 33), send(&b, 34), send(&with, 35)];
    for (job, size) in early.iter().chain(&later).zip(31..) {
        let right = with.post(&format!("/v1/render?backend=gpu&size={size}"), CUBE_OBJ);
        assert!(picture(&a, job, "gpu") == right.body);
    }
    let job = job_of(&a.post("/v1/jobs?size=38", CUBE_OBJ));
    picture(&b, &job, "cpu");
}

/// The lines of `meshsnap jobs`.
fn listed(service: &Service, more: &[&str]) -> Vec<serde_json::Value> {
    let mut command = meshsnap();
    command.args(["jobs", "--jsonl", "--queue", &service.nats.address()]).args(more);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn jobs_that_are_given_up_are_dead_letters() {
    let Some(service) = Service::new() else { return };
    let start = || service.server(&["--workers", "1", "--queue-jobs", "700"]);
    let server = start();
    let slow = "/v1/jobs?style=wire&size=2000&samples=16";
    let jobs: Vec<String> = (0..6).map(|_| job_of(&server.post(slow, CUBE_OBJ))).collect();
    server.kill_9();
    let ids: Vec<&str> = jobs.iter().map(|job| job.rsplit('/').next().unwrap()).collect();
    let live = listed(&service, &[]);
    let known = |id: &str| live.iter().any(|job| job["id"] == id && job["owner"].is_string());
    assert!((1..=6).contains(&live.len()) && known(ids[5]) && known(ids[4]), "{live:#?}");
    assert_eq!(listed(&service, &["--dead"]).len(), 0);
    // One that servers have begun five times, and one that the store has damaged.
    let note = br#"{"owner":"local","accepted_unix_ms":5,"starts":5}"#;
    service.nats.publish(&format!("$KV.farm.{}", ids[5].replace('-', "")), note);
    std::fs::write(service.folder.path().join("jobs").join(ids[4].replace('-', "")), b"nothing").unwrap();
    let server = start();
    for (job, code) in [(&jobs[5], "crashed"), (&jobs[4], "internal")] {
        let end = end_of(&server, job);
        assert_eq!((&end["state"], &end["error"]["code"]), (&"failed".into(), &code.into()), "{end}");
    }
    service.nats.publish("farm.dead.00000000000000000000000000000001", b"no letter");
    let dead = listed(&service, &["--dead"]);
    assert_eq!(dead.len(), 3, "{dead:#?}");
    assert_eq!(dead[0]["error"]["code"], "unreadable");
    for (id, code, starts) in [(ids[5], "crashed", 5), (ids[4], "lost", 0)] {
        let letter = dead.iter().find(|letter| letter["id"] == id).unwrap();
        assert_eq!((&letter["error"]["code"], &letter["state"]), (&code.into(), &"failed".into()), "{letter}");
        assert_eq!(letter["starts"], starts, "{letter}");
        assert!(letter["ended_unix_ms"].as_u64() > Some(1_000_000_000_000), "{letter}");
    }
    let text = String::from_utf8(server.get("/metrics").body).unwrap();
    assert!(text.contains("meshsnap_shared_queue_messages{kind=\"dead\"} 3"), "{text}");
    let mut plain = meshsnap();
    let output = plain.args(["jobs", "--dead", "--queue", &service.nats.address()]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains(ids[5]) && text.contains("crashed: ") && text.contains("3 dead letters (3 failed)"),
        "{text}"
    );
    let mut set = meshsnap();
    let output = set.args(["jobs", "--dead"]).env("MESHSNAP_QUEUE", service.nats.address()).output().unwrap();
    assert!(String::from_utf8(output.stdout).unwrap().contains("3 dead letters"));
    for (address, words) in [
        (service.nats.address() + "x", "no queue of this name"),
        ("nats://127.0.0.1:1/farm".to_owned(), "cannot be reached"),
        ("12".to_owned(), "nats://HOST:PORT/NAME"),
    ] {
        let output = meshsnap().args(["jobs", "--queue", &address]).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && text.contains(words) && text.lines().count() == 1, "{text}");
    }
}
