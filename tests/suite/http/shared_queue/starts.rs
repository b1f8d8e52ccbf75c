//! Settings of a shared queue that are wrong, and starts without it.

use std::process::Command;
use std::time::Duration;

use super::nats::Nats;
use super::{Service, command, job_of};
use crate::http::jobs::durable::end_of;
use crate::http::shared_store::bucket::Bucket;
use crate::http::shared_store::{of_folder, wait};
use crate::support::server::{CUBE_OBJ, Server, meshsnap};

/// Exit code 2, and one sentence with these words.
#[track_caller]
fn usage(command: &mut Command, parts: &[&str]) {
    let output = command.output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    let last = text.lines().last().unwrap_or_default();
    assert!(parts.iter().all(|part| last.contains(part)), "{parts:?}: {text}");
}

#[test]
fn wrong_settings_are_said_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let store = of_folder(folder.path());
    for address in ["http://localhost", "nats://", "nats://localhost/a.b", "nats://user:secret@local host"] {
        usage(&mut command(address, &store, &[]), &["--queue", "nats://HOST:PORT/NAME"]);
    }
    let mut secret = command("nats://user:secret@local host", &store, &[]);
    let shown = String::from_utf8(secret.output().unwrap().stderr).unwrap();
    assert!(!shown.contains("secret"), "{shown}");
    let mut without = meshsnap();
    usage(
        without.args(["serve", "--listen", "127.0.0.1:0", "--queue", "nats://127.0.0.1:1"]),
        &["--queue needs --store"],
    );
    let many = meshsnap().args(["serve", "--queue", "many"]).output().unwrap();
    let text = String::from_utf8(many.stderr).unwrap();
    assert!(many.status.code() == Some(2) && text.contains("or an address: nats://HOST:PORT/NAME"), "{text}");

    let Some(plain) = Nats::start_with(&[]) else { return };
    usage(&mut command(&plain.address(), &store, &[]), &["shared queue", "cannot be used"]);
    let Some(locked) = Nats::start_with(&["-js", "--user", "a", "--pass", "b"]) else { return };
    usage(&mut command(&locked.address(), &store, &[]), &["refuses the credentials"]);
    let wrong = locked.address().replace("nats://", "nats://a:wrong@");
    usage(&mut command(&wrong, &store, &[]), &["refuses the credentials"]);
    let right = locked.address().replace("nats://", "nats://a:b@");
    drop(Server::start_with(&mut command(&right, &store, &["--queue-jobs", "7"])));
    // A queue of other servers with another limit.
    usage(&mut command(&right, &store, &["--queue-jobs", "8"]), &["farm-jobs", "max_msgs 7", "needs 8"]);
    for (flag, text) in [("--queue-credentials-file", "/nonexistent/x"), ("--queue-ca", "/nonexistent/y")] {
        usage(&mut command(&right, &store, &[flag, text]), &[flag, text]);
    }
    usage(&mut command(&right, &store, &["--queue-ca", "/dev/null"]), &["--queue-ca", "no certificate"]);
    // A queue has its jobs in one store, and a store those of one queue.
    let other_folder = tempfile::tempdir().unwrap();
    let other_store = of_folder(other_folder.path());
    usage(&mut command(&right, &other_store, &["--queue-jobs", "7"]), &["farm-jobs", "description", "store"]);
    let renamed = right.replace("/farm", "/barn");
    usage(&mut command(&renamed, &store, &[]), &["the jobs of the queue farm", "--queue names barn"]);
    std::fs::write(folder.path().join("service"), b"{").unwrap();
    usage(&mut command(&right, &store, &["--queue-jobs", "7"]), &["the queue (unreadable)", "remove the object"]);
}

/// NATS with a certificate of an authority of one's own.
#[test]
fn a_queue_is_reached_by_tls() {
    let tls = |name: &str| format!("{}/tests/data/tls/{name}", env!("CARGO_MANIFEST_DIR"));
    let (certificate, key, ca) = (tls("server.pem"), tls("server.key"), tls("ca.pem"));
    let Some(nats) = Nats::start_with(&["-js", "--tls", "--tlscert", &certificate, "--tlskey", &key]) else { return };
    let folder = tempfile::tempdir().unwrap();
    let store = of_folder(folder.path());
    let address = nats.address().replace("nats://", "tls://");
    let server = Server::start_with(&mut command(&address, &store, &["--queue-ca", &ca]));
    let job = job_of(&server.post("/v1/jobs?size=32", CUBE_OBJ));
    assert_eq!(end_of(&server, &job)["state"], "done");
    let output = meshsnap().args(["jobs", "--queue", &address, "--queue-ca", &ca]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = meshsnap().args(["jobs", "--queue", &address]).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && text.contains("certificate"), "{text}");
}

#[test]
fn a_store_that_ignores_conditions_is_refused() {
    let (Some(nats), Some(bucket)) = (Nats::start(), Bucket::start()) else { return };
    bucket.ignore_conditions();
    let mut refused = command(&nats.address(), &Bucket::address(), &[]);
    bucket.introduce(&mut refused);
    usage(&mut refused, &["If-None-Match", "--queue needs another store"]);
}

#[test]
fn a_server_waits_for_its_queue() {
    let Some(mut service) = Service::new() else { return };
    service.nats.kill();
    let log = service.folder.path().join("log");
    let mut child = service.command(&[]).stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap();
    wait("it says what it waits for", || {
        std::fs::read_to_string(&log).is_ok_and(|text| text.contains("waiting for the shared queue"))
    });
    Command::new("sh").arg("-c").arg(format!("kill -TERM {}", child.id())).status().unwrap();
    assert!(child.wait().unwrap().success(), "a signal ends it meanwhile");
    let mut starting = service.command(&[]);
    let server = std::thread::scope(|scope| {
        let starting = scope.spawn(|| Server::start_with(&mut starting));
        std::thread::sleep(Duration::from_millis(500));
        service.nats.start_again();
        starting.join().unwrap()
    });
    assert_eq!(server.post("/v1/jobs?size=32", CUBE_OBJ).status, 202);
}
