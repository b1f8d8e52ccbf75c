//! Small uploads made to cost a lot, sent to a server: each is refused at once, and costs next to nothing.

use crate::bundles_zip::{Raw, archive, crc32};
use crate::server::{Answer, CUBE_OBJ, Server};
use std::time::{Duration, Instant};

/// What an answer may take. A build without optimisation, on a machine that does other things, is no measure.
const TIME_MAX: Duration = Duration::from_millis(if cfg!(debug_assertions) { 1000 } else { 50 });
/// What the server may grow by, at its largest.
const MEMORY_MAX: u64 = 64 << 20;

/// A PNG of this size, whose pixels are not there.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        let body = [kind, data].concat();
        out.extend((data.len() as u32).to_be_bytes());
        out.extend(&body);
        out.extend(crc32(&body).to_be_bytes());
    };
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 6, 0, 0, 0]].concat();
    chunk(b"IHDR", &header);
    // A deflate stream that goes on beyond its end.
    chunk(b"IDAT", &[&[0x78, 0x9c][..], &[0xed; 900]].concat());
    chunk(b"IEND", b"");
    out
}

/// A cube with that texture, in an archive.
fn textured(picture: &[u8]) -> Vec<u8> {
    let obj = b"mtllib m.mtl\nusemtl A\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    let mtl = b"newmtl A\nmap_Kd a.png\n";
    archive(&[Raw::stored("m.obj", obj), Raw::stored("m.mtl", mtl), Raw::stored("a.png", picture)], 3)
}

/// The largest that the process has been, bytes.
fn peak_bytes(server: &Server) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.pid())).unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
}

/// A package whose objects hold each other twice, forty deep.
fn doubling_3mf() -> Vec<u8> {
    let mut model = "<model><resources><object id=\"1\"><mesh><vertices>".to_owned();
    model += "<vertex x=\"0\" y=\"0\" z=\"1\"/><vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/>";
    model += "</vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/></triangles></mesh></object>";
    for level in 2..42 {
        let inner = format!("<component objectid=\"{}\"/>", level - 1).repeat(2);
        model += &format!("<object id=\"{level}\"><components>{inner}</components></object>");
    }
    model += "</resources><build><item objectid=\"41\"/></build></model>";
    let parts = [("[Content_Types].xml", "<Types/>"), ("3D/3dmodel.model", model.as_str())];
    archive(&parts.map(|(name, text)| Raw::stored(name, text.as_bytes())), 2)
}

#[test]
fn every_bomb_is_refused_in_no_time_and_no_memory() {
    let zeros = vec![0; 64 << 20];
    let bomb = Raw::deflated("zeros.obj", &zeros);
    let named = |i: usize| Raw { name: format!("{i}.obj").into(), ..bomb.clone() };
    let cube = || Raw::deflated("cube.obj", CUBE_OBJ);
    let zip = archive(&[cube()], 1);
    let many: Vec<Raw> = (0..65_535).map(|i| Raw::stored(&format!("{i}"), b"")).collect();
    let shared: Vec<Raw> = (0..500)
        .map(|i| Raw { name: format!("{i}.obj").into(), start: (i > 0).then_some(0), ..bomb.clone() })
        .collect();
    let cases: [(&str, Vec<u8>, u16, &str); 13] = [
        ("1000:1, 64 MiB", archive(&[named(0)], 1), 422, "bundle_broken"),
        ("1000:1, 512 MiB", archive(&(0..8).map(named).collect::<Vec<_>>(), 8), 422, "bundle_broken"),
        ("1000:1, 576 MiB", archive(&(0..9).map(named).collect::<Vec<_>>(), 9), 422, "limit_exceeded"),
        ("says 1 kB, is 64 MiB", archive(&[Raw { size: 1000, ..named(0) }], 1), 422, "bundle_broken"),
        ("500 entries share their bytes", archive(&shared, 500), 422, "bundle_broken"),
        ("a zip in a zip", archive(&[Raw::stored("inner.zip", &zip)], 1), 415, "mesh_unrecognised"),
        ("65,535 entries", archive(&many, 65_535), 422, "limit_exceeded"),
        ("a symbolic link", archive(&[Raw { mode: 0o120_777, ..cube() }], 1), 422, "bundle_broken"),
        ("../", archive(&[Raw { name: b"../../etc/cube.obj".into(), ..cube() }], 1), 422, "bundle_broken"),
        ("an absolute name", archive(&[Raw { name: b"/etc/passwd".into(), ..cube() }], 1), 422, "bundle_broken"),
        ("a PNG of 30000 x 30000", textured(&png(30_000, 30_000)), 422, "limit_exceeded"),
        ("a PNG of 2^31 x 2^31", textured(&png(1 << 31, 1 << 31)), 422, ""),
        ("3MF, 2^40 triangles", doubling_3mf(), 422, "limit_exceeded"),
    ];
    // A first picture opens everything that stays open.
    let server = Server::start(&["--workers", "1"]);
    let warm = |path: &str| server.post(path, &zip).picture(16, 16);
    warm("/v1/render?size=16");
    println!("{:32} {:>9} {:>6} {:>9} {:>8}", "upload", "bytes", "status", "time", "memory");
    for (name, body, status, code) in &cases {
        let before = peak_bytes(&server);
        let (mut best, mut answer): (Duration, Option<Answer>) = (Duration::MAX, None);
        for _ in 0..3 {
            let began = Instant::now();
            answer = Some(server.post("/v1/render?size=16", body));
            best = best.min(began.elapsed());
        }
        let answer = answer.unwrap();
        let grown = peak_bytes(&server).saturating_sub(before);
        println!(
            "{name:32} {:>9} {:>6} {:>6.1} ms {:>5} MB",
            body.len(),
            answer.status,
            best.as_secs_f64() * 1e3,
            grown >> 20
        );
        let said = answer.json()["code"].as_str().unwrap().to_owned();
        assert_eq!(answer.status, *status, "{name}: {said}");
        assert!(code.is_empty() || said == *code, "{name}: {said}");
        assert!(best < TIME_MAX, "{name}: {best:?}");
        assert!(grown < MEMORY_MAX, "{name}: {grown} bytes");
    }
    assert_eq!(cases.len(), 13);
    warm("/v1/render?size=16");
}
