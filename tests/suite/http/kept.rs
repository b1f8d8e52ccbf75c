//! The caches of stored meshes and of their pictures: they change no answer, stay within their
//! sizes, and a picture is drawn once.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::sync::atomic::{AtomicBool, Ordering};

use crate::http::meshes::url;
use crate::support::files::bundle::zipped;
use crate::support::server::{Answer, CUBE_OBJ, Server};
use crate::support::shapes;

/// A torus of a size of its own.
fn torus(name: usize) -> Vec<u8> {
    shapes::torus(24 + name).into_bytes()
}

/// Milliseconds of a stage.
fn stage_ms(answer: &Answer, stage: &str) -> Option<f64> {
    let timings = answer.header("server-timing")?;
    timings.split(", ").find_map(|part| part.strip_prefix(&format!("{stage};dur="))?.split(';').next()?.parse().ok())
}

#[test]
fn a_picture_is_drawn_once_and_a_mesh_read_once() {
    let server = Server::start(&[]);
    let mesh = torus(100);
    server.post("/v1/meshes", &mesh);
    let path = |rest: &str| format!("{}/render.png?size=64&{rest}", url(&mesh));
    let first = server.get(&path("style=wire"));
    assert_eq!((first.header("x-cache"), first.header("age")), (Some("miss"), None));
    assert!(!first.header("server-timing").unwrap().contains("resident"));
    let second = server.get(&path("style=wire"));
    assert_eq!(second.header("x-cache"), Some("hit"));
    assert!(second.header("age").unwrap().parse::<u32>().unwrap() < 60);
    assert_eq!((&second.body, second.header("server-timing")), (&first.body, None));
    for name in ["etag", "content-type", "cache-control", "x-render-backend"] {
        assert!(first.header(name).is_some() && first.header(name) == second.header(name), "{name}");
    }
    // The same request in other words, and as a document.
    assert_eq!(server.get(&path("style=wire&view=auto")).header("x-cache"), Some("hit"));
    let document = format!(r##"{{"mesh":"{}","style":"wire","image":{{"height":64,"width":64}}}}"##, &url(&mesh)[11..]);
    let posted = server.post("/v1/render", document.as_bytes());
    assert_eq!((posted.header("x-cache"), &posted.body), (Some("hit"), &first.body));
    assert!(posted.header("content-location").is_some());
    // Another camera is another picture of the same mesh.
    let mut kept_ms = f64::INFINITY;
    for view in ["top", "front", "left", "right", "back"] {
        let turned = server.get(&path(&format!("style=wire&view={view}")));
        assert_eq!(turned.header("x-cache"), Some("miss"));
        kept_ms = kept_ms.min(stage_ms(&turned, "parse").unwrap());
        assert!(turned.header("server-timing").unwrap().contains(";desc=resident"));
    }
    let read_ms = stage_ms(&first, "parse").unwrap();
    assert!(kept_ms < read_ms / 4.0, "{kept_ms} ms, and {read_ms} ms to read it");
    let load = server.get("/v1/capabilities").json()["load"].take();
    assert_eq!((&load["resident_meshes"], &load["kept_pictures"]), (&1.into(), &6.into()));
    assert!(load["resident_mesh_bytes"].as_u64().unwrap() > mesh.len() as u64 / 4, "{load}");
    // What is sent is drawn anew.
    assert_eq!(server.post("/v1/render?size=64", &mesh).header("x-cache"), None);
}

/// Everything that an answer says of a picture, how it came about aside.
fn said(answer: &Answer) -> (u16, [Option<&str>; 5], &[u8]) {
    let names = ["content-type", "etag", "x-warnings", "x-chosen", "x-expected-error"];
    (answer.status, names.map(|name| answer.header(name)), &answer.body)
}

#[test]
fn what_is_kept_changes_no_answer() {
    let kept = Server::start(&["--limit-memory-bytes", "12000000"]);
    let none = Server::start(&["--limit-memory-bytes", "12000000", "--resident-bytes", "0", "--picture-bytes", "0"]);
    let with_warnings = [b"mtllib none.mtl\nusemtl red\n", &torus(4)[..], b"v 2 2 2\nv 3 3 3\nl -1 -2\n"].concat();
    let in_folder = zipped(&[("a.obj", CUBE_OBJ), ("b.obj", &with_warnings)]);
    for server in [&kept, &none] {
        assert_eq!(server.post("/v1/meshes", &with_warnings).status, 201);
        assert_eq!(server.post("/v1/meshes?entry=a.obj", &in_folder).status, 201);
    }
    let looks =
        ["style=wire", "style=outline&view=top", "style=smooth", "max_error=3", "scene.time_s=1", "style=topology"];
    let odd = ["size=2000&samples=16", "size=1500&style=outline&samples=16", "camera.from_file=true", "entry=none.obj"];
    let mut answers = [0; 2];
    for (mesh, entry) in [(&with_warnings, ""), (&in_folder, "entry=a.obj&"), (&in_folder, "entry=b.obj&")] {
        for rest in looks.iter().chain(&odd).chain(&looks) {
            let size = if rest.contains("size") { "" } else { "size=40&" };
            let path = format!("{}/render.png?{entry}{size}{rest}", url(mesh));
            let path = if rest.contains("entry") { path.replacen(entry, "", 1) } else { path };
            let (warm, cold) = (kept.get(&path), none.get(&path));
            if warm.status == 200 {
                assert_eq!(said(&warm), said(&cold), "{path}");
            } else {
                let (mut warm, mut cold) = (warm.json(), cold.json());
                (warm["request_id"], cold["request_id"]) = (0.into(), 0.into());
                assert_eq!(warm, cold, "{path}");
            }
            answers[usize::from(warm.status != 200)] += 1;
        }
    }
    assert!(answers[0] >= 30 && answers[1] >= 6 && answers[0] + answers[1] == 48, "{answers:?}");
}

#[test]
fn what_is_kept_changes_no_byte() {
    let kept = Server::start(&[]);
    let none = Server::start(&["--resident-bytes", "0", "--picture-bytes", "0"]);
    let mesh = torus(40);
    for server in [&kept, &none] {
        server.post("/v1/meshes", &mesh);
    }
    let mut compared = 0;
    for style in ["flat", "smooth", "wire", "outline", "hidden-line", "topology", "wireframe"] {
        for rest in ["view=iso", "view=front&samples=1", "view=top&camera.projection=orthographic", "view=iso"] {
            let path = format!("{}/render.png?size=48&style={style}&{rest}", url(&mesh));
            let (warm, cold) = (kept.get(&path), none.get(&path));
            assert_eq!((warm.status, cold.status, cold.header("x-cache")), (200, 200, Some("miss")), "{path}");
            assert!(warm.body == cold.body, "{path}");
            compared += 1;
        }
    }
    assert_eq!(compared, 28);
    let load = none.get("/v1/capabilities").json()["load"].take();
    assert_eq!((&load["resident_meshes"], &load["kept_pictures"]), (&0.into(), &0.into()));
}

#[test]
fn requests_for_one_picture_draw_it_once() {
    const CLIENTS: usize = 24;
    let server = Server::start(&["--workers", "2"]);
    let mesh = torus(160);
    server.post("/v1/meshes", &mesh);
    let path = format!("{}/render.png?size=512&style=wire&samples=16", url(&mesh));
    let answers: Vec<Answer> = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS).map(|_| scope.spawn(|| server.get(&path))).collect();
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    let of = |source: &str| answers.iter().filter(|answer| answer.header("x-cache") == Some(source)).count();
    assert!(answers.iter().all(|answer| answer.status == 200 && answer.body == answers[0].body));
    assert_eq!((of("miss"), of("hit") + of("coalesced")), (1, CLIENTS - 1));
}

#[test]
fn faults_are_not_kept() {
    let server = Server::start(&["--limit-memory-bytes", "3000000"]);
    let mesh = torus(20);
    assert_eq!(server.post("/v1/meshes", &mesh).status, 201);
    let path = format!("{}/render.png?size=", url(&mesh));
    for _ in 0..3 {
        assert_eq!(server.get(&format!("{path}3000")).status, 422);
        server.get(&format!("{path}16")).picture(16, 16);
    }
}

#[test]
fn the_room_is_never_exceeded_and_no_picture_is_wrong() {
    const ROOM: u64 = 400_000;
    const MESHES: usize = 12;
    let server = Server::start(&["--resident-bytes", "400000", "--picture-bytes", "20000", "--workers", "3"]);
    let meshes: Vec<_> = (0..MESHES).map(torus).collect();
    let path = |i: usize, look: usize| {
        let look = ["style=flat", "style=wire&view=top", "style=outline"][look % 3];
        format!("{}/render.png?size=32&{look}", url(&meshes[i]))
    };
    let sent: Vec<Vec<Vec<u8>>> = (0..MESHES)
        .map(|i| {
            server.post("/v1/meshes", &meshes[i]);
            let query = |look: usize| path(i, look).split_once('?').unwrap().1.to_owned();
            (0..3).map(|look| server.post(&format!("/v1/render?{}", query(look)), &meshes[i]).body).collect()
        })
        .collect();
    let is_busy = AtomicBool::new(true);
    let (mut drawn, mut looks) = (0, 0);
    std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut looks = 0;
            while is_busy.load(Ordering::Relaxed) || looks == 0 {
                let load = server.get("/v1/capabilities").json()["load"].take();
                assert!(load["resident_mesh_bytes"].as_u64().unwrap() <= ROOM, "{load}");
                assert!(load["kept_picture_bytes"].as_u64().unwrap() <= 20_000, "{load}");
                looks += 1;
            }
            looks
        });
        let clients: Vec<_> = (0..6_usize)
            .map(|client| {
                let (server, sent, path) = (&server, &sent, &path);
                scope.spawn(move || {
                    for step in 0..60_usize {
                        // Some meshes are asked for more often than others.
                        let i = (step * step + 5 * client) % (1 + step % MESHES);
                        let answer = server.get(&path(i, step + client));
                        assert!(answer.body == sent[i][(step + client) % 3], "mesh {i}, step {step}");
                    }
                    60
                })
            })
            .collect();
        drawn = clients.into_iter().map(|client| client.join().unwrap()).sum();
        is_busy.store(false, Ordering::Relaxed);
        looks = watch.join().unwrap();
    });
    assert!(drawn == 360 && looks > 3, "{drawn} pictures, {looks} looks");
    let load = server.get("/v1/capabilities").json()["load"].take();
    assert!(load["resident_meshes"].as_u64().unwrap() > 0, "{load}");
}

#[test]
fn a_mesh_that_is_gone_has_no_picture() {
    let server = Server::start(&[]);
    server.post("/v1/meshes", CUBE_OBJ);
    let path = format!("{}/render.png?size=16", url(CUBE_OBJ));
    server.get(&path).picture(16, 16);
    assert_eq!(server.request("DELETE", &url(CUBE_OBJ), &[], b"").status, 204);
    server.get(&path).problem(404, "mesh_unknown");
}
