//! Everything under api/examples: the requests are drawn, alike on both back-ends, the meshes are
//! what their generators here make, and the curl line that the server prints works.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Deadline, Limits};
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::BackendChoice;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::server::{Server, meshsnap};
use crate::support::skip::{Need, skip};

/// Requests under api/examples.
const EXAMPLES: usize = 44;

const SIZE_PX: u32 = 256;

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
        // The torus's own normal is across the knot everywhere, so the frame closes without a
        // twist.
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
            writeln!(text, "f {} {} {} {}", at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)).unwrap();
        }
    }
    text
}

#[test]
fn the_knot_is_what_its_generator_makes() {
    check_written("knot.obj", &knot(), 60_000..120_000);
}

/// With MESHSNAP_WRITE_EXAMPLES set, writes the file anew, and fails: writing is not checking.
fn check_written(file: &str, made: &str, sizes: std::ops::Range<usize>) {
    let path = examples().join(file);
    if std::env::var_os("MESHSNAP_WRITE_EXAMPLES").is_some() {
        std::fs::write(&path, made).unwrap();
        panic!("{} was written; look at it, then run again without MESHSNAP_WRITE_EXAMPLES", path.display());
    }
    let written = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    assert!(written == made, "{} differs from its generator", path.display());
    assert!(sizes.contains(&made.len()), "{} bytes", made.len());
}

/// Six times the volume that the quads enclose: positive if they face outwards, and 6 pi 0.42^2
/// times the length.
#[test]
fn the_knot_faces_outwards() {
    let text = knot();
    let numbers = |line: &str| line.split(' ').skip(1).map(|n| n.parse::<f64>().unwrap()).collect::<Vec<_>>();
    let points: Vec<_> = text.lines().filter(|l| l.starts_with("v ")).map(numbers).collect();
    let mut volume = 0.0;
    for quad in text.lines().filter(|l| l.starts_with("f ")).map(numbers) {
        let at = |corner: usize| &points[quad[corner] as usize - 1];
        for (a, b, c) in [(at(0), at(1), at(2)), (at(0), at(2), at(3))] {
            volume += a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0]);
        }
    }
    assert!((100.0..105.0).contains(&volume), "{volume}");
}

/// A lamp with everything that a look can be about: parts of several materials (Base, Glass,
/// Shade), a shade with two open rims and colours of its own, a fin that makes an edge of three
/// faces, sharp rims, and texture coordinates.
fn lamp() -> String {
    let mut lamp = Lamp::default();
    let (base, gold, glass) = ([0.42, 0.46, 0.5], [0.9, 0.75, 0.45], [0.8, 0.9, 0.95]);
    // Radius and height of rings from the bottom up; a ring without a radius closes.
    lamp.turn("Base", &[(0.0, 0.0), (0.9, 0.0), (0.9, 0.15), (0.1, 0.25), (0.1, 1.0), (0.0, 1.0)], base);
    let bulb: Vec<(f64, f64)> = (0..=10)
        .map(|i| {
            let a = std::f64::consts::PI * f64::from(i) / 10.0;
            (if i % 10 == 0 { 0.0 } else { 0.55 * libm::sin(a) }, 1.55 - 0.55 * libm::cos(a))
        })
        .collect();
    lamp.turn("Glass", &bulb, glass);
    let shade = lamp.turn("Shade", &[(1.25, 1.75), (1.05, 2.1), (0.85, 2.45), (0.65, 2.8)], gold);
    // From the shade's own corners outwards: its upright edges there have three faces.
    let fin = [lamp.point([1.6, 1.75, 0.0], [1.0, 0.5], gold), lamp.point([1.3, 2.1, 0.0], [1.0, 0.6], gold)];
    writeln!(lamp.faces, "f {0}/{0} {1}/{1} {2}/{2} {3}/{3}", shade, fin[0], fin[1], shade + Lamp::AROUND + 1).unwrap();
    format!("# A lamp. Made by tests/suite/examples.rs.\no lamp\n{}{}{}", lamp.points, lamp.uvs, lamp.faces)
}

#[derive(Default)]
struct Lamp {
    points: String,
    uvs: String,
    faces: String,
    count: usize,
}

impl Lamp {
    const AROUND: usize = 24;

    fn point(&mut self, [x, y, z]: [f64; 3], [u, v]: [f64; 2], [r, g, b]: [f64; 3]) -> usize {
        writeln!(self.points, "v {x:.4} {y:.4} {z:.4} {r} {g} {b}").unwrap();
        writeln!(self.uvs, "vt {u:.4} {v:.4}").unwrap();
        self.count += 1;
        self.count
    }

    /// A profile, turned around the y axis; the number of its first point. The seam's points are
    /// there twice, for the texture coordinates' sake.
    fn turn(&mut self, material: &str, profile: &[(f64, f64)], color: [f64; 3]) -> usize {
        let first = self.count + 1;
        for (i, &(radius, height)) in profile.iter().enumerate() {
            for j in 0..=Self::AROUND {
                let u = j as f64 / Self::AROUND as f64;
                let a = std::f64::consts::TAU * (j % Self::AROUND) as f64 / Self::AROUND as f64;
                // Darker towards the bottom.
                let shade = 0.6 + 0.4 * (i as f64 / (profile.len() - 1) as f64);
                let color = color.map(|c| (c * shade * 100.0).round() / 100.0);
                let v = i as f64 / (profile.len() - 1) as f64;
                self.point([radius * libm::cos(a), height, -radius * libm::sin(a)], [u, v], color);
            }
        }
        writeln!(self.faces, "usemtl {material}").unwrap();
        for i in 0..profile.len() - 1 {
            for j in 0..Self::AROUND {
                let at = |i: usize, j: usize| first + i * (Self::AROUND + 1) + j;
                let mut corners = vec![at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
                // At a pole, two of them are one.
                if profile[i].0 == 0.0 {
                    corners.remove(1);
                } else if profile[i + 1].0 == 0.0 {
                    corners.remove(2);
                }
                let corners: Vec<String> = corners.iter().map(|c| format!("{c}/{c}")).collect();
                writeln!(self.faces, "f {}", corners.join(" ")).unwrap();
            }
        }
        first
    }
}

#[test]
fn the_lamp_has_what_looks_are_about() {
    check_written("lamp.obj", &lamp(), 20_000..60_000);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("lamp.obj");
    std::fs::write(&path, lamp()).unwrap();
    let done = meshsnap().args(["inspect", "--json"]).arg(&path).output().unwrap();
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let topology = &report["topology"];
    // Two rims, and three sides of the fin; its fourth side.
    assert_eq!(topology["open_edges"], 2 * Lamp::AROUND + 3, "{report:#}");
    assert_eq!(topology["nonmanifold_edges"], 1, "{report:#}");
    let mesh = scenes::mesh(&lamp());
    let names: Vec<&str> = mesh.materials.iter().map(|slot| slot.name.as_str()).collect();
    assert_eq!(names, ["Base", "Glass", "Shade"]);
    assert!(!mesh.uvs.is_empty() && !mesh.colors.is_empty());
}

/// Examples that the knot, a closed surface of one material, would not do justice.
const OF_THE_LAMP: [&str; 11] = [
    "boundary",
    "debug-face-orientation",
    "debug-uv",
    "debug-uv-layout",
    "debug-uv-stretch",
    "debug-vertex-color",
    "feature-edges",
    "glow",
    "materials",
    "topology",
    "transparent",
];

/// The name and the content of every request under api/examples.
fn requests() -> Vec<(String, Vec<u8>)> {
    let files = std::fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path());
    let requests = files.filter(|path| path.extension().is_some_and(|e| e == "json"));
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let mut all: Vec<_> = requests.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect();
    all.sort();
    all
}

#[test]
fn every_example_is_drawn_alike_on_both_back_ends() {
    let (knot, lamp) = (scenes::mesh(&knot()), scenes::mesh(&lamp()));
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let size = [("size".to_owned(), SIZE_PX.to_string())];
    let mut cpu = CpuRenderer::new(2);
    let mut gpu = gpus().map(|gpus| GpuRenderer::new(gpus[0].clone()));
    let (mut drawn, mut compared, mut of_the_lamp) = (0, 0, 0);
    let mut faults = Vec::new();
    for (name, document) in requests() {
        let spec = request::read(Some(&document), &size, &rules).unwrap_or_else(|e| panic!("{name}: {e}"));
        let is_lamp = OF_THE_LAMP.contains(&name.as_str());
        of_the_lamp += usize::from(is_lamp);
        let plan = scenes::plan(if is_lamp { &lamp } else { &knot }, &spec);
        let picture = cpu.draw(&plan, &Deadline::default()).unwrap();
        let background = picture.rgba.chunks(4).filter(|pixel| *pixel == &picture.rgba[..4]).count();
        let inked = picture.rgba.len() / 4 - background;
        assert!(inked > (SIZE_PX * SIZE_PX / 20) as usize, "{name}: only {inked} pixels are not background");
        drawn += 1;
        keep(&name, &picture);
        if let Some(gpu) = &mut gpu {
            let other = gpu.draw(&plan, &Deadline::default()).unwrap();
            let like = Likeness::of(&picture, &other);
            println!("{name:24} {like}");
            if !like.is_within(Tolerance::TWINS) {
                faults.push(format!("{name}: {like}"));
            }
            compared += 1;
        }
    }
    println!("{drawn} drawn, {compared} compared");
    assert_eq!((drawn, of_the_lamp), (EXAMPLES, OF_THE_LAMP.len()));
    assert!(compared == drawn || gpu.is_none());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// `MESHSNAP_EXAMPLES_OUT=FOLDER` keeps the pictures, to be looked at.
fn keep(name: &str, picture: &Image) {
    if let Some(folder) = std::env::var_os("MESHSNAP_EXAMPLES_OUT") {
        let path = Path::new(&folder).join(format!("{name}.png"));
        image::save_buffer(path, &picture.rgba, picture.width_px, picture.height_px, image::ColorType::Rgba8).unwrap();
    }
}

/// Every word of the document that chooses a look is in some example.
#[test]
fn the_examples_show_every_look() {
    let all: Vec<serde_json::Value> = requests().iter().map(|(_, d)| serde_json::from_slice(d).unwrap()).collect();
    let vocabulary = request::vocabulary();
    let mut words = 0;
    for (key, at) in [
        ("style", "/style"),
        ("surface.normals", "/surface/normals"),
        ("surface.debug", "/surface/debug"),
        ("wire.method", "/wire/method"),
        ("wire.edges", "/wire/edges"),
        ("outline.method", "/outline/method"),
        ("outline.unit", "/outline/unit"),
        ("light.preset", "/light/preset"),
    ] {
        for word in &vocabulary[key] {
            // A default needs no word.
            let is_default = ["none", "face", "exact", "triangles", "auto"].contains(word);
            let is_shown = all.iter().any(|document| document.pointer(at).is_some_and(|v| v == word));
            assert!(is_shown || is_default, "no example has {key}={word}");
            words += 1;
        }
    }
    assert_eq!(words, 44);
}

/// As a stranger would: from the root of a clone, exactly the line that the server prints.
#[test]
fn the_printed_curl_line_works_as_printed() {
    if Command::new("curl").arg("--version").output().is_err() {
        skip(Need::Curl, "curl");
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
