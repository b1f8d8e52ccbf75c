//! glTF: cameras of the scene, and polygons that the order of triangles encodes
//! (`FB_ngon_encoding`).

use crate::formats::gltf::surfaces::surface;
use crate::support::files::mesh::codes;
use crate::support::files::mesh::{Gltf, read};
use meshsnap_render::mesh::material::FileLens;
use serde_json::json;

#[test]
fn cameras_of_the_scene_in_its_order() {
    let mut gltf = surface(json!({}));
    let half = std::f64::consts::FRAC_1_SQRT_2;
    gltf.json["cameras"] = json!([
        { "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 }, "name": "main" },
        { "type": "orthographic", "orthographic": { "xmag": 3, "ymag": 2, "znear": 0, "zfar": 9 } },
        { "type": "perspective", "perspective": { "yfov": 4.0, "znear": 0.1 } },
    ]);
    gltf.json["nodes"] = json!([
        { "mesh": 0, "children": [1, 2, 4, 5] },
        // A quarter turn about y, scaled and mirrored: it looks along -x.
        { "camera": 1, "name": "side", "translation": [5, 1, 2], "rotation": [0, half, 0, half], "scale": [2, 3, -4], "children": [3] },
        { "camera": 0, "translation": [0, 0, 7] },
        { "camera": 0, "name": "last" },
        { "camera": 2 },
        { "camera": 9 },
        { "camera": 0 }, // not in the scene
    ]);
    let mesh = read(&gltf.glb()).unwrap();
    let names: Vec<&str> = mesh.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["side", "main", "main"]);
    let close = |axes: [[f64; 3]; 3], expected: [[f64; 3]; 3]| {
        let far = axes.iter().flatten().zip(expected.iter().flatten()).any(|(a, b)| (a - b).abs() > 1e-12);
        assert!(!far, "{axes:?} is not {expected:?}");
    };
    assert_eq!((mesh.cameras[0].eye, mesh.cameras[0].lens), ([5.0, 1.0, 2.0], FileLens::Orthographic { height: 4.0 }));
    // The mirrored z axis points away from the scene's +x, and picture right follows.
    close(mesh.cameras[0].axes, [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
    assert_eq!((mesh.cameras[1].eye, mesh.cameras[1].axes), (mesh.cameras[0].eye, mesh.cameras[0].axes), "a child");
    assert_eq!(mesh.cameras[2].eye, [0.0, 0.0, 7.0]);
    assert_eq!(mesh.cameras[2].lens, FileLens::Perspective { fov_deg: 1.0_f64.to_degrees() });
    close(mesh.cameras[2].axes, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    assert_eq!(codes(&mesh), ["camera_ignored"], "half a turn and more, and one that is not there");
}

#[test]
fn fans_are_polygons_where_the_file_says_so() {
    // A pentagon, a quad, a triangle that happens to begin with the quad's first corner, and a
    // triangle.
    let indices = [0, 1, 2, 0, 2, 3, 0, 3, 4, 5, 6, 7, 5, 7, 8, 5, 1, 2, 4, 3, 2];
    let build = |extension: bool, used: bool, mode: u32, scale: f64| {
        let mut gltf = Gltf::default();
        let around = |k: usize| [(k as f32).cos(), (k as f32).sin(), (k * k % 5) as f32];
        let p = gltf.floats("VEC3", &(0..9).flat_map(around).collect::<Vec<f32>>());
        let i = gltf.shorts("SCALAR", &indices);
        let mut primitive = json!({ "attributes": { "POSITION": p }, "indices": i, "mode": mode });
        if extension {
            primitive["extensions"] = json!({ "FB_ngon_encoding": {} });
        }
        gltf.mesh(primitive);
        if used {
            gltf.json["extensionsUsed"] = json!(["FB_ngon_encoding"]);
        }
        gltf.json["nodes"] = json!([{ "mesh": 0, "scale": [scale, 1, 1] }]);
        read(&gltf.glb()).unwrap()
    };
    let mesh = build(true, true, 4, 1.0);
    assert_eq!(mesh.edge_masks, [0b011, 0b010, 0b110, 0b011, 0b110, 0b111, 0b111]);
    assert_eq!(mesh.report.polygons_by_arity, [0, 0, 0, 2, 1, 1, 0, 0, 0, 0, 0, 0, 0]);
    // Mirrored, two corners of each triangle change places, and their edges with them.
    let mirrored = build(true, true, 4, -1.0);
    assert_eq!(mirrored.edge_masks, [0b110, 0b010, 0b011, 0b110, 0b011, 0b111, 0b111]);
    for plain in [build(false, true, 4, 1.0), build(true, false, 4, 1.0)] {
        assert_eq!(plain.edge_masks, [0b111; 7]);
        assert_eq!(plain.report.polygons_by_arity[3..5], [7, 0]);
    }
    let strip = build(true, true, 5, 1.0);
    assert!(strip.edge_masks.iter().all(|&m| m == 0b111), "a strip has no fans");
}
