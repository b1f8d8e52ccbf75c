//! Meshes made to cost a lot: a limit refuses them before their memory is allocated. Polygons that
//! take too long to triangulate are cut into fans.

use meshsnap_render::import::{Bundle, MeshFault, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use serde_json::{Value, json};

use crate::support::files::mesh::{Gltf, Solid, read, read_limited};
use crate::support::files::ply::Encoding;
use crate::support::work::within_bytes;

#[test]
fn counts_are_paid_before_they_are_believed() {
    let triangle = || {
        let mut gltf = Gltf::default();
        let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        gltf.mesh(json!({ "attributes": { "POSITION": p } }));
        gltf.json["nodes"] = json!([{ "mesh": 0 }]);
        gltf
    };
    let is_limit = |bytes: &[u8]| {
        // A count of 4e12 that was believed would be terabytes.
        let error = within_bytes(1 << 30, "a count without data", || read(bytes).unwrap_err());
        assert!(matches!(error.fault, MeshFault::Limit(_)), "{error}");
        assert!(error.detail.contains("--limit-"), "{error}");
    };
    // A count without any data behind it.
    let mut empty = triangle();
    empty.json["accessors"][0] = json!({ "type": "VEC3", "componentType": 5126, "count": 4_000_000_000_000_u64 });
    is_limit(&empty.glb());
    // The same, with a sparse part that replaces as many as it says.
    for replaced in [1, 4_000_000_000_000_u64] {
        let mut sparse = empty.clone();
        sparse.json["accessors"][0]["sparse"] = json!({ "count": replaced, "indices": { "bufferView": 0, "componentType": 5125 },
                                                        "values": { "bufferView": 0 } });
        is_limit(&sparse.glb());
    }
    // Twice as many nodes a level: 2^40 triangles in 2 kB.
    let mut doubling = triangle();
    let mut nodes = vec![json!({ "mesh": 0 })];
    for i in 0..40 {
        nodes.push(json!({ "children": [i, i] }));
    }
    doubling.json["nodes"] = nodes.into();
    doubling.json["scenes"] = json!([{ "nodes": [40] }]);
    is_limit(&doubling.glb());
    // One node with a million children.
    let mut wide = triangle();
    wide.json["nodes"] = json!([{ "mesh": 0 }, { "children": vec![0; 1_000_000] }]);
    wide.json["scenes"] = json!([{ "nodes": [1] }]);
    is_limit(&wide.glb());
    // A cycle through several nodes is told as such.
    let mut cycle = triangle();
    cycle.json["nodes"] = json!([{ "children": [1] }, { "children": [2] }, { "children": [0], "mesh": 0 }]);
    assert!(read(&cycle.glb()).unwrap_err().detail.contains("ancestor"));
    // A chain as long as the limit is fine.
    let mut chain = triangle();
    let mut nodes: Vec<Value> = (1..100_000).map(|i| json!({ "children": [i] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    chain.json["nodes"] = nodes.into();
    assert_eq!(read(&chain.glb()).unwrap().triangles.len(), 1);
    // Deep JSON, where nothing reads it, and unclosed.
    for depth in [65, 100_000] {
        let mut json = triangle().json.to_string();
        json.pop();
        json += &format!(",\"extras\":{}{}}}", "[".repeat(depth - 1), "]".repeat(depth - 1));
        is_limit(json.as_bytes());
    }
    is_limit(format!("{{\"asset\":{}", "{\"a\":".repeat(1_000_000)).as_bytes());
    // Many empty objects: small in the file, large in memory.
    is_limit(format!("{{\"asset\":{{\"version\":\"2.0\"}},\"nodes\":[{}{{}}]}}", "{},".repeat(5_000_000)).as_bytes());
}

#[test]
fn triangles_and_memory_are_limited_in_every_format() {
    let solid = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7], [0, 1, 5]]);
    let gltf = solid.gltf();
    let files = [
        solid.obj().into_bytes(),
        gltf.gltf().into_bytes(),
        gltf.glb(),
        solid.stl_binary(),
        solid.stl_ascii().into_bytes(),
        solid.ply(Encoding::Ascii),
        solid.ply(Encoding::Little),
        solid.ply(Encoding::Big),
    ];
    for bytes in &files {
        let exact = Limits::default().with(|limits| limits.triangles = 3);
        assert!(read_limited(bytes, None, &exact).is_ok());
        for limits in [
            Limits::default().with(|limits| limits.triangles = 2),
            Limits::default().with(|limits| limits.memory_bytes = 100),
        ] {
            let error = read_limited(bytes, None, &limits).unwrap_err();
            assert!(matches!(error.fault, MeshFault::Limit(_)), "{error}");
        }
        let stopped = Deadline::default();
        stopped.stop();
        let limits = Limits::default();
        let error =
            import(&Bundle::of_one(bytes.clone()), None, &limits, &mut Budget::new(&limits), &stopped).unwrap_err();
        assert_eq!(error.fault, MeshFault::Stopped);
    }
}

#[test]
fn obj_text_that_explodes_is_refused() {
    let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let cases = [
        format!("{head}{}", "f 1 2 3\n".repeat(10_000_001)),
        format!("{head}{}", "f 1 2 3\nf 1/1 2/1 3/1\n".repeat(3_000_000)),
        format!("{head}f{}", " 1".repeat(20_000_000)),
    ];
    for text in &cases {
        let error = read(text.as_bytes()).unwrap_err();
        assert!(matches!(error.fault, MeshFault::Limit(_)), "{error}");
    }
    // Materials that change with every face cost no more than other lines.
    let changes = format!("{head}{}", "usemtl a\nf 1 2 3\nusemtl b\n".repeat(200_000));
    let mesh = read_limited(changes.as_bytes(), None, &Limits::default().with(|limits| limits.memory_bytes = 64 << 20))
        .unwrap();
    assert_eq!(mesh.triangles.len(), 200_000);
    assert_eq!(mesh.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
}

#[test]
fn names_of_libraries_take_the_memory_that_was_paid_for() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let limits = Limits::default().with(|limits| limits.memory_bytes = 64 << 20);
    let distinct: String = (0..400_000).map(|i| format!("mtllib {i}\n")).collect();
    let cases = [(distinct, false), ("mtllib a\n".repeat(1_000_000), true), ("mtllib\n".repeat(2_000_000), true)];
    for (lines, is_read) in cases {
        let bundle = Bundle::of_one(format!("{triangle}{lines}").into_bytes());
        let mut budget = Budget::new(&limits);
        let read = || import(&bundle, None, &limits, &mut budget, &Deadline::default()).is_ok();
        assert_eq!(within_bytes(limits.memory_bytes, "an OBJ file of libraries", read), is_read);
    }
}

#[test]
fn hostile_polygons_are_fanned() {
    // A spiral staircase of spikes keeps every ear test busy.
    let mut text = String::new();
    let n = 8000;
    for i in 0..n {
        let r = if i % 2 == 0 { 1.0 } else { 1.0 + f64::from(i) };
        let a = f64::from(i) * 0.7;
        text += &format!("v {} {} 0\n", r * libm::cos(a), r * libm::sin(a));
    }
    for _ in 0..20 {
        text += "f";
        for i in 1..=n {
            text += &format!(" {i}");
        }
        text += "\n";
    }
    let mesh = read(text.as_bytes()).unwrap();
    assert!(mesh.report.warnings.iter().any(|w| w.code == "polygons_fanned"));
}
