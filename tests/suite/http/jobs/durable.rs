//! What a data folder keeps: jobs, results and meshes outlive the process, however it ends.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server, meshsnap};
use crate::support::skip::{Need, skip};

/// A server with this data folder.
pub fn start(folder: &Path, arguments: &[&str]) -> Server {
    let mut command = meshsnap();
    command
        .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--ephemeral=false", "--data-dir"])
        .arg(folder);
    Server::start_with(command.args(arguments))
}

fn submit(server: &Server, query: &str) -> String {
    let accepted = server.post(&format!("/v1/jobs?{query}"), CUBE_OBJ);
    assert_eq!(accepted.status, 202, "{}", String::from_utf8_lossy(&accepted.body));
    accepted.header("location").unwrap().to_owned()
}

/// The final state of a job.
pub fn end_of(server: &Server, job: &str) -> serde_json::Value {
    let began = Instant::now();
    loop {
        let state = server.request("GET", job, &["Prefer: wait=30"], b"").json();
        if !matches!(state["state"].as_str(), Some("queued" | "running")) {
            return state;
        }
        assert!(began.elapsed() < PATIENCE, "{state}");
    }
}

/// Numbers that look random: xorshift64, Marsaglia 2003.
fn next(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state >> 8
}

/// Jobs with one of a few requests each. A larger number in `MESHSNAP_KILLS` kills more often.
#[test]
#[expect(clippy::too_many_lines, reason = "one story, told step by step")]
fn every_accepted_job_survives_kill_9_and_ends_once_with_the_right_picture() {
    let kills: u64 = std::env::var("MESHSNAP_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(8);
    let queries: Vec<String> =
        (0..6).map(|i| format!("style=wire&size={}&wire.color=%23{i}{i}4080&backend=cpu", 40 + 8 * i)).collect();
    let expected: Vec<Vec<u8>> = {
        let server = Server::start(&[]);
        queries.iter().map(|query| server.post(&format!("/v1/render?{query}"), CUBE_OBJ).body).collect()
    };
    let folder = tempfile::tempdir().unwrap();
    let mut random = 0x2545_F491_4F6C_DD1D_u64;
    // Locations, with the number of the query and the terminal state if it was seen before a kill.
    let mut jobs: BTreeMap<String, (usize, Option<String>)> = BTreeMap::new();
    let mut seen = 0;
    for round in 0..kills {
        let server = start(folder.path(), &["--workers", "2", "--queue", "100000"]);
        let (accepted, is_over) = (Mutex::new(Vec::new()), AtomicBool::new(false));
        let instant = Duration::from_micros(next(&mut random) % 250_000);
        std::thread::scope(|scope| {
            for client in 0..3_usize {
                let (server, accepted, is_over, queries) = (&server, &accepted, &is_over, &queries);
                scope.spawn(move || {
                    for turn in client.. {
                        let query = turn % queries.len();
                        // The connection breaks when the server dies.
                        let sent =
                            std::panic::catch_unwind(|| server.post(&format!("/v1/jobs?{}", queries[query]), CUBE_OBJ));
                        match sent {
                            Ok(answer) if answer.status == 202 => {
                                accepted.lock().unwrap().push((answer.header("location").unwrap().to_owned(), query));
                            }
                            Ok(answer) => assert_eq!(answer.status, 429, "{}", String::from_utf8_lossy(&answer.body)),
                            Err(_) => return,
                        }
                        if is_over.load(Ordering::Relaxed) {
                            return;
                        }
                    }
                });
            }
            let began = Instant::now();
            while accepted.lock().unwrap().is_empty() {
                assert!(began.elapsed() < PATIENCE, "nothing is accepted");
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(instant);
            // Some ends are seen before the kill, and must not change after it.
            for (job, _) in accepted.lock().unwrap().iter().take(3).cloned().collect::<Vec<_>>() {
                let state = server.get(&job).json();
                if state["state"] == "done" {
                    seen += 1;
                    jobs.insert(
                        job,
                        (
                            usize::MAX,
                            Some(
                                server.get(state["result"]["url"].as_str().unwrap()).header("etag").unwrap().to_owned(),
                            ),
                        ),
                    );
                }
            }
            server.kill_9();
            is_over.store(true, Ordering::Relaxed);
        });
        for (job, query) in accepted.into_inner().unwrap() {
            jobs.entry(job).or_insert((query, None)).0 = query;
        }
        assert!(jobs.len() as u64 > round, "{} jobs", jobs.len());
    }
    let server = start(folder.path(), &["--workers", "2"]);
    for (job, (query, tag)) in &jobs {
        let state = end_of(&server, job);
        assert_eq!(state["state"], "done", "{job}: {state}");
        let result = server.get(&format!("{job}/result"));
        assert!(result.body == expected[*query], "{job}: another picture than that of {}", queries[*query]);
        assert!(
            tag.as_deref().is_none_or(|tag| result.header("etag") == Some(tag)),
            "{job}: another picture than before"
        );
        assert_eq!(server.get(job).json()["state"], "done");
    }
    println!(
        "{kills} kills: {} accepted, all done with the right picture; {seen} of them had been fetched before",
        jobs.len()
    );
}

#[test]
fn a_terminated_server_leaves_results_for_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let (done, failed, cancelled, tag);
    {
        let mut server = start(folder.path(), &["--workers", "1"]);
        done = submit(&server, "size=64&style=wire");
        failed = server.post("/v1/jobs", b"no mesh").header("location").unwrap().to_owned();
        let slow = submit(&server, "size=4096&samples=16");
        cancelled = slow;
        assert!(matches!(
            server.request("DELETE", &cancelled, &[], b"").json()["state"].as_str(),
            Some("cancelled" | "done")
        ));
        end_of(&server, &failed);
        tag = server.post("/v1/render?size=64&style=wire", CUBE_OBJ).header("etag").unwrap().to_owned();
        server.terminate();
        assert_eq!(server.wait().code(), Some(0));
    }
    for _ in 0..2 {
        let server = start(folder.path(), &[]);
        let state = server.get(&done).json();
        assert_eq!(
            (state["state"].as_str(), state["result"]["content_type"].as_str()),
            (Some("done"), Some("image/png")),
            "{state}"
        );
        let result = server.get(&format!("{done}/result"));
        result.picture(64, 64);
        assert_eq!(result.header("etag"), Some(tag.as_str()));
        assert!(result.header("server-timing").is_some_and(|timing| timing.contains("render;dur=")));
        server.get(&format!("{failed}/result")).problem(415, "mesh_unrecognised");
        assert_eq!(server.get(&failed).json()["error"]["code"], "mesh_unrecognised");
        assert!(matches!(server.get(&cancelled).json()["state"].as_str(), Some("cancelled" | "done")));
    }
}

#[test]
fn stored_meshes_and_jobs_on_deleted_ones_outlive_a_crash() {
    let folder = tempfile::tempdir().unwrap();
    let large = [b"# ".repeat(100_000), b"\n".to_vec(), CUBE_OBJ.to_vec()].concat();
    let (kept, picture, deleted, job);
    {
        let server = start(folder.path(), &[]);
        kept = server.post("/v1/meshes?format_in=obj", &large).header("location").unwrap().to_owned();
        deleted = server.post("/v1/meshes", CUBE_OBJ).header("location").unwrap().to_owned();
        picture = server.get(&format!("{kept}/render.png?size=48&backend=cpu")).body;
        let sha256 = kept.rsplit('/').next().unwrap();
        // A document names the mesh of a job, which goes on when the mesh is deleted.
        let document = format!(
            "{{\"mesh\": \"{}\", \"image\": {{\"width\": 48, \"height\": 48}}}}",
            deleted.rsplit('/').next().unwrap()
        );
        let accepted = server.request(
            "POST",
            "/v1/jobs?backend=cpu&format=webp",
            &["Content-Type: application/json"],
            document.as_bytes(),
        );
        job = accepted.header("location").unwrap().to_owned();
        assert_eq!(server.request("DELETE", &deleted, &[], b"").status, 204);
        assert_eq!(sha256.len(), 64);
        server.kill_9();
    }
    let server = start(folder.path(), &[]);
    let report = server.get(&format!("{kept}?format_in=obj"));
    assert_eq!((report.status, report.json()["format"].as_str()), (200, Some("obj")), "{:?}", report.json());
    assert_eq!(server.get(&format!("{kept}/render.png?size=48&backend=cpu")).body, picture);
    assert_eq!(server.post("/v1/meshes?format_in=obj", &large).status, 200, "known");
    let state = end_of(&server, &job);
    assert_eq!(state["state"], "done", "{state}");
    assert_eq!(server.get(&format!("{job}/result")).header("content-type"), Some("image/webp"));
    // A deletion is stored soon after its answer. If it was not, the mesh is there still and can be deleted again.
    assert!(matches!(server.request("DELETE", &deleted, &[], b"").status, 204 | 404));
}

#[test]
fn a_data_folder_has_one_server_and_results_have_their_caps() {
    let folder = tempfile::tempdir().unwrap();
    let server = start(folder.path(), &["--workers", "1", "--result-count", "2"]);
    let mut second = meshsnap();
    second.args(["serve", "--listen", "127.0.0.1:0", "--ephemeral=false", "--data-dir"]).arg(folder.path());
    let refused = second.output().unwrap();
    let sentence = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && sentence.contains("--ephemeral"), "{sentence}");
    let jobs: Vec<String> = (0..4).map(|_| submit(&server, "size=16")).collect();
    for job in &jobs[2..] {
        end_of(&server, job);
    }
    assert_eq!(server.get(&jobs[0]).status, 404, "the oldest has made room");
    drop(server);
    let server = start(folder.path(), &["--result-count", "2"]);
    let found: Vec<u16> = jobs.iter().map(|job| server.get(job).status).collect();
    assert_eq!(found[2..], [200, 200], "{found:?}");
}

/// The data folder on a small file system of its own, whose server sees it alone.
#[test]
fn a_full_disk_is_a_507_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let may_mount = Command::new("unshare").args(["-rm", "true"]).output().is_ok_and(|output| output.status.success());
    if !may_mount {
        return skip(Need::Mount, "leave to mount a file system (unshare -rm)");
    }
    let binary = meshsnap();
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", "mount -t tmpfs -o size=24m none \"$1\" && shift && exec \"$@\"", "sh"]);
    command.arg(folder.path()).arg(binary.get_program());
    command.args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"]).arg(folder.path());
    let mut server = Server::start_with(&mut command);
    // The server's view of the folder.
    let inside =
        Path::new("/proc").join(server.pid().to_string()).join("root").join(folder.path().strip_prefix("/").unwrap());
    let early: Vec<String> = (0..5).map(|_| submit(&server, "size=64")).collect();
    let filler = inside.join("filler");
    let mut fill = std::fs::File::create(&filler).unwrap();
    while std::io::Write::write_all(&mut fill, &[0; 4096]).is_ok() {}
    let refused = |answer: Answer| {
        answer.problem(507, "storage_full");
        assert!(answer.header("retry-after").is_some());
    };
    let large = [b"# ".repeat(200_000), b"\n".to_vec(), CUBE_OBJ.to_vec()].concat();
    drop(fill);
    refused(server.post("/v1/jobs?size=16", &large));
    refused(server.post("/v1/meshes?format_in=obj", &large));
    // The log has some free pages, so that a few small jobs may fit.
    let mut accepted = Vec::new();
    let full = (0..2000).find_map(|_| {
        let answer = server.post("/v1/jobs?size=16", &CUBE_OBJ.repeat(40));
        if answer.status == 202 {
            accepted.push(answer.header("location").unwrap().to_owned())
        };
        (answer.status != 202).then_some(answer)
    });
    refused(full.expect("a full disk"));
    assert_eq!(server.get("/healthz").status, 200);
    server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    for job in early.iter().chain(&accepted) {
        assert_eq!(end_of(&server, job)["state"], "done");
    }
    std::fs::remove_file(&filler).unwrap();
    let began = Instant::now();
    let late = loop {
        let answer = server.post("/v1/jobs?size=16", &large);
        if answer.status == 202 {
            break answer.header("location").unwrap().to_owned();
        }
        assert!(began.elapsed() < PATIENCE, "no recovery without a restart");
        std::thread::sleep(Duration::from_millis(20));
    };
    for job in early.iter().chain(&accepted).chain([&late]) {
        assert_eq!(end_of(&server, job)["state"], "done");
        assert_eq!(server.get(&format!("{job}/result")).status, 200);
    }
    server.terminate();
    assert_eq!(server.wait().code(), Some(0));
}
