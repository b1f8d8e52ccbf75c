//! Lines and points in OBJ, PLY, OFF and FBX files. Those of glTF are in `gltf/basics.rs`.

use crate::support::data;
use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::fbx::{Value, ascii, binary, file, geometry, model, node, property};
use crate::support::files::mesh::{Solid, codes, read, read_limited};
use crate::support::files::ply::{ENCODINGS, Ply, XYZ};
use meshsnap_render::import::{Format, MeshFault};
use meshsnap_render::limits::Limits;
use meshsnap_render::mesh::Mesh;

/// The ends of a line or point in the file's own numbers, and its material.
type End = ([[f64; 3]; 2], u32);

fn loose(mesh: &Mesh) -> Vec<End> {
    let to_file = |v: u32| {
        let p = mesh.positions[v as usize];
        std::array::from_fn(|k| mesh.to_file.centre[k] + mesh.to_file.scale * f64::from(p[k]))
    };
    mesh.lines_and_points.iter().map(|one| (one.ends.map(to_file), one.material)).collect()
}

const A: [f64; 3] = [0.0, 0.0, 0.0];
const B: [f64; 3] = [2.0, 0.0, 0.0];
const C: [f64; 3] = [0.0, 1.0, 0.5];

#[test]
fn obj_lines_and_points() {
    let head = "v 0 0 0\nv 2 0 0\nv 0 1 0.5\nvt 0 0\nvn 0 0 1\n";
    let cases: [(&str, &[End]); 8] = [
        ("l 1 2\n", &[([A, B], 0)]),
        ("l 1 2 3\n", &[([A, B], 0), ([B, C], 0)]),
        ("l 1/1 2/1 -1 1\n", &[([A, B], 0), ([B, C], 0), ([C, A], 0)]),
        ("p 1 3\n", &[([A, A], 0), ([C, C], 0)]),
        ("l 1 1 2\np\nl 3\n", &[([A, B], 0)]),
        ("usemtl Wire\nl 1 2\nusemtl Dot\np 3\n", &[([A, B], 0), ([C, C], 1)]),
        ("p 3\nusemtl Wire\nl 1 \\\n 2 # to there\n", &[([C, C], 0), ([A, B], 1)]),
        // In among faces of all forms.
        ("f 1 2 3\nl 1 2\nf 1/1 2/1 3/1\nl 2 3\nf 1//1 2//1 3//1\n", &[([A, B], 0), ([B, C], 0)]),
    ];
    for (text, expected) in cases {
        let mesh = read(format!("{head}{text}").as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!(loose(&mesh), expected, "{text}");
        assert_eq!(mesh.triangles.len(), text.matches('f').count(), "{text}");
        // Of what has no normals beside what has.
        let repaired = if text.contains("//") { vec!["normals_repaired"] } else { vec![] };
        assert_eq!(codes(&mesh), repaired, "{text}");
        let attributes = if mesh.attribute_triangles.is_empty() { 0 } else { mesh.lines_and_points.len() };
        assert_eq!(mesh.line_point_attributes.len(), attributes, "{text}");
    }
    assert_eq!(cases.len(), 8);
    for (text, part) in [("l 1 4\n", "vertex index 4 is out of range"), ("p 0\n", "is 0"), ("l 1 x\n", "\"x\"")] {
        let error = read(format!("{head}{text}").as_bytes()).unwrap_err();
        assert!(error.fault == MeshFault::Broken && error.detail.contains("line 6 of the OBJ file"), "{error}");
        assert!(error.detail.contains(part), "{error}");
    }
    // One line of text may be the whole file.
    let long = format!("{head}l{}\np{}", " 1 2".repeat(3_000_000), " 3".repeat(1_000_000));
    for limits in [Limits::default(), Limits::default().with(|limits| limits.memory_bytes = 32 << 20)] {
        assert!(matches!(read_limited(long.as_bytes(), None, &limits).unwrap_err().fault, MeshFault::Limit(_)));
    }
    let good = format!("{head}usemtl A\nl 1 2 3\np 1 2\nf 1/1 2/1 3/1\nl 3/1 1/1\n");
    cut_everywhere(good.as_bytes(), Format::Obj);
    let drawn = mutate(good.as_bytes(), Format::Obj, 20_000, 0x0B_1001);
    assert!(drawn > 1000 && drawn < 19_900, "{drawn}");
}

#[test]
fn ply_clouds_and_edges() {
    let points = [A, B, C].map(|p| p.to_vec());
    let ends = ["int vertex1", "int vertex2"];
    for encoding in ENCODINGS {
        let cloud = Ply::new(encoding).element("vertex", &XYZ, &points);
        let mesh = read(&cloud.bytes()).unwrap();
        assert_eq!(loose(&mesh), [([A, A], 0), ([B, B], 0), ([C, C], 0)]);
        assert_eq!((codes(&mesh), mesh.triangles.len(), mesh.materials.len()), (vec![], 0, 1));
        let edges = cloud.element("edge", &ends, &[vec![0.0, 1.0], vec![1.0, 1.0], vec![2.0, 0.0]]);
        assert_eq!(loose(&read(&edges.bytes()).unwrap()), [([A, B], 0), ([C, A], 0)]);
        let wrong = Ply::new(encoding).element("vertex", &XYZ, &points).element("edge", &ends, &[vec![0.0, 3.0]]);
        assert!(read(&wrong.bytes()).unwrap_err().detail.contains("refers to vertex 3"));
    }
    let colored: Vec<Vec<f64>> = points.iter().map(|p| [&p[..], &[255.0, 0.0, 0.0]].concat()).collect();
    let properties = [&XYZ[..], &["uchar red", "uchar green", "uchar blue"]].concat();
    let mesh = read(&Ply::new(ENCODINGS[0]).element("vertex", &properties, &colored).bytes()).unwrap();
    let of = |v: u32| mesh.colors[v as usize];
    assert!(mesh.line_point_attributes.iter().all(|ends| ends.map(of) == [[1.0, 0.0, 0.0, 1.0]; 2]));
    assert_eq!(mesh.line_point_attributes.len(), 3);
    // Too many to draw, and told before they are.
    let few = Limits::default().with(|limits| limits.triangles = 11);
    let cloud = Ply::new(ENCODINGS[1]).element("vertex", &XYZ, &points).bytes();
    assert!(read_limited(&cloud, None, &few).unwrap_err().detail.contains("--limit-triangles"));
    for name in ["ply_points_ascii.ply", "ply_points_bin.ply"] {
        let mesh = read(&data::bytes(&format!("corpus/emptyIO/{name}"))).unwrap();
        assert_eq!(mesh.lines_and_points.len() as u64, mesh.report.file_vertices, "{name}");
        assert!(mesh.lines_and_points.len() > 3 && mesh.lines_and_points.iter().all(|one| one.is_point()), "{name}");
    }
}

#[test]
fn off_and_fbx_have_them_too() {
    let off = "OFF\n3 3 0\n0 0 0\n2 0 0\n0 1 0.5\n2 0 1\n1 2\n3 0 1 2\n";
    let mesh = read(off.as_bytes()).unwrap();
    assert_eq!((loose(&mesh), mesh.triangles.len()), (vec![([A, B], 0), ([C, C], 0)], 1));
    let cloud = read(b"COFF\n3 0 0\n0 0 0 1 0 0\n2 0 0 1 0 0\n0 1 0.5 1 0 0\n").unwrap();
    assert_eq!(loose(&cloud), [([A, A], 0), ([B, B], 0), ([C, C], 0)]);
    assert_eq!(cloud.line_point_attributes.len(), 3);

    let solid = Solid { positions: vec![A, B, C], polygons: vec![vec![0, 1], vec![2], vec![0, 1, 2]] };
    let curve = node(
        "Geometry",
        vec![Value::Id(101), Value::Name("curve", "Geometry"), Value::Text("Line".into())],
        vec![
            node("Type", vec![Value::Text("Line".into())], vec![]),
            node("Points", vec![Value::Floats([A, B, C].concat())], vec![]),
            node("PointsIndex", vec![Value::Ints(vec![0, 1, !2])], vec![]),
        ],
    );
    let up = property("Lcl Translation", "Lcl Translation", &[0.0, 0.0, 4.0]);
    let objects = vec![geometry(100, &solid, vec![]), model(200, "Mesh", vec![]), curve, model(201, "Line", vec![up])];
    let nodes = file(1, objects, &[(200, 0, ""), (100, 200, ""), (201, 0, ""), (101, 201, "")]);
    let raised = |p: [f64; 3]| [p[0], p[1], p[2] + 4.0];
    let expected = [([A, B], 0), ([C, C], 0), ([raised(A), raised(B)], 0), ([raised(B), raised(C)], 0)];
    for bytes in [ascii(&nodes), binary(&nodes)] {
        let mesh = read(&bytes).unwrap();
        assert_eq!((loose(&mesh), mesh.triangles.len()), (expected.to_vec(), 1));
        assert_eq!(codes(&mesh), [""; 0]);
    }
}
