//! glTF: instances, and nodes that are hidden.

use crate::support::files::mesh::{Gltf, Solid, corners, read, read_limited};
use meshsnap_render::import::{MeshError, MeshFault};
use meshsnap_render::limits::Limits;
use serde_json::{Value, json};

fn instanced() -> Gltf {
    let mut gltf = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7]]).gltf();
    let t = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0, 20.0, 0.0]);
    let r = gltf.accessor("VEC4", 5120, 3, &[0, 0, 0, 127, 0, 0, 127, 0, 0, 0, 0, 127]);
    gltf.json["accessors"][r]["normalized"] = true.into();
    let s = gltf.floats("VEC3", &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, -2.0]);
    gltf.json["nodes"][0]["scale"] = json!([2, 2, 2]);
    gltf.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": t, "ROTATION": r, "SCALE": s, "_ID": t } } });
    gltf.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    gltf
}

#[test]
fn instances_stand_where_their_attributes_say() {
    let gltf = instanced();
    let mesh = read(&gltf.glb()).unwrap();
    let mut one = gltf.clone();
    one.json["nodes"][0].as_object_mut().unwrap().remove("extensions");
    let first = corners(&read(&one.glb()).unwrap());
    let all = corners(&mesh);
    assert_eq!((first.len(), all.len()), (2, 6));
    let near = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
        assert!(a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} is not {b:?}");
    };
    for (t, &shape) in first.iter().enumerate() {
        near(all[t], shape);
        near(all[2 + t], shape.map(|[x, y, z]| [20.0 - x, -y, z]));
        let [a, b, c] = shape.map(|[x, y, z]| [2.0 * x, 40.0 + 2.0 * y, -2.0 * z]);
        near(all[4 + t], [a, c, b]);
    }
    // Counted before they are read: as many as would be drawn.
    let exact =
        |triangles| read_limited(&gltf.glb(), None, &Limits::default().with(|limits| limits.triangles = triangles));
    assert!(exact(6).is_ok());
    assert!(matches!(exact(5).unwrap_err().fault, MeshFault::Limit(_)));
    let refuse = |change: &dyn Fn(&mut Value)| -> MeshError {
        let mut gltf = instanced();
        change(&mut gltf.json);
        read(&gltf.glb()).unwrap_err()
    };
    let many = refuse(&|json| {
        for accessor in [2, 3, 4] {
            json["accessors"][accessor] =
                json!({ "type": "VEC3", "componentType": 5126, "count": 4_000_000_000_000_u64 });
        }
    });
    assert!(matches!(many.fault, MeshFault::Limit(_)) && many.detail.contains("triangles"), "{many}");
    assert!(refuse(&|json| json["accessors"][2]["count"] = 2.into()).detail.contains("equally many"));
    assert!(refuse(&|json| json["accessors"][3]["normalized"] = false.into()).detail.contains("ROTATION"));
    assert!(refuse(&|json| json["accessors"][4]["type"] = "VEC2".into()).detail.contains("SCALE"));
}

#[test]
fn hidden_nodes_hide_what_is_below_them() {
    let mut gltf = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7]]).gltf();
    gltf.json["nodes"] = json!([
        { "children": [1, 2] },
        { "mesh": 0, "translation": [9, 0, 0], "children": [3], "extensions": { "KHR_node_visibility": { "visible": false } } },
        { "mesh": 0, "extensions": { "KHR_node_visibility": {} } },
        { "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": true } } },
    ]);
    gltf.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    let mesh = read(&gltf.glb()).unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.report.content.unwrap().triangles, 2);
    gltf.json["nodes"][0]["extensions"] = json!({ "KHR_node_visibility": { "visible": false } });
    assert_eq!(read(&gltf.glb()).unwrap_err().fault, MeshFault::Empty);
}

#[test]
fn the_only_instance_is_as_one_of_several() {
    let torn = Solid::cuboid().triangulated(&[[0, 2, 3], [4, 5, 7]]);
    let placed = [json!({}), json!({ "translation": [3, 0, 1], "scale": [2, 1, 4] }), json!({ "scale": [-1, 1, 1] })];
    for placed in placed {
        let with_nodes = |count: usize| {
            let mut gltf = torn.gltf();
            let mut node = placed.clone();
            node["mesh"] = 0.into();
            gltf.json["nodes"] = json!(vec![node; count]);
            gltf.json["scenes"] = json!([{ "nodes": (0..count).collect::<Vec<_>>() }]);
            read(&gltf.glb()).unwrap()
        };
        let (one, two) = (with_nodes(1), with_nodes(2));
        assert_eq!((one.triangles.len(), two.triangles.len()), (2, 4));
        assert_eq!(corners(&one)[..], corners(&two)[..2], "{placed}");
        assert_eq!((&one.positions, &one.face_normals[..]), (&two.positions, &two.face_normals[..2]));
        assert_eq!(one.report.file_vertices * 2, two.report.file_vertices);
    }
}
