//! 3MF packages: shapes, components, parts, colours, and hostile ones.

use crate::support::files::bundle::{files, read_bundle, zipped};
use crate::support::files::damage::{cut_everywhere, mutate};
use crate::support::files::mesh::{Read, Solid, codes, read, read_as, read_limited};
use crate::support::files::same::assert_same_shape;
use crate::support::server::Server;
use crate::support::work::within_bytes;
use meshsnap_render::import::{Bundle, Format, MeshError, MeshFault, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::UpAxis;
use meshsnap_render::mesh::material::AlphaMode;

const TYPES: &str = r#"<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>"#;
const RELS: &str = r#"<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
<Relationship Target="/3D/3dmodel.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;

fn triangles() -> Solid {
    let quads = Solid::cuboid();
    let halves = quads.polygons.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
    let halves: Vec<[u32; 3]> = halves.collect();
    quads.triangulated(&halves)
}

/// A mesh; `more` says what attributes a triangle has.
fn mesh(solid: &Solid, more: impl Fn(usize) -> String) -> String {
    let mut out = String::from("<mesh><vertices>");
    for [x, y, z] in &solid.positions {
        out += &format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>");
    }
    out += "</vertices><triangles>";
    for (i, t) in solid.polygons.iter().enumerate() {
        out += &format!("<triangle v1=\"{}\" v2=\"{}\" v3=\"{}\"{}/>", t[0], t[1], t[2], more(i));
    }
    out + "</triangles></mesh>"
}

fn model(resources: &str, build: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06">
 <metadata name="Title">A &amp; B</metadata><resources>{resources}</resources><build>{build}</build></model>"#
    )
}

pub fn cube_model(build: &str) -> String {
    model(&format!("<object id=\"1\" type=\"model\">{}</object>", mesh(&triangles(), |_| String::new())), build)
}

pub const ITEM: &str = "<item objectid=\"1\"/>";

pub fn package(model: &[u8]) -> Vec<u8> {
    zipped(&[("[Content_Types].xml", TYPES.as_bytes()), ("_rels/.rels", RELS.as_bytes()), ("3D/3dmodel.model", model)])
}

fn read_model(model: &str) -> Result<Read, MeshError> {
    read(&package(model.as_bytes()))
}

#[test]
fn a_box_is_the_same_box_as_in_obj() {
    let obj = read(triangles().obj().as_bytes()).unwrap();
    let utf16: Vec<u8> = format!("\u{feff}{}", cube_model(ITEM)).encode_utf16().flat_map(u16::to_be_bytes).collect();
    let plain = cube_model(ITEM);
    let whole: [(&str, Vec<u8>); 6] = [
        ("plain", plain.clone().into_bytes()),
        ("with a mark", format!("\u{feff}{plain}").into_bytes()),
        ("UTF-16", utf16),
        ("no items", cube_model("").into_bytes()),
        ("prefixed", plain.replace("<vertex ", "<x:vertex ").into_bytes()),
        ("apostrophes", plain.replace('"', "'").into_bytes()),
    ];
    for (name, bytes) in &whole {
        let mesh = read(&package(bytes)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_same_shape(&obj, &mesh, name);
        assert_eq!((mesh.report.format, mesh.up, mesh.report.file_vertices), (Format::ThreeMf, UpAxis::Z, 8), "{name}");
        assert_eq!((codes(&mesh), mesh.edge_masks.len(), mesh.colors.len()), (vec![], 12, 0), "{name}");
    }
    // The same files, not packed; and a part alone, if it is said what it is.
    let parts = files(&[
        ("[Content_Types].xml", TYPES.as_bytes()),
        ("3D/3dmodel.model", plain.as_bytes()),
        ("Metadata/thumbnail.png", b"\x89PNG"),
    ]);
    assert_same_shape(&obj, &read_bundle(&Bundle::of_files(parts)).unwrap(), "loose");
    assert_same_shape(&obj, &read_as(plain.as_bytes(), Some(Format::ThreeMf)).unwrap(), "a part");
    assert_same_shape(&obj, &read_as(&package(plain.as_bytes()), Some(Format::ThreeMf)).unwrap(), "named");
}

#[test]
fn components_and_parts_are_placed() {
    let cube = mesh(&triangles(), |_| String::new());
    let other = model(&format!("<object id=\"7\">{cube}</object>"), "");
    let resources = format!(
        "<object id=\"1\">{cube}</object><object id=\"2\"><components>\
         <component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 10 0 0\"/>\
         <component objectid=\"7\" p:path=\"/3D/Objects/other.model\" transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/></components></object>"
    );
    let first = model(&resources, "<item objectid=\"2\" transform=\"2 0 0 0 2 0 0 0 2 0 0 5\"/><item objectid=\"1\"/>");
    let bytes = zipped(&[
        ("[Content_Types].xml", TYPES.as_bytes()),
        ("_rels/.rels", RELS.as_bytes()),
        ("3D/Objects/other.model", other.as_bytes()),
        ("3D/3dmodel.model", first.as_bytes()),
    ]);
    let mesh = read(&bytes).unwrap();
    assert_eq!((mesh.triangles.len(), mesh.report.file_vertices), (36, 24));
    let (low, high): (Vec<f64>, Vec<f64>) = (0..3)
        .map(|k| [0, 1].map(|side| mesh.to_file.centre[k] + mesh.to_file.scale * f64::from(mesh.bounds[side][k])))
        .map(|[low, high]| (low, high))
        .unzip();
    // x: 1.5..2.5, times 2 after adding 10, or after mirroring.
    assert_eq!((low, high), (vec![-5.0, 2.25, -4.0], vec![25.0, 8.5, -2.0]));
    let volume: f64 = mesh.triangles.iter().map(|t| volume(t.map(|v| mesh.positions[v as usize].map(f64::from)))).sum();
    assert!(volume > 0.0, "mirrored, and still outside out");
    let missing = read(&package(first.as_bytes())).unwrap_err();
    assert!(missing.fault == MeshFault::Broken && missing.detail.contains("/3D/Objects/other.model"), "{missing}");
}

fn volume([a, b, c]: [[f64; 3]; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

#[test]
fn materials_and_colours_are_read() {
    let groups = "<basematerials id=\"5\"><base name=\"Red &quot;PLA&quot;\" displaycolor=\"#FF0000\"/>\
                  <base name=\"Glass\" displaycolor=\"#0000FF40\"/></basematerials>\
                  <m:colorgroup id=\"6\"><m:color color=\"#00FF00\"/><m:color color=\"#FFFFFF00\"/></m:colorgroup>\
                  <m:texture2dgroup id=\"8\" texid=\"9\"><m:tex2coord u=\"0\" v=\"0\"/></m:texture2dgroup>";
    let more = |i: usize| match i {
        0 => " pid=\"5\" p1=\"1\"".to_owned(),
        1 => " pid=\"6\" p1=\"0\" p2=\"1\" p3=\"0\"".to_owned(),
        2 => " pid=\"6\" p1=\"0\"".to_owned(),
        3 => " pid=\"99\" p1=\"0\"".to_owned(),
        4 => " pid=\"5\" p1=\"77\"".to_owned(),
        _ => String::new(),
    };
    let object = format!("<object id=\"1\" pid=\"5\" pindex=\"0\">{}</object>", mesh(&triangles(), more));
    let mesh = read_model(&model(&format!("{groups}{object}"), ITEM)).unwrap();
    let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["Glass", "", "Red \"PLA\""]);
    assert_eq!(mesh.triangle_materials, [0, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2]);
    assert_eq!(mesh.materials[2].base_color, Some([1.0, 0.0, 0.0, 1.0]));
    assert_eq!((mesh.materials[0].alpha, mesh.materials[1].base_color), (AlphaMode::Blend, Some([1.0; 4])));
    let color = |t: usize, c: usize| mesh.colors[mesh.attribute_triangles[t][c] as usize];
    assert_eq!(
        [color(1, 0), color(1, 1), color(2, 2)],
        [[0.0, 1.0, 0.0, 1.0], [1.0, 1.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]]
    );
    assert_eq!([color(0, 0), color(3, 1), color(11, 2)], [[1.0; 4]; 3]);
    assert_eq!(codes(&mesh), ["properties_ignored"]);
}

const SLICE: &str = "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07";
const BEAMS: &str = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02";

#[test]
fn elements_of_other_namespaces_are_passed_over() {
    let plain = read_model(&cube_model(ITEM)).unwrap();
    let with = |declared: &str, before: &str| {
        let text = cube_model(ITEM).replace("<resources>", &format!("<resources>{before}"));
        text.replacen("<model ", &format!("<model {declared} "), 1)
    };
    let slices = "<s:slicestack id=\"9\"><s:slice><s:vertices><s:vertex x=\"1\" y=\"2\"/></s:vertices><s:object/></s:slice></s:slicestack>";
    let own = format!("<slicestack xmlns=\"{SLICE}\"><vertex x=\"1\"/><object/></slicestack><!-- and back -->");
    let lattice =
        "</triangles><b:beamlattice radius=\"1\"><b:beams><b:beam v1=\"0\" v2=\"1\"/></b:beams></b:beamlattice>";
    let spaces = format!("xmlns:s=\"{SLICE}\" xmlns:b=\"{BEAMS}\"");
    let cases = [
        (with(&spaces, slices), vec![]),
        (with("", &own), vec![]),
        (with(&spaces, "<s:colorgroup id=\"6\"><s:color color=\"no colour\"/></s:colorgroup>"), vec![]),
        (with(&spaces, "").replace("</triangles>", lattice), vec!["beams_ignored"]),
        (with("requiredextensions=\" p m\" recommendedextensions=\"s\"", ""), vec![]),
    ];
    for (text, expected) in &cases {
        let mesh = read_model(text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_same_shape(&plain, &mesh, text);
        assert_eq!(&codes(&mesh), expected, "{text}");
    }
    assert_eq!(cases.len(), 5);
    for (required, part) in [("b", BEAMS), ("p s", SLICE), ("unknown", "\"unknown\"")] {
        let error = read_model(&with(&format!("{spaces} requiredextensions=\"{required}\""), "")).unwrap_err();
        assert_eq!(error.fault, MeshFault::Unsupported);
        assert!(error.detail.contains(part) && !error.detail.contains("production"), "{error}");
    }
    let many: String = (0..70).map(|i| format!("xmlns:a{i}=\"x\" ")).collect();
    assert!(read_model(&with(&many, "")).unwrap_err().detail.contains("too many declarations"));
    // Of a kind whose names it uses itself, and its own by another name.
    let foreign = cube_model(ITEM).replacen("core/2015/02", "other", 1);
    assert!(read_model(&foreign).unwrap_err().detail.contains("begins with <model>"));
}

#[test]
fn what_is_broken_is_told() {
    let good = cube_model(ITEM);
    let cases = [
        ("a vertex", good.replace("v1=\"0\" v2=\"2\"", "v1=\"8\" v2=\"2\""), "refers to vertex 8"),
        ("a number", good.replace("x=\"1.5\"", "x=\"one\""), "\"x\" is \"one\", which is no number"),
        ("no y", good.replace("y=\"2.25\"", ""), "<vertex>: a vertex needs x, y and z"),
        ("negative", good.replace("v1=\"0\"", "v1=\"-1\""), "\"v1\" is \"-1\""),
        ("no object", good.replace("<item objectid=\"1\"", "<item objectid=\"3\""), "refers to object 3"),
        ("a transform", good.replace(ITEM, "<item objectid=\"1\" transform=\"1 2\"/>"), "twelve numbers"),
        ("a DTD", good.replace("<model ", "<!DOCTYPE lolz [<!ENTITY lol \"lol\">]><model "), "DTD"),
        ("cut off", good.replace("</model>", ""), "cut off"),
        ("unclosed", good.replace("</vertices>", ""), "byte"),
        ("another root", "<svg></svg>".into(), "begins with <model>"),
        ("no XML", "v 0 0 0".into(), "there is no XML"),
        ("not UTF-8", good.replace("A &amp; B", "\u{1}"), "nothing"),
        (
            "itself",
            {
                let inner = "<components><component objectid=\"2\"/></components>";
                model(&format!("<object id=\"2\">{inner}</object>"), "<item objectid=\"2\"/>")
            },
            "is in itself",
        ),
        ("twice", model("<object id=\"2\"/><object id=\"2\"/>", ""), "two objects have the number 2"),
        ("a colour", model("<basematerials id=\"1\"><base displaycolor=\"red\"/></basematerials>", ""), "#RRGGBB"),
    ];
    for (name, text, part) in &cases {
        let result = read_model(text);
        if *name == "not UTF-8" {
            // A control character in a title is harmless.
            assert!(result.is_ok(), "{name}: {result:?}");
            continue;
        }
        let error = result.unwrap_err();
        assert!(matches!(error.fault, MeshFault::Broken | MeshFault::Empty), "{name}: {error}");
        assert!(error.detail.contains(part), "{name}: {error}");
    }
    assert_eq!(cases.len(), 15);
    let latin = package(&good.replace("A &amp; B", "é").chars().map(|c| c as u8).collect::<Vec<u8>>());
    assert!(read(&latin).unwrap_err().detail.contains("neither UTF-8 nor UTF-16"));
}

#[test]
fn what_doubles_and_deepens_is_counted_first() {
    let cube = mesh(&triangles(), |_| String::new());
    let chain = |levels: u32, copies: usize, first: &str| {
        let mut resources = format!("<object id=\"1\">{first}</object>");
        for level in 2..=levels {
            let component = format!("<component objectid=\"{}\"/>", level - 1);
            resources +=
                &format!("<object id=\"{level}\"><components>{}</components></object>", component.repeat(copies));
        }
        model(&resources, &format!("<item objectid=\"{levels}\"/>"))
    };
    let rising: String = (1..=400).map(|i| format!("<item objectid=\"{}\"/>", i * 50)).collect();
    let cases = [
        (chain(50, 2, &cube), "--limit-triangles"),
        (chain(50, 2, "<mesh><vertices/><triangles/></mesh>"), "--limit-nodes"),
        (chain(100, 1, &cube), "64 deep"),
        // Each a little deeper than one that is known by then, and the last too deep for any stack.
        (chain(20_000, 1, &cube).replace("<item objectid=\"20000\"/>", &rising), "64 deep"),
        (chain(66, 1, &cube).replace("<item", "<item objectid=\"65\"/><item"), "64 deep"),
        (format!("<model>{}", "<a>".repeat(100_000)), "64 deep"),
    ];
    for (text, part) in &cases {
        let error = within_bytes(64 << 20, part, || read_model(text).unwrap_err());
        assert!(error.detail.contains(part), "{error}");
    }
    assert_eq!(cases.len(), 6);
    assert_eq!(read_model(&chain(65, 1, &cube)).unwrap().triangles.len(), 12);
    let bytes = package(cube_model(ITEM).as_bytes());
    for limits in [
        Limits::default().with(|limits| limits.triangles = 11),
        Limits::default().with(|limits| limits.memory_bytes = 1000),
    ] {
        assert!(matches!(read_limited(&bytes, None, &limits).unwrap_err().fault, MeshFault::Limit(_)));
    }
    let (stopped, limits) = (Deadline::default(), Limits::default());
    stopped.stop();
    let error = import(&Bundle::of_one(bytes), None, &limits, &mut Budget::new(&limits), &stopped).unwrap_err();
    assert_eq!(error.fault, MeshFault::Stopped);
    // Two hundred thousand attributes on one element, and a package that is a bomb.
    let wide = cube_model(ITEM).replace("<vertices>", &format!("<vertices {}>", "a=\"\" ".repeat(200_000)));
    assert_eq!(read_model(&wide).unwrap().triangles.len(), 12);
    let bomb = cube_model(ITEM).replace("<vertices>", &format!("<vertices {}>", " ".repeat(2 << 20)));
    assert!(read_model(&bomb).unwrap_err().detail.contains("too long"));
    let small = Limits::default().with(|limits| limits.bundle_bytes = 1 << 20);
    assert!(read_limited(&package(bomb.as_bytes()), None, &small).unwrap_err().detail.contains("--limit-bundle-bytes"));
}

#[test]
fn packages_and_parts_cut_off_or_changed_are_survived() {
    let part = cube_model(ITEM);
    assert_eq!(cut_everywhere(part.as_bytes(), Format::ThreeMf), 0);
    assert_eq!(cut_everywhere(&package(part.as_bytes()), Format::ThreeMf), 0);
    // Packed data has a checksum, which alone would reveal a change, so the part is changed
    // unpacked.
    let drawn = mutate(part.as_bytes(), Format::ThreeMf, 20_000, 0x30F1);
    assert!(drawn > 1000 && drawn < 19_000, "{drawn}");
    let drawn = mutate(&package(part.as_bytes()), Format::ThreeMf, 20_000, 0x30F2);
    assert!(drawn < 19_000, "{drawn}");
}

#[test]
fn the_service_reads_it_by_its_bytes_and_by_its_name() {
    let server = Server::start(&[]);
    let bytes = package(cube_model(ITEM).as_bytes());
    let sniffed = server.post("/v1/render?size=32", &bytes);
    sniffed.picture(32, 32);
    assert_eq!(server.post("/v1/render?size=32&format_in=3mf", &bytes).body, sniffed.body);
    server.post("/v1/render?size=32", &bytes[..bytes.len() - 9]).problem(422, "bundle_broken");
    server.post("/v1/render?size=32&format_in=3mf", b"v 0 0 0\n").problem(422, "mesh_broken");
    let nested = zipped(&[("a.3mf", &bytes), ("readme.txt", b"two")]);
    server.post("/v1/render?size=32", &nested).problem(422, "bundle_broken");
    let formats = server.get("/v1/capabilities").json()["mesh_formats"].clone();
    assert!(formats.as_array().unwrap().contains(&"3mf".into()), "{formats}");
}
