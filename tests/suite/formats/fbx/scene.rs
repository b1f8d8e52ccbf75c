//! FBX: which parts of a scene are drawn (hidden nodes and coarse levels of detail are not), and
//! materials with numbers that are not finite.

use crate::support::files::fbx::{Node, Value, ascii, binary, file, geometry, model, node, properties, property, text};
use crate::support::files::mesh::{Solid, codes, read};

type Links = Vec<(i64, i64, &'static str)>;
/// A name, a file, how many boxes it shows, and its warnings.
type Case = (&'static str, Vec<Node>, usize, Vec<&'static str>);

fn flag(name: &str, value: f64) -> Node {
    property(name, if name == "Visibility" { "Visibility" } else { "bool" }, &[value])
}

/// A box at the top, and three more nodes that show it below a fourth, which is of this kind.
fn family(kind: &str, parent: Vec<Node>, last: Vec<Node>, more: Vec<Node>, links: Links) -> Vec<Node> {
    let mut objects = vec![
        geometry(100, &Solid::cuboid(), vec![]),
        model(200, "Mesh", vec![]),
        model(300, kind, parent),
        model(301, "Mesh", vec![]),
        model(302, "Mesh", vec![]),
        model(303, "Mesh", last),
    ];
    objects.extend(more);
    let mut all: Links = vec![(200, 0, ""), (300, 0, ""), (301, 300, ""), (302, 300, ""), (303, 302, "")];
    all.extend([200, 301, 302, 303].map(|node| (100, node, "")));
    all.extend(links);
    file(1, objects, &all)
}

#[test]
fn hidden_parents_and_coarse_levels_are_not_drawn() {
    let level =
        || node("NodeAttribute", vec![Value::Id(400), Value::Name("lod", "NodeAttribute"), text("LodGroup")], vec![]);
    let group = |more: Vec<Node>| {
        let mut attribute = level();
        attribute.children = more;
        family("LodGroup", vec![], vec![], vec![attribute], vec![(400, 300, "")])
    };
    let hidden = || vec![flag("Visibility", 0.0)];
    // A hidden group whose levels do not inherit that.
    let apart = |id| model(id, "Mesh", vec![flag("Visibility Inheritance", 0.0)]);
    let objects = vec![
        geometry(100, &Solid::cuboid(), vec![]),
        model(300, "LodGroup", hidden()),
        apart(301),
        apart(302),
        level(),
    ];
    let links = [(300, 0, ""), (301, 300, ""), (302, 300, ""), (100, 301, ""), (100, 302, ""), (400, 300, "")];
    // A level that is hidden and not drawn, with a child that does not inherit that.
    let below = [(300, 0, ""), (301, 300, ""), (302, 300, ""), (303, 302, ""), (400, 300, "")];
    let below = [&below[..], &[301, 302, 303].map(|node| (100, node, ""))].concat();
    let within = vec![
        geometry(100, &Solid::cuboid(), vec![]),
        level(),
        model(300, "LodGroup", vec![]),
        model(301, "Mesh", vec![]),
        model(302, "Mesh", hidden()),
        apart(303),
    ];
    let cases: [Case; 6] = [
        ("shown", family("Null", vec![], vec![], vec![], vec![]), 4, vec![]),
        ("hidden", family("Null", hidden(), vec![], vec![], vec![]), 1, vec!["hidden_ignored"]),
        (
            "no heir",
            family("Null", hidden(), vec![flag("Visibility Inheritance", 0.0)], vec![], vec![]),
            2,
            vec!["hidden_ignored"],
        ),
        ("levels", group(vec![]), 2, vec!["levels_ignored"]),
        ("levels of a hidden group", file(1, objects, &links), 1, vec!["levels_ignored"]),
        ("below a hidden level", file(1, within, &below), 1, vec!["levels_ignored"]),
    ];
    for (name, nodes, shown, expected) in &cases {
        for (kind, bytes) in [("ascii", ascii(nodes)), ("binary", binary(nodes))] {
            let mesh = read(&bytes).unwrap_or_else(|error| panic!("{name} {kind}: {error}"));
            assert_eq!(mesh.triangles.len(), 12 * shown, "{name} {kind}");
            assert_eq!(&codes(&mesh), expected, "{name} {kind}");
        }
    }
    assert_eq!(cases.len(), 6);
    let mesh = read(&ascii(&cases[3].1)).unwrap();
    assert!(
        mesh.report.warnings[0].detail.ends_with("(meshes of other levels in the file: 2)"),
        "{:?}",
        mesh.report.warnings
    );
}

#[test]
fn lines_are_hidden_as_meshes_are() {
    for (properties, expected) in [(vec![], 2), (vec![flag("Visibility", 0.0)], 0)] {
        let points = node("Points", vec![Value::Floats(vec![0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 5.0, 5.0, 0.0])], vec![]);
        let indices = node("PointsIndex", vec![Value::Ints(vec![0, 1, -3])], vec![]);
        let line = vec![Value::Id(101), Value::Name("line", "Geometry"), text("Line")];
        let objects = vec![
            geometry(100, &Solid::cuboid(), vec![]),
            model(200, "Mesh", vec![]),
            node("Geometry", line, vec![points, indices]),
            model(201, "Line", properties),
        ];
        let nodes = file(1, objects, &[(200, 0, ""), (100, 200, ""), (201, 0, ""), (101, 201, "")]);
        assert_eq!(read(&ascii(&nodes)).unwrap().lines_and_points.len(), expected);
    }
}

#[test]
fn materials_have_no_nan() {
    let class = |name: &str, value: i32| property(name, "int", &[f64::from(value)]);
    let physical = |value: f64| {
        let list = vec![
            class("3dsMax|ClassIDa", -804_315_648),
            class("3dsMax|ClassIDb", -1_099_438_848),
            property("3dsMax|main|roughness", "double", &[value]),
            property("3dsMax|main|metalness", "double", &[value]),
            property("3dsMax|main|base_color", "Color", &[1.0, value, 0.5]),
        ];
        let children = vec![node("ShadingModel", vec![text("unknown")], vec![]), properties(list)];
        node("Material", vec![Value::Id(300), Value::Name("m", "Material"), text("")], children)
    };
    for (value, expected) in [(0.25, Some(0.25)), (f64::NAN, None), (f64::INFINITY, None)] {
        let objects = vec![geometry(100, &Solid::cuboid(), vec![]), model(200, "Mesh", vec![]), physical(value)];
        let nodes = file(1, objects, &[(200, 0, ""), (100, 200, ""), (300, 200, "")]);
        let mesh = read(&binary(&nodes)).unwrap();
        let slot = &mesh.materials[0];
        assert_eq!([slot.roughness, slot.metallic], [expected; 2], "{value}");
        assert!(slot.base_color.is_none_or(|color| color.iter().all(|c| c.is_finite())), "{slot:?}");
    }
}
