//! Several servers that are one service: one queue in NATS, one store. Any of them accepts a job, does it, and tells of it.

mod faults;
mod nats;
mod service;
mod starts;

use std::process::Command;
use std::time::Duration;

use self::nats::{Nats, programs};
use crate::http::jobs::durable::end_of;
use crate::http::jobs::events::read_all;
use crate::http::meshes::url;
use crate::http::shared_store::bucket::Bucket;
use crate::http::shared_store::{count_files, of_folder, wait};
use crate::support::server::{Answer, CUBE_OBJ, Server, meshsnap};
use crate::support::skip::{Need, skip};
use meshsnap_server::digest::Digest;

const SHEET_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn command(queue: &str, store: &str, more: &[&str]) -> Command {
    let mut command = meshsnap();
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--queue", queue, "--store", store]);
    command.args(more);
    command
}

/// A service on a folder of this machine.
pub struct Service {
    nats: Nats,
    folder: tempfile::TempDir,
}

impl Service {
    pub fn new() -> Option<Self> {
        Some(Self { nats: Nats::start()?, folder: tempfile::tempdir().unwrap() })
    }

    pub fn command(&self, more: &[&str]) -> Command {
        command(&self.nats.address(), &of_folder(self.folder.path()), more)
    }

    fn server(&self, more: &[&str]) -> Server {
        Server::start_with(&mut self.command(more))
    }

    /// The number of objects in a folder of the store.
    fn objects(&self, folder: &str) -> usize {
        count_files(&self.folder.path().join(folder))
    }
}

/// Sends a job, and returns its address.
pub fn job_of(answer: &Answer) -> String {
    assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
    answer.header("location").unwrap().to_owned()
}

/// What a server that is alone answers.
fn alone(path: &str, body: &[u8]) -> Answer {
    Server::start(&[]).post(path, body)
}

/// The life of jobs at three servers. `left` is the number of objects of jobs that have not ended.
fn story(start: impl Fn() -> Server, left: impl Fn() -> usize) {
    let servers = [start(), start(), start()];
    let [a, b, c] = &servers;
    let job = job_of(&a.post("/v1/jobs?style=wire&size=64", CUBE_OBJ));
    let picture = alone("/v1/render?style=wire&size=64", CUBE_OBJ);
    for server in &servers {
        let end = end_of(server, &job);
        assert_eq!((&end["state"], &end["result"]["bytes"]), (&"done".into(), &picture.body.len().into()), "{end}");
        let result = server.get(&format!("{job}/result"));
        assert_eq!((result.status, result.header("etag")), (200, picture.header("etag")));
        assert!(result.body == picture.body);
        let events = String::from_utf8(read_all(server, &job, "").body).unwrap();
        assert!(events.contains("event: done"), "{events}");
    }

    // A job is followed where it was not accepted, from before its end.
    let slow = job_of(&b.post("/v1/jobs?style=wire&size=1000&samples=16", CUBE_OBJ));
    let events = String::from_utf8(read_all(c, &slow, "").body).unwrap();
    assert!(events.starts_with("event: queued") && events.contains("event: done"), "{events}");

    // Jobs that fail, verdicts, comparisons, forms, and pictures of stored meshes.
    let broken = job_of(&a.post("/v1/jobs?format_in=obj", b"v 0 0 0\nf 1 2 3\n"));
    assert_eq!(end_of(b, &broken)["state"], "failed");
    let alone_broken = alone("/v1/render?format_in=obj", b"v 0 0 0\nf 1 2 3\n");
    let result = c.get(&format!("{broken}/result"));
    assert_eq!((result.status, &result.json()["code"]), (alone_broken.status, &alone_broken.json()["code"]));
    let check = job_of(&b.post("/v1/jobs?kind=check&rules=watertight", CUBE_OBJ));
    assert_eq!(end_of(c, &check)["state"], "done");
    assert_eq!(a.get(&format!("{check}/result")).json(), alone("/v1/check?rules=watertight", CUBE_OBJ).json());
    let part = |name: &str| {
        format!("--b\r\nContent-Disposition: form-data; name=\"mesh\"; filename=\"{name}\"\r\n\r\n{SHEET_OBJ}\r\n")
    };
    let form = format!("{}{}--b--\r\n", part("a.obj"), part("b.obj"));
    let multipart = ["Content-Type: multipart/form-data; boundary=b", "Idempotency-Key: two"];
    let several = || a.request("POST", "/v1/jobs?size=32", &multipart, form.as_bytes()).json();
    let urls = |several: &serde_json::Value| -> Vec<String> {
        several["jobs"].as_array().unwrap().iter().map(|job| job["url"].as_str().unwrap().to_owned()).collect()
    };
    let both = urls(&several());
    assert_eq!((both.len(), &both), (2, &urls(&several())));
    for job in &both {
        assert_eq!(end_of(c, job)["state"], "done", "{job}");
    }
    assert_eq!(a.post("/v1/meshes", CUBE_OBJ).status, 201);
    let json = ["Content-Type: application/json"];
    let document = format!(
        "{{\"mesh\": \"{}\", \"style\": \"flat\", \"image\": {{\"width\": 48, \"height\": 48}}}}",
        Digest::of(CUBE_OBJ)
    );
    let of_stored = job_of(&b.request("POST", "/v1/jobs", &json, document.as_bytes()));
    assert_eq!(end_of(c, &of_stored)["state"], "done");
    let sides = format!("{{\"a\": \"{0}\", \"b\": \"{0}\"}}", Digest::of(CUBE_OBJ));
    let difference = job_of(&c.request("POST", "/v1/jobs?kind=diff", &json, sides.as_bytes()));
    assert_eq!(end_of(a, &difference)["state"], "done");
    assert_eq!(b.get(&format!("{difference}/result")).json()["same"], true);
    // A mesh that is gone fails its job with a reason.
    assert_eq!(a.request("DELETE", &url(CUBE_OBJ), &[], b"").status, 204);

    // A name of a request is known everywhere.
    let named = |server: &Server, path: &str| server.request("POST", path, &["Idempotency-Key: order-66"], CUBE_OBJ);
    let first = job_of(&named(a, "/v1/jobs?size=40"));
    assert_eq!(job_of(&named(b, "/v1/jobs?size=40")), first);
    named(c, "/v1/jobs?size=41").problem(422, "idempotency_key_reused");
    assert_eq!(end_of(c, &first)["state"], "done");
    assert_eq!(job_of(&named(b, "/v1/jobs?size=40")), first, "after its end");
    assert_eq!(a.request("DELETE", &first, &[], b"").status, 200);
    for server in &servers {
        server.get(&first).problem(404, "not_found");
        server.request("DELETE", &first, &[], b"").problem(404, "not_found");
    }
    let again = job_of(&named(c, "/v1/jobs?size=41"));
    assert_eq!((again.clone(), end_of(a, &again)["state"].as_str()), (first, Some("done")), "the name is free again");
    wait("nothing is left of jobs that have ended", || left() == 0);
}

#[test]
fn any_server_accepts_does_and_tells_of_any_job() {
    let programs = programs();
    if programs.len() < 2 {
        skip(Need::Nats, "nats-server, and a later one in target/python");
    }
    for program in programs {
        let (nats, folder) = (Nats::of(program, &["-js"]), tempfile::tempdir().unwrap());
        let store = of_folder(folder.path());
        let left = || ["jobs", "webhooks"].map(|name| count_files(&folder.path().join(name))).iter().sum();
        story(|| Server::start_with(&mut command(&nats.address(), &store, &[])), left);
    }
}

#[test]
fn jobs_are_kept_in_a_bucket() {
    let (Some(nats), Some(bucket)) = (Nats::start(), Bucket::start()) else { return };
    let start = || {
        let mut command = command(&nats.address(), &Bucket::address(), &[]);
        bucket.introduce(&mut command);
        Server::start_with(&mut command)
    };
    story(start, || bucket.names("team/a/jobs/").len());
    // Slow answers and broken connections lose nothing.
    let [a, b] = [start(), start()];
    bucket.hamper(Duration::from_millis(200), 10);
    let jobs: Vec<String> = (0..6).map(|i| job_of(&a.post(&format!("/v1/jobs?size={}", 30 + i), CUBE_OBJ))).collect();
    for job in &jobs {
        assert_eq!(end_of(&b, job)["state"], "done");
    }
}

#[test]
fn each_key_has_its_own_jobs_at_every_server() {
    let Some(service) = Service::new() else { return };
    let start = || Server::start_with(service.command(&[]).env("MESHSNAP_API_KEYS", "one,two"));
    let [a, b] = [start(), start()];
    let ask = |server: &Server, key: &str, method: &str, path: &str, body: &[u8]| {
        let headers = [&*format!("Authorization: Bearer {key}"), "Idempotency-Key: the-same"];
        server.request(method, path, &headers, body)
    };
    let of_one = job_of(&ask(&a, "one", "POST", "/v1/jobs?size=32", CUBE_OBJ));
    let of_two = job_of(&ask(&b, "two", "POST", "/v1/jobs?size=33", CUBE_OBJ));
    assert_ne!(of_one, of_two);
    for (server, path) in [(&a, &of_one), (&b, &of_one), (&b, &format!("{of_one}/events"))] {
        ask(server, "two", "GET", path, b"").problem(404, "not_found");
        ask(server, "two", "DELETE", &of_one, b"").problem(404, "not_found");
        server.get(path).problem(401, "unauthorized");
    }
    wait("it ends", || ask(&b, "one", "GET", &of_one, b"").json()["state"] == "done");
    assert_eq!(ask(&b, "one", "GET", &format!("{of_one}/result"), b"").status, 200);
}

#[test]
fn a_job_is_cancelled_at_any_server() {
    let Some(service) = Service::new() else { return };
    let [a, b] = [service.server(&["--workers", "1"]), service.server(&["--workers", "1"])];
    let slow = "/v1/jobs?style=wire&size=2000&samples=16&view=turntable&sheet.count=8";
    let slow = if a.post(slow, CUBE_OBJ).status == 202 { slow } else { "/v1/jobs?style=wire&size=4000&samples=16" };
    let jobs: Vec<String> = (0..8).map(|_| job_of(&a.post(slow, CUBE_OBJ))).collect();
    // One that is being done, and the last, which waits.
    let state = |server: &Server, job: &str| server.get(job).json()["state"].as_str().unwrap().to_owned();
    wait("some run", || jobs.iter().any(|job| state(&b, job) == "running"));
    let running = jobs.iter().find(|job| state(&b, job) == "running").unwrap_or(&jobs[7]);
    for job in [running, &jobs[7]] {
        let cancelled = b.request("DELETE", job, &[], b"").json();
        assert!(["cancelled", "done"].contains(&cancelled["state"].as_str().unwrap()), "{cancelled}");
        assert_eq!(cancelled["state"], end_of(&a, job)["state"]);
    }
    assert_eq!(state(&a, &jobs[7]), "cancelled");
    a.get(&format!("{}/result", jobs[7])).problem(409, "cancelled");
    for job in &jobs {
        a.request("DELETE", job, &[], b"");
    }
    wait("all objects are gone", || service.objects("jobs") == 0);
}

/// Many clients that want the same few pictures of a stored mesh.
#[test]
fn what_many_ask_for_is_drawn_once() {
    let Some(service) = Service::new() else { return };
    let servers = [service.server(&[]), service.server(&[]), service.server(&[])];
    assert_eq!(servers[0].post("/v1/meshes", CUBE_OBJ).status, 201);
    let json = ["Content-Type: application/json"];
    let document = |i: usize| {
        let (mesh, size) = (Digest::of(CUBE_OBJ), 40 + i % 6);
        format!("{{\"mesh\": \"{mesh}\", \"style\": \"wire\", \"image\": {{\"width\": {size}, \"height\": {size}}}}}")
    };
    let jobs: Vec<String> = std::thread::scope(|scope| {
        let sending: Vec<_> = (0..60)
            .map(|i| {
                let server = &servers[i % servers.len()];
                scope.spawn(move || job_of(&server.request("POST", "/v1/jobs", &json, document(i).as_bytes())))
            })
            .collect();
        sending.into_iter().map(|sending| sending.join().unwrap()).collect()
    });
    let mut sizes = std::collections::BTreeMap::new();
    for (i, job) in jobs.iter().enumerate() {
        assert_eq!(end_of(&servers[(i + 1) % servers.len()], job)["state"], "done");
        let picture = servers[0].get(&format!("{job}/result")).body;
        assert!(*sizes.entry(i % 6).or_insert_with(|| picture.clone()) == picture);
    }
    let drawn = |server: &Server| {
        let text = String::from_utf8(server.get("/metrics").body).unwrap();
        let line =
            text.lines().find(|line| line.starts_with("meshsnap_stage_seconds_count") && line.contains("\"render\""));
        line.map_or(0, |line| line.rsplit(' ').next().unwrap().parse::<u64>().unwrap())
    };
    assert_eq!(servers.iter().map(drawn).sum::<u64>(), 6);
}
