//! The report of `inspect`: metadata of the formats, area and volume against closed forms, and
//! hostile meshes in bounded memory.

use crate::support::files::mesh::{Gltf, Read, Solid, read};
use crate::support::files::ply::Encoding;
use crate::support::server::meshsnap;
use crate::support::shapes::{Obj, cube, torus};
use crate::support::truth::cases;
use crate::support::work::within_bytes;
use meshsnap_inspect::report::{Extras, Report};
use meshsnap_render::import::ImportReport;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::topology::Topology;
use meshsnap_render::mesh::{Mesh, ToFile};
use serde_json::{Value, json};
use std::f64::consts::TAU;

fn report(bytes: &[u8]) -> (Value, String) {
    let Read { mesh, report } = read(bytes).unwrap();
    let report = of(&mesh, &report);
    (serde_json::to_value(&report).unwrap(), report.text())
}

fn of(mesh: &Mesh, import: &ImportReport) -> Report {
    Report::of(mesh, import, Extras::default(), &mut Budget::new(&Limits::default()), &Deadline::default()).unwrap()
}

/// Area and volume.
fn measures(report: &Value) -> [f64; 2] {
    [report["area"].as_f64().unwrap(), report["volume"].as_f64().unwrap()]
}

#[track_caller]
fn assert_close(given: [f64; 2], expected: [f64; 2]) {
    for (given, expected) in given.into_iter().zip(expected) {
        assert!((given / expected - 1.0).abs() <= 1e-6, "{given} is not {expected}");
    }
}

/// Area and volume of what the corners of a polygon (radius and height each) sweep when it turns in
/// `n` steps: each side makes `n` equal trapezoids and a frustum.
fn turned(polygon: &[[f64; 2]], n: f64) -> [f64; 2] {
    let [half, cut] = [(TAU / n / 2.0).sin(), n / 2.0 * (TAU / n).sin()];
    let mut sums = [0.0; 2];
    for (i, [r0, z0]) in polygon.iter().enumerate() {
        let [r1, z1] = polygon[(i + 1) % polygon.len()];
        // The trapezoids' height runs from the middle of one parallel side to that of the other.
        let height = ((r1 - r0) * (TAU / n / 2.0).cos()).hypot(z1 - z0);
        sums[0] += n * (r0 + r1) * half * height;
        sums[1] += cut * (z1 - z0) * (r0 * r0 + r0 * r1 + r1 * r1) / 3.0;
    }
    [sums[0], sums[1].abs()]
}

#[test]
fn measures_are_those_of_closed_forms() {
    let (unit, _) = report(cube().as_bytes());
    assert_close(measures(&unit), [24.0, 8.0]);
    // Two lengths of one number: n columns and n / 2 rows.
    for n in [8, 50, 200] {
        let mut ball = Obj::default();
        ball.ball([5.0, -3.0, 1.0], 2.0, n);
        let rows = n / 2;
        let at = |j: usize| {
            let b = j as f64 / rows as f64 * TAU / 2.0;
            [2.0 * b.sin(), 2.0 * b.cos()]
        };
        let polygon: Vec<[f64; 2]> = (0..=rows).map(at).collect();
        let (ball, _) = report(ball.finish().as_bytes());
        assert_close(measures(&ball), turned(&polygon, n as f64));
        assert_eq!((&ball["topology"]["genus"], &ball["topology"]["is_watertight"]), (&json!(0), &json!(true)));
        // And of the true sphere, up to what corners cost.
        let [area, volume] = measures(&ball);
        let [area, volume] = [1.0 - area / (2.0 * TAU * 4.0), 1.0 - volume / (2.0 / 3.0 * TAU * 8.0)];
        let most = 20.0 / (n * n) as f64;
        assert!(area > 0.0 && area < most && volume > 0.0 && volume < most, "{n}: {area} {volume}");

        let m = n / 2;
        let at = |j: usize| {
            let b = j as f64 / m as f64 * TAU;
            [1.0 + 0.4 * b.cos(), 0.4 * b.sin()]
        };
        let polygon: Vec<[f64; 2]> = (0..m).map(at).collect();
        let (ring, _) = report(torus(n).as_bytes());
        assert_close(measures(&ring), turned(&polygon, n as f64));
        assert_eq!((&ring["topology"]["genus"], &ring["topology"]["euler_characteristic"]), (&json!(1), &json!(0)));
    }
}

#[test]
fn measures_scale_and_end_in_null() {
    let scaled = |scale: f64, turned: bool| {
        let mut obj = Obj::default();
        for i in 0..8 {
            obj.vertex([0, 1, 2].map(|k| (f64::from(i >> k & 1) * 2.0 - 1.0) * scale));
        }
        for mut face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            if turned {
                face.reverse();
            }
            obj.face(&face);
        }
        report(obj.finish().as_bytes())
    };
    for scale in [1e-30, 1e-3, 1.0, 1e30, 1e90] {
        let (given, _) = scaled(scale, false);
        assert_close(measures(&given), [24.0 * scale * scale, 8.0 * scale * scale * scale]);
    }
    let (inside_out, text) = scaled(3.0, true);
    assert_close(measures(&inside_out), [216.0, -216.0]);
    assert!(text.contains("inside out"), "{text}");
    // Beyond what an f64 holds: first the volume, then the area too.
    for (scale, has_area) in [(1e-120, true), (1e120, true), (1e-200, false), (1e200, false)] {
        let (given, text) = scaled(scale, false);
        assert_eq!((given["area"].is_f64(), given["volume"].is_null()), (has_area, true), "{scale}: {given}");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        assert!(given["bounds"]["size"][0].as_f64().is_some_and(|size| size > 0.0), "{given}");
    }
    // No volume where nothing is enclosed.
    let (open, _) = report(b"v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    assert_eq!((open["area"].as_f64(), &open["volume"]), (Some(2.0), &Value::Null));
    assert_eq!(open["topology"]["boundary_loops"], 1);
}

#[test]
fn every_format_says_who_wrote_it() {
    let solid = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7], [0, 1, 5]]);
    let mut stl = solid.stl_binary();
    stl[..80].fill(0);
    stl[..9].copy_from_slice(b"made by 7");
    let ply = String::from_utf8(solid.ply(Encoding::Ascii)).unwrap();
    let ply = ply.replacen("comment made by a test", "comment TextureFile a.png\ncomment written by hand", 1);
    let mut gltf = solid.gltf();
    gltf.json["asset"]["generator"] = json!("a tool");
    let cases = [
        (solid.obj().into_bytes(), "obj", json!("made by a test")),
        (solid.obj().replacen("# made by a test\n", "", 1).into_bytes(), "obj", Value::Null),
        (stl, "stl", json!("made by 7")),
        (solid.stl_ascii().into_bytes(), "stl", json!("a test")),
        (ply.into_bytes(), "ply", json!("written by hand")),
        (gltf.glb(), "glb", json!("a tool")),
        (gltf.gltf().into_bytes(), "gltf", json!("a tool")),
    ];
    let mut scenes = 0;
    for (bytes, format, generator) in &cases {
        let (given, text) = report(bytes);
        assert_eq!((&given["format"], &given["generator"]), (&json!(format), generator));
        let is_gltf = format.starts_with('g');
        for key in ["scenes", "nodes", "meshes", "primitives"] {
            assert_eq!(given[key], if is_gltf { json!(1) } else { Value::Null }, "{format} {key}");
        }
        scenes += usize::from(text.contains("1 scene, 1 node, 1 mesh, 1 primitive\n"));
        assert_eq!(text.contains("generator"), !generator.is_null(), "{text}");
        assert_eq!((given["triangles"].as_u64(), given["file_bytes"].as_u64()), (Some(3), Some(bytes.len() as u64)));
    }
    assert_eq!((cases.len(), scenes), (7, 2));
}

#[test]
fn lines_points_and_textures_are_told() {
    let (given, text) = report(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\nl 1 2 3\np 1\n");
    assert_eq!((&given["lines"], &given["points"]), (&json!(3), &json!(1)));
    assert!(text.contains("beside       3 lines, 1 point\n"), "{text}");

    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(5, 3).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut gltf = Gltf::default();
    let position = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let view = gltf.view(png.get_ref());
    let broken = gltf.view(b"\x89PNG\r\n\x1a\nnothing more");
    gltf.json["images"] = json!([{ "bufferView": view, "mimeType": "image/png", "name": "wood" },
                                 { "bufferView": broken, "mimeType": "image/png" }]);
    gltf.json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    gltf.json["materials"] = json!([{ "name": "Wood", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
                                      "normalTexture": { "index": 1 } }]);
    gltf.json["extensionsUsed"] = json!(["KHR_mesh_quantization", "KHR_materials_unlit"]);
    gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    gltf.mesh(json!({ "attributes": { "POSITION": position }, "material": 0 }));
    gltf.mesh(json!({ "attributes": { "POSITION": position }, "mode": 3 }));
    gltf.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "camera": 0, "name": "eye", "mesh": 1 }]);
    gltf.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 0.5, "znear": 0.1 } }]);
    let (given, text) = report(&gltf.glb());
    let textures = given["textures"].as_array().unwrap();
    assert_eq!(textures.len(), 2);
    let expected = json!({ "format": "png", "width_px": 5, "height_px": 3, "file_bytes": png.get_ref().len() });
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(&textures[0][key], value);
    }
    assert!(textures[0]["name"].as_str().unwrap().contains("wood"));
    assert_eq!((&textures[1]["format"], &textures[1]["width_px"]), (&Value::Null, &Value::Null));
    let warnings = given["warnings"].as_array().unwrap().iter();
    let broken: Vec<_> = warnings.filter(|warning| warning["code"] == "textures_broken").collect();
    let [broken] = &broken[..] else { panic!("{broken:?}") };
    assert!(broken["detail"].as_str().unwrap().contains("image 1"), "{broken}");
    assert_eq!((&given["materials"], &given["lines"], &given["meshes"]), (&json!(["Wood", ""]), &json!(2), &json!(2)));
    assert_eq!(given["extensions_required"], json!(["KHR_mesh_quantization"]));
    assert_eq!((&given["cameras"], &given["scene_cameras"][0]["name"]), (&json!(1), &json!("eye")));
    for part in ["5x3 png", "(unreadable)", "KHR_mesh_quantization (required), KHR_materials_unlit", "28.6 degrees"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

/// A mesh in its normal form, of triangles that need no file.
fn mesh_of(triangles: Vec<[u32; 3]>) -> Mesh {
    let count = triangles.iter().flatten().max().map_or(0, |m| m + 1);
    let at = |v: u32| [v as f32 / count as f32 - 0.5, (v % 1000) as f32 / 1000.0 - 0.5, 0.0];
    Mesh {
        positions: (0..count).map(at).collect(),
        edge_masks: vec![7; triangles.len()],
        triangles,
        bounds: [[-0.5; 3], [0.5; 3]],
        to_file: ToFile { centre: [0.0; 3], scale: 1.0 },
        ..Mesh::default()
    }
}

/// Bytes that counting may allocate per triangle.
const COUNTING_BYTES: u64 = 1000;

#[test]
fn many_hostile_triangles_are_counted_in_linear_memory() {
    let n = cases(100_000, 1_000_000);
    let noise = |i: u32, k: u32| (u64::from(i * 3 + k).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as u32 % (n / 2);
    let meshes: [(&str, Vec<[u32; 3]>); 6] = [
        ("a fan around one vertex", (1..=n).map(|i| [0, i, i + 1]).collect()),
        ("blades that share a vertex alone", (0..n).map(|i| [0, 2 * i + 1, 2 * i + 2]).collect()),
        ("pages of one book", (0..n).map(|i| [0, 1, i + 2]).collect()),
        ("one triangle again and again", (0..n).map(|i| [[0, 1, 2], [1, 2, 0], [2, 1, 0]][i as usize % 3]).collect()),
        ("a strip from its end to its start", (0..n).rev().map(|i| [i, i + 1, i + 2]).collect()),
        (
            "noise",
            (0..n)
                .map(|i| [0, 1, 2].map(|k| noise(i, k)))
                .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
                .collect(),
        ),
    ];
    for (name, triangles) in meshes {
        let mesh = mesh_of(triangles);
        // Linear in the triangles, whatever their shape.
        let most = COUNTING_BYTES * mesh.triangles.len() as u64;
        let given = within_bytes(most, name, || serde_json::to_value(of(&mesh, &ImportReport::default())).unwrap());
        let t = &given["topology"];
        let count = |key: &str| t[key].as_u64().unwrap();
        let n = u64::from(n);
        match name {
            "a fan around one vertex" => {
                assert_eq!([count("components"), count("boundary_loops"), count("open_edges")], [1, 1, n + 2]);
                assert_eq!([count("nonmanifold_vertices"), count("nonmanifold_edges")], [0, 0]);
            }
            "blades that share a vertex alone" => {
                assert_eq!([count("components"), count("boundary_loops"), count("nonmanifold_vertices")], [1, n, 1]);
            }
            "pages of one book" => {
                assert_eq!([count("nonmanifold_edges"), count("open_edges"), count("boundary_loops")], [1, 2 * n, 1]);
            }
            "one triangle again and again" => {
                assert_eq!([count("duplicate_faces"), count("edges"), count("nonmanifold_edges")], [n - 1, 3, 3]);
            }
            "a strip from its end to its start" => {
                assert_eq!([count("components"), count("boundary_loops"), count("open_edges")], [1, 1, n + 2]);
                assert_eq!(t["is_orientable"], true);
            }
            _ => assert!(count("edges") > n && t["genus"].is_null()),
        }
    }
}

#[test]
fn a_poor_budget_and_a_raised_flag_stop_the_report() {
    let mesh = read(cube().as_bytes()).unwrap();
    let edges = EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap();
    let stopped = Deadline::default();
    stopped.stop();
    assert!(Topology::of(&mesh, &edges, &mut Budget::new(&Limits::default()), &stopped).is_err());
    assert!(
        Report::of(&mesh, &mesh.report, Extras::default(), &mut Budget::new(&Limits::default()), &stopped).is_err()
    );
    let needed = (0..10_000).find(|&memory_bytes| {
        let limits = Limits::default().with(|limits| limits.memory_bytes = memory_bytes);
        Report::of(&mesh, &mesh.report, Extras::default(), &mut Budget::new(&limits), &Deadline::default()).is_ok()
    });
    assert!(needed.is_some_and(|bytes| bytes > 500), "{needed:?}");
}

#[test]
fn the_command_line_prints_the_same_report() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("torus.obj");
    std::fs::write(&path, torus(12)).unwrap();
    let inspect = |more: &[&str]| {
        let output = meshsnap().arg("inspect").arg(&path).args(more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let (expected, text) = report(torus(12).as_bytes());
    assert_eq!(serde_json::from_str::<Value>(&inspect(&["--json"])).unwrap(), expected);
    assert_eq!(inspect(&[]), text);
    assert!(text.contains("topology     1 part, watertight, 216 edges, Euler characteristic 0, genus 1\n"), "{text}");
}
