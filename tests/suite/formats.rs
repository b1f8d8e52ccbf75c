//! Every format that is read gives the same mesh for the same shape, and the shape keeps what matters.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use crate::mesh_files::{Gltf, Solid, read, read_as};
use meshsnap::mesh::edges::EdgeList;
use meshsnap::mesh::topology::Topology;
use meshsnap::mesh::{Format, Mesh, UpAxis};
use serde_json::json;

fn edges(mesh: &Mesh) -> EdgeList {
    let limits = meshsnap::limits::Limits::default();
    EdgeList::of(mesh, &mut meshsnap::limits::Budget::new(&limits)).unwrap()
}

/// What must not depend on the format.
fn assert_same_shape(a: &Mesh, b: &Mesh, what: &str) {
    assert_eq!(a.positions, b.positions, "{what}");
    assert_eq!(a.triangles, b.triangles, "{what}");
    assert_eq!(a.face_normals, b.face_normals, "{what}");
    assert_eq!(a.bounds, b.bounds, "{what}");
    assert_eq!(a.to_file, b.to_file, "{what}");
}

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
        let files: [(Vec<u8>, Format, UpAxis); 5] = [
            (solid.obj().into_bytes(), Format::Obj, UpAxis::Y),
            (solid.stl_binary(), Format::StlBinary, UpAxis::Z),
            (solid.stl_ascii().into_bytes(), Format::StlAscii, UpAxis::Z),
            (gltf.glb(), Format::Glb, UpAxis::Y),
            (gltf.gltf().into_bytes(), Format::Gltf, UpAxis::Y),
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
    assert_eq!(cases, 10);
}

#[test]
fn a_box_is_watertight_and_its_quads_stay_quads() {
    let mesh = read(Solid::cuboid().obj().as_bytes()).unwrap();
    let edges = edges(&mesh);
    let topology = Topology::of(&mesh, &edges);
    assert_eq!((topology.components, topology.euler_characteristic, topology.is_watertight), (1, 2, true));
    assert_eq!((mesh.triangles.len(), topology.edges), (12, 18));
    assert_eq!(edges.edges.iter().filter(|e| e.is_polygon_edge).count(), 12);
    // Two units long becomes one: the scale is the next power of two.
    assert_eq!(mesh.to_file.scale, 2.0);
    assert_eq!(mesh.bounds, [[-0.25, -0.5, -0.125], [0.25, 0.5, 0.125]]);
    for (t, n) in mesh.triangles.iter().zip(&mesh.face_normals) {
        let middle: Vec<f32> = (0..3).map(|k| t.iter().map(|&v| mesh.positions[v as usize][k]).sum::<f32>()).collect();
        assert!((0..3).map(|k| middle[k] * n[k]).sum::<f32>() > 0.0, "normals point outwards");
        assert_eq!(n.iter().map(|c| c * c).sum::<f32>(), 1.0);
    }
}

/// The area of the triangles, and that none runs against the polygon, tell that a polygon was cut rightly.
#[test]
fn concave_polygons_are_cut_inside() {
    let comb = |teeth: u32| {
        let mut outline = vec![[0.0, 0.0], [f64::from(2 * teeth), 0.0]];
        for i in (0..2 * teeth).rev() {
            outline.push([f64::from(i) + 0.5, if i % 2 == 0 { 3.0 } else { 1.0 }]);
        }
        outline
    };
    let star = |n: u32| -> Vec<[f64; 2]> {
        (0..2 * n)
            .map(|i| {
                let (r, a) = (if i % 2 == 0 { 2.0 } else { 0.5 }, f64::from(i) * std::f64::consts::PI / f64::from(n));
                [r * libm::cos(a), r * libm::sin(a)]
            })
            .collect()
    };
    let shapes: Vec<Vec<[f64; 2]>> = vec![
        vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
        vec![[0.0, 0.0], [2.0, 2.0], [4.0, 0.0], [2.0, 1.0 / 8.0]], // a quad with a reflex corner: one diagonal is wrong
        vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0]], // corners in line
        vec![
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 4.0],
            [0.0, 4.0],
            [0.0, 0.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [3.0, 3.0],
            [3.0, 1.0],
            [1.0, 1.0],
        ],
        comb(3),
        comb(20),
        star(5),
        star(101),
    ];
    let mut cases = 0;
    for outline in &shapes {
        let n = outline.len();
        let signed: f64 = (0..n)
            .map(|i| outline[i][0] * outline[(i + 1) % n][1] - outline[(i + 1) % n][0] * outline[i][1])
            .sum::<f64>();
        for axis in 0..3 {
            for reversed in [false, true] {
                let mut obj = String::new();
                for p in outline {
                    let mut q = [0.25; 3];
                    (q[axis], q[(axis + 1) % 3]) = (p[0], p[1]);
                    obj += &format!("v {} {} {}\n", q[0], q[1], q[2]);
                }
                let order: Vec<usize> = if reversed { (1..=n).rev().collect() } else { (1..=n).collect() };
                obj += &format!("f {}\n", order.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
                let mesh = read(obj.as_bytes()).unwrap();
                let normal_axis = (axis + 2) % 3;
                let sign = if reversed { -signed.signum() } else { signed.signum() };
                let mut area = 0.0;
                for (t, normal) in mesh.triangles.iter().zip(&mesh.face_normals) {
                    assert_eq!(f64::from(normal[normal_axis]), sign, "{outline:?}");
                    let p = t.map(|v| mesh.positions[v as usize].map(f64::from));
                    let (u, v) = (axis, (axis + 1) % 3);
                    area += (p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) - (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]);
                }
                let area = area * mesh.to_file.scale * mesh.to_file.scale;
                assert!((area.abs() - signed.abs()).abs() < 1e-5 * signed.abs(), "{area} {signed} {outline:?}");
                // Every corner is joined to the next by an edge that is drawn.
                let drawn = edges(&mesh).edges.iter().filter(|e| e.is_polygon_edge).count();
                let bridges = usize::from(n == 10 && outline[0] == outline[4]);
                assert_eq!(drawn, n - bridges, "{outline:?}");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, shapes.len() * 6);
}

#[test]
fn convex_quads_are_cut_along_the_shorter_diagonal() {
    let quad = |first: usize| {
        let corners = [[0.0, 0.0], [3.0, 0.0], [4.0, 1.0], [1.0, 1.0]];
        let mut obj = String::new();
        for k in 0..4 {
            let p = corners[(first + k) % 4];
            obj += &format!("v {} {} 0\n", p[0], p[1]);
        }
        read((obj + "f 1 2 3 4\n").as_bytes()).unwrap()
    };
    for first in 0..4 {
        let mesh = quad(first);
        let hidden = edges(&mesh).edges.into_iter().find(|e| !e.is_polygon_edge).unwrap();
        let [a, b] = hidden.vertices.map(|v| mesh.positions[v as usize]);
        assert_eq!((a[0] - b[0]).abs() * 4.0, 2.0, "from (3, 0) to (1, 1)");
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
    // In f32 the tiny ones have no area left, and are counted; but they were not taken for faces along a line.
    assert_eq!((mesh.triangles.len(), mesh.report.dropped_degenerate_faces), (1, 2));
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
    assert_eq!(mesh.uvs[mesh.attribute_triangles[1][0] as usize], [1.0, 1.0]);
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
fn obj_in_all_its_forms() {
    let cube = Solid::cuboid();
    let plain = read(cube.obj().as_bytes()).unwrap();
    let n = cube.positions.len() as i64;
    let relative = {
        let mut out = String::new();
        for [x, y, z] in &cube.positions {
            out += &format!("v {x} {y} {z} 1.0\n");
        }
        for p in &cube.polygons {
            let corners: Vec<String> = p.iter().map(|v| format!("{}//", i64::from(*v) - n)).collect();
            out += &format!("f {}\n", corners.join(" "));
        }
        out
    };
    let variants = [
        cube.obj().replace('\n', "\r\n"),
        cube.obj().replace('\n', "\r"),
        format!("\u{feff}{}", cube.obj()),
        cube.obj().replace("\nf ", "\no part\ng a b\ns 1\nf "),
        cube.obj().replace("\nf ", "\n f\t").replace("v ", "  v   "),
        cube.obj().replace("\nf ", "\nf \\\n"),
        cube.obj().replace("\nf ", " # a comment\nf "),
        format!("f\nf 1\nf 1 2\nl 1 2\np 1\n{}", cube.obj()),
        relative,
        cube.obj() + "curv 0 1 2\nunknown words here\n",
    ];
    for (i, text) in variants.iter().enumerate() {
        let mesh = read(text.as_bytes()).unwrap_or_else(|e| panic!("variant {i}: {e}"));
        assert_same_shape(&plain, &mesh, text);
        assert_eq!(mesh.edge_masks, plain.edge_masks);
    }
    let mut latin1 = cube.obj().into_bytes();
    latin1.extend(b"# caf\xe9\ng caf\xe9\nusemtl caf\xe9\n");
    assert_same_shape(&plain, &read(&latin1).unwrap(), "latin-1");
}

#[test]
fn obj_faces_of_different_forms_keep_their_own_attributes() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.25 0.5\nvn 1 0 0\n\
               f 1 2 3\nf 1/1 2/1 4/1\nf 1//1 3//1 4//1\nf 2/1/1 3/1/1 4/1/1\nf 1/1 2 3/1/1\n";
    let mesh = read(obj.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.len(), 5);
    let at = |t: usize, c: usize| mesh.attribute_triangles[t][c] as usize;
    let face = |t: usize| mesh.face_normals[t];
    let expected_uv = [[0.0; 2], [0.25, 0.5], [0.0; 2], [0.25, 0.5], [0.0; 2]];
    let expected_normal = [face(0), face(1), [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], face(4)];
    for t in 0..5 {
        for c in 0..3 {
            assert_eq!(mesh.uvs[at(t, c)], expected_uv[t], "{t}");
            if t != 4 {
                assert_eq!(mesh.normals[at(t, c)], expected_normal[t], "{t}");
            }
        }
    }
    assert!(mesh.report.warnings.iter().any(|w| w.code == "normals_repaired"));
}

#[test]
fn obj_materials_and_colours() {
    let obj = "mtllib x.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0\nv 0 0 1 0 0 1 0.5\n\
               usemtl Red Glass\nf 1 2 3\nusemtl Blue\nf 1 2 4\nusemtl Red Glass\nf 1 3 4\n";
    let mesh = read(obj.as_bytes()).unwrap();
    let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["Red Glass", "Blue"]);
    assert_eq!(mesh.triangle_materials, [0, 1, 0]);
    let color = |t: usize, c: usize| mesh.colors[mesh.attribute_triangles[t][c] as usize];
    assert_eq!(color(0, 0), [1.0, 0.0, 0.0, 1.0]);
    assert!((color(0, 1)[1] - 0.2140411).abs() < 1e-6, "sRGB 0.5 is linear 0.214");
    assert_eq!(color(0, 2), [1.0; 4], "a vertex without a colour is white");
    assert_eq!(color(1, 2), [0.0, 0.0, 1.0, 1.0]);
    for code in ["mtl_ignored", "colors_incomplete"] {
        assert!(mesh.report.warnings.iter().any(|w| w.code == code), "{code}");
    }
    let unnamed = read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl A\nf 3 2 1\n").unwrap();
    assert_eq!(unnamed.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["", "A"]);
    assert_eq!(unnamed.triangle_materials, [0, 1]);
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
