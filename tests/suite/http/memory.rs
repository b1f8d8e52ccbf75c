//! `--memory-bytes`, one budget of memory for everything that the server does and keeps: caches
//! give way to uploads, what does not fit is refused, and all memory of jobs and answers is given
//! back.

use std::io::Write as _;
use std::time::{Duration, Instant};

use crate::support::server::{Answer, CUBE_OBJ, PATIENCE, Server};

/// Bytes of an account, as /metrics shows them.
fn account(server: &Server, name: &str) -> u64 {
    gauge(server, &format!("meshsnap_memory_bytes{{account=\"{name}\"}}"))
}

fn gauge(server: &Server, name: &str) -> u64 {
    let text = String::from_utf8(server.get("/metrics").body).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    line.unwrap_or_else(|| panic!("{name} is not in {text}")).trim().parse().unwrap()
}

fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A mesh of so many triangles that share no vertices, so that none of them are welded.
fn soup(triangles: usize) -> Vec<u8> {
    let mut text = String::new();
    for i in 0..triangles {
        let (x, y) = ((i % 500) as f64, (i / 500) as f64);
        text += &format!("v {x} {y} 0\nv {} {y} 0\nv {x} {} 0\nf -3 -2 -1\n", x + 0.4, y + 0.4);
    }
    text.into_bytes()
}

#[test]
fn what_never_fits_is_the_requests_fault_and_names_the_flag() {
    let server = Server::start(&["--memory-bytes", "16MiB", "--workers", "1"]);
    assert_eq!(gauge(&server, "meshsnap_memory_budget_bytes"), 16 << 20);
    let answer = server.post("/v1/render?size=16", &soup(100_000));
    answer.problem(413, "body_too_large");
    assert_eq!(answer.json()["flag"], "--uploads-bytes");
    // 1.5 MB of text that takes more than 8 MB as it is read.
    let answer = server.post("/v1/render?style=flat&size=1024&samples=16", &soup(25_000));
    answer.problem(422, "limit_exceeded");
    assert_eq!(answer.json()["flag"], "--memory-bytes");
    for _ in 0..3 {
        server.post("/v1/render?size=64", CUBE_OBJ).picture(64, 64);
    }
    assert_eq!((account(&server, "jobs"), account(&server, "uploads")), (0, 0));
}

/// A square of so many points by so many, in colours of which no picture is small.
fn noise(side: usize) -> Vec<u8> {
    let mut seed = 1_u32;
    let mut text = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nelement face {}\nproperty list uchar int \
         vertex_indices\nend_header\n",
        side * side,
        (side - 1) * (side - 1)
    )
    .into_bytes();
    for i in 0..side * side {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        [(i % side) as f32, (i / side) as f32, 0.0].iter().for_each(|number| text.extend(number.to_le_bytes()));
        text.extend(&seed.to_be_bytes()[..3]);
    }
    for i in (0..side * (side - 1)).filter(|i| i % side + 1 < side) {
        text.push(4);
        [i, i + 1, i + side + 1, i + side].iter().for_each(|&corner| text.extend((corner as i32).to_le_bytes()));
    }
    text
}

#[test]
fn answers_that_nobody_reads_count_once_and_are_given_back() {
    const PICTURES: u32 = 3;
    // Half of it is for jobs. An upload that stands still has 7.5 MiB of the other half.
    let server = Server::start(&["--memory-bytes", "32MiB", "--workers", "2", "--least-rate-bytes", "0"]);
    let mut upload = server.connect();
    write!(upload, "POST /v1/render HTTP/1.1\r\nHost: localhost\r\nContent-Length: {}\r\n\r\n", 8 << 20).unwrap();
    upload.write_all(&vec![b'#'; 15 << 19]).unwrap();
    wait_until("the upload arrives", || account(&server, "uploads") == 15 << 19);
    let mesh = noise(100);
    let (mut readers, mut bytes) = (Vec::new(), 0);
    for number in 0..PICTURES {
        let path = format!("/v1/jobs?size={}&samples=1&image.effort=0&view=front&style=unlit", 1500 - number);
        let answer = server.post(&path, &mesh);
        let job = answer.header("location").expect("accepted").to_owned();
        server.request("GET", &job, &["Prefer: wait=60"], b"");
        let result = account(&server, "results");
        assert!(result > 2_500_000, "{result}: {}", server.get(&job).json());
        // Two that read nothing of several answers: what the buffers of their sockets have not taken stays here, once.
        for _ in 0..2 {
            let mut stream = server.connect();
            let question = format!("GET {job}/result HTTP/1.1\r\nHost: localhost\r\n\r\n");
            stream.write_all(question.repeat(8).as_bytes()).unwrap();
            // The server has begun to answer.
            stream.peek(&mut [0; 1]).unwrap();
            readers.push(stream);
        }
        // The first answers are on their way, and the next one waits.
        std::thread::sleep(Duration::from_millis(500));
        server.request("DELETE", &job, &[], b"");
        bytes += result;
        // Each counts once, however many read it. The buffers of a socket may grow, and take one after a while.
        let waiting = account(&server, "answers");
        assert!(waiting <= bytes && waiting > 0, "{waiting} of {bytes}");
        assert_eq!(account(&server, "results"), 0);
    }
    let refused = server.post("/v1/render?size=16", CUBE_OBJ);
    println!("{} of {bytes} bytes wait", account(&server, "answers"));
    refused.problem(429, "memory_full");
    assert!(refused.header("retry-after").is_some());
    assert_eq!(refused.json()["flag"], "--memory-bytes");
    assert_eq!(server.get("/healthz").status, 200);
    Answer::read(&mut readers[0]).picture(1500, 1500);
    drop((readers, upload));
    wait_until("clients that went away hold memory", || account(&server, "answers") + account(&server, "uploads") == 0);
    server.post("/v1/render?size=64", CUBE_OBJ).picture(64, 64);
    assert_eq!(account(&server, "jobs"), 0);
}

#[test]
fn caches_make_room_for_uploads() {
    let server = Server::start(&["--memory-bytes", "48MiB", "--workers", "1"]);
    let mut stored = Vec::new();
    for number in 0..7 {
        let mesh = [soup(18_000).as_slice(), format!("# {number}\n").as_bytes()].concat();
        let location = server.post("/v1/meshes", &mesh).header("location").unwrap().to_owned();
        server.get(&format!("{location}/render.png?size=64")).picture(64, 64);
        stored.push(location);
    }
    let before = account(&server, "residents");
    assert!(before > 0 && account(&server, "pictures") > 0);
    // All but jobs may have 24 MiB, of which half are for uploads. Stored meshes and those that are kept as they are drawn
    // have more than the other half.
    let large = [CUBE_OBJ, &[b'#'; 9_000_000]].concat();
    server.post("/v1/render?size=64", &large).picture(64, 64);
    let after = account(&server, "residents");
    println!("meshes in memory: {before} bytes, then {after}");
    assert!(after < before);
    for location in &stored {
        server.get(&format!("{location}/render.png?size=65")).picture(65, 65);
    }
    assert_eq!(account(&server, "jobs"), 0);
}

#[test]
fn jobs_that_need_more_than_there_is_at_once_take_turns() {
    const JOBS: usize = 10;
    // Each takes some 40 MiB, which nobody knows at first, and there is room for two.
    let server = Server::start(&["--memory-bytes", "160MiB", "--workers", "4"]);
    let mesh = soup(60_000);
    let drawn = std::thread::scope(|scope| {
        let clients: Vec<_> = (0..JOBS)
            .map(|number| {
                let (server, mesh) = (&server, &mesh);
                scope.spawn(move || {
                    let began = Instant::now();
                    loop {
                        let answer = server.post(&format!("/v1/render?style=flat&size={}", 64 + number), mesh);
                        match answer.status {
                            200 => return 1,
                            429 => assert!(answer.header("retry-after").is_some()),
                            other => panic!("{other}: {}", String::from_utf8_lossy(&answer.body)),
                        }
                        assert!(began.elapsed() < PATIENCE);
                        std::thread::sleep(Duration::from_millis(50));
                    }
                })
            })
            .collect();
        let mut most = 0;
        while clients.iter().any(|client| !client.is_finished()) {
            let accounts = ["jobs", "uploads", "answers", "residents", "pictures", "results", "meshes"];
            most = most.max(accounts.iter().map(|name| account(&server, name)).sum());
        }
        println!("at most {most} bytes");
        assert!(most <= 161 << 20, "{most}");
        clients.into_iter().map(|client| client.join().unwrap()).sum::<usize>()
    });
    assert_eq!(drawn, JOBS);
    assert_eq!((account(&server, "jobs"), account(&server, "uploads")), (0, 0));
}
