//! Servers that are killed, a queue that is away, full, or loses everything: what was accepted ends once all the same.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::{Service, alone, job_of};
use crate::http::jobs::durable::end_of;
use crate::http::jobs::webhooks::Hook;
use crate::http::shared_store::wait;
use crate::support::server::{CUBE_OBJ, PATIENCE, Server};

/// The query of a job of one of a few kinds.
fn query(number: usize) -> String {
    format!("style=wire&size={}&samples=16", 100 + 4 * (number % 5))
}

/// Every job has ended as done, at a server that is asked now, with the picture that a server that is alone draws.
fn all_are_right(server: &Server, jobs: &[String]) {
    let mut pictures = BTreeMap::new();
    for (number, job) in jobs.iter().enumerate() {
        let end = end_of(server, job);
        assert_eq!(end["state"], "done", "{job}: {end}");
        let result = server.get(&format!("{job}/result"));
        let query = query(number);
        let right =
            pictures.entry(query.clone()).or_insert_with(|| alone(&format!("/v1/render?{query}"), CUBE_OBJ).body);
        assert!(result.body == *right, "{job}");
    }
}

#[test]
fn every_accepted_job_ends_although_servers_and_the_queue_are_killed() {
    let Some(mut service) = Service::new() else { return };
    let mut servers: Vec<Server> = (0..3).map(|_| service.server(&["--workers", "1"])).collect();
    let mut jobs = Vec::new();
    for round in 0..6 {
        for _ in 0..5 {
            let answer = servers[jobs.len() % 3].post(&format!("/v1/jobs?{}", query(jobs.len())), CUBE_OBJ);
            // While the queue is away, nothing is accepted that could not be kept.
            if answer.status == 202 {
                jobs.push(job_of(&answer));
            } else {
                assert_eq!(answer.status, 503, "{}", String::from_utf8_lossy(&answer.body));
                std::thread::sleep(Duration::from_millis(100));
            }
        }
        match round {
            1 | 4 => {
                service.nats.kill();
                service.nats.start_again();
            }
            _ => {
                servers[round % 3].kill_9();
                servers[round % 3] = service.server(&["--workers", "1"]);
            }
        }
    }
    assert!(jobs.len() >= 15, "{}", jobs.len());
    all_are_right(&servers[0], &jobs);
    wait("nothing is left of jobs that have ended", || service.objects("jobs") == 0);
    assert_eq!(service.objects("results"), jobs.len());
}

#[test]
fn a_lost_stream_is_made_again_from_the_store() {
    let Some(service) = Service::new() else { return };
    let first = service.server(&["--workers", "1"]);
    let jobs: Vec<String> = (0..12).map(|i| job_of(&first.post(&format!("/v1/jobs?{}", query(i)), CUBE_OBJ))).collect();
    first.kill_9();
    service.nats.delete_stream("farm-jobs");
    let server = service.server(&[]);
    all_are_right(&server, &jobs);
    // Whatever is deleted while servers run is made anew.
    for name in ["farm-jobs", "farm-gpu", "farm-webhooks", "farm-dead", "KV_farm"] {
        service.nats.delete_stream(name);
        all_are_right(&server, &[job_of(&server.post(&format!("/v1/jobs?{}", query(0)), CUBE_OBJ))]);
        wait("the queue is whole", || {
            String::from_utf8(server.get("/metrics").body).unwrap().contains("shared_queue_messages{kind=\"dead\"}")
        });
    }
}

/// NATS 2.9 may keep messages of jobs that have ended, if it is killed.
#[test]
fn messages_about_no_job_are_removed() {
    let Some(service) = Service::new() else { return };
    let server = service.server(&["--queue-jobs", "9"]);
    server.post("/v1/jobs?size=32", CUBE_OBJ);
    let kept = |kind: &str| {
        let text = String::from_utf8(server.get("/metrics").body).unwrap();
        let name = format!("meshsnap_shared_queue_messages{{kind=\"{kind}\"}} ");
        text.lines().find_map(|line| line.strip_prefix(&name)).map(|count| count.parse::<u32>().unwrap())
    };
    // Without a secret, no server takes messages about webhooks.
    service.nats.publish("farm.webhooks.00000000000000000000000000000007", b"");
    wait("it is there", || kept("webhooks") == Some(1));
    wait("it is removed", || kept("webhooks") == Some(0));
}

#[test]
fn a_full_queue_refuses_and_keeps_what_it_has() {
    let Some(service) = Service::new() else { return };
    let limit = ["--queue-jobs", "4", "--workers", "1"];
    let [a, b] = [service.server(&limit), service.server(&limit)];
    let slow = "/v1/jobs?style=wire&size=1500&samples=16";
    let answers: Vec<_> = (0..16).map(|i| [&a, &b][i % 2].post(slow, CUBE_OBJ)).collect();
    let (accepted, refused): (Vec<_>, Vec<_>) = answers.iter().partition(|answer| answer.status == 202);
    assert!(accepted.len() >= 4 && !refused.is_empty(), "{} accepted", accepted.len());
    for answer in refused {
        answer.problem(429, "queue_full");
        assert!(answer.header("retry-after").is_some());
    }
    for answer in accepted {
        assert_eq!(end_of(&b, &job_of(answer))["state"], "done");
    }
    wait("refused jobs leave nothing", || service.objects("jobs") == 0);
}

#[test]
fn without_the_queue_old_jobs_are_told_of_and_new_ones_refused() {
    let Some(mut service) = Service::new() else { return };
    let server = service.server(&[]);
    let job = job_of(&server.post("/v1/jobs?size=32", CUBE_OBJ));
    assert_eq!(end_of(&server, &job)["state"], "done");
    assert_eq!(server.get("/readyz").status, 200);
    service.nats.kill();
    wait("it is not ready", || server.get("/readyz").status == 503);
    server.get("/readyz").problem(503, "queue_unavailable");
    let refused = server.post("/v1/jobs?size=32", CUBE_OBJ);
    refused.problem(503, "queue_unavailable");
    assert!(refused.header("retry-after").is_some());
    assert_eq!(server.get(&format!("{job}/result")).status, 200, "its end is in the store");
    assert_eq!(server.post("/v1/render?size=32", CUBE_OBJ).status, 200, "who waits for a picture needs no queue");
    assert_eq!(server.get("/metrics").status, 200);
    service.nats.start_again();
    wait("it is ready again", || server.get("/readyz").status == 200);
    let job = job_of(&server.post("/v1/jobs?size=33", CUBE_OBJ));
    assert_eq!(end_of(&server, &job)["state"], "done");
}

/// What is cancelled and forgotten while the queue is away stays so, although its messages and notes are still there.
#[test]
fn cancelled_without_the_queue_stays_cancelled() {
    let Some(mut service) = Service::new() else { return };
    let [a, b] = [service.server(&["--workers", "1"]), service.server(&["--workers", "1"])];
    let slow = "/v1/jobs?style=wire&size=2000&samples=16";
    let named =
        |server: &Server, key: &str| server.request("POST", slow, &[&format!("Idempotency-Key: {key}")], CUBE_OBJ);
    let jobs: Vec<String> = (0..10).map(|i| job_of(&named(&a, &format!("key-{i}")))).collect();
    service.nats.kill();
    wait("it is not ready", || b.get("/readyz").status == 503);
    let [cancelled, forgotten] = [&jobs[8], &jobs[9]];
    for job in [cancelled, forgotten] {
        assert_eq!(a.request("DELETE", job, &[], b"").json()["state"], "cancelled");
    }
    assert_eq!(a.request("DELETE", forgotten, &[], b"").status, 200);
    assert_eq!(b.get(cancelled).json()["state"], "cancelled");
    b.get(forgotten).problem(404, "not_found");
    assert_eq!(job_of(&named(&b, "key-7")), jobs[7], "a known request needs no queue");
    named(&b, "key-new").problem(503, "queue_unavailable");
    service.nats.start_again();
    for job in &jobs[..8] {
        assert_eq!(end_of(&b, job)["state"], "done");
    }
    wait("the queue is empty", || service.objects("jobs") == 0);
    for server in [&a, &b] {
        wait("it is cancelled again", || server.get(cancelled).json()["state"] == "cancelled");
        wait("it is forgotten again", || server.get(forgotten).status == 404);
        server.request("DELETE", forgotten, &[], b"").problem(404, "not_found");
    }
}

/// A server that is told to end gives its jobs back at once.
#[test]
fn a_server_that_ends_leaves_its_jobs_to_others() {
    let Some(service) = Service::new() else { return };
    let mut first = service.server(&["--workers", "1"]);
    let jobs: Vec<String> = (0..10).map(|i| job_of(&first.post(&format!("/v1/jobs?{}", query(i)), CUBE_OBJ))).collect();
    let second = service.server(&["--workers", "1"]);
    first.terminate();
    assert!(first.wait().success());
    let began = Instant::now();
    all_are_right(&second, &jobs);
    assert!(began.elapsed() < PATIENCE / 2, "they waited for {:?}", began.elapsed());
}

/// A webhook hears of a job once, from whichever server, also if the one that was to tell it is killed.
#[test]
fn webhooks_are_told_once_by_the_service() {
    let Some(service) = Service::new() else { return };
    let start = || {
        let mut command = service.command(&["--webhooks-to-private", "--webhook-retry-ms", "200"]);
        Server::start_with(command.env("MESHSNAP_WEBHOOK_SECRET", crate::http::jobs::webhooks::SECRET))
    };
    let hook = Hook::new(true);
    let [a, b] = [start(), start()];
    let webhook = [&*format!("Webhook: {}", hook.address)];
    let job = job_of(&a.request("POST", "/v1/jobs?size=32", &webhook, CUBE_OBJ));
    let told = hook.taken();
    assert!(job.ends_with(told["data"]["id"].as_str().unwrap()), "{told}");
    assert_eq!(told["type"], "job.done");
    hook.hears_nothing(Duration::from_millis(500));
    // The receiver is away, and so is then the server that tries.
    hook.set_takes(false);
    let job = job_of(&b.request("POST", "/v1/jobs?size=33", &webhook, CUBE_OBJ));
    hook.refused();
    a.kill_9();
    b.kill_9();
    hook.set_takes(true);
    let _third = start();
    let told = hook.taken();
    assert!(job.ends_with(told["data"]["id"].as_str().unwrap()), "{told}");
    wait("it is settled", || service.objects("webhooks") == 0);
}
