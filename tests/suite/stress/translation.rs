//! Models far from the origin. Files with f64 coordinates, OBJ among them, give the same vertices
//! on screen, to 1/512 px. Files with f32 coordinates whose positions are too coarse give a
//! warning, or an error if nothing is left.

use meshsnap_render::import::MeshFault;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::DrawPlan;

use crate::oracle::camera::project;
use crate::oracle::obj::Shape;
use crate::oracle::vector::{V2, V3};
use crate::support::families::moved::{MESHES, shape};
use crate::support::files::mesh::{Solid, read};
use crate::support::files::ply::{ENCODINGS, Encoding, INDICES, Ply};
use crate::support::scenes;
use crate::support::truth::scene;

const MOVED_MAX_PX: f64 = 1.0 / 512.0;
const F64_XYZ: [&str; 3] = ["double x", "double y", "double z"];
const SIZE: &str = "512";

/// The plan's position of each vertex, before it is snapped.
fn on_screen(mesh: &Mesh) -> Vec<V2> {
    let plan: DrawPlan<'_> = scenes::plan(mesh, &scenes::spec(&[("style", "flat"), ("size", SIZE)]));
    let scene = scene(&plan);
    let positions = scene.positions.iter().map(|&p| project(scene.camera.homogeneous(p)));
    positions.map(|p| [p[0], p[1]]).collect()
}

fn ply(shape: &Shape, encoding: Encoding, xyz: &[&str; 3]) -> Vec<u8> {
    let solid = solid(shape);
    let ply = Ply::new(encoding).element("vertex", xyz, &solid.vertex_records());
    ply.element("face", &INDICES, &solid.face_records()).bytes()
}

fn solid(shape: &Shape) -> Solid {
    let polygons = shape.polygons.iter().map(|p| p.iter().map(|&v| v as u32).collect()).collect();
    Solid { positions: shape.vertices.clone(), polygons }
}

fn moved(shape: &Shape, by: V3) -> Shape {
    shape.clone().map(|v| std::array::from_fn(|k| v[k] + by[k]))
}

#[test]
fn f64_files_are_the_same_picture_wherever_they_lie() {
    let (mut compared, mut worst) = (0, 0.0_f64);
    for (name, obj) in MESHES {
        let shape = shape(&obj());
        let want = on_screen(&read(shape.text().as_bytes()).unwrap());
        for exponent in 3..=9 {
            let far = f64::powi(10.0, exponent);
            for by in [[far, 0.0, 0.0], [0.0, -far, 0.0], [far, far, -far]] {
                let moved = moved(&shape, by);
                let mut files = vec![moved.text().into_bytes()];
                files.extend(ENCODINGS.map(|encoding| ply(&moved, encoding, &F64_XYZ)));
                for file in files {
                    let mesh = read(&file).unwrap();
                    assert_eq!(mesh.report.warnings, [], "{name} at {by:?}");
                    let got = on_screen(&mesh);
                    assert_eq!(want.len(), got.len(), "{name} at {by:?}");
                    let pairs = want.iter().zip(&got);
                    let error = pairs.map(|(p, q)| (p[0] - q[0]).hypot(p[1] - q[1])).fold(0.0, f64::max);
                    assert!(error <= MOVED_MAX_PX, "{name} at {by:?}: {error} px away");
                    worst = worst.max(error);
                    compared += 1;
                }
            }
        }
    }
    println!("- translations of f64 files: at most {worst:.6} px away (gate {MOVED_MAX_PX:.6})");
    assert_eq!(compared, MESHES.len() * 7 * 3 * 4);
}

/// The formats that hold f32.
fn f32_files(shape: &Shape) -> [(&'static str, Vec<u8>); 5] {
    let shape = shape.triangulated().map(|v| v.map(|c| f64::from(c as f32)));
    let solid = solid(&shape);
    let [ascii, little, big] = ENCODINGS.map(|encoding| ply(&shape, encoding, &["float x", "float y", "float z"]));
    [
        ("STL", solid.stl_binary()),
        ("glTF", solid.gltf().glb()),
        ("PLY ascii", ascii),
        ("PLY little", little),
        ("PLY big", big),
    ]
}

#[test]
fn f32_files_far_away_are_said_to_be_coarse() {
    let mut read_files = 0;
    for (name, obj) in MESHES {
        let shape = shape(&obj()).map(|v| v.map(|c| c * 1024.0));
        for (far, is_coarse) in [(0.0, false), (1e3, false), (1e9, true), (-1e9, true)] {
            for (format, file) in f32_files(&moved(&shape, [0.0, far, 0.0])) {
                let mesh = read(&file).unwrap();
                let coarse: Vec<&str> = mesh.report.warnings.iter().map(|w| w.code).collect();
                let want: &[&str] = if is_coarse { &["positions_coarse"] } else { &[] };
                assert_eq!(coarse, want, "{name} at {far}, {format}");
                for warning in &mesh.report.warnings {
                    let says = warning.detail.starts_with("f32 positions near 1e9 are 64 units apart");
                    assert!(says, "{name}, {format}: {}", warning.detail);
                }
                read_files += 1;
            }
        }
    }
    assert_eq!(read_files, MESHES.len() * 4 * 5);
}

/// Two units in steps of 64: nothing is left, and the reason is part of the answer.
#[test]
fn what_f32_has_crushed_is_refused_with_the_reason() {
    let mut refused = 0;
    for (name, obj) in MESHES {
        for (format, file) in f32_files(&moved(&shape(&obj()), [1e9; 3])) {
            let error = read(&file).unwrap_err();
            assert_eq!(error.fault, MeshFault::Empty, "{name}, {format}: {}", error.detail);
            assert!(error.detail.contains("f32 positions near 1e9 are 64 units apart"), "{}", error.detail);
            refused += 1;
        }
    }
    assert_eq!(refused, MESHES.len() * 5);
}
