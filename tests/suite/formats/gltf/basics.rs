//! glTF: primitive modes, accessor encodings, the node tree, materials with vertex colours, and
//! what is counted of a file.

use crate::support::files::mesh::{Gltf, Read, corners, read};
use meshsnap_render::import::MeshFault;
use serde_json::{Value, json};

/// Six points that make a zigzag band.
const BAND: [f32; 18] = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.5, 1.0, 1.0, 0.0, 2.0, 0.0, 0.25, 2.0, 1.0, 0.0];

fn band(indices: Option<&[u16]>, mode: u32) -> Result<Read, meshsnap_render::import::MeshError> {
    let mut gltf = Gltf::default();
    let position = gltf.floats("VEC3", &BAND);
    let mut primitive = json!({ "attributes": { "POSITION": position }, "mode": mode });
    if let Some(indices) = indices {
        primitive["indices"] = gltf.shorts("SCALAR", indices).into();
    }
    gltf.mesh(primitive);
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    read(&gltf.glb())
}

fn band_corners(triangles: &[[usize; 3]]) -> Vec<[[f64; 3]; 3]> {
    let point = |i: usize| std::array::from_fn(|k| f64::from(BAND[i * 3 + k]));
    triangles.iter().map(|t| t.map(point)).collect()
}

#[test]
fn lists_strips_and_fans() {
    type Case<'a> = (Option<&'a [u16]>, u32, &'a [[usize; 3]]);
    let cases: [Case<'_>; 6] = [
        (None, 4, &[[0, 1, 2], [3, 4, 5]]),
        (Some(&[0, 2, 1, 5, 4]), 4, &[[0, 2, 1]]), // two left over
        (None, 5, &[[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]),
        (Some(&[1, 0, 3, 2]), 5, &[[1, 0, 3], [0, 2, 3]]),
        (None, 6, &[[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]),
        (Some(&[2, 5, 3]), 6, &[[5, 3, 2]]),
    ];
    for (indices, mode, expected) in cases {
        let mesh = band(indices, mode).unwrap();
        assert_eq!(corners(&mesh), band_corners(expected), "mode {mode}");
    }
    for (mode, expected) in [(0, [0, 6]), (1, [3, 0]), (2, [6, 0]), (3, [5, 0])] {
        let mesh = band(None, mode).unwrap();
        let points = mesh.lines_and_points.iter().filter(|one| one.is_point()).count();
        assert_eq!(
            ([mesh.lines_and_points.len() - points, points], mesh.triangles.len()),
            (expected, 0),
            "mode {mode}"
        );
    }
    assert_eq!(band(None, 7).unwrap_err().fault, MeshFault::Broken);
}

/// The same square in every component type, plain and normalised.
#[test]
fn every_component_type_and_normalisation() {
    let square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
    let build = |component: u32, bytes: usize, one: i64, normalised: bool| {
        let mut gltf = Gltf::default();
        // A multiple of 4 bytes an element, as vertices are aligned.
        let element = |c: &[i64; 3]| -> Vec<u8> {
            let mut out: Vec<u8> = c.iter().flat_map(|c| (c * one).to_le_bytes()[..bytes].to_vec()).collect();
            out.resize(out.len().next_multiple_of(4), 0);
            out
        };
        let data: Vec<u8> = square.iter().flat_map(element).collect();
        let position = gltf.accessor("VEC3", component, 4, &data);
        gltf.json["accessors"][position]["normalized"] = normalised.into();
        gltf.json["bufferViews"][0]["byteStride"] = (data.len() / 4).into();
        let index = gltf.accessor("SCALAR", 5121, 6, &[0, 1, 2, 0, 2, 3]);
        gltf.mesh(json!({ "attributes": { "POSITION": position }, "indices": index }));
        gltf.json["nodes"] = json!([{ "mesh": 0 }]);
        gltf
    };
    let mut cases = 0;
    for (component, bytes, largest) in [(5120, 1, 127), (5121, 1, 255), (5122, 2, 32767), (5123, 2, 65535)] {
        for normalised in [false, true] {
            let mut gltf = build(component, bytes, if normalised { largest } else { 100 }, normalised);
            let error = read(&gltf.glb()).unwrap_err();
            assert!(error.detail.contains("KHR_mesh_quantization"), "{error}");
            gltf.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
            let mesh = read(&gltf.glb()).unwrap();
            let side = if normalised { 1.0 } else { 100.0 };
            assert_eq!(corners(&mesh)[0][2][..2], [side; 2], "{component} {normalised}");
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
            cases += 1;
        }
    }
    // Forms that no extension allows.
    for (component, normalised) in [(5125, false), (5125, true), (5126, true), (5124, false)] {
        let mut gltf = build(component, 4, 1, normalised);
        gltf.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Broken, "{component}");
        cases += 1;
    }
    // Signed ones reach down to -1, which the lowest value would exceed.
    let mut gltf = Gltf::default();
    let low = gltf.accessor("VEC3", 5120, 3, &[0x80, 0, 0, 9, 0x7f, 0, 0, 9, 0, 0x7f, 0, 9]);
    gltf.json["accessors"][low]["normalized"] = true.into();
    gltf.json["bufferViews"][0]["byteStride"] = 4.into();
    gltf.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    gltf.mesh(json!({ "attributes": { "POSITION": low } }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    assert_eq!(corners(&read(&gltf.glb()).unwrap())[0], [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(cases, 12);
}

#[test]
fn strides_and_offsets() {
    let mut gltf = Gltf::default();
    // Position and normal interleaved, with four odd bytes before.
    let mut bytes = vec![9, 9, 9, 9];
    for p in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0_f32]] {
        bytes.extend(p.iter().chain(&[0.0, 0.0, 5.0]).flat_map(|c| c.to_le_bytes()));
    }
    let view = gltf.view(&bytes);
    gltf.json["bufferViews"][view]["byteStride"] = 24.into();
    gltf.json["accessors"] = json!([
        { "bufferView": view, "byteOffset": 4, "type": "VEC3", "componentType": 5126, "count": 3 },
        { "bufferView": view, "byteOffset": 16, "type": "VEC3", "componentType": 5126, "count": 3 },
    ]);
    gltf.mesh(json!({ "attributes": { "POSITION": 0, "NORMAL": 1 } }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    let mesh = read(&gltf.glb()).unwrap();
    assert_eq!(corners(&mesh)[0][1], [1.0, 0.0, 0.0]);
    assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 3]);
    // One byte more than there is, and elements that overlap.
    gltf.json["accessors"][1]["byteOffset"] = 17.into();
    assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Broken);
    gltf.json["accessors"][1]["byteOffset"] = 16.into();
    gltf.json["bufferViews"][view]["byteStride"] = 8.into();
    assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Broken);
}

#[test]
fn sparse_accessors_with_and_without_a_view() {
    for with_view in [true, false] {
        let mut gltf = Gltf::default();
        let position = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 7.0, 7.0, 7.0, 0.0, 1.0, 0.0]);
        let indices = gltf.view(&[1, 0, 2, 0]);
        let values: Vec<u8> = [2.0, 0.0, 0.0, 0.0, 3.0, 0.0_f32].iter().flat_map(|v| v.to_le_bytes()).collect();
        let values = gltf.view(&values);
        let accessor = &mut gltf.json["accessors"][position];
        accessor["sparse"] = json!({ "count": 2, "indices": { "bufferView": indices, "componentType": 5123 },
                                     "values": { "bufferView": values } });
        if !with_view {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        gltf.mesh(json!({ "attributes": { "POSITION": position } }));
        gltf.json["nodes"] = json!([{ "mesh": 0 }]);
        let mesh = read(&gltf.glb()).unwrap();
        assert_eq!(corners(&mesh), [[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]]);

        let sparse = |key: &str, value: Value| {
            let mut gltf = gltf.clone();
            *gltf.json["accessors"][position]["sparse"].pointer_mut(key).unwrap() = value;
            read(&gltf.glb()).unwrap_err().fault
        };
        assert_eq!(sparse("/count", json!(4)), MeshFault::Broken, "more than there are");
        assert_eq!(sparse("/count", json!(4_000_000_000_000_u64)), MeshFault::Broken);
        assert_eq!(sparse("/indices/componentType", json!(5125)), MeshFault::Broken, "too few bytes");
        assert_eq!(sparse("/indices/componentType", json!(5126)), MeshFault::Broken);
        assert_eq!(sparse("/indices/bufferView", json!(99)), MeshFault::Broken);
        assert_eq!(sparse("/values/bufferView", json!(indices)), MeshFault::Broken);
        let mut outside = gltf.clone();
        outside.json["accessors"][position]["sparse"]["indices"]["byteOffset"] = 2.into();
        assert_eq!(read(&outside.glb()).unwrap_err().fault, MeshFault::Broken);
    }
}

#[test]
fn the_node_tree_places_meshes() {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let n = gltf.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    gltf.mesh(json!({ "attributes": { "POSITION": p, "NORMAL": n } }));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    gltf.json["scenes"] = json!([{ "nodes": [] }, { "nodes": [0, 4] }]);
    gltf.json["scene"] = 1.into();
    gltf.json["nodes"] = json!([
        { "translation": [10, 0, 0], "children": [1, 2] },
        { "mesh": 0, "rotation": [0, 0, half * 3.0, half * 3.0] }, // a quarter turn, not normalised
        { "scale": [2, 2, -2], "children": [3] },
        { "mesh": 0, "translation": [0, 0, 5] },
        // By columns: x to y, y to x, z up by 1.
        { "mesh": 0, "matrix": [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1] },
        { "mesh": 0 }, // not in the scene
    ]);
    let mesh = read(&gltf.glb()).unwrap();
    let rounded: Vec<[[i64; 3]; 3]> = corners(&mesh).iter().map(|t| t.map(|p| p.map(|c| c.round() as i64))).collect();
    assert_eq!(
        rounded,
        [
            [[10, 0, 0], [10, 1, 0], [9, 0, 0]],
            [[10, 0, -10], [10, 2, -10], [12, 0, -10]], // mirrored: two corners change places
            [[0, 0, 1], [1, 0, 1], [0, 1, 1]],          // mirrored again
        ]
    );
    let normals: Vec<[f32; 3]> = mesh.attribute_triangles.iter().map(|t| mesh.normals[t[0] as usize]).collect();
    assert_eq!(normals[0], [0.0, 0.0, 1.0]);
    assert_eq!(normals[1], [0.0, 0.0, -1.0]);
    assert_eq!(normals[2], [0.0, 0.0, 1.0]);
    for (face, normal) in mesh.face_normals.iter().zip(&normals) {
        assert!(face[2] * normal[2] > 0.99, "windings agree with normals");
    }
    // Normals stay perpendicular under uneven scales.
    let mut slope = Gltf::default();
    let p = slope.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
    let n = slope.floats("VEC3", &[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    slope.mesh(json!({ "attributes": { "POSITION": p, "NORMAL": n } }));
    slope.json["nodes"] = json!([{ "mesh": 0, "scale": [4, 1, 1] }]);
    let mesh = read(&slope.glb()).unwrap();
    let dot: f32 = (0..3).map(|k| mesh.normals[0][k] * mesh.face_normals[0][k]).sum();
    assert!((dot.abs() - 1.0).abs() < 1e-6);
}

#[test]
fn materials_and_colours() {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &BAND);
    let rgb = gltf.accessor("VEC3", 5121, 6, &[255; 18]);
    let rgba: Vec<u16> = (0..24).map(|i| if i % 4 == 0 { 65535 } else { 0 }).collect();
    let rgba = gltf.shorts("VEC4", &rgba);
    for accessor in [rgb, rgba] {
        gltf.json["accessors"][accessor]["normalized"] = true.into();
    }
    gltf.json["materials"] =
        json!([{ "name": "Glass", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0, 0.5] } }, {}]);
    gltf.json["meshes"] = json!([{ "primitives": [
        { "attributes": { "POSITION": p, "COLOR_0": rgb }, "mode": 5, "material": 1 },
        { "attributes": { "POSITION": p, "COLOR_0": rgba }, "mode": 4 },
        { "attributes": { "POSITION": p }, "mode": 6, "material": 0 },
    ]}]);
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    let mesh = read(&gltf.glb()).unwrap();
    assert_eq!(mesh.triangle_materials, [1, 1, 1, 1, 2, 2, 0, 0, 0, 0]);
    assert_eq!(mesh.materials[0].name, "Glass");
    assert_eq!(mesh.materials[0].base_color, Some([0.5, 0.25, 0.0, 0.5]));
    assert_eq!((mesh.materials[2].name.as_str(), mesh.materials[2].base_color), ("", None));
    let color = |t: usize| mesh.colors[mesh.attribute_triangles[t][0] as usize];
    assert_eq!((color(0), color(4), color(9)), ([1.0; 4], [1.0, 0.0, 0.0, 0.0], [1.0; 4]));
    gltf.json["meshes"][0]["primitives"][0]["material"] = 2.into();
    assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Broken);
}

#[test]
fn what_a_file_has_is_counted() {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &BAND);
    let i = gltf.shorts("SCALAR", &[0, 1, 2, 3, 4]);
    let of = |mode: usize, indices: Option<usize>| json!({ "attributes": { "POSITION": p }, "mode": mode, "indices": indices });
    let all: Vec<Value> = (0..7).flat_map(|mode| [of(mode, None), of(mode, Some(i))]).collect();
    gltf.json["meshes"] = json!([{ "primitives": all }]);
    // Shown twice, and counted once.
    gltf.json["nodes"] = json!([{ "mesh": 0, "children": [1] }, { "mesh": 0 }]);
    let mesh = read(&gltf.glb()).unwrap();
    let content = mesh.report.content.unwrap();
    assert_eq!((content.draw_calls, content.vertices), (14, 14 * 6));
    assert_eq!(content.points, 6 + 5);
    assert_eq!(content.segments, (3 + 2) + (6 + 5) + (5 + 4));
    assert_eq!(content.triangles, (2 + 1) + (4 + 3) + (4 + 3));
    assert_eq!(mesh.lines_and_points.len() as u64, 2 * (content.points + content.segments));
    assert_eq!(mesh.report.warnings, []);
}
