//! Everything under api/examples works as it lies there.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::server::{Server, meshsnap};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("api/examples")
}

/// A tube around a trefoil knot that lies on a torus, in quads, standing upright.
fn knot() -> String {
    const ALONG: usize = 160;
    const AROUND: usize = 14;
    const TUBE: f64 = 0.42;
    let mut text = String::from("# A trefoil knot in quads. Made by tests/suite/examples.rs.\no knot\n");
    for i in 0..ALONG {
        let t = std::f64::consts::TAU * i as f64 / ALONG as f64;
        let (s2, c2, s3, c3) = (libm::sin(2.0 * t), libm::cos(2.0 * t), libm::sin(3.0 * t), libm::cos(3.0 * t));
        let centre = [(2.0 + c3) * c2, (2.0 + c3) * s2, s3];
        let tangent = [-3.0 * s3 * c2 - 2.0 * (2.0 + c3) * s2, -3.0 * s3 * s2 + 2.0 * (2.0 + c3) * c2, 3.0 * c3];
        // The torus's own normal is across the knot everywhere, so the frame closes without a twist.
        let normal = [c3 * c2, c3 * s2, s3];
        let length = tangent.iter().map(|v| v * v).sum::<f64>().sqrt();
        let [tx, ty, tz] = tangent.map(|v| v / length);
        let across =
            [ty * normal[2] - tz * normal[1], tz * normal[0] - tx * normal[2], tx * normal[1] - ty * normal[0]];
        for j in 0..AROUND {
            let a = std::f64::consts::TAU * j as f64 / AROUND as f64;
            let point: [f64; 3] =
                std::array::from_fn(|k| centre[k] + TUBE * (libm::cos(a) * normal[k] + libm::sin(a) * across[k]));
            writeln!(text, "v {:.4} {:.4} {:.4}", point[0], point[1], point[2]).unwrap();
        }
    }
    for i in 0..ALONG {
        for j in 0..AROUND {
            let at = |i: usize, j: usize| (i % ALONG) * AROUND + j % AROUND + 1;
            writeln!(text, "f {} {} {} {}", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)).unwrap();
        }
    }
    text
}

/// With MESHSNAP_WRITE_EXAMPLES set, writes the file anew, and fails so that nobody takes writing for checking.
#[test]
fn the_knot_is_what_its_generator_makes() {
    let path = examples().join("knot.obj");
    let made = knot();
    if std::env::var_os("MESHSNAP_WRITE_EXAMPLES").is_some() {
        std::fs::write(&path, &made).unwrap();
        panic!("{} was written; look at it, then run again without MESHSNAP_WRITE_EXAMPLES", path.display());
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(written == made, "{} differs from its generator", path.display());
    assert!((60_000..120_000).contains(&made.len()), "{} bytes", made.len());
}

#[test]
fn every_example_request_draws_the_knot() {
    let knot = examples().join("knot.obj");
    let directory = tempfile::tempdir().unwrap();
    let mut seen = Vec::new();
    for entry in std::fs::read_dir(examples()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let out = directory.path().join("out.png");
        let mut command = meshsnap();
        command.args(["render", "--backend", "cpu", "--request"]).arg(&path).arg(&knot).arg("-o").arg(&out);
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}: {}", path.display(), String::from_utf8_lossy(&done.stderr));
        let picture = image::open(&out).unwrap().to_rgba8();
        let first = *picture.get_pixel(0, 0);
        assert!(picture.pixels().any(|p| *p != first), "{} is blank", path.display());
        let document: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        seen.push(document["style"].as_str().unwrap().to_owned());
    }
    seen.sort();
    assert_eq!(seen, ["flat", "hidden-line", "outline", "smooth", "unlit", "wire", "wireframe"]);
}

/// As a stranger would: from the root of a clone, exactly the line that the server prints.
#[test]
fn the_printed_curl_line_works_as_printed() {
    if Command::new("curl").arg("--version").output().is_err() {
        assert_ne!(std::env::var("MESHSNAP_TEST_REQUIRE").as_deref(), Ok("all"), "curl is missing");
        println!("curl is missing: not checked");
        return;
    }
    let server = Server::start(&[]);
    let line = server.curl_line.replace("-o out.png", "-sS --fail -o \"$OUT\"");
    assert!(line.starts_with("curl --data-binary @api/examples/knot.obj 'http://127.0.0.1:"), "{line}");
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out.png");
    let done =
        Command::new("sh").arg("-c").arg(&line).env("OUT", &out).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let done = done.unwrap();
    assert!(done.status.success(), "{line}: {}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(image::open(&out).unwrap().to_rgba8().dimensions(), (512, 512));
}
