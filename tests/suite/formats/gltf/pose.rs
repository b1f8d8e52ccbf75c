//! glTF: skins, morph targets, and animations at a moment.

use crate::support::data;
use crate::support::files::mesh::codes;
use crate::support::files::mesh::{Gltf, assert_close, corners, read, read_at, set};
use crate::support::server::{Server, meshsnap};
use meshsnap_render::import::MeshFault;
use serde_json::{Value, json};

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// By columns: moved by (x, y, z).
fn moved(x: f32, y: f32, z: f32) -> [f32; 16] {
    [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
}

/// A triangle whose corners are held by joint 1, by joint 2, and by both.
fn skinned() -> Gltf {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &TRIANGLE);
    let n = gltf.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let joints = gltf.accessor("VEC4", 5121, 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = gltf.floats("VEC4", &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 1.5, 0.0, 0.0]);
    // The second joint's own place is one to the right.
    let inverse = gltf.floats("MAT4", &[moved(0.0, 0.0, 0.0), moved(-1.0, 0.0, 0.0)].concat());
    gltf.mesh(json!({ "attributes": { "POSITION": p, "NORMAL": n, "JOINTS_0": joints, "WEIGHTS_0": weights } }));
    gltf.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": inverse }]);
    gltf.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, // means nothing
        { "translation": [0, 0, 5], "children": [2] },
        { "translation": [1, 0, 0], "rotation": [0, 0, HALF, HALF] },
    ]);
    gltf.json["scenes"] = json!([{ "nodes": [0, 1] }]);
    gltf
}

fn close(a: &[[[f64; 3]; 3]], b: &[[[f64; 3]; 3]]) {
    let same = a.len() == b.len()
        && a.iter().flatten().flatten().zip(b.iter().flatten().flatten()).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(same, "{a:?} is not {b:?}");
}

#[test]
fn joints_hold_vertices_wherever_their_mesh_is() {
    let mesh = read(&skinned().glb()).unwrap();
    // (0, 1, 0): a quarter stays, and three turn a quarter about (1, 0, 0), to (0, -1, 0). Weights
    // are shares of their sum.
    close(&corners(&mesh), &[[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, -0.5, 5.0]]]);
    assert!(mesh.normals.iter().all(|n| *n == [0.0, 0.0, 1.0]), "{:?}", mesh.normals);
    // Two sets hold together as one would.
    let mut gltf = skinned();
    let none = gltf.floats("VEC4", &[0.0; 12]);
    let weights = gltf.floats("VEC4", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
    let first = gltf.json["meshes"][0]["primitives"][0]["attributes"].clone();
    let attributes = &mut gltf.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["JOINTS_1"], attributes["WEIGHTS_1"]) = (first["JOINTS_0"].clone(), weights.into());
    // 0.5 stays, 7.5 turn.
    close(&corners(&read(&gltf.glb()).unwrap()), &[[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, -0.875, 5.0]]]);
    // Without weights the first joint holds all.
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = none.into();
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_1"] = none.into();
    close(&corners(&read(&gltf.glb()).unwrap()), &[[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]]);
    // Without inverse bind matrices joints stand where the mesh was made.
    let mut gltf = skinned();
    gltf.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    // The second turns what is at its own place in the mesh: (1, 0) goes to (1, 1), and of (0, 1)
    // three parts to (0, 0).
    close(&corners(&read(&gltf.glb()).unwrap()), &[[[0.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 0.25, 5.0]]]);
}

#[test]
fn broken_skins_are_refused() {
    let mut cases = 0;
    let mut refuse = |place: &str, value: Value, word: &str| {
        let mut gltf = skinned();
        set(&mut gltf.json, place, value);
        let error = read(&gltf.glb()).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{place}");
        assert!(error.detail.contains(word), "{place}: {error}");
        cases += 1;
    };
    refuse("/skins/0/joints", json!([1]), "joint");
    refuse("/skins/0/joints", json!([]), "no joints");
    refuse("/skins/0/joints", json!([1, 2, 0]), "inverse bind matrices");
    refuse("/skins/0/joints/0", json!(9), "node 9");
    refuse("/skins/0/inverseBindMatrices", json!(0), "Vec3");
    refuse("/nodes/0/skin", json!(1), "skin 1");
    refuse("/accessors/2/normalized", json!(true), "joints");
    refuse("/accessors/3/count", json!(2), "3 positions and 2");
    refuse("/meshes/0/primitives/0/attributes/WEIGHTS_0", json!(0), "weights");
    refuse("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0, "JOINTS_0": 2 }), "pairs");
    refuse("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0 }), "JOINTS_0");
    assert_eq!(cases, 11);
}

/// A triangle with two morph targets.
fn morphed() -> Gltf {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &TRIANGLE);
    let n = gltf.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let up = gltf.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0]);
    let wide = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let lean = gltf.floats("VEC3", &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    gltf.mesh(json!({ "attributes": { "POSITION": p, "NORMAL": n },
                      "targets": [{ "POSITION": up }, { "POSITION": wide, "NORMAL": lean }] }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    gltf
}

#[test]
fn morph_targets_weigh_as_the_node_says_else_as_the_mesh() {
    let mut gltf = morphed();
    let at = |gltf: &Gltf| corners(&read(&gltf.glb()).unwrap())[0];
    assert_eq!(at(&gltf)[1], [1.0, 0.0, 0.0], "no weights, no morph");
    gltf.json["meshes"][0]["weights"] = json!([0.5, 0.25]);
    assert_eq!(at(&gltf), [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
    gltf.json["nodes"][0]["weights"] = json!([-1, 1]);
    assert_eq!(at(&gltf), [[0.0, 0.0, -2.0], [5.0, 0.0, -2.0], [0.0, 1.0, -2.0]]);
    let normal = read(&gltf.glb()).unwrap().normals[0];
    assert!(normal.iter().zip([HALF as f32, 0.0, HALF as f32]).all(|(a, b)| (a - b).abs() < 1e-6), "{normal:?}");
    gltf.json["nodes"][0]["weights"] = json!([1]);
    assert!(read(&gltf.glb()).unwrap_err().detail.contains("has 1 weights, and 2 morph targets"));
}

/// Adds an animation of node 0 with three keys at 1, 2 and 4 s.
fn animate(gltf: &mut Gltf, path: &str, interpolation: &str, kind: &str, values: &[f32]) {
    let input = gltf.floats("SCALAR", &[1.0, 2.0, 4.0]);
    let output = gltf.floats(kind, values);
    gltf.json["animations"] = json!([
        { "channels": [{ "sampler": 0, "target": { "node": 0, "path": path } }],
          "samplers": [{ "input": input, "output": output, "interpolation": interpolation }] },
        { "channels": [], "samplers": [] },
    ]);
}

fn triangle() -> Gltf {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &TRIANGLE);
    gltf.mesh(json!({ "attributes": { "POSITION": p } }));
    gltf.json["nodes"] = json!([{ "mesh": 0, "translation": [0, 7, 0] }]);
    gltf
}

#[test]
fn keys_are_interpolated_as_the_sampler_says() {
    let keys = [[10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 0.0, 8.0_f32]];
    // In-tangent, value, out-tangent of each key.
    let tangents = [[0.0, 3.0, 0.0], [0.0, 0.0, 6.0_f32]];
    let spline: Vec<f32> = keys.iter().flat_map(|key| [tangents[0], *key, tangents[1]]).flatten().collect();
    let cases: [(&str, &[f32], f64, [f64; 3]); 9] = [
        ("STEP", &keys.concat(), 0.0, [10.0, 0.0, 0.0]),
        ("STEP", &keys.concat(), 1.99, [10.0, 0.0, 0.0]),
        ("STEP", &keys.concat(), 2.0, [20.0, 0.0, 0.0]),
        ("STEP", &keys.concat(), 99.0, [20.0, 0.0, 8.0]),
        ("LINEAR", &keys.concat(), 1.25, [12.5, 0.0, 0.0]),
        ("LINEAR", &keys.concat(), 3.0, [20.0, 0.0, 4.0]),
        ("CUBICSPLINE", &spline, 1.0, [10.0, 0.0, 0.0]),
        // h00 = h01 = 1/2, h10 = 1/8, h11 = -1/8, over 1 s and over 2.
        ("CUBICSPLINE", &spline, 1.5, [15.0, -0.375, 0.75]),
        ("CUBICSPLINE", &spline, 3.0, [20.0, -0.75, 5.5]),
    ];
    for (interpolation, values, time_s, expected) in cases {
        let mut gltf = triangle();
        animate(&mut gltf, "translation", interpolation, "VEC3", values);
        let mesh = read_at(&gltf.glb(), time_s).unwrap();
        let at = corners(&mesh)[0][0];
        assert!(at.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{interpolation} {time_s}: {at:?}");
        assert_eq!(codes(&mesh), ["animations_left_out"]);
        // Nobody asked for a moment.
        let still = read(&gltf.glb()).unwrap();
        assert_eq!(corners(&still)[0][0], [0.0, 7.0, 0.0]);
        assert_eq!(codes(&still), ["animations_ignored"]);
    }
}

#[test]
fn rotations_scales_and_weights_are_animated() {
    let half = HALF as f32;
    let mut gltf = triangle();
    // Half a turn about z in normalised shorts, from 1 s to 4 s by way of a quarter.
    animate(&mut gltf, "rotation", "LINEAR", "VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half, 0.0, 0.0, 1.0, 0.0]);
    let turned = corners(&read_at(&gltf.glb(), 3.0).unwrap())[0][1];
    let expected = [-HALF, 7.0 + HALF, 0.0];
    assert!(turned.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{turned:?}");

    let mut gltf = triangle();
    animate(&mut gltf, "scale", "LINEAR", "VEC3", &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0, 3.0, 1.0, 1.0]);
    assert_eq!(corners(&read_at(&gltf.glb(), 1.5).unwrap())[0][1], [2.0, 7.0, 0.0]);

    let mut gltf = morphed();
    animate(&mut gltf, "weights", "LINEAR", "SCALAR", &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0]);
    assert_eq!(corners(&read_at(&gltf.glb(), 3.0).unwrap())[0][1], [3.0, 0.0, 2.0]);

    // A joint that moves takes what it holds along.
    let mut gltf = skinned();
    animate(&mut gltf, "translation", "LINEAR", "VEC3", &[0.0; 9]);
    gltf.json["animations"][0]["channels"][0]["target"]["node"] = 1.into();
    close(&corners(&read_at(&gltf.glb(), 0.0).unwrap()), &[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -0.5, 0.0]]]);
}

#[test]
fn broken_animations_are_refused_when_they_are_asked_for() {
    let mut cases = 0;
    let mut refuse = |place: &str, value: Value, word: &str| {
        let mut gltf = triangle();
        animate(&mut gltf, "translation", "LINEAR", "VEC3", &[0.0; 9]);
        set(&mut gltf.json, place, value);
        assert!(read(&gltf.glb()).is_ok(), "{place}: nobody asked");
        let error = read_at(&gltf.glb(), 1.0).unwrap_err();
        assert_eq!(error.fault, MeshFault::Broken, "{place}");
        assert!(error.detail.contains(word), "{place}: {error}");
        cases += 1;
    };
    refuse("/animations/0/channels/0/sampler", json!(1), "sampler");
    refuse("/animations/0/channels/0/target/node", json!(3), "node");
    refuse("/animations/0/channels/0/target/path", json!("colour"), "changes something");
    refuse("/animations/0/samplers/0/input", json!(2), "key times");
    refuse("/animations/0/samplers/0/output", json!(99), "accessor 99");
    refuse("/animations/0/samplers/0/interpolation", json!("CUBICSPLINE"), "need 9 values, and 3");
    refuse("/animations/0/samplers/0/interpolation", json!("SPLINE"), "unknown");
    refuse("/accessors/1/bufferView", json!(0), "do not rise");
    refuse("/accessors/1/count", json!(2), "need 2 values, and 3");
    refuse("/nodes/0", json!({ "mesh": 0, "matrix": moved(0.0, 0.0, 0.0).to_vec() }), "matrix");
    refuse("/animations/0", json!([]), "animation 0");
    assert_eq!(cases, 11);
    let still = read_at(&triangle().glb(), 1.0).unwrap();
    assert_eq!(codes(&still), ["animation_missing"]);
}

#[test]
fn known_models_move() {
    let fox = data::bytes("models/Fox.glb");
    let still = read(&fox).unwrap();
    let moments = [0.0, 0.5, 1.0].map(|time_s| read_at(&fox, time_s).unwrap());
    assert_eq!(codes(&still), ["animations_ignored"]);
    for moment in &moments {
        assert_eq!(moment.triangles.len(), still.triangles.len());
        // A fox stays a fox: about as large, and where it was.
        assert!((moment.to_file.scale / still.to_file.scale - 1.0).abs() < 0.01);
        assert_ne!(moment.positions, still.positions);
    }
    assert_ne!(moments[0].positions, moments[1].positions);
    assert_close(&moments[2], &read_at(&fox, 1.0).unwrap(), 0.0);
    let stress = data::bytes("models/MorphStressTest.gltf");
    let [a, b] = [0.1, 0.6].map(|time_s| read_at(&stress, time_s).unwrap());
    assert_ne!(a.positions, b.positions);
}

#[test]
fn the_report_can_be_of_a_moment() {
    let server = Server::start(&[]);
    let mut gltf = triangle();
    animate(&mut gltf, "scale", "LINEAR", "VEC3", &[1.0, 1.0, 1.0, 1.0, 9.0, 1.0, 1.0, 9.0, 1.0]);
    let stored = server.post("/v1/meshes", &gltf.glb());
    let url = stored.json()["url"].as_str().unwrap().to_owned();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flagpole.glb");
    std::fs::write(&path, gltf.glb()).unwrap();
    let mut tags = std::collections::BTreeSet::new();
    for (query, set, height) in [
        ("", None, 1.0),
        ("?scene.time_s=null", Some("scene.time_s=null"), 1.0),
        ("?scene.time_s=1.5", Some("scene.time_s=1.5"), 5.0),
        ("?scene.time_s=2", Some("scene.time_s=2"), 9.0),
    ] {
        let report = server.get(&format!("{url}{query}"));
        let mut command = meshsnap();
        command.args(["inspect", "--json"]).arg(&path).args(set.iter().flat_map(|set| ["--set", set]));
        let printed = command.output().unwrap();
        assert_eq!(String::from_utf8_lossy(&report.body), String::from_utf8_lossy(&printed.stdout), "{query}");
        assert_eq!(report.json()["bounds"]["size"][1], height, "{query}");
        tags.insert(report.header("etag").unwrap().to_owned());
    }
    assert_eq!(tags.len(), 3, "a moment has a tag of its own, none has the mesh's");
    server.get(&format!("{url}?scene.time_s=-1")).problem(400, "out_of_range");
    server.get(&format!("{url}?scene.time_s=1&scene.time_s=2")).problem(400, "conflicting_keys");
    let detail = server.get(&format!("{url}?size=8")).problem(400, "unknown_key");
    assert!(detail.contains("scene.time_s") && detail.contains("`entry`"), "{detail}");
    server.post("/v1/meshes?scene.time_s=1", &gltf.glb()).problem(400, "unknown_key");
}

#[test]
fn the_service_draws_a_moment() {
    let server = Server::start(&[]);
    let mut gltf = triangle();
    // Stretched to a flagpole: the fitted picture changes with it.
    animate(&mut gltf, "scale", "LINEAR", "VEC3", &[1.0, 1.0, 1.0, 1.0, 9.0, 1.0, 1.0, 9.0, 1.0]);
    let etag = |query: &str| {
        let answer = server.post(&format!("/v1/render?size=32&view=front{query}"), &gltf.glb());
        assert_eq!(answer.status, 200, "{query}");
        answer.header("etag").unwrap().to_owned()
    };
    let [still, start, middle, end, late] =
        ["", "&scene.time_s=0", "&scene.time_s=1.5", "&scene.time_s=2", "&scene.time_s=1000"].map(etag);
    assert_eq!(still, start);
    assert_eq!(end, late);
    assert!(start != middle && middle != end && start != end);
    assert_eq!(server.post("/v1/render?scene.time_s=-1", &gltf.glb()).status, 400);
}
