//! The limits of the mesh store: the least recently used mesh is evicted first, and stored bytes
//! never exceed `--mesh-bytes`, in which meshes that are still being drawn count too.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::http::meshes::{head, url};
use crate::support::server::{CUBE_OBJ, PATIENCE, Server};

/// A cube of a name and a size.
fn cube(name: u64, bytes: usize) -> Vec<u8> {
    let mut cube = [CUBE_OBJ, format!("# {name}\n").as_bytes()].concat();
    cube.resize(cube.len().max(bytes), b'\n');
    cube
}

fn there(server: &Server, meshes: &[Vec<u8>]) -> Vec<bool> {
    // Asking is using: of those that are there, the last is now the newest.
    meshes.iter().map(|mesh| head(server, &url(mesh), &[]).status == 200).collect()
}

#[test]
fn the_least_recently_used_makes_room() {
    let server = Server::start(&["--mesh-count", "3"]);
    let meshes: Vec<_> = (0..5).map(|i| cube(i, 0)).collect();
    for mesh in &meshes[..3] {
        assert_eq!(server.post("/v1/meshes", mesh).status, 201);
    }
    // From the oldest: 2, 0, 1.
    server.get(&format!("{}/render.png?size=8", url(&meshes[0]))).picture(8, 8);
    assert_eq!(server.request("PUT", &url(&meshes[1]), &[], &meshes[1]).status, 200);
    assert_eq!(server.post("/v1/meshes", &meshes[3]).status, 201);
    assert_eq!(there(&server, &meshes), [true, true, false, true, false]);
    // They were asked for in their order. From the oldest: 1, 3, 0.
    let document = format!(r#"{{"mesh":"{}","image":{{"width":8,"height":8}}}}"#, &url(&meshes[0])[11..]);
    server.post("/v1/render", document.as_bytes()).picture(8, 8);
    assert_eq!(server.post("/v1/meshes", &meshes[4]).status, 201);
    assert_eq!(there(&server, &meshes), [true, false, false, true, true]);
    let load = server.get("/v1/capabilities").json()["load"].take();
    assert_eq!(load["stored_meshes"], 3);
}

/// Sends a mesh until there is memory for it to be read into.
fn patient(server: &Server, name: u64) {
    let (mesh, began) = (cube(name, 20_000), Instant::now());
    loop {
        let answer = server.post("/v1/meshes", &mesh);
        if answer.status == 201 {
            return;
        }
        answer.problem(429, "uploads_full");
        assert!(began.elapsed() < PATIENCE, "no place for mesh {name}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn many_uploads_at_once_stay_within_the_room() {
    const ROOM: u64 = 100_000;
    let server = Server::start(&["--mesh-bytes", "100000", "--uploads-bytes", "120000", "--mesh-count", "100"]);
    let uploading = AtomicBool::new(true);
    let load = || server.get("/v1/capabilities").json()["load"].take();
    let mut stored = 0;
    std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut looks = 0;
            while uploading.load(Ordering::Relaxed) || looks == 0 {
                let load = load();
                assert!(load["stored_mesh_bytes"].as_u64().unwrap() <= ROOM, "{load}");
                looks += 1;
            }
            looks
        });
        let clients: Vec<_> =
            (0..32).map(|i| (i, &server)).map(|(i, server)| scope.spawn(move || patient(server, i))).collect();
        for client in clients {
            client.join().unwrap();
            stored += 1;
        }
        uploading.store(false, Ordering::Relaxed);
        assert!(watch.join().unwrap() > 0);
    });
    assert_eq!(stored, 32);
    let after = load();
    assert_eq!(after["stored_meshes"], 4, "{after}");
    let bytes = after["stored_mesh_bytes"].as_u64().unwrap();
    assert!((80_000..=ROOM).contains(&bytes), "{after}");
    // All upload memory is back: the largest that fits at all does.
    assert_eq!(server.post("/v1/meshes", &cube(99, 90_000)).status, 201);
    assert_eq!(load()["stored_meshes"], 1);
}

#[test]
fn a_mesh_may_be_deleted_while_it_is_drawn() {
    let server = Server::start(&["--workers", "1", "--mesh-bytes", "30000"]);
    let (first, second) = (cube(1, 20_000), cube(2, 20_000));
    assert_eq!(server.post("/v1/meshes", &first).status, 201);
    let document = format!(r#"{{"mesh":"{}","image":{{"width":4096,"height":4096}}}}"#, &url(&first)[11..]);
    let jobs = [0; 2].map(|_| {
        let accepted = server.post("/v1/jobs", document.as_bytes());
        accepted.header("location").expect("accepted").to_owned()
    });
    assert_eq!(server.request("DELETE", &url(&first), &[], b"").status, 204);
    server.get(&url(&first)).problem(404, "mesh_unknown");
    server.post("/v1/render", document.as_bytes()).problem(404, "mesh_unknown");
    let load = server.get("/v1/capabilities").json()["load"].take();
    assert_eq!(load["stored_meshes"], 0);
    assert!(load["stored_mesh_bytes"].as_u64().unwrap() > 20_000, "it is still being drawn: {load}");
    for job in &jobs {
        assert_eq!(server.request("GET", job, &["Prefer: wait=60"], b"").json()["state"], "done");
        server.get(&format!("{job}/result")).picture(4096, 4096);
    }
    server.wait_for_load(|load| load["stored_mesh_bytes"] == 0);
    assert_eq!(server.post("/v1/meshes", &second).status, 201);
}

#[test]
fn what_is_drawn_keeps_its_room_until_it_is_done() {
    let server = Server::start(&["--workers", "2", "--mesh-bytes", "30000", "--limit-job-ms", "60000"]);
    let (first, second) = (cube(1, 20_000), cube(2, 20_000));
    assert_eq!(server.post("/v1/meshes", &first).status, 201);
    // Two jobs occupy both workers; when they end, one takes the third and the other looks at what
    // was sent meanwhile.
    let document =
        format!(r#"{{"mesh":"{}","style":"topology","image":{{"width":4096,"height":4096}}}}"#, &url(&first)[11..]);
    let jobs =
        [0; 3].map(|_| server.post("/v1/jobs", document.as_bytes()).header("location").expect("accepted").to_owned());
    let answer = server.post("/v1/meshes", &second);
    answer.problem(429, "meshes_full");
    assert_eq!((answer.header("retry-after"), &answer.json()["flag"]), (Some("1"), &"--mesh-bytes".into()));
    for job in &jobs {
        assert_eq!(server.request("GET", job, &["Prefer: wait=60"], b"").json()["state"], "done");
    }
    assert_eq!(server.post("/v1/meshes", &second).status, 201);
    assert_eq!(head(&server, &url(&first), &[]).status, 404);
}
