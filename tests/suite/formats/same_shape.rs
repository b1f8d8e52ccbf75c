//! One shape in OBJ, STL, glTF and PLY is the same mesh; OFF, FBX and 3MF are compared in their own
//! files. Also tests what the import makes of a file: scale, normals of slivers, welded positions,
//! and faces and attributes that are dropped or repaired.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use crate::support::files::mesh::{Gltf, Solid, read, read_as};
use crate::support::files::ply::Encoding;
use crate::support::files::same::{assert_same_shape, edges};
use meshsnap_render::import::Format;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::UpAxis;
use meshsnap_render::mesh::topology::Topology;
use serde_json::json;

#[test]
fn one_shape_in_every_format_is_one_mesh() {
    let mut cases = 0;
    for solid in [Solid::cuboid(), Solid::grid(9)] {
        let polygons = read(solid.obj().as_bytes()).unwrap();
        assert_eq!(polygons.report.format, Format::Obj);
        assert_eq!(polygons.report.polygons_by_arity[4], solid.polygons.len() as u64);
        assert_eq!(polygons.positions.len(), solid.positions.len());

        // In file space the welded positions are the file's, so its triangles can be written back.
        let file: Vec<u32> = polygons
            .positions
            .iter()
            .map(|p| {
                let to_file = |k: usize| polygons.to_file.centre[k] + polygons.to_file.scale * f64::from(p[k]);
                let p = [to_file(0), to_file(1), to_file(2)];
                solid.positions.iter().position(|q| *q == p).unwrap() as u32
            })
            .collect();
        let triangles: Vec<[u32; 3]> = polygons.triangles.iter().map(|t| t.map(|v| file[v as usize])).collect();
        let solid = solid.triangulated(&triangles);

        let gltf = solid.gltf();
        let files: [(Vec<u8>, Format, UpAxis); 8] = [
            (solid.obj().into_bytes(), Format::Obj, UpAxis::Y),
            (solid.stl_binary(), Format::StlBinary, UpAxis::Z),
            (solid.stl_ascii().into_bytes(), Format::StlAscii, UpAxis::Z),
            (gltf.glb(), Format::Glb, UpAxis::Y),
            (gltf.gltf().into_bytes(), Format::Gltf, UpAxis::Y),
            (solid.ply(Encoding::Ascii), Format::Ply, UpAxis::Y),
            (solid.ply(Encoding::Little), Format::Ply, UpAxis::Y),
            (solid.ply(Encoding::Big), Format::Ply, UpAxis::Y),
        ];
        for (bytes, format, up) in files {
            let mesh = read(&bytes).unwrap();
            assert_eq!((mesh.report.format, mesh.up), (format, up));
            assert_same_shape(&polygons, &mesh, format.name());
            assert_eq!(mesh.edge_masks, vec![7; mesh.triangles.len()]);
            assert_eq!(mesh.materials.len(), 1);
            let named = Format::from_name(format.name()).unwrap();
            assert_same_shape(&mesh, &read_as(&bytes, Some(named)).unwrap(), "named");
            cases += 1;
        }
    }
    assert_eq!(cases, 16);
}

#[test]
fn a_box_is_watertight_and_its_quads_stay_quads() {
    let mesh = read(Solid::cuboid().obj().as_bytes()).unwrap();
    let edges = edges(&mesh);
    let mut budget = Budget::new(&Limits::default());
    let topology = Topology::of(&mesh, &edges, &mut budget, &Deadline::default()).unwrap();
    assert_eq!((topology.components, topology.euler_characteristic, topology.is_watertight), (1, 2, true));
    assert_eq!((mesh.triangles.len(), topology.edges), (12, 18));
    assert_eq!(edges.iter().filter(|e| e.is_polygon_edge).count(), 12);
    // Two units long becomes one: the scale is the next power of two.
    assert_eq!(mesh.to_file.scale, 2.0);
    assert_eq!(mesh.bounds, [[-0.25, -0.5, -0.125], [0.25, 0.5, 0.125]]);
    for (t, n) in mesh.triangles.iter().zip(&mesh.face_normals) {
        let middle: Vec<f32> = (0..3).map(|k| t.iter().map(|&v| mesh.positions[v as usize][k]).sum::<f32>()).collect();
        assert!((0..3).map(|k| middle[k] * n[k]).sum::<f32>() > 0.0, "normals point outwards");
        assert_eq!(n.iter().map(|c| c * c).sum::<f32>(), 1.0);
    }
}

#[test]
fn scaling_by_a_power_of_two_changes_nothing() {
    let solid = Solid::grid(4);
    let plain = read(solid.obj().as_bytes()).unwrap();
    let mut cases = 0;
    for exponent in [-1000, -300, -149, -30, -1, 1, 20, 127, 600, 1010] {
        let factor = libm::ldexp(1.0, exponent);
        let mut scaled = solid.clone();
        scaled.positions.iter_mut().flatten().for_each(|c| *c *= factor);
        let mesh = read(scaled.obj().as_bytes()).unwrap();
        assert_eq!(mesh.positions, plain.positions, "{exponent}");
        assert_eq!(mesh.triangles, plain.triangles, "{exponent}");
        assert_eq!(mesh.face_normals, plain.face_normals, "{exponent}");
        assert_eq!(mesh.to_file.scale, plain.to_file.scale * factor);
        cases += 1;
    }
    assert_eq!(cases, 10);
}

#[test]
fn extents_of_any_size_fit_the_unit_box() {
    let mut cases = 0;
    for scale in ["1e300", "1e307", "1e-300", "1e-310", "5e-324", "3e38", "1e-45"] {
        let obj = format!("v 0 0 0\nv {scale} 0 0\nv 0 {scale} 0\nf 1 2 3\n");
        let mesh = read(obj.as_bytes()).unwrap();
        let extent = mesh.bounds[1][0] - mesh.bounds[0][0];
        assert!(extent > 0.5 && extent <= 1.0, "{scale}: {extent}");
        assert_eq!(mesh.face_normals, [[0.0, 0.0, 1.0]]);
        assert!(mesh.to_file.scale > 0.0 && mesh.to_file.scale.is_finite());
        cases += 1;
    }
    // A small thing far away: its own f64 precision is all there is, and all of it is kept.
    let mesh = read(b"v 1e9 1e9 1e9\nv 1000000001 1e9 1e9\nv 1e9 1000000000.5 1e9\nf 1 2 3\n").unwrap();
    assert_eq!(mesh.bounds, [[-0.5, -0.25, 0.0], [0.5, 0.25, 0.0]]);
    assert_eq!(cases, 7);
}

#[test]
fn slivers_and_tiny_faces_have_normals() {
    // A face of 1e-160 beside one of 1, and a needle: products of their edges underflow or cancel.
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e-160 0 0\nv 0 1e-160 0\nv 1 1e-170 0\nf 1 2 3\nf 1 4 5\nf 1 2 6\n";
    let mesh = read(obj.as_bytes()).unwrap();
    // In f32 the tiny ones have no area left, and are counted; but they were not taken for faces
    // along a line.
    let report = &mesh.report;
    assert_eq!((mesh.triangles.len(), report.dropped_degenerate_faces, report.dropped_collapsed_faces), (1, 0, 2));
    let tiny = "v 0 0 0\nv 1e-160 0 0\nv 0 1e-160 0\nf 1 2 3\n";
    assert_eq!(read(tiny.as_bytes()).unwrap().face_normals, [[0.0, 0.0, 1.0]]);
    let needle = "v 0 0 0\nv 1 0 0\nv 1 1e-30 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n";
    let mesh = read(needle.as_bytes()).unwrap();
    assert_eq!(mesh.face_normals, [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
}

#[test]
fn equal_positions_are_welded_and_attributes_are_not() {
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -0.0 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\n\
               vn 0 0 2\nvn 0 1 0\nvt 0 0\nvt 1 1\n\
               f 1/1/1 2/1/1 3/2/1\nf 4/2/2 5/1/2 6/1/2\n";
    let mesh = read(obj.as_bytes()).unwrap();
    assert_eq!(mesh.positions.len(), 4, "the unused vertex is dropped, the doubled ones are welded");
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.to_file.scale, 1.0, "unused vertices do not count in the bounds");
    let normal = |t: usize, c: usize| mesh.normals[mesh.attribute_triangles[t][c] as usize];
    assert_eq!((normal(0, 0), normal(1, 0)), ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]), "unit, and the file's");
    assert_eq!(mesh.uvs[mesh.attribute_triangles[1][0] as usize], [1.0, 0.0], "v runs down");
}

#[test]
fn bad_faces_are_dropped_and_counted() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 0 inf 0\nv 1e999 0 0\nv 0.5 0 0\n\
               f 1 2 3\nf 1 2 4\nf 1 2 3 5\nf 6 1 2\nf 1 7 2\nf 1 1 2\n";
    let mesh = read(obj.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.len(), 1);
    assert_eq!(mesh.report.dropped_nonfinite_faces, 3);
    assert_eq!(mesh.report.dropped_degenerate_faces, 2);
    assert_eq!(mesh.to_file.scale, 1.0);
}

#[test]
fn bad_gltf_attributes_are_repaired() {
    let mut gltf = Gltf::default();
    let p = gltf.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let n = gltf.floats("VEC3", &[0.0, 0.0, 9.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f32::INFINITY, 0.0]);
    let t = gltf.floats("VEC2", &[0.0, 0.0, f32::NAN, 1.0, 0.5, f32::INFINITY, 1.0, 1.0]);
    let c = gltf.floats("VEC3", &[f32::NAN, -1.0, 2.0, 0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let i = gltf.shorts("SCALAR", &[0, 1, 2, 0, 2, 3]);
    let attributes = json!({ "POSITION": p, "NORMAL": n, "TEXCOORD_0": t, "COLOR_0": c });
    gltf.mesh(json!({ "attributes": attributes, "indices": i }));
    gltf.json["nodes"] = json!([{ "mesh": 0 }]);
    let mesh = read(&gltf.glb()).unwrap();
    assert_eq!(mesh.normals[0], [0.0, 0.0, 1.0]);
    for n in &mesh.normals {
        assert!((n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-6, "{n:?}");
    }
    assert!(mesh.uvs.iter().flatten().all(|c| c.is_finite()));
    assert_eq!(mesh.colors[0], [1.0, 0.0, 1.0, 1.0]);
    for code in ["normals_repaired", "uvs_repaired"] {
        assert!(mesh.report.warnings.iter().any(|w| w.code == code), "{code}");
    }
}
