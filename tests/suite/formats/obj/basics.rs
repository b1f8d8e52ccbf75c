//! OBJ: forms of the text, faces with different attributes, materials, and colours of vertices.

use crate::support::files::mesh::{Solid, read};
use crate::support::files::same::assert_same_shape;
use crate::support::scenes;

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
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.25 0.625\nvn 1 0 0\n\
               f 1 2 3\nf 1/1 2/1 4/1\nf 1//1 3//1 4//1\nf 2/1/1 3/1/1 4/1/1\nf 1/1 2 3/1/1\n";
    let mesh = read(obj.as_bytes()).unwrap();
    assert_eq!(mesh.triangles.len(), 5);
    // v runs up in OBJ, and down in a mesh.
    let at = |t: usize, c: usize| mesh.attribute_triangles[t][c] as usize;
    let face = |t: usize| mesh.face_normals[t];
    let expected_uv = [[0.0; 2], [0.25, 0.375], [0.0; 2], [0.25, 0.375], [0.0; 2]];
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
fn vertex_colors_are_shown_as_they_are() {
    let base = |obj: &str| {
        let mesh = scenes::mesh(obj);
        scenes::plan(&mesh, &scenes::spec(&[("style", "unlit")])).surface.unwrap().materials[0].base_color
    };
    let grey = base("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    assert!(grey[0] < 0.7, "{grey:?}");
    assert_eq!(base("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n"), [1.0; 4]);
}
