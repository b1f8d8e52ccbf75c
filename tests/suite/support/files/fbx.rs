//! FBX files, ASCII and binary, made from one description.

use crate::support::files::archive::Raw;
use crate::support::files::mesh::Solid;

/// A value of a node.
#[derive(Clone, Debug)]
pub enum Value {
    Int(i32),
    Id(i64),
    Float(f64),
    Text(String),
    /// Name and class of an object.
    Name(&'static str, &'static str),
    Ints(Vec<i32>),
    Floats(Vec<f64>),
    Raw(Vec<u8>),
    /// An array of this kind, deflated; the binary form alone has them.
    Packed(u8, Vec<u8>),
}

/// A node of the tree that an FBX file is.
#[derive(Clone, Debug)]
pub struct Node {
    pub name: &'static str,
    pub values: Vec<Value>,
    pub children: Vec<Node>,
}

pub fn node(name: &'static str, values: Vec<Value>, children: Vec<Node>) -> Node {
    Node { name, values, children }
}

pub fn text(text: &str) -> Value {
    Value::Text(text.into())
}

/// `P: "name", "kind", "", "A", ...`
pub fn property(name: &str, kind: &str, values: &[f64]) -> Node {
    let mut all = vec![text(name), text(kind), text(""), text("A")];
    let is_int = matches!(kind, "int" | "enum" | "Visibility" | "bool");
    all.extend(values.iter().map(|v| if is_int { Value::Int(*v as i32) } else { Value::Float(*v) }));
    node("P", all, vec![])
}

pub fn properties(list: Vec<Node>) -> Node {
    node("Properties70", vec![], list)
}

/// A file of these objects and connections; `up` is 1 for Y and 2 for Z.
pub fn file(up: i32, objects: Vec<Node>, connections: &[(i64, i64, &str)]) -> Vec<Node> {
    let setting = |name: &str, value: i32| property(name, "int", &[f64::from(value)]);
    let front = if up == 1 { (2, 1) } else { (1, -1) };
    let connections = connections.iter().map(|&(from, to, slot)| {
        let kind = if slot.is_empty() { "OO" } else { "OP" };
        let mut values = vec![text(kind), Value::Id(from), Value::Id(to)];
        if !slot.is_empty() {
            values.push(text(slot));
        }
        node("C", values, vec![])
    });
    vec![
        node(
            "FBXHeaderExtension",
            vec![],
            vec![
                node("FBXHeaderVersion", vec![Value::Int(1003)], vec![]),
                node("FBXVersion", vec![Value::Int(7400)], vec![]),
            ],
        ),
        node(
            "GlobalSettings",
            vec![],
            vec![
                node("Version", vec![Value::Int(1000)], vec![]),
                properties(vec![
                    setting("UpAxis", up),
                    setting("UpAxisSign", 1),
                    setting("FrontAxis", front.0),
                    setting("FrontAxisSign", front.1),
                    setting("CoordAxis", 0),
                    setting("CoordAxisSign", 1),
                    property("UnitScaleFactor", "double", &[1.0]),
                ]),
            ],
        ),
        node("Objects", vec![], objects),
        node("Connections", vec![], connections.collect()),
    ]
}

/// A layer of attributes, by corner, with indices.
pub fn layer(element: &'static str, data: &'static str, values: &[f64], indices: (&'static str, &[i32])) -> Node {
    let mut children = vec![
        node("Version", vec![Value::Int(101)], vec![]),
        node("Name", vec![text("")], vec![]),
        node("MappingInformationType", vec![text("ByPolygonVertex")], vec![]),
        node("ReferenceInformationType", vec![text("IndexToDirect")], vec![]),
        node(data, vec![Value::Floats(values.to_vec())], vec![]),
    ];
    children.push(node(indices.0, vec![Value::Ints(indices.1.to_vec())], vec![]));
    node(element, vec![Value::Int(0)], children)
}

/// The slot of each face's material.
pub fn face_materials(slots: &[i32]) -> Node {
    node(
        "LayerElementMaterial",
        vec![Value::Int(0)],
        vec![
            node("Version", vec![Value::Int(101)], vec![]),
            node("MappingInformationType", vec![text("ByPolygon")], vec![]),
            node("ReferenceInformationType", vec![text("IndexToDirect")], vec![]),
            node("Materials", vec![Value::Ints(slots.to_vec())], vec![]),
        ],
    )
}

/// A mesh, with layers.
pub fn geometry(id: i64, solid: &Solid, layers: Vec<Node>) -> Node {
    let positions = solid.positions.iter().flatten().copied().collect();
    let mut indices = Vec::new();
    for polygon in &solid.polygons {
        indices.extend(polygon.iter().map(|&v| v as i32));
        if let Some(last) = indices.last_mut() {
            *last = !*last;
        }
    }
    let elements = layers.iter().map(|layer| {
        let kind = node("Type", vec![text(layer.name)], vec![]);
        node("LayerElement", vec![], vec![kind, node("TypedIndex", vec![Value::Int(0)], vec![])])
    });
    let layer = node("Layer", vec![Value::Int(0)], elements.collect());
    let mut children = vec![
        node("Vertices", vec![Value::Floats(positions)], vec![]),
        node("PolygonVertexIndex", vec![Value::Ints(indices)], vec![]),
        node("GeometryVersion", vec![Value::Int(124)], vec![]),
    ];
    children.extend(layers);
    children.push(layer);
    node("Geometry", vec![Value::Id(id), Value::Name("shape", "Geometry"), text("Mesh")], children)
}

/// A node of the scene.
pub fn model(id: i64, kind: &str, list: Vec<Node>) -> Node {
    let children = vec![node("Version", vec![Value::Int(232)], vec![]), properties(list)];
    node("Model", vec![Value::Id(id), Value::Name("thing", "Model"), text(kind)], children)
}

pub fn material(id: i64, name: &'static str, list: Vec<Node>) -> Node {
    let children = vec![
        node("Version", vec![Value::Int(102)], vec![]),
        node("ShadingModel", vec![text("phong")], vec![]),
        properties(list),
    ];
    node("Material", vec![Value::Id(id), Value::Name(name, "Material"), text("")], children)
}

/// The text form.
pub fn ascii(nodes: &[Node]) -> Vec<u8> {
    let mut out = String::from("; FBX 7.4.0 project file\n");
    nodes.iter().for_each(|node| write_ascii(node, 0, &mut out));
    out.into_bytes()
}

fn write_ascii(node: &Node, depth: usize, out: &mut String) {
    use base64::Engine;
    let words = |list: &mut dyn Iterator<Item = String>| list.collect::<Vec<_>>().join(",");
    let values = node.values.iter().map(|value| match value {
        Value::Int(v) => v.to_string(),
        Value::Id(v) => v.to_string(),
        Value::Float(v) => v.to_string(),
        Value::Text(v) => format!("\"{v}\""),
        Value::Name(name, class) => format!("\"{class}::{name}\""),
        Value::Ints(v) => format!("*{} {{ a: {} }}", v.len(), words(&mut v.iter().map(ToString::to_string))),
        Value::Floats(v) => format!("*{} {{ a: {} }}", v.len(), words(&mut v.iter().map(ToString::to_string))),
        Value::Raw(v) => format!(",\"{}\"", base64::engine::general_purpose::STANDARD.encode(v)),
        Value::Packed(..) => panic!("text is not packed"),
    });
    *out += &format!("{}{}: {}", "\t".repeat(depth), node.name, values.collect::<Vec<_>>().join(","));
    if !node.children.is_empty() {
        *out += " {\n";
        node.children.iter().for_each(|child| write_ascii(child, depth + 1, out));
        *out += &format!("{}}}", "\t".repeat(depth));
    }
    *out += "\n";
}

/// RFC 1950 around an honest archiver's RFC 1951.
fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0x78, 0x9c];
    out.extend(Raw::deflated("x", bytes).packed);
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in bytes {
        a = (a + u32::from(*byte)) % 65_521;
        b = (b + a) % 65_521;
    }
    out.extend((b << 16 | a).to_be_bytes());
    out
}

/// The binary form, version 7.4.
pub fn binary(nodes: &[Node]) -> Vec<u8> {
    let mut out = b"Kaydara FBX Binary  \0\x1a\0".to_vec();
    out.extend(7400_u32.to_le_bytes());
    nodes.iter().for_each(|node| write_binary(node, &mut out));
    out.extend([0; 13]);
    out
}

fn write_binary(node: &Node, out: &mut Vec<u8>) {
    let start = out.len();
    out.extend([0; 12]);
    out.push(node.name.len() as u8);
    out.extend(node.name.bytes());
    let values = out.len();
    let bytes = |kind: u8, data: &[u8], out: &mut Vec<u8>| {
        out.push(kind);
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(data);
    };
    let array = |kind: u8, count: usize, data: Vec<u8>, out: &mut Vec<u8>| {
        out.push(kind);
        [count as u32, 0, data.len() as u32].iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(data);
    };
    for value in &node.values {
        match value {
            Value::Int(v) => {
                out.push(b'I');
                out.extend(v.to_le_bytes());
            }
            Value::Id(v) => {
                out.push(b'L');
                out.extend(v.to_le_bytes());
            }
            Value::Float(v) => {
                out.push(b'D');
                out.extend(v.to_le_bytes());
            }
            Value::Text(v) => bytes(b'S', v.as_bytes(), out),
            Value::Name(name, class) => bytes(b'S', format!("{name}\0\x01{class}").as_bytes(), out),
            Value::Ints(v) => array(b'i', v.len(), v.iter().flat_map(|v| v.to_le_bytes()).collect(), out),
            Value::Floats(v) => array(b'd', v.len(), v.iter().flat_map(|v| v.to_le_bytes()).collect(), out),
            Value::Raw(v) => bytes(b'R', v, out),
            Value::Packed(kind, v) => {
                let size = if matches!(kind, b'd' | b'l') { 8 } else { 4 };
                let packed = zlib(v);
                out.push(*kind);
                [(v.len() / size) as u32, 1, packed.len() as u32].iter().for_each(|v| out.extend(v.to_le_bytes()));
                out.extend(packed);
            }
        }
    }
    let values = out.len() - values;
    if !node.children.is_empty() {
        node.children.iter().for_each(|child| write_binary(child, out));
        out.extend([0; 13]);
    }
    let words = [out.len() as u32, node.values.len() as u32, values as u32];
    for (place, word) in words.iter().enumerate() {
        out[start + 4 * place..start + 4 * place + 4].copy_from_slice(&word.to_le_bytes());
    }
}
