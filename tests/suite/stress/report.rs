//! Reports of `inspect` and warnings of jobs: they say what was dropped, snapped, degenerate or too
//! coarse.

use std::io::Write as _;
use std::process::Stdio;

use crate::support::files::ply::{Encoding, INDICES, Ply, XYZ, list};
use crate::support::server::{Server, meshsnap};

/// Seven good and bad triangles: two good ones, one with NaN, two without area, one too small, and
/// one good one again at positions that the others have too.
const MIXED: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv nan 0 0\nv 2 0 0\nv 0 1e-30 0\nv 1e-30 0 0\nv 1 0 0\nv -0 0 1\n\
                     f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 2 6\nf 2 2 3\nf 1 7 8\nf 1 9 10\n";

/// A triangle in f32 that is `side` long, far away.
fn coarse(side: f64) -> Vec<u8> {
    let vertices = [[1e9, 0.0, 0.0], [1e9 + side, 0.0, 0.0], [1e9, side, 0.0]].map(|p| p.to_vec());
    let ply = Ply::new(Encoding::Little).element("vertex", &XYZ, &vertices);
    ply.element("face", &INDICES, &[list(&[0.0, 1.0, 2.0])]).bytes()
}

fn inspect(arguments: &[&str], file: &[u8]) -> String {
    let mut command = meshsnap();
    command.args(["inspect", "-"]).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(file).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn inspect_counts_what_was_dropped_and_snapped() {
    let report: serde_json::Value = serde_json::from_str(&inspect(&["--json"], MIXED.as_bytes())).unwrap();
    let counts = [
        ("file_vertices", 10),
        ("positions", 4),
        ("polygons", 7),
        ("triangles", 3),
        ("dropped_nonfinite_faces", 1),
        ("dropped_degenerate_faces", 2),
        ("dropped_collapsed_faces", 1),
    ];
    for (name, count) in counts {
        assert_eq!(report[name], count, "{name}: {report}");
    }
    let text = inspect(&[], MIXED.as_bytes());
    for part in [
        "10 in the file, 4 different positions",
        "1 face with NaN or infinite corners, 2 faces without area, 1 face too small beside the whole mesh",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let clean = inspect(&[], b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert!(!clean.contains("dropped") && !clean.contains("warning"), "{clean}");
}

#[test]
fn coarse_positions_are_said_by_inspect_and_by_jobs() {
    let file = coarse(512.0);
    let text = inspect(&[], &file);
    assert!(
        text.contains("f32 positions near 1e9 are 64 units apart") && text.contains("(positions_coarse)"),
        "{text}"
    );
    let report: serde_json::Value = serde_json::from_str(&inspect(&["--json"], &file)).unwrap();
    assert_eq!(report["warnings"][0]["code"], "positions_coarse", "{report}");
    let server = Server::start(&[]);
    let job = server.post("/v1/jobs?size=16", &file);
    assert_eq!(job.status, 202);
    let done = server.request("GET", job.header("location").unwrap(), &["Prefer: wait=50"], b"").json();
    assert_eq!(done["result"]["warnings"][0]["code"], "positions_coarse", "{done}");
    // Both ends of a side of one unit are the same f32.
    let detail = server.post("/v1/render", &coarse(1.0)).problem(422, "mesh_empty");
    assert!(detail.contains("64 units apart"), "{detail}");
}
