//! glTF: the document and its container, buffers and extensions.

use crate::support::files::mesh::{Solid, glb, read};
use meshsnap_render::import::MeshFault;
use serde_json::{Value, json};

#[test]
fn buffers_come_from_the_chunk_or_a_data_uri_and_from_nowhere_else() {
    let gltf = Solid::cuboid().triangulated(&[[0, 1, 2], [0, 1, 4]]).gltf();
    let expected = read(&gltf.glb()).unwrap();
    let text = gltf.gltf();
    assert_eq!(read(text.as_bytes()).unwrap().positions, expected.positions);
    assert_eq!(read(format!("\u{feff} \n{text}").as_bytes()).unwrap().positions, expected.positions);
    let unpadded = text.replace("=\"", "\"");
    assert_eq!(read(unpadded.as_bytes()).unwrap().positions, expected.positions);

    let fault_of = |buffer: Value| {
        let mut json: Value = serde_json::from_str(&text).unwrap();
        json["buffers"] = json!([buffer]);
        read(json.to_string().as_bytes()).unwrap_err()
    };
    let length = gltf.bin.len();
    let mut cases = 0;
    for uri in ["a.bin", "../../etc/passwd", "file:///etc/passwd", "http://127.0.0.1/a.bin", "%FF", "", "\\\\host\\a"] {
        let error = fault_of(json!({ "byteLength": length, "uri": uri }));
        assert_eq!(error.fault, MeshFault::OutsideBundle, "{uri}");
        assert!(error.detail.contains(uri), "{}", error.detail);
        cases += 1;
    }
    for uri in
        ["data:", "data:;base64", "data:;base64,", "data:;base64,!!!!", "data:text/plain,AAAA", "data:;base64,AAAA"]
    {
        assert_eq!(fault_of(json!({ "byteLength": length, "uri": uri })).fault, MeshFault::Broken, "{uri}");
        cases += 1;
    }
    assert_eq!(fault_of(json!({ "byteLength": length })).fault, MeshFault::Broken, "no data at all");
    assert_eq!(cases, 13);

    // A buffer that only a texture needs is never looked at.
    let mut textured = gltf.clone();
    let buffers = textured.json["buffers"].as_array_mut().unwrap();
    buffers.push(json!({ "byteLength": 4, "uri": "texture.bin" }));
    assert!(read(&textured.glb()).is_ok());
}

#[test]
fn required_extensions_are_known_or_named() {
    let mut gltf = Solid::cuboid().triangulated(&[[0, 1, 2], [0, 1, 4]]).gltf();
    gltf.json["extensionsUsed"] = json!(["EXT_anything"]);
    assert!(read(&gltf.glb()).is_ok());
    gltf.json["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_texture_transform", "KHR_mesh_quantization"]);
    assert!(read(&gltf.glb()).is_ok());
    gltf.json["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_materials_new", "EXT_x"]);
    let error = read(&gltf.glb()).unwrap_err();
    assert_eq!(error.fault, MeshFault::Unsupported);
    assert!(error.detail.ends_with("KHR_materials_new, EXT_x"), "{}", error.detail);
    gltf.json.as_object_mut().unwrap().remove("extensionsRequired");
    for version in ["1.0", "3.0", "", "x"] {
        gltf.json["asset"] = json!({ "version": version });
        assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Unsupported);
    }
}

#[test]
fn glb_containers_may_have_more_chunks_and_no_binary_one() {
    let gltf = Solid::cuboid().triangulated(&[[0, 1, 2], [0, 1, 4]]).gltf();
    let mut bytes = gltf.glb();
    let expected = read(&bytes).unwrap().mesh.positions;
    bytes.extend([4, 0, 0, 0, b'A', b'B', b'C', b'D', 1, 2, 3, 4]);
    let length = (bytes.len() as u32).to_le_bytes();
    bytes[8..12].copy_from_slice(&length);
    assert_eq!(read(&bytes).unwrap().positions, expected);
    bytes.extend([1, 2, 3]);
    let mesh = read(&bytes).unwrap();
    assert!(mesh.report.warnings.iter().any(|w| w.code == "trailing_bytes"));

    let text = gltf.gltf();
    let mut alone = glb(&text, &[]);
    alone.truncate(alone.len() - 8);
    let length = (alone.len() as u32).to_le_bytes();
    alone[8..12].copy_from_slice(&length);
    assert_eq!(read(&alone).unwrap().positions, expected, "no second chunk");
}

#[test]
fn scenes_may_be_left_out() {
    let mut gltf = Solid::cuboid().triangulated(&[[0, 1, 2], [0, 1, 4]]).gltf();
    let expected = read(&gltf.glb()).unwrap().mesh.positions;
    let root = gltf.json.as_object_mut().unwrap();
    root.remove("scene");
    assert_eq!(read(&gltf.glb()).unwrap().positions, expected);
    gltf.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(read(&gltf.glb()).unwrap().positions, expected, "all root nodes");
    gltf.json.as_object_mut().unwrap().remove("nodes");
    assert_eq!(read(&gltf.glb()).unwrap().positions, expected, "all meshes");
    // So are integers with a fraction of zero.
    let floats = gltf.gltf().replace("\"count\":8,", "\"count\":8.0,");
    assert!(floats.contains("8.0"));
    assert_eq!(read(floats.as_bytes()).unwrap().positions, expected);
    // An empty scene is legal, though the crate's types disagree; but there is nothing to draw.
    gltf.json["scenes"] = json!([{}]);
    assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Empty);
}

/// Some readers pass over a text without a look at it, and others do not: then lists were empty
/// that are not.
#[test]
fn bytes_that_are_no_text_are_named_wherever_they_are() {
    let mut gltf = Solid::cuboid().triangulated(&[[0, 2, 3]]).gltf();
    gltf.json["materials"] = json!([{ "name": "Gr?n" }]);
    gltf.json["meshes"][0]["primitives"][0]["material"] = 0.into();
    gltf.json["animations"] = json!([{ "name": "g?n" }]);
    gltf.json["extras"] = json!("x?y");
    let text = gltf.gltf();
    assert_eq!(read(text.as_bytes()).unwrap().materials[0].name, "Gr?n");
    let mut cases = 0;
    for (at, _) in text.match_indices('?') {
        let mut bytes = text.clone().into_bytes();
        bytes[at] = 0xFC;
        let error = read(&bytes).unwrap_err();
        assert!(error.detail.contains(&format!("byte {at} of the glTF JSON is not UTF-8")), "{error}");
        cases += 1;
    }
    assert_eq!(cases, 3);
    let twice = text.replacen("{", "{\"materials\":[],", 1);
    assert!(read(twice.as_bytes()).unwrap_err().detail.contains("duplicate field"));
}
