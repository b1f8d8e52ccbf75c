//! OBJ as editors, old programs and careless exporters write it, and inputs that are known to break
//! another parser, the crate `tobj`.

use crate::support::files::bundle::{files, read_bundle};
use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::mesh::{Solid, codes, read, read_as};
use crate::support::files::same::assert_same_shape;
use meshsnap_render::import::{Bundle, Format};

fn utf16(text: &str, order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    format!("\u{feff}{text}").encode_utf16().flat_map(order).collect()
}

#[test]
fn texts_of_every_encoding_and_line_end_are_one_shape() {
    let cube = Solid::cuboid().obj();
    let plain = read(cube.as_bytes()).unwrap();
    let named = cube.replace("\nf ", "\nusemtl Grün 中\nf ");
    let mut cases: Vec<(String, Vec<u8>)> = Vec::new();
    for (end, name) in [("\n", "LF"), ("\r\n", "CRLF"), ("\r", "CR"), (" \t\n", "trailing space"), ("\n\n", "gaps")] {
        let text = named.replace('\n', end);
        cases.push((format!("UTF-8 {name}"), text.clone().into_bytes()));
        cases.push((format!("marked {name}"), format!("\u{feff}{text}").into_bytes()));
        cases.push((format!("little {name}"), utf16(&text, u16::to_le_bytes)));
        cases.push((format!("big {name}"), utf16(&text, u16::to_be_bytes)));
    }
    for (name, bytes) in &cases {
        for format in [None, Some(Format::Obj)] {
            let mesh = read_as(bytes, format).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_same_shape(&plain, &mesh, name);
            assert_eq!(mesh.materials[0].name, "Grün 中", "{name}");
        }
    }
    assert_eq!(cases.len(), 20);
    // Latin-1 is no UTF-8, and its shape is all that must be right.
    let latin1: Vec<u8> = named.replace('中', "z").chars().map(|c| c as u8).collect();
    assert_same_shape(&plain, &read(&latin1).unwrap(), "Latin-1");
    let mtl = "newmtl Grün 中\r\nKd 1 0 0\r\n";
    for mtl in [mtl.as_bytes().to_vec(), utf16(mtl, u16::to_le_bytes), utf16(mtl, u16::to_be_bytes)] {
        let obj = utf16(&format!("mtllib m.mtl\n{named}"), u16::to_le_bytes);
        let mesh = read_bundle(&Bundle::of_files(files(&[("m.obj", &obj), ("m.mtl", &mtl)]))).unwrap();
        assert_eq!(mesh.materials[0].base_color, Some([1.0, 0.0, 0.0, 1.0]));
        assert_eq!(codes(&mesh), [""; 0]);
    }
    assert!(read(&utf16("Dear Sir,\n", u16::to_le_bytes)).unwrap_err().detail.contains("UTF-16"));
    let damaged = utf16(&cube, u16::to_le_bytes);
    cut_everywhere(&damaged, Format::Obj);
    let drawn = mutate(&damaged, Format::Obj, 20_000, 0x0B_2001);
    assert!(drawn > 100 && drawn < 19_900, "{drawn}");
}

#[test]
fn statements_in_all_their_spellings() {
    let square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0.5 0.5 0\nv 0 2 0\nvt 0 0\nvn 0 0 1\n";
    let expected = read(format!("{square}f 1 2 3 4 5\n").as_bytes()).unwrap();
    // A concave polygon: of its three triangles none may lie outside.
    let area: f32 = expected.triangles.iter().map(|t| area(t.map(|v| expected.positions[v as usize]))).sum();
    assert!((f64::from(area) * expected.to_file.scale.powi(2) - 2.5).abs() < 1e-6, "{area}");
    let faces = [
        "f -5 -4 -3 -2 -1\n",
        "f 1/1 2/1 3/1 4/1 5/1\n",
        "f 1//1 2//1 3//1 4//1 5//1\n",
        "f 1/1/1 2/1/1 3/1/1 4/1/1 5/1/1\n",
        "f -5/-1/-1 2/1/1 -3/1/-1 4/1/1 5/1/1\n",
        "f 1/1 2 3//1 4/1/1 5\n",
        "f 1/ 2/ 3// 4 5//\n",
        "f 1 2 \\\n3 \\\r\n4 5\n",
        "f 1 2 3 4 5 # done\n",
        "\tf\t1  2\t3 4 5\t\n",
        "g a b\no c\ns off\nlod 2\nf 1 2 3 4 5\n",
        "fo 1 2 3 4 5\n",
        "mtllib missing.mtl\nusemtl gone\nf 1 2 3 4 5\n",
    ];
    for face in faces {
        let mesh = read(format!("{square}{face}").as_bytes()).unwrap_or_else(|error| panic!("{face}: {error}"));
        assert_same_shape(&expected, &mesh, face);
        assert_eq!(mesh.report.polygons_by_arity[5], 1, "{face}");
    }
    assert_eq!(faces.len(), 13);
    let colored = read(b"v 0 0 0 255 0 0\nv 1 0 0 0 255 0\nv 0 1 0 0 0 255\nf 1 2 3\n").unwrap();
    assert_eq!(colored.colors, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
}

fn area([a, b, c]: [[f32; 3]; 3]) -> f32 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs() / 2.0
}

/// Each once stopped, broke or fooled `tobj` 4.0.5.
#[test]
fn traps_of_the_parser_beneath_are_no_traps_here() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    let with_mtl = |mtl: &[u8]| {
        let obj = format!("mtllib m.mtl\n{triangle}usemtl A\nf 1 2 3\n");
        read_bundle(&Bundle::of_files(files(&[("m.obj", obj.as_bytes()), ("m.mtl", mtl)])))
    };
    let drawn: [(&str, Vec<u8>, usize); 8] = [
        ("mixed forms in a face", format!("{triangle}f 1/1 2 3\n").into_bytes(), 1),
        ("a byte that is not UTF-8", [triangle.as_bytes(), b"o caf\xE9\nf 1 2 3\n"].concat(), 1),
        ("some vertices with colours", b"v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n".to_vec(), 1),
        ("an empty f", format!("{triangle}f\nf 1 2 3\n").into_bytes(), 1),
        ("f with spaces alone", format!("{triangle}f   \nf 1 2 3\n").into_bytes(), 1),
        ("a path in mtllib", format!("mtllib /etc/passwd\nmtllib ../../x.mtl\n{triangle}f 1 2 3\n").into_bytes(), 1),
        ("NaN in a vertex", format!("{triangle}v nan 0 0\nf 1 2 3\nf 1 2 4\n").into_bytes(), 1),
        ("a line of three words", format!("{triangle}l 1 2 3\nf 1 2 3\n").into_bytes(), 1),
    ];
    for (name, bytes, triangles) in &drawn {
        let mesh = read(bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(mesh.triangles.len(), *triangles, "{name}");
    }
    assert_eq!(drawn.len(), 8);
    assert_eq!(read(&drawn[6].1).unwrap().report.dropped_nonfinite_faces, 1);
    for mtl in
        ["newmtl A\nKd 0.5\n", "newmtl A\nKd\n", "newmtl A\nNs\nd\nillum x\nKd a b c\n", "Kd 1 1 1\n", "newmtl\n"]
    {
        assert_eq!(with_mtl(mtl.as_bytes()).unwrap().triangles.len(), 1, "{mtl}");
    }
    // f32 would make one point of these.
    let far = read(b"v 100000000.25 0 0\nv 100000000.5 0 0\nv 100000000.25 1 0\nf 1 2 3\n").unwrap();
    assert_eq!((far.triangles.len(), far.to_file.centre[0]), (1, 100_000_000.375));
    for bad in ["f 1 2 4294967296\n", "f 1 2 18446744073709551616\n", "f 1 2 -4\n", "f 0 1 2\n", "f 1/9 2/9 3/9\n"] {
        let error = read(format!("{triangle}{bad}").as_bytes()).unwrap_err();
        assert!(error.detail.starts_with("line 5 of the OBJ file"), "{bad}: {error}");
    }
}

#[test]
fn comments_may_touch_what_is_before_them() {
    let plain = read(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\n").unwrap();
    let touched = "v 0 0 0#c\nv 1 0 0 #1 2 3\nv 0 1 0#c 1 0 0\nv 5 5 5 # c\nusemtl red # c\nf 1 2 3#c 4\n";
    let mesh = read(touched.as_bytes()).unwrap();
    assert_same_shape(&plain, &mesh, "touched");
    assert!(mesh.colors.is_empty() && mesh.materials[0].name == "red", "{:?}", mesh.materials);
    let named = read(touched.replace("red # c", "Material #25").as_bytes()).unwrap();
    assert_eq!(named.materials[0].name, "Material #25");
    // Microsoft's C library prints a number with `#`, which is no comment.
    let nan = read(touched.replace("v 5 5 5 # c", "v 1.#IND -1.#QNAN nan(ind)").as_bytes()).unwrap();
    assert_same_shape(&plain, &nan, "NaN");
    for broken in ["v 0 0#c\n", "v 0 0 #1\n", "v 1 2 3(\n"] {
        assert!(read(format!("{broken}{touched}").as_bytes()).is_err(), "{broken}");
    }
    let off = "OFF 3 1 0#c\n0 0 0#c\n1 0 0 # 1\n0 1 0\n3 0 1 2#c 4\n";
    assert_eq!(read(off.as_bytes()).unwrap().triangles.len(), 1);
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_eq!(read(ply.as_bytes()).unwrap().triangles.len(), 1);
    assert!(read(ply.replace("1 0 0", "1 0 0#c").as_bytes()).unwrap_err().detail.contains("0#c"));
}
