//! PLY files that are broken or hostile: the error says what is wrong and where, and memory is
//! bounded.

use crate::support::data::{self, large_folder};
use crate::support::files::mesh::{read, read_as};
use crate::support::files::ply::{ENCODINGS, Encoding, INDICES, Ply, XYZ, list};
use crate::support::work::within_bytes;
use meshsnap_render::import::{Format, MeshError, MeshFault};

/// Bytes that a broken file may allocate.
const COST_MAX: u64 = 16 << 20;

const CORNERS: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn vertices(encoding: Encoding) -> Ply {
    Ply::new(encoding).element("vertex", &XYZ, &CORNERS.map(|p| p.to_vec()))
}

/// With a face given by its list.
fn with_face(encoding: Encoding, property: &str, record: &[f64]) -> Vec<u8> {
    vertices(encoding).element("face", &[property], &[record.to_vec()]).bytes()
}

fn broken(bytes: &[u8], expected: &str) {
    // The bundle is a copy of the bytes.
    let error = within_bytes(COST_MAX + bytes.len() as u64, expected, || read(bytes).unwrap_err());
    assert_eq!((&error.fault, error.detail.contains(expected)), (&MeshFault::Broken, true), "{expected}: {error}");
}

#[test]
fn header_errors_name_the_line() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n";
    let after: [(&str, &str); 18] = [
        ("element vertex 4\n", "line 5 of the PLY header: there is an element \"vertex\" already"),
        ("element face\n", "line 5 of the PLY header: \"element\" needs a name and a whole number, not \"face\""),
        ("element face -1\n", "not \"face -1\""),
        ("element face 1.5\n", "not \"face 1.5\""),
        ("element face 99999999999999999999\n", "not \"face 99999999999999999999\""),
        ("element\n", "line 5 of the PLY header: \"element\" needs a name"),
        ("property float\n", "line 5 of the PLY header: the property has no name"),
        ("property list uchar int\n", "the property has no name"),
        ("property half y\n", "line 5 of the PLY header: the type \"half\" is not char, uchar"),
        ("property list uchar index y\n", "the type \"index\" is not"),
        ("property\n", "the type \"\" is not"),
        ("format ascii 2.0\n", "line 5 of the PLY header: the version is \"2.0\", and 1.0 is the only one"),
        ("format utf8 1.0\n", "the format \"utf8\" is not ascii, binary_little_endian or"),
        ("proprety float y\n", "line 5 of the PLY header: \"proprety\" is no word that a line begins with"),
        ("\u{e9} \u{7}\n", "\"\u{e9}\" is no word"),
        ("property float y", "the PLY file ends after line 5 without an \"end_header\""),
        ("", "the PLY file ends after line 4 without an \"end_header\""),
        ("end_header\n", "the vertices of the PLY file lack one of the numbers x, y and z"),
    ];
    for (tail, expected) in after {
        broken(format!("{head}{tail}{}", if tail.contains("end") { "0 0 0 0 0\n" } else { "" }).as_bytes(), expected);
    }
    broken(b"ply\nend_header\n", "the PLY header has no \"format\" line");
    broken(b"ply\nformat ascii 1.0\nproperty float x\n", "line 3 of the PLY header: a property comes before the first");
    broken(b"ply\n\xff\xfe\n", "line 2 of the PLY header: \"\u{fffd}\u{fffd}\" is no word");
    let error = read_as(b"v 0 0 0\n", Some(Format::Ply)).unwrap_err();
    assert_eq!(error, MeshError::broken("the PLY file does not begin with a line that says \"ply\""));
    let list = "ply\nformat ascii 1.0\nelement vertex 1\nproperty list int int x\nproperty int y\nproperty int z\nend_header\n0 0 0\n";
    broken(list.as_bytes(), "lack one of the numbers x, y and z");
}

#[test]
fn headers_that_go_on_and_on_are_refused() {
    let head = "ply\nformat binary_little_endian 1.0\n";
    let elements: String = (0..1_000_000).map(|i| format!("element e{i} 0\n")).collect();
    let cases = [
        (
            format!("{head}comment {}\nend_header\n", "x".repeat(20_000)),
            "line 3 of the PLY header: it is longer than 16384",
        ),
        (format!("{head}comment {}", "x".repeat(60_000_000)), "line 3 of the PLY header: it is longer than 16384"),
        (format!("{head}{elements}end_header\n"), "line 259 of the PLY header: there are more than 256 elements"),
        (
            format!("{head}element vertex 0\n{}end_header\n", "property int8 p\n".repeat(1_000_000)),
            "line 4100 of the PLY header: there are more than 4096 properties",
        ),
        (format!("{head}{}", "comment TextureFile a\n".repeat(2000)), "more than 1000 textures are named"),
        (format!("{head}{}", "comment\n".repeat(1_000_000)), "no \"end_header\" in its first 1048576 bytes"),
        (format!("{head}{}", "\n".repeat(60_000_000)), "no \"end_header\" in its first 1048576 bytes"),
    ];
    for (text, expected) in cases {
        broken(text.as_bytes(), expected);
    }
}

#[test]
fn counts_must_fit_the_file() {
    for encoding in ENCODINGS {
        let good = vertices(encoding).element("face", &INDICES, &[list(&[0.0, 1.0, 2.0])]).bytes();
        let end = good.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let lie = |from: &str, to: &str| {
            let header = String::from_utf8(good[..end].to_vec()).unwrap().replace(from, to);
            [header.as_bytes(), &good[end..]].concat()
        };
        let bytes = if encoding == Encoding::Ascii { 6 } else { 12 };
        let expected =
            format!("says 4000000000000 records of \"vertex\", which need {} bytes", 4_000_000_000_000_u64 * bytes);
        broken(&lie("vertex 3", "vertex 4000000000000"), &expected);
        broken(&lie("face 1", "face 4000000000000"), "says 4000000000000 records of \"face\", which need");
        broken(
            &lie("face 1", "face 18446744073709551615"),
            "records of \"face\", which need 18446744073709551615 bytes",
        );
        broken(&lie("element face", "element other 99\nproperty double a\nelement face"), "99 records of \"other\"");
        // Vertices of nothing need no bytes, and are none.
        broken(
            &lie("face 1", "face 1\nelement vertices 9\nelement edge 9\nproperty list int int a"),
            "9 records of \"edge\"",
        );
        broken(&lie("face 1", "face 2"), "of the PLY file: the file ends within face 2 of 2");
    }
    for text in
        ["element vertex 5000000000\nproperty", "element face 1\nelement vertex 5000000000\nelement p 0\nproperty"]
    {
        let text = format!("ply\nformat ascii 1.0\n{text} list int int vertex_index\nend_header\n0\n");
        assert_eq!(read(text.as_bytes()).unwrap_err().fault, MeshFault::Broken);
    }
}

#[test]
fn lists_and_indices_are_checked() {
    let cases: [(&str, &[f64], &str); 12] = [
        (
            "list uchar int vertex_indices",
            &[3.0, 0.0, 1.0, 3.0],
            "face 1 of 1 refers to vertex 3, and there are 3, the first of them 0",
        ),
        ("list uchar int vertex_indices", &[3.0, 0.0, 1.0, -1.0], "face 1 of 1 refers to vertex -1, and there are 3"),
        ("list uchar uint vertex_indices", &[2.0, 0.0, 4294967295.0], "refers to vertex 4294967295"),
        ("list uchar float vertex_indices", &[3.0, 0.0, 1.0, 1.5], "refers to vertex 1.5"),
        ("list uchar float vertex_indices", &[3.0, 0.0, 1.0, f64::NAN], "refers to vertex NaN"),
        ("list uchar double vertex_indices", &[3.0, 0.0, 1.0, 1e300], "refers to vertex 1000000"),
        ("list int int vertex_indices", &[-3.0], "face 1 of 1 has a list of -3 items"),
        ("list char uchar vertex_indices", &[-1.0], "has a list of -1 items"),
        ("list float int vertex_indices", &[f64::NAN], "has a list of NaN items"),
        ("list double int vertex_indices", &[f64::INFINITY], "has a list of inf items"),
        ("list double int vertex_indices", &[2.5, 0.0, 1.0], "has a list of 2.5 items"),
        ("uchar vertex_indices", &[3.0], "the faces of the PLY file have no list \"vertex_indices\""),
    ];
    for encoding in ENCODINGS {
        for (property, record, expected) in cases {
            // Every value of a list counts as one record here, so that the writer believes any
            // count.
            let (first, rest) = record.split_at(1);
            let words: Vec<&str> = property.split(' ').collect();
            let mut bytes = vertices(encoding).line(&format!("element face 1\nproperty {property}")).bytes();
            let tail = |kind: &str, values: &[f64]| {
                let records: Vec<Vec<f64>> = values.iter().map(|&v| vec![v]).collect();
                let whole = Ply::new(encoding).element("x", &[&format!("{kind} y")], &records).bytes();
                let end = whole.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
                whole[end..].to_vec()
            };
            bytes.extend(tail(if words[0] == "list" { words[1] } else { words[0] }, first));
            if !rest.is_empty() {
                bytes.extend(tail(words[2], rest));
            }
            broken(&bytes, expected);
            let place = if encoding == Encoding::Ascii { "line 13 of the PLY file" } else { "byte " };
            assert!(words[0] != "list" || read(&bytes).unwrap_err().detail.contains(place), "{property}");
        }
        let huge = with_face(encoding, "list uint int vertex_indices", &[0.0]);
        let huge = match encoding {
            Encoding::Ascii => [&huge[..huge.len() - 3], b"4000000000 1 2".as_slice()].concat(),
            _ => [&huge[..huge.len() - 4], &[0xee; 12]].concat(),
        };
        broken(&huge, "items, and only");
        let strip =
            vertices(encoding).element("tristrips", &["list int int vertex_indices"], &[list(&[0.0, 1.0, -2.0])]);
        broken(&strip.bytes(), "tristrips 1 of 1 refers to vertex -2, and there are 3");
    }
    let text = String::from_utf8(with_face(Encoding::Ascii, INDICES[0], &list(&[0.0, 1.0, 2.0]))).unwrap();
    broken(
        text.replace("3 0 1 2", "3 0 one 2").as_bytes(),
        "line 13 of the PLY file: \"one\" is no number, in face 1 of 1",
    );
    broken(
        text.replace("1 0 0", "1 0,5 0").as_bytes(),
        "line 11 of the PLY file: \"0,5\" is no number, in vertex 2 of 3",
    );
    broken(text.replace("3 0 1 2", "3 0 1").as_bytes(), "line 13 of the PLY file: the file ends within face 1 of 1");
    let binary = with_face(Encoding::Little, INDICES[0], &list(&[0.0, 1.0, 2.0]));
    let cut = &binary[..binary.len() - 1];
    broken(
        cut,
        &format!(
            "byte {} of the PLY file: face 1 of 1 has a list of 3 items, and only 11 bytes follow",
            cut.len() - 12
        ),
    );
}

#[test]
fn what_can_be_read_around_is() {
    for encoding in ENCODINGS {
        let faces: Vec<Vec<f64>> =
            [&[0.0, 1.0, 2.0][..], &[], &[1.0], &[1.0, 2.0], &[0.0, 1.0, 3.0], &[0.0, 0.0, 1.0]].map(list).to_vec();
        let mut corners = CORNERS.map(|p| p.to_vec()).to_vec();
        corners.push(vec![f64::NAN, 0.0, 0.0]);
        let mut bytes = Ply::new(encoding).element("vertex", &XYZ, &corners).element("face", &INDICES, &faces).bytes();
        let mesh = read(&bytes).unwrap();
        assert_eq!(mesh.triangles.len(), 1);
        assert_eq!((mesh.report.dropped_nonfinite_faces, mesh.report.dropped_degenerate_faces), (1, 1));
        let details =
            |bytes: &[u8]| read(bytes).unwrap().report.warnings.into_iter().map(|w| w.detail).collect::<Vec<_>>();
        let short = "faces with fewer than three corners are not drawn (faces in the file: 3)";
        assert_eq!(details(&bytes), [short]);
        bytes.extend(b" \n");
        assert_eq!(details(&bytes).len(), if encoding == Encoding::Ascii { 1 } else { 2 });
        bytes.extend(b"more");
        let trailing = if encoding == Encoding::Ascii { 4 } else { 6 };
        let trailing = format!("what comes after the last PLY element is ignored (bytes: {trailing})");
        assert_eq!(details(&bytes), [short, &trailing]);

        let nothing = Ply::new(encoding).element("vertex", &XYZ, &[]).bytes();
        let error = read(&nothing).unwrap_err();
        let expected = "the PLY file has nothing to draw: 0 vertices and 0 faces";
        assert_eq!((error.fault, error.detail.as_str()), (MeshFault::Empty, expected));
    }
    assert_eq!(read(b"ply\nformat ascii 1.0\nend_header\n").unwrap_err().fault, MeshFault::Empty);
}

#[test]
fn large_files_have_their_known_counts() {
    let Some(models) = large_folder("models") else { return };
    let read_at = |path: std::path::PathBuf| read(&std::fs::read(path).unwrap()).unwrap();
    let mesh = read_at(models.join("cube_blender_uv.ply"));
    assert_eq!((mesh.report.file_vertices, mesh.positions.len(), mesh.triangles.len()), (24, 8, 12));
    assert_eq!((mesh.report.polygons_by_arity[4], mesh.normals.len(), mesh.uvs.len()), (6, 24, 24));
    let mesh = read_at(models.join("featuretype.ply"));
    assert_eq!((mesh.report.file_vertices, mesh.triangles.len(), mesh.normals.len()), (5096, 3476, 5096));
    let stl = read_at(models.join("featuretype.STL"));
    let codes: Vec<&str> = mesh.report.warnings.iter().map(|warning| warning.code).collect();
    // Blender wrote it, with the z of the STL that it was read from.
    assert_eq!((mesh.positions.len(), codes), (stl.positions.len(), vec!["up_unlikely"]));
    for name in ["points_ascii.ply", "points_bin.ply"] {
        let mesh = read_at(models.join(name));
        assert_eq!((mesh.lines_and_points.len(), mesh.triangles.len()), (5, 0), "{name}");
        assert_eq!(mesh.report.file_vertices, 5, "{name}");
        assert!(mesh.lines_and_points.iter().all(|one| one.is_point()), "{name}");
    }
}

#[test]
fn clouds_and_empty_files_have_their_known_counts() {
    let corpus = data::folder("corpus/emptyIO");
    for name in ["ply_points_ascii.ply", "ply_points_bin.ply"] {
        let mesh = read(&std::fs::read(corpus.join(name)).unwrap()).unwrap();
        assert_eq!((mesh.lines_and_points.len(), mesh.triangles.len()), (8, 0), "{name}");
    }
    for name in ["ply_empty_ascii.ply", "ply_empty_bin.ply", "ply_empty_header.ply"] {
        let error = read(&std::fs::read(corpus.join(name)).unwrap()).unwrap_err();
        assert_eq!(error.fault, MeshFault::Empty, "{name}");
        assert!(error.detail.contains("0 vertices and 0 faces"), "{error}");
    }
}
