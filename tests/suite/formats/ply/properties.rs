//! PLY in every encoding: types and order of properties, other elements, triangle strips, line
//! ends.

use crate::support::files::mesh::{Solid, codes, read};
use crate::support::files::ply::{ENCODINGS, Encoding, INDICES, Ply, XYZ, list};
use crate::support::files::same::assert_same_shape;
use crate::support::scenes;
use crate::support::server::Server;
use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::import::Format;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::{Mesh, UpAxis};

/// A solid with quads, a pentagon and a concave hexagon: an L on a slab with a gable.
fn polygons() -> Solid {
    let mut solid = Solid::cuboid();
    let base = solid.positions.len() as u32;
    let outline = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let gable = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.75], [0.0, 1.0]];
    solid.positions.extend(outline.map(|[x, y]| [x, y, -1.0]));
    solid.positions.extend(gable.map(|[x, y]| [x, -0.5, y]));
    solid.polygons.push((base..base + 6).collect());
    solid.polygons.push((base + 6..base + 11).collect());
    solid
}

#[test]
fn every_encoding_draws_what_obj_draws() {
    let solid = polygons();
    let obj = read(solid.obj().as_bytes()).unwrap();
    let looks: [&[(&str, &str)]; 3] = [
        &[("size", "160"), ("style", "flat")],
        &[("size", "160"), ("style", "wire"), ("wire.edges", "polygons")],
        &[("size", "160"), ("style", "wire"), ("wire.edges", "triangles")],
    ];
    let draw = |mesh: &Mesh, look| {
        let plan = scenes::plan(mesh, &scenes::spec(look));
        CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap().rgba
    };
    let expected = looks.map(|look| draw(&obj, look));
    assert!(expected[0] != expected[1] && expected[1] != expected[2], "hidden diagonals can be seen");
    let mut cases = 0;
    for encoding in ENCODINGS {
        let ply = read(&solid.ply(encoding)).unwrap();
        assert_eq!((ply.report.format, ply.up), (Format::Ply, UpAxis::Y));
        assert_same_shape(&obj, &ply, "PLY");
        assert_eq!(ply.edge_masks, obj.edge_masks);
        assert_eq!(ply.report.polygons_by_arity, obj.report.polygons_by_arity);
        assert_eq!(ply.report.polygons_by_arity[4..7], [6, 1, 1]);
        assert_eq!(codes(&ply), [""; 0]);
        for (look, expected) in looks.iter().zip(&expected) {
            assert!(draw(&ply, look) == *expected, "{encoding:?} {look:?}");
            cases += 1;
        }
    }
    assert_eq!(cases, 9);
}

#[test]
fn any_type_and_any_order_will_do() {
    let mut solid = polygons();
    // Small whole numbers fit every type.
    solid.positions.iter_mut().flatten().for_each(|c| *c = (*c * 8.0).abs());
    let expected = read(solid.obj().as_bytes()).unwrap();
    let types = [
        "char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int8", "uint8", "int16", "uint16",
        "int32", "uint32", "float32", "float64",
    ];
    let mut cases = 0;
    for encoding in ENCODINGS {
        for (i, kind) in types.iter().enumerate() {
            let count = types[(i + 5) % types.len()];
            let vertex = [
                format!("{kind} z"),
                "uchar flags".into(),
                format!("list {count} {kind} history"),
                format!("{kind} x"),
                "double weight".into(),
                format!("{count} y"),
            ];
            let vertex: Vec<&str> = vertex.iter().map(String::as_str).collect();
            let records = |with_list: bool| -> Vec<Vec<f64>> {
                let of = |p: &[f64; 3]| {
                    let mut record = vec![p[2], 7.0, p[0], 0.5, p[1]];
                    if with_list {
                        record.splice(2..2, list(&[1.0, 2.0]));
                    }
                    record
                };
                solid.positions.iter().map(of).collect()
            };
            let face = format!("list {kind} {count} {}", ["vertex_index", "vertex_indices"][i % 2]);
            let faces: Vec<Vec<f64>> =
                solid.face_records().iter().map(|f| [list(&[3.0]), f.clone(), vec![9.0]].concat()).collect();
            let face = ["list uchar short parents", &face, "ushort quality"];
            let lines = Ply::new(encoding).line("obj_info any words").line("comment").line("");
            let with_list = lines.element("vertex", &vertex, &records(true)).element("face", &face, &faces).bytes();
            assert_same_shape(&expected, &read(&with_list).unwrap(), kind);
            // Without a list, records have a fixed size, and are read in columns.
            let fixed = [&vertex[..2], &vertex[3..]].concat();
            let plain = Ply::new(encoding).element("face", &face, &faces).element("vertex", &fixed, &records(false));
            let mesh = read(&plain.bytes()).unwrap();
            assert_same_shape(&expected, &mesh, "faces first");
            assert_eq!(mesh.edge_masks, expected.edge_masks);
            cases += 1;
        }
    }
    assert_eq!(cases, 48);
}

#[test]
fn many_vertices_are_read_in_blocks() {
    let solid = Solid::grid(50);
    let expected = read(solid.obj().as_bytes()).unwrap();
    assert!(expected.positions.len() > 2 * 1024);
    for encoding in ENCODINGS {
        assert_same_shape(&expected, &read(&solid.ply(encoding)).unwrap(), "PLY");
    }
}

#[test]
fn unknown_elements_are_passed_over() {
    let solid = polygons();
    let expected = read(solid.obj().as_bytes()).unwrap();
    for encoding in ENCODINGS {
        let bytes = Ply::new(encoding)
            .element(
                "camera",
                &["float view_px", "list uchar float distortion"],
                &[vec![1.0, 2.0, 0.5, 0.25], vec![3.0, 0.0]],
            )
            .element("nothing", &[], &[vec![], vec![], vec![]])
            .element("vertex", &XYZ, &solid.vertex_records())
            .element("grid", &["double a", "uchar b"], &[vec![0.5, 1.0], vec![1.5, 2.0], vec![2.5, 3.0]])
            .element("face", &INDICES, &solid.face_records())
            .element("edge", &["int vertex1", "int vertex2"], &[vec![0.0, 1.0], vec![1.0, 2.0]])
            .bytes();
        let mesh = read(&bytes).unwrap();
        assert_same_shape(&expected, &mesh, "PLY");
        assert_eq!(codes(&mesh), ["lines_ignored"]);
    }
    // A billion records of nothing take no time.
    let text = String::from_utf8(solid.ply(Encoding::Ascii)).unwrap();
    let text = text.replace("element vertex", "element nothing 1000000000000\nelement vertex");
    assert_same_shape(&expected, &read(text.as_bytes()).unwrap(), "nothing");
}

#[test]
fn lines_may_end_and_words_may_be_spread_in_any_way() {
    let solid = polygons();
    let expected = read(solid.obj().as_bytes()).unwrap();
    let text = String::from_utf8(solid.ply(Encoding::Ascii)).unwrap();
    let (header, body) = text.split_at(text.find("end_header\n").unwrap() + 11);
    let variants = [
        text.replace('\n', "\r\n"),
        text.replace('\n', "\r"),
        header.to_owned() + &body.replace('\n', " "),
        header.to_owned() + &body.replace(' ', "\n"),
        text.trim_end().to_owned(),
        text.replace("ply\n", "ply \n").replace("element ", " element\t").replace("property ", "property  "),
        text.replace("comment made", "obj_info made"),
    ];
    for (i, text) in variants.iter().enumerate() {
        assert_same_shape(&expected, &read(text.as_bytes()).unwrap_or_else(|e| panic!("{i}: {e}")), text);
    }
    for newline in ["\r\n", "\r"] {
        for encoding in [Encoding::Little, Encoding::Big] {
            let bytes = solid.ply(encoding);
            let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
            let header = String::from_utf8(bytes[..end].to_vec()).unwrap().replace('\n', newline);
            let mesh = read(&[header.as_bytes(), &bytes[end..]].concat()).unwrap();
            assert_same_shape(&expected, &mesh, newline);
        }
    }
    let mut latin1 = solid.ply(Encoding::Little);
    latin1.splice(4..4, *b"comment caf\xe9 \xff\xfe\n");
    assert_same_shape(&expected, &read(&latin1).unwrap(), "latin-1");
}

#[test]
fn doubles_keep_what_floats_lose() {
    for encoding in ENCODINGS {
        let far = 1e7;
        let records: Vec<Vec<f64>> =
            [[0.0, 0.0], [0.125, 0.0], [0.0, 0.125]].iter().map(|[x, y]| vec![far + x, far + y, far]).collect();
        let ply = |kind: &str| {
            let names = ["x", "y", "z"].map(|axis| format!("{kind} {axis}"));
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            Ply::new(encoding)
                .element("vertex", &names, &records)
                .element("face", &INDICES, &[list(&[0.0, 1.0, 2.0])])
                .bytes()
        };
        let mesh = read(&ply("double")).unwrap();
        assert_eq!(mesh.to_file.scale, 0.125);
        assert_eq!(mesh.triangles.len(), 1);
        // A text says what it says, whatever it calls it.
        assert_eq!(read(&ply("float")).is_ok(), encoding == Encoding::Ascii);
    }
}

#[test]
fn strips_wind_alternately_and_begin_anew() {
    let grid: Vec<Vec<f64>> = (0..8).map(|i| vec![f64::from(i / 2), f64::from(i % 2), 0.0]).collect();
    let strip = [0.0, 2.0, 1.0, 3.0, 3.0, -1.0, 2.0, 4.0, 3.0, 5.0, -1.0, -1.0, 6.0, -1.0, 4.0, 6.0, 5.0, 7.0];
    for encoding in ENCODINGS {
        let ply = Ply::new(encoding).element("tristrips", &["list int int vertex_indices"], &[list(&strip)]);
        let ply = ply.element("vertex", &XYZ, &grid);
        let mesh = read(&ply.bytes()).unwrap();
        assert_eq!(mesh.triangles.len(), 6);
        assert!(mesh.face_normals.iter().all(|n| *n == [0.0, 0.0, 1.0]), "{:?}", mesh.face_normals);
        assert_eq!((mesh.report.polygons_by_arity[3], mesh.report.dropped_degenerate_faces), (6, 0));
        // Beside faces, in either order.
        let both = ply.element("face", &INDICES, &[list(&[0.0, 2.0, 3.0, 1.0])]);
        assert_eq!(read(&both.bytes()).unwrap().triangles.len(), 8);
    }
}

#[test]
fn the_service_reads_it_by_its_bytes_and_by_its_name() {
    let server = Server::start(&[]);
    for encoding in ENCODINGS {
        let bytes = polygons().ply(encoding);
        let sniffed = server.post("/v1/render?size=32", &bytes);
        sniffed.picture(32, 32);
        assert_eq!(server.post("/v1/render?size=32&format_in=ply", &bytes).body, sniffed.body);
        server.post("/v1/render?size=32", &bytes[..bytes.len() - 9]).problem(422, "mesh_broken");
        server.post("/v1/render?size=32&format_in=stl", &bytes).problem(422, "mesh_broken");
    }
    let points = Ply::new(Encoding::Little).element("vertex", &XYZ, &Solid::cuboid().vertex_records()).bytes();
    server.post("/v1/render?size=32", &points).picture(32, 32);
    let formats = server.get("/v1/capabilities").json()["mesh_formats"].clone();
    assert!(formats.as_array().unwrap().contains(&"ply".into()), "{formats}");
}
