//! OFF files: every prefix, colours of all kinds, comments, binary ones, and broken ones.

use crate::support::data::large_folder;
use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::mesh::{Solid, codes, read, read_as, read_limited};
use crate::support::files::same::assert_same_shape;
use crate::support::server::Server;
use meshsnap_render::import::{Format, MeshFault};
use meshsnap_render::limits::Limits;

/// A box with `extra` words after the position of each vertex, and `color` after each face.
fn off(head: &str, extra: &str, color: &str) -> String {
    let solid = Solid::cuboid();
    let mut out = head.to_owned();
    for [x, y, z] in &solid.positions {
        out += &format!("{x} {y} {z}{extra}\n");
    }
    for polygon in &solid.polygons {
        let words: Vec<String> = polygon.iter().map(u32::to_string).collect();
        out += &format!("{} {}{color}\n", words.len(), words.join(" "));
    }
    out
}

fn plain() -> String {
    off("OFF\n8 6 12\n", "", "")
}

/// Big-endian, with colours of the faces if asked.
fn binary(with_color: bool) -> Vec<u8> {
    let solid = Solid::cuboid();
    let mut out = b"OFF BINARY\n".to_vec();
    [8_i32, 6, 12].iter().for_each(|n| out.extend(n.to_be_bytes()));
    solid.positions.iter().flatten().for_each(|c| out.extend((*c as f32).to_be_bytes()));
    for polygon in &solid.polygons {
        out.extend((polygon.len() as i32).to_be_bytes());
        polygon.iter().for_each(|v| out.extend((*v as i32).to_be_bytes()));
        out.extend((if with_color { 3_i32 } else { 0 }).to_be_bytes());
        if with_color {
            [1.0_f32, 0.0, 0.0].iter().for_each(|c| out.extend(c.to_be_bytes()));
        }
    }
    out
}

#[test]
fn prefixes_in_the_order_of_meshlab_put_colours_before_normals() {
    let cases = [
        ("CNOFF\n8 6 0\n", " 0 0 1 255 0 0"),
        ("NCOFF\n8 6 0\n", " 255 0 0 255 0 0 1"),
        ("NCOFF\n8 6 0\n", " 255 0 0 0 0 1"),
        ("NCSTOFF\n8 6 0\n", " 255 0 0 255 0 0 1 0.25 0.75"),
        ("CSTOFF\n8 6 0\n", " 255 0 0 255 0.25 0.75"),
        ("STCNOFF\n8 6 0\n", " 0 0 1 255 0 0 255 0.25 0.75"),
    ];
    for (head, extra) in cases {
        let mesh = read(off(head, extra, "").as_bytes()).unwrap_or_else(|error| panic!("{head}: {error}"));
        assert_eq!(mesh.triangles.len(), 12, "{head}");
        assert!(mesh.colors.iter().all(|color| *color == [1.0, 0.0, 0.0, 1.0]), "{head}: {:?}", mesh.colors);
        assert!(mesh.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]), "{head}: {:?}", mesh.normals);
        assert_eq!((mesh.normals.is_empty(), mesh.uvs.is_empty()), (!head.contains('N'), !head.contains("ST")));
        assert!(mesh.uvs.iter().all(|uv| *uv == [0.25, 0.25]), "{head}: {:?}", mesh.uvs);
    }
    assert_eq!(cases.len(), 6);
    assert!(read(off("NCOFF\n8 6 0\n", " 255 0 0 0 0", "").as_bytes()).is_err());
}

#[test]
fn off_in_all_its_forms_is_the_same_shape_as_obj() {
    let obj = read(Solid::cuboid().obj().as_bytes()).unwrap();
    let forms = [
        plain(),
        plain().replace('\n', "\r\n"),
        plain().replace('\n', "\r"),
        plain().replace("8 6 12\n", "8 6\n"),
        plain().replace("OFF\n8", "OFF 8"),
        plain().replace("OFF\n8", "OFF8"),
        plain().replace("OFF\n", "\u{feff}# made by a test\n\nOFF # here it begins\n# and goes on\n\n"),
        plain().replace("0.5\n", "0.5 # a comment\n\n"),
        plain().replace(" ", "\t  "),
        off("COFF\n8 6 0\n", " 255 0 0 255", ""),
        off("COFF\n8 6 0\n", " 0.5 0 0", ""),
        off("NOFF\n8 6 0\n", " 0 0 1", ""),
        off("STOFF\n8 6 0\n", " 0.25 0.75", ""),
        off("STCNOFF\n8 6 0\n", " 0 0 1 0.5 0.5 0.5 1 0.25 0.75", ""),
        off("OFF\n8 6 0\n", " 255 0 0", ""),
        off("OFF\n8 6 0\n", "", " 3"),
        off("OFF\n8 6 0\n", "", " 255 0 0"),
        off("OFF\n8 6 0\n", "", " 0.5 0.25 0 0.5 # colour"),
        // A vertex over two lines.
        plain().replace(" 2.25 ", "\n2.25 "),
    ];
    for text in &forms {
        let mesh = read(text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_same_shape(&obj, &mesh, text);
        assert_eq!(mesh.edge_masks, obj.edge_masks, "{text}");
        assert_eq!((mesh.report.format, mesh.report.polygons_by_arity[4]), (Format::Off, 6), "{text}");
        assert_eq!(codes(&mesh), [""; 0], "{text}");
    }
    assert_eq!(forms.len(), 19);
    for with_color in [false, true] {
        let mesh = read(&binary(with_color)).unwrap();
        assert_same_shape(&obj, &mesh, "binary");
        assert_eq!(mesh.colors.is_empty(), !with_color);
    }
    // Without its keyword it must be named.
    let bare = plain().replace("OFF\n", "");
    assert!(read(bare.as_bytes()).is_err());
    assert_same_shape(&obj, &read_as(bare.as_bytes(), Some(Format::Off)).unwrap(), "bare");
}

#[test]
fn colours_normals_and_texture_coordinates_are_read() {
    let half = 0.214_041_14_f32;
    let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
    let cases = [
        ("COFF\n8 6 0\n", " 255 0 0 51", "", [1.0, 0.0, 0.0, 0.2]),
        ("COFF\n8 6 0\n", " 0.5 0 1.0 0.25", "", [half, 0.0, 1.0, 0.25]),
        ("COFF\n8 6 0\n", " 1 0 0", "", [1.0, 0.0, 0.0, 1.0]),
        ("COFF\n8 6 0\n", " 127.5 0 255.0", "", [half, 0.0, 1.0, 1.0]),
        ("OFF\n8 6 0\n", "", " 0 255 0", [0.0, 1.0, 0.0, 1.0]),
        ("OFF\n8 6 0\n", "", " 0.5 0.0 1.0 0.5", [half, 0.0, 1.0, 0.5]),
        ("STCNOFF\n8 6 0\n", " 0 0 1 1.0 0.0 0.5 0.25 0.75", " 9 9 9", [1.0, 0.0, half, 1.0]),
    ];
    for (head, extra, color, expected) in cases {
        let mesh = read(off(head, extra, color).as_bytes()).unwrap();
        assert!(mesh.colors.iter().all(|c| near(*c, expected)) && !mesh.colors.is_empty(), "{head}: {:?}", mesh.colors);
        assert_eq!(mesh.materials[0].base_color, Some([1.0; 4]));
        assert_eq!(codes(&mesh).contains(&"face_colors_ignored"), !extra.is_empty() && !color.is_empty());
        if head.contains('N') {
            assert!(
                mesh.normals.iter().all(|n| *n == [0.0, 0.0, 1.0]) && mesh.uvs.iter().all(|uv| *uv == [0.25, 0.25])
            );
        }
    }
    assert_eq!(cases.len(), 7);
    // Each face its own colour, the first and the last none.
    let mut text = plain();
    for (i, line) in ["4 0 1 5 4", "4 2 6 7 3", "4 0 4 6 2"].iter().enumerate() {
        text = text.replace(line, &format!("{line} {} 0 0", [255, 0, 51][i]));
    }
    let mesh = read(text.as_bytes()).unwrap();
    let red = |t: usize| mesh.attribute_triangles[t].map(|v| mesh.colors[v as usize][0]);
    let green = |t: usize| mesh.attribute_triangles[t].map(|v| mesh.colors[v as usize][1]);
    assert_eq!([red(0), red(2), red(4), red(6), red(10)], [[1.0; 3], [1.0; 3], [1.0; 3], [0.0; 3], [1.0; 3]]);
    assert_eq!([green(0), green(4), green(5), green(11)], [[1.0; 3], [0.0; 3], [0.0; 3], [1.0; 3]]);
}

#[test]
fn broken_files_are_told_with_their_line() {
    let cases: [(String, MeshFault, &str); 15] = [
        ("OFF\n8 6".into(), MeshFault::Broken, "8 vertices and 6 faces"),
        ("OFF\n".into(), MeshFault::Broken, "are missing"),
        ("OFF\n3\n".into(), MeshFault::Broken, "are missing"),
        ("OFF\n4000000000 1 0\n".into(), MeshFault::Broken, "need"),
        ("OFF\n99999999999 1 0\n".into(), MeshFault::Broken, "4 billion"),
        ("OFF\n1 18446744073709551615 0\n0 0 0\n".into(), MeshFault::Broken, "need"),
        (
            plain().replace("4 0 2 3 1", "4 0 2 3 8"),
            MeshFault::Broken,
            "line 11 of the OFF file: the face refers to vertex 8",
        ),
        (plain().replace("4 0 2 3 1", "4 0 2 3 -1"), MeshFault::Broken, "vertex -1"),
        (plain().replace("4 0 2 3 1", "4000000000 0 2 3 1"), MeshFault::Broken, "more than the file has left"),
        (plain().replace("1.5 2.25 -4", "1.5 2.25 x"), MeshFault::Broken, "line 3 of the OFF file: \"x\" is no number"),
        (plain().replace("1.5 2.25 -4", "1.5 2.25 -4 7"), MeshFault::Broken, "a vertex has 3 numbers, and here are 4"),
        (off("COFF\n8 6 0\n", " 1 1 1 1 1", ""), MeshFault::Broken, "6 numbers, or one more for alpha"),
        ("4OFF\n8 6 0\n".into(), MeshFault::Unsupported, "4OFF"),
        ("nOFF 3\n8 6 0\n".into(), MeshFault::Unsupported, "nOFF"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n".into(), MeshFault::Empty, "3 vertices and 1 face"),
    ];
    for (text, fault, part) in &cases {
        let error = read(text.as_bytes()).unwrap_err();
        assert!(error.fault == *fault && error.detail.contains(part), "{text}: {error}");
    }
    let more = plain().replace("8 6 12", "8 7 12") + "2 1 1\n" + "left over\n";
    let mesh = read(more.as_bytes()).unwrap();
    assert_eq!(codes(&mesh), ["short_faces_ignored", "trailing_bytes"]);
    for limits in [
        Limits::default().with(|limits| limits.triangles = 11),
        Limits::default().with(|limits| limits.memory_bytes = 100),
    ] {
        for bytes in [plain().into_bytes(), binary(true)] {
            assert!(matches!(read_limited(&bytes, None, &limits).unwrap_err().fault, MeshFault::Limit(_)));
        }
    }
}

#[test]
fn files_cut_off_or_changed_are_survived() {
    let text = off("STCNOFF\n8 6 0\n", " 0 0 1 0.5 0.5 0.5 1 0.25 0.75", " 1 2 3 # c");
    // Without the comment, and then the colour's words, it is whole; and so is the last corner.
    let drawn = cut_everywhere(text.as_bytes(), Format::Off);
    assert!(drawn > 0 && drawn < 30, "{drawn}");
    assert_eq!(cut_everywhere(&binary(true), Format::Off), 0);
    for (good, seed) in [(text.into_bytes(), 0x0FF1), (binary(true), 0x0FF2)] {
        let drawn = mutate(&good, Format::Off, 20_000, seed);
        assert!(drawn > 1000 && drawn < 19_000, "{drawn}");
    }
}

#[test]
fn real_files_and_the_service_read_it() {
    let server = Server::start(&[]);
    let sniffed = server.post("/v1/render?size=32", plain().as_bytes());
    sniffed.picture(32, 32);
    assert_eq!(server.post("/v1/render?size=32&format_in=off", plain().as_bytes()).body, sniffed.body);
    let formats = server.get("/v1/capabilities").json()["mesh_formats"].clone();
    assert!(formats.as_array().unwrap().contains(&"off".into()), "{formats}");
}

#[test]
fn large_files_have_their_known_sizes() {
    let Some(models) = large_folder("models") else { return };
    let sizes = [("3holes.off", 3596, 7200), ("ballA.off", 1900, 3796), ("comments.off", 8, 12)];
    for (name, vertices, triangles) in sizes {
        let mesh = read(&std::fs::read(models.join(name)).unwrap()).unwrap();
        assert_eq!((mesh.report.file_vertices, mesh.triangles.len()), (vertices, triangles), "{name}");
        assert_eq!(codes(&mesh), [""; 0], "{name}");
    }
}
