//! Decoders in C run in processes of their own. Files that stand in for exploits make such a process abort, loop,
//! allocate without end, and reach for files, the network and other programs: a 422 each, and other jobs go on.
#![cfg(target_os = "linux")]

use std::io::Write as _;
use std::net::TcpListener;
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::formats::fbx::basics::cube;
use crate::formats::gltf::packed::Sheet;
use crate::support::files::bundle::{read_bundle, zipped};
use crate::support::files::fbx::{Node, ascii, binary};
use crate::support::server::{CUBE_OBJ, Server, meshsnap};
use meshsnap::{Mesh, Renderer, Spec};
use meshsnap_render::import::Bundle;

/// An FBX file that makes the process which reads it misbehave.
fn misbehaving(how: &str) -> Vec<u8> {
    [b"; FBX 7.4.0 project file\n; meshsnap-test-misbehave:", how.as_bytes(), b"\n", &ascii(&cube(vec![]))].concat()
}

fn server() -> Server {
    Server::start(&["--limit-memory-bytes", "256MiB", "--workers", "2"])
}

#[test]
fn an_exploited_decoder_costs_one_job() {
    let server = server();
    let good = binary(&cube(vec![]));
    let expected = server.post("/v1/render?size=32", &good);
    expected.picture(32, 32);
    // Linux refuses each by itself: what is not needed ends the process.
    let listener = TcpListener::bind("127.0.0.1:9").ok();
    let cases = [
        ("abort", "crashed"),
        ("allocate", "took too much memory"),
        ("open", "tried what it may not do"),
        ("write", "tried what it may not do"),
        ("connect", "tried what it may not do"),
        ("run", "tried what it may not do"),
    ];
    for (how, why) in cases {
        let detail = server.post("/v1/render?size=32", &misbehaving(how)).problem(422, "decoder_crashed");
        assert!(detail.contains(why), "{how}: {detail}");
        assert!(server.post("/v1/render?size=32", &good).body == expected.body, "after {how}");
        server.post("/v1/render?size=16", CUBE_OBJ).picture(16, 16);
    }
    assert!(!Path::new("/tmp/meshsnap-was-here").exists());
    drop(listener);
}

/// Bytes of the account of jobs.
fn jobs_hold(server: &Server) -> u64 {
    let text = String::from_utf8(server.get("/metrics").body).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("meshsnap_memory_bytes{account=\"jobs\"} "));
    line.unwrap().parse().unwrap()
}

/// The process may take what is left of the job, and the job no more than the server has: 64 MiB here, where the limit
/// of jobs is 2 GiB.
#[test]
fn the_memory_of_a_decoder_is_the_jobs() {
    let server = Server::start(&["--memory-bytes", "128MiB", "--workers", "1", "--limit-job-ms", "300000"]);
    let detail = server.post("/v1/render?size=32", &misbehaving("allocate")).problem(422, "decoder_crashed");
    assert!(detail.contains(&format!("more than {} bytes", 64 << 20)), "{detail}");
    server.post("/v1/render?size=32", &binary(&cube(vec![]))).picture(32, 32);
    // A file of comments that is held twice, here and there, while its process hangs.
    let file = [misbehaving("loop"), vec![b';'; 20 << 20]].concat();
    let mut stream = server.connect();
    let head = format!("POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", file.len());
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(&file).unwrap();
    let wanted = |hold: u64| hold >= 2 * file.len() as u64;
    let began = Instant::now();
    while !wanted(jobs_hold(&server)) {
        assert!(began.elapsed() < Duration::from_secs(60), "the job holds {} bytes", jobs_hold(&server));
        std::thread::sleep(Duration::from_millis(5));
    }
    drop(stream);
    while jobs_hold(&server) != 0 {
        assert!(began.elapsed() < Duration::from_secs(90), "a job that has ended holds {} bytes", jobs_hold(&server));
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_decoder_that_hangs_is_ended_and_keeps_nobody_waiting() {
    // On a busy machine, processor time passes slowly.
    let server = Server::start(&["--limit-job-ms", "300000", "--workers", "2"]);
    let good = binary(&cube(vec![]));
    std::thread::scope(|scope| {
        let hang = scope.spawn(|| {
            let began = Instant::now();
            let detail = server.post("/v1/render?size=32", &misbehaving("loop")).problem(422, "decoder_crashed");
            (detail, began.elapsed())
        });
        for _ in 0..20 {
            let began = Instant::now();
            server.post("/v1/render?size=32", &good).picture(32, 32);
            assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
        }
        let (detail, took) = hang.join().unwrap();
        assert!(detail.contains("took too long"), "{detail}");
        assert!(took > Duration::from_secs(5), "{took:?}");
    });
}

/// The job's own deadline ends the process, too.
#[test]
fn a_deadline_ends_the_process() {
    let server = Server::start(&["--limit-job-ms", "1000", "--workers", "1"]);
    server.post("/v1/render?size=32", &misbehaving("loop")).problem(504, "deadline");
    server.post("/v1/render?size=32", &binary(&cube(vec![]))).picture(32, 32);
    let began = Instant::now();
    while children(server.pid()).iter().any(|pid| processor_s(*pid) > 0.5) {
        assert!(began.elapsed() < Duration::from_secs(10), "the process goes on");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The answer of the process is the mesh that the importer makes in this one.
#[test]
fn the_process_reads_the_same_mesh() {
    let server = server();
    let files = [
        ("binary", binary(&cube(vec![]))),
        ("ascii", ascii(&cube(vec![]))),
        ("meshoptimizer", Sheet::new().meshopt("KHR_meshopt_compression").glb()),
    ];
    let spec = Spec::from_json(r#"{"size":32,"style":"wire"}"#);
    for (name, bytes) in files {
        // This binary has set up no process.
        let here = Renderer::cpu().render(&Mesh::read(&bytes).unwrap(), &spec).unwrap().to_png().unwrap();
        assert!(server.post("/v1/render?size=32&style=wire", &bytes).body == here, "{name}");
        let report = read_bundle(&Bundle::of_one(bytes.clone())).unwrap().report;
        let there = server.post("/v1/meshes", &bytes);
        let there = server.get(there.header("location").unwrap()).json();
        assert_eq!(there["format"], report.format.name(), "{name}");
        assert_eq!(there["warnings"].as_array().unwrap().len(), report.warnings.len(), "{name}");
    }
    let broken: &[Node] = &[];
    let nothing = server.post("/v1/render", &binary(broken));
    assert!(nothing.status == 422 && nothing.json()["code"] != "decoder_crashed", "{:?}", nothing.json());
    let many = Server::start(&["--limit-triangles", "3"]);
    let detail = many.post("/v1/render", &binary(&cube(vec![]))).problem(422, "limit_exceeded");
    assert!(detail.contains("--limit-triangles"), "{detail}");
}

/// A process that waits holds no rights, whoever talks to it.
#[test]
fn what_the_kernel_refuses_is_said() {
    let server = server();
    let waiting = children(server.pid());
    assert!(!waiting.is_empty(), "no process waits");
    for pid in waiting {
        // The server starts them in the background, but the first.
        let began = Instant::now();
        while [value_of(pid, "NoNewPrivs:"), value_of(pid, "Seccomp:")] != ["1", "2"] {
            assert!(began.elapsed() < Duration::from_secs(10), "{pid} is not confined");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
    // Formats that need no process start none on a command line.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cube.obj"), CUBE_OBJ).unwrap();
    let mut command = meshsnap();
    let done =
        command.current_dir(&folder).args(["render", "cube.obj", "-o", "a.png", "--size", "16"]).status().unwrap();
    assert!(done.success() && done.signal().is_none());
    let zip = zipped(&[("cube.fbx", &binary(&cube(vec![])))]);
    std::fs::write(folder.path().join("cube.zip"), zip).unwrap();
    let mut command = meshsnap();
    assert!(
        command
            .current_dir(&folder)
            .args(["render", "cube.zip", "-o", "b.png", "--size", "16"])
            .status()
            .unwrap()
            .success()
    );
}

/// A line of a process's status.
fn value_of(pid: u32, name: &str) -> String {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    status.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default().trim().to_owned()
}

/// The processes that a process has started.
fn children(pid: u32) -> Vec<u32> {
    let began = Instant::now();
    loop {
        let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap();
        let of_task =
            |task: std::io::Result<std::fs::DirEntry>| std::fs::read_to_string(task.ok()?.path().join("children")).ok();
        let all: Vec<u32> = tasks
            .filter_map(of_task)
            .flat_map(|list| list.split_whitespace().filter_map(|p| p.parse().ok()).collect::<Vec<_>>())
            .collect();
        if !all.is_empty() || began.elapsed() > Duration::from_secs(5) {
            return all;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Processor time of a process, seconds.
fn processor_s(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / 100.0
}
