//! FBX files, binary and ASCII: shapes, transforms, materials, textures, and broken ones.

use crate::support::files::bundle::{files, read_bundle};
use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::fbx::{
    Node, Value, ascii, binary, face_materials, file, geometry, layer, material, model, node, property, text,
};
use crate::support::files::mesh::{Solid, codes, read, read_limited};
use crate::support::files::same::assert_same_shape;
use crate::support::server::Server;
use meshsnap_render::import::{Bundle, Format, MeshFault, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::UpAxis;
use meshsnap_render::mesh::material::{AlphaMode, ImageContent};

type Writer = fn(&[Node]) -> Vec<u8>;

const WRITERS: [(&str, Writer); 2] = [("ascii", ascii), ("binary", binary)];

/// A box, shown by one node with these properties.
pub fn cube(list: Vec<Node>) -> Vec<Node> {
    let objects = vec![geometry(100, &Solid::cuboid(), vec![]), model(200, "Mesh", list)];
    file(1, objects, &[(200, 0, ""), (100, 200, "")])
}

fn lcl(name: &str, values: [f64; 3]) -> Node {
    property(name, name, &values)
}

fn moved(solid: &Solid, map: impl Fn([f64; 3]) -> [f64; 3]) -> Solid {
    Solid { positions: solid.positions.iter().map(|p| map(*p)).collect(), polygons: solid.polygons.clone() }
}

#[test]
fn a_box_is_the_same_box_as_in_obj() {
    let solid = Solid::cuboid();
    let turned = moved(&solid, |[x, y, z]| [1.0 - y, 2.0 + x, 3.0 + z]);
    let scaled = moved(&solid, |[x, y, z]| [2.0 * x, 0.5 * y, z]);
    let quarter = vec![lcl("Lcl Translation", [1.0, 2.0, 3.0]), lcl("Lcl Rotation", [0.0, 0.0, 90.0])];
    let cases = [
        (cube(vec![]), solid.clone()),
        (cube(quarter), turned),
        (cube(vec![lcl("Lcl Scaling", [2.0, 0.5, 1.0])]), scaled),
        (cube(vec![lcl("GeometricTranslation", [4.0, 0.0, 0.0])]), moved(&solid, |[x, y, z]| [x + 4.0, y, z])),
    ];
    for (i, (nodes, expected)) in cases.iter().enumerate() {
        let obj = read(expected.obj().as_bytes()).unwrap();
        for (name, write) in WRITERS {
            let mesh = read(&write(nodes)).unwrap_or_else(|error| panic!("{i} {name}: {error}"));
            // The vertices may come in another order.
            assert_same_shape(&obj, &mesh, &format!("{i} {name}"));
            assert_eq!(mesh.edge_masks, obj.edge_masks);
            let report = &mesh.report;
            assert_eq!((report.format, report.polygons_by_arity[4], report.file_vertices), (Format::Fbx, 6, 8));
            assert_eq!((mesh.up, codes(&mesh)), (UpAxis::Y, vec![]));
        }
    }
    assert_eq!(cases.len(), 4);
    // Mirrored, and still outside out.
    let mesh = read(&ascii(&cube(vec![lcl("Lcl Scaling", [-1.0, 1.0, 1.0])]))).unwrap();
    let volume: f32 = mesh.triangles.iter().map(|t| volume(t.map(|v| mesh.positions[v as usize]))).sum();
    assert!(volume > 0.0, "{volume}");
    let mut z_up = cube(vec![]);
    z_up[1] = file(2, vec![], &[])[1].clone();
    assert_eq!(read(&binary(&z_up)).unwrap().up, UpAxis::Z);
}

fn volume([a, b, c]: [[f32; 3]; 3]) -> f32 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[test]
fn nodes_below_nodes_show_a_mesh_as_often_as_they_say() {
    let solid = Solid::cuboid();
    let objects = vec![
        geometry(100, &solid, vec![]),
        model(200, "Mesh", vec![lcl("Lcl Translation", [10.0, 0.0, 0.0])]),
        model(201, "Mesh", vec![lcl("Lcl Translation", [0.0, 10.0, 0.0])]),
        model(202, "Null", vec![lcl("Lcl Scaling", [2.0, 2.0, 2.0])]),
        model(203, "Mesh", vec![property("Visibility", "Visibility", &[0.0])]),
    ];
    let links =
        [(202, 0, ""), (200, 202, ""), (201, 202, ""), (100, 200, ""), (100, 201, ""), (203, 0, ""), (100, 203, "")];
    for (name, write) in WRITERS {
        let bytes = write(&file(1, objects.clone(), &links));
        let mesh = read(&bytes).unwrap();
        assert_eq!(mesh.triangles.len(), 24, "{name}");
        assert_eq!(codes(&mesh), ["hidden_ignored"]);
        let size = [0, 1].map(|k| f64::from(mesh.bounds[1][k] - mesh.bounds[0][k]) * mesh.to_file.scale);
        assert_eq!(size, [22.0, 24.0], "{name}");
        let few = Limits::default().with(|limits| limits.triangles = 23);
        assert!(matches!(read_limited(&bytes, None, &few).unwrap_err().fault, MeshFault::Limit(_)));
        let few = Limits::default().with(|limits| limits.nodes = 3);
        assert!(read_limited(&bytes, None, &few).unwrap_err().detail.contains("--limit-nodes"));
    }
}

/// A quad with every attribute, two materials and a texture.
fn dressed(texture: Vec<Node>) -> Vec<Node> {
    let solid = Solid {
        positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0], [3.0, 0.5, 0.0]],
        polygons: vec![vec![0, 1, 2, 3], vec![1, 4, 2]],
    };
    let corners = [0, 1, 2, 3, 1, 0, 2];
    let layers = vec![
        layer(
            "LayerElementNormal",
            "Normals",
            &[0.0, 0.0, 3.0, 0.0, 0.6, 0.8],
            ("NormalsIndex", &[0, 0, 0, 0, 1, 1, 1]),
        ),
        layer("LayerElementUV", "UV", &[0.0, 0.0, 1.0, 0.0, 1.0, 0.75, 0.0, 0.75], ("UVIndex", &corners)),
        layer(
            "LayerElementColor",
            "Colors",
            &[1.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.5, 0.5],
            ("ColorIndex", &[0, 0, 0, 0, 1, 1, 1]),
        ),
        face_materials(&[1, 0]),
    ];
    let color = |name: &str, rgb: [f64; 3]| property(name, "Color", &rgb);
    let mut objects = vec![
        geometry(100, &solid, layers),
        model(200, "Mesh", vec![]),
        material(300, "Red", vec![color("DiffuseColor", [1.0, 0.5, 0.0]), property("DiffuseFactor", "Number", &[1.0])]),
        material(
            301,
            "Glass",
            vec![
                color("DiffuseColor", [0.0, 0.0, 1.0]),
                color("TransparentColor", [1.0; 3]),
                property("TransparencyFactor", "Number", &[0.75]),
                color("EmissiveColor", [0.0, 1.0, 0.0]),
                property("EmissiveFactor", "Number", &[2.0]),
            ],
        ),
    ];
    let has_texture = !texture.is_empty();
    objects.extend(texture);
    let mut links = vec![(200, 0, ""), (100, 200, ""), (300, 200, ""), (301, 200, "")];
    if has_texture {
        links.extend([(400, 300, "DiffuseColor"), (500, 400, "")]);
    }
    file(1, objects, &links)
}

/// A texture under other people's path; with its bytes, or without.
fn texture(content: Option<&[u8]>) -> Vec<Node> {
    let path = "C:/Users/someone/My Textures/Wood Grain.png";
    let names = |list: Vec<Node>| {
        let mut all = vec![
            node("Version", vec![Value::Int(202)], vec![]),
            node("FileName", vec![text(path)], vec![]),
            node("RelativeFilename", vec![text("../My Textures/Wood Grain.png")], vec![]),
        ];
        all.extend(list);
        all
    };
    let content = content.map(|bytes| node("Content", vec![Value::Raw(bytes.to_vec())], vec![]));
    vec![
        node("Texture", vec![Value::Id(400), Value::Name("wood", "Texture"), text("")], names(vec![])),
        node(
            "Video",
            vec![Value::Id(500), Value::Name("wood", "Video"), text("Clip")],
            names(content.into_iter().collect()),
        ),
    ]
}

#[test]
fn materials_and_attributes_are_read() {
    for (name, write) in WRITERS {
        let mesh = read(&write(&dressed(vec![]))).unwrap_or_else(|error| panic!("{name}: {error}"));
        let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!((names, &mesh.triangle_materials), (vec!["Glass", "Red"], &vec![0, 0, 1]), "{name}");
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        let [glass, red] = mesh.materials.as_slice() else { panic!("{:?}", mesh.materials) };
        assert!(near(&glass.base_color.unwrap(), &[0.0, 0.0, 1.0, 0.25]), "{name}: {glass:?}");
        assert_eq!((glass.alpha, red.alpha), (AlphaMode::Blend, AlphaMode::Opaque));
        assert!(near(&glass.emissive.unwrap(), &[0.0, 2.0, 0.0]), "{glass:?}");
        assert!(near(&red.base_color.unwrap(), &[1.0, 0.214_041, 0.0, 1.0]), "{red:?}");
        let corner = |t: usize, c: usize| mesh.attribute_triangles[t][c] as usize;
        assert!(
            near(&mesh.normals[corner(0, 0)], &[0.0, 0.0, 1.0]) && near(&mesh.normals[corner(2, 0)], &[0.0, 0.6, 0.8])
        );
        assert!(near(&mesh.uvs[corner(0, 2)], &[1.0, 0.25]), "{:?}", mesh.uvs[corner(0, 2)]);
        assert!(near(&mesh.colors[corner(0, 1)], &[1.0, 0.0, 0.0, 1.0]));
        assert!(near(&mesh.colors[corner(2, 1)], &[0.214_041, 0.214_041, 0.214_041, 0.5]));
    }
}

#[test]
fn textures_are_embedded_or_found_by_their_last_part() {
    let png: &[u8] = b"\x89PNG\r\n\x1a\nnot a whole picture";
    let mut cases = 0;
    for (name, write) in WRITERS {
        let embedded = read(&write(&dressed(texture(Some(png))))).unwrap();
        let named = write(&dressed(texture(None)));
        let bundle = Bundle::of_files(files(&[("scene/a.fbx", &named), ("textures/wood grain.PNG", png)]));
        for mesh in [embedded, read_bundle(&bundle).unwrap()] {
            let red = mesh.materials.iter().find(|m| m.name == "Red").unwrap();
            assert_eq!((red.base_texture.map(|t| t.image), red.base_color), (Some(0), Some([1.0; 4])), "{name}");
            assert_eq!(mesh.images[0].content, ImageContent::Encoded(png.into()), "{name}");
            assert_eq!(codes(&mesh), [""; 0]);
            cases += 1;
        }
        let alone = read(&named).unwrap();
        assert_eq!((codes(&alone), &alone.images[0].content), (vec!["textures_missing"], &ImageContent::Absent));
        assert!(alone.report.warnings[0].detail.contains("Wood Grain.png"), "{:?}", alone.report.warnings);
    }
    assert_eq!(cases, 4);
}

#[test]
fn what_is_hostile_is_refused() {
    let good = ascii(&cube(vec![]));
    let text = String::from_utf8(good.clone()).unwrap();
    // A node that is its own ancestor, a count that lies, and a text that only begins as one.
    let cycle = {
        let objects =
            vec![geometry(100, &Solid::cuboid(), vec![]), model(200, "Mesh", vec![]), model(201, "Null", vec![])];
        ascii(&file(1, objects, &[(200, 201, ""), (201, 200, ""), (100, 200, "")]))
    };
    let broken = [
        text.replace("*24 { a: 1.5", "*4000000000 { a: x1.5"),
        "; FBX 7.4.0 project file\n".to_owned(),
        format!("; FBX 7.4.0 project file\n{}", "a: {\n".repeat(100_000)),
        "FBXHeaderExtension: {\n".to_owned(),
    ];
    for (i, text) in broken.iter().enumerate() {
        let error = read(text.as_bytes()).unwrap_err();
        assert!(matches!(error.fault, MeshFault::Broken | MeshFault::Empty), "{i}: {error}");
    }
    assert_eq!(broken.len(), 4);
    if let Err(error) = read(&cycle) {
        assert!(matches!(error.fault, MeshFault::Broken | MeshFault::Empty), "{error}");
    }
    let deep: Vec<i64> = (1000..3000).collect();
    let mut objects: Vec<Node> = deep.iter().map(|&id| model(id, "Null", vec![])).collect();
    let mut links: Vec<(i64, i64, &str)> = deep.windows(2).map(|pair| (pair[1], pair[0], "")).collect();
    objects.extend([geometry(100, &Solid::cuboid(), vec![]), model(200, "Mesh", vec![])]);
    links.extend([(1000, 0, ""), (200, 2999, ""), (100, 200, "")]);
    let error = read(&binary(&file(1, objects, &links))).unwrap_err();
    assert!(error.fault == MeshFault::Broken && error.detail.contains("1024 deep"), "{error}");
    for write in [ascii, binary] {
        let good = write(&cube(vec![]));
        let small = Limits::default().with(|limits| limits.memory_bytes = 20_000);
        let error = read_limited(&good, None, &small).unwrap_err();
        assert!(error.detail.contains("--limit-memory-bytes"), "{error}");
        let (stopped, limits) = (Deadline::default(), Limits::default());
        stopped.stop();
        let bundle = Bundle::of_one(good);
        let error = import(&bundle, None, &limits, &mut Budget::new(&limits), &stopped).unwrap_err();
        assert_eq!(error.fault, MeshFault::Stopped);
    }
}

#[test]
fn files_cut_off_or_changed_are_survived() {
    for (i, (name, write)) in WRITERS.into_iter().enumerate() {
        let good = write(&dressed(texture(Some(b"\x89PNG\r\n\x1a\n"))));
        read(&good).unwrap();
        // The connections come last, and some of them may be missing.
        let drawn = cut_everywhere(&good, Format::Fbx);
        assert!(drawn < good.len() / 2, "{name}: {drawn}");
        let drawn = mutate(&good, Format::Fbx, 20_000, 0xFB_0001 + i as u64);
        assert!(drawn > 500 && drawn < 19_900, "{name}: {drawn}");
    }
}

#[test]
fn the_service_reads_it_by_its_bytes_and_by_its_name() {
    let server = Server::start(&[]);
    for (name, write) in WRITERS {
        let bytes = write(&cube(vec![]));
        let sniffed = server.post("/v1/render?size=32", &bytes);
        sniffed.picture(32, 32);
        assert_eq!(server.post("/v1/render?size=32&format_in=fbx", &bytes).body, sniffed.body, "{name}");
        server.post("/v1/render?size=32", &bytes[..bytes.len() / 2]).problem(422, "mesh_broken");
    }
    let formats = server.get("/v1/capabilities").json()["mesh_formats"].clone();
    assert!(formats.as_array().unwrap().contains(&"fbx".into()), "{formats}");
}
