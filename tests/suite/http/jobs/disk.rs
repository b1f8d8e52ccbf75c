//! A data folder on a disk that cannot be written to, is full, or takes two seconds for each sync.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use super::durable::end_of;
use crate::support::server::{CUBE_OBJ, PATIENCE, Server, meshsnap};
use crate::support::skip::{Need, skip};

/// A server whose data folder is on a disk with faults.
struct Faulty {
    server: Server,
    mode: PathBuf,
    _folder: tempfile::TempDir,
}

impl Faulty {
    /// None where there is no C compiler to build the faults with.
    fn start() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("faults.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/suite/http/jobs/disk_faults.c");
        let mut compile = Command::new("cc");
        let built = compile.args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(source).arg("-ldl").output();
        let Ok(built) = built else {
            skip(Need::Compiler, "cc");
            return None;
        };
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        let (data, mode) = (folder.path().join("data"), folder.path().join("mode"));
        std::fs::write(&mode, "ok").unwrap();
        let mut command = meshsnap();
        command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--ephemeral=false", "--data-dir"]);
        command.arg(&data).env("LD_PRELOAD", &library).env("FAULT_DIR", &data).env("FAULT_MODE", &mode);
        Some(Self { server: Server::start_with(&mut command), mode, _folder: folder })
    }

    fn set(&self, mode: &str) {
        // Renamed into place, because the server reads it at any moment.
        let new = self.mode.with_extension("new");
        std::fs::write(&new, mode).unwrap();
        std::fs::rename(new, &self.mode).unwrap();
    }

    fn submit(&self, number: usize) -> crate::support::server::Answer {
        // Large enough for a file of its own beside the log.
        let body = [CUBE_OBJ, format!("# {number}\n").as_bytes(), &b"#\n".repeat(50_000)].concat();
        self.server.post("/v1/jobs?size=16", &body)
    }

    fn troubles(&self) -> Vec<String> {
        let ready = self.server.get("/readyz");
        assert_eq!(ready.status, 200);
        let ready = ready.json();
        ready["problems"].as_array().into_iter().flatten().map(|it| it["code"].as_str().unwrap().to_owned()).collect()
    }
}

#[test]
fn a_disk_that_cannot_be_written_to_is_a_507_until_it_can() {
    let Some(faulty) = Faulty::start() else { return };
    let server = &faulty.server;
    let location = |answer: crate::support::server::Answer| {
        assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
        answer.header("location").unwrap().to_owned()
    };
    let mut jobs = vec![location(faulty.submit(0))];
    assert_eq!(end_of(server, &jobs[0])["state"], "done");
    let mut refused = 0;
    for (mode, code) in [("ro", "storage_failed"), ("full", "storage_full")] {
        faulty.set(mode);
        for number in 0..5 {
            let answer = faulty.submit(100 + number);
            answer.problem(507, code);
            assert!(answer.header("retry-after").is_some());
            server.post("/v1/meshes", &[CUBE_OBJ, &[b'\n'; 9]].concat()).problem(507, code);
            refused += 2;
        }
        assert_eq!(faulty.troubles(), [code]);
        // Nothing that needs no disk fails.
        assert_eq!(server.get("/healthz").status, 200);
        server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
        server.get(&format!("{}/result", jobs[0])).picture(16, 16);
        faulty.set("ok");
        let began = Instant::now();
        loop {
            let answer = faulty.submit(200 + jobs.len());
            if answer.status == 202 && faulty.troubles().is_empty() {
                jobs.push(location(answer));
                break;
            }
            assert!(began.elapsed() < PATIENCE, "no recovery without a restart");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
    assert_eq!((refused, jobs.len()), (20, 3));
    for job in &jobs {
        assert_eq!(end_of(server, job)["state"], "done");
        server.get(&format!("{job}/result")).picture(16, 16);
    }
}

#[test]
fn a_disk_that_takes_two_seconds_delays_nobody_who_needs_none() {
    const JOBS: usize = 12;
    let Some(faulty) = Faulty::start() else { return };
    let server = &faulty.server;
    faulty.set("slow");
    let (mut slowest_health, mut looks) = (Duration::ZERO, 0);
    let began = Instant::now();
    let jobs: Vec<String> = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..JOBS)
            .map(|number| {
                let small = format!("/v1/jobs?size={}", 16 + number);
                scope.spawn(move || server.post(&small, CUBE_OBJ).header("location").expect("202").to_owned())
            })
            .collect();
        while clients.iter().any(|client| !client.is_finished()) {
            let asked = Instant::now();
            assert_eq!(server.get("/healthz").status, 200);
            slowest_health = slowest_health.max(asked.elapsed());
            server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
            looks += 1;
        }
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    let took = began.elapsed();
    println!("{JOBS} jobs were accepted in {took:?}; the slowest of {looks} looks at health took {slowest_health:?}");
    // They share transactions: one by one they would take a minute at least.
    assert!(took > Duration::from_secs(2) && took < Duration::from_secs(30), "{took:?}");
    assert!(looks > 3 && slowest_health < Duration::from_secs(1), "{slowest_health:?}");
    faulty.set("ok");
    assert!(jobs.iter().all(|job| end_of(server, job)["state"] == "done"));
}
