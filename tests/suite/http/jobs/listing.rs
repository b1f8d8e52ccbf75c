//! `meshsnap jobs`: it lists the jobs of a data folder while a server uses it and after that server
//! was killed, and writes nothing there.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use super::durable::{end_of, start};
use crate::support::server::{CUBE_OBJ, meshsnap};

fn jobs(folder: &Path, arguments: &[&str]) -> Output {
    meshsnap().args(["jobs", "--data-dir"]).arg(folder).args(arguments).output().unwrap()
}

/// The lines of a listing that succeeds.
fn listed(folder: &Path, arguments: &[&str]) -> Vec<String> {
    let output = jobs(folder, arguments);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

fn states(folder: &Path, arguments: &[&str]) -> Vec<(String, String)> {
    let lines = listed(folder, &[&["--jsonl"], arguments].concat());
    let jobs = lines.iter().map(|line| serde_json::from_str::<Value>(line).unwrap());
    jobs.map(|job| (job["id"].as_str().unwrap().to_owned(), job["state"].as_str().unwrap().to_owned())).collect()
}

#[test]
fn jobs_are_listed_beside_a_server_and_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let server = start(folder.path(), &["--workers", "1"]);
    assert_eq!(server.post("/v1/meshes", CUBE_OBJ).status, 201);
    let submit = |query: &str, mesh: &[u8]| {
        let accepted = server.post(&format!("/v1/jobs?{query}"), mesh);
        assert_eq!(accepted.status, 202);
        accepted.header("location").unwrap().to_owned()
    };
    let done = submit("size=16", CUBE_OBJ);
    let failed = submit("size=16", b"no \x1b[31mmesh");
    end_of(&server, &done);
    end_of(&server, &failed);
    assert_eq!(server.get(&format!("{done}/result")).status, 200);
    // One is drawn, the other waits.
    let slow = submit("size=2048&samples=16", &[CUBE_OBJ, b"# a"].concat());
    let waiting = submit("size=2048&samples=16", &[CUBE_OBJ, b"# b"].concat());
    let id = |location: &str| location.rsplit('/').next().unwrap().to_owned();

    let beside = states(folder.path(), &[]);
    let names: Vec<&String> = beside.iter().map(|(id, _)| id).collect();
    assert_eq!(names, [&id(&done), &id(&failed), &id(&slow), &id(&waiting)]);
    assert_eq!((&*beside[0].1, &*beside[1].1), ("done", "failed"));
    assert!(beside[2..].iter().all(|(_, state)| ["queued", "running", "done"].contains(&&**state)), "{beside:?}");
    assert_eq!(states(folder.path(), &["--dead"]), [(id(&failed), "failed".into())]);

    let text = listed(folder.path(), &["--dead"]);
    assert_eq!(text.len(), 2, "{text:?}");
    assert!(text[0].starts_with(&format!("{}  failed ", id(&failed))), "{text:?}");
    assert!(text[0].contains("mesh_unrecognised: ") && !text[0].contains('\x1b'), "{text:?}");
    assert!(text[1].starts_with("4 jobs (") && text[1].contains(", 1 stored mesh in /"), "{text:?}");
    assert!(text[1].contains("1 failed"), "{text:?}");

    server.kill_9();
    let log = std::fs::read(folder.path().join("jobs.redb")).unwrap();
    let after = states(folder.path(), &[]);
    assert_eq!(after.len(), 4);
    assert!(std::fs::read(folder.path().join("jobs.redb")).unwrap() == log, "the log is as the crash has left it");
    // The next server finds what the listing has left.
    let server = start(folder.path(), &["--workers", "2"]);
    for job in [&done, &slow, &waiting] {
        assert_eq!(end_of(&server, job)["state"], "done");
    }
    let line = &listed(folder.path(), &["--jsonl"])[0];
    let first: Value = serde_json::from_str(line).unwrap();
    assert_eq!(
        (first["files"][0].as_str(), first["kind"].as_str(), first["starts"].as_u64()),
        (Some("mesh"), Some("draw"), Some(1))
    );
    assert_eq!(first["result"]["format"], "png");
    assert!(first["fetched_unix_ms"].as_u64() >= first["ended_unix_ms"].as_u64(), "{line}");
    assert_eq!(first["result"]["sha256"].as_str().map(str::len), Some(64));
}

#[test]
fn a_folder_without_jobs_is_said_to_be_none_and_is_not_made() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing");
    for (place, expected) in [(&missing, "is no data folder"), (&folder.path().to_owned(), "is no data folder")] {
        let output = jobs(place, &[]);
        let sentence = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && sentence.contains(expected), "{sentence}");
        assert!(sentence.lines().count() == 1 && sentence.contains("--data-dir") && output.stdout.is_empty());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    std::fs::write(folder.path().join("jobs.redb"), "no log at all").unwrap();
    let output = jobs(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
}
