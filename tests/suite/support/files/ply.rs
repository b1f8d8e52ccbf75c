//! PLY files in every encoding, made from one description.

use crate::support::files::mesh::Solid;

/// The encoding of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Ascii,
    Little,
    Big,
}

pub const ENCODINGS: [Encoding; 3] = [Encoding::Ascii, Encoding::Little, Encoding::Big];

/// A PLY file in the making.
pub struct Ply {
    encoding: Encoding,
    header: String,
    body: Vec<u8>,
}

impl Ply {
    pub fn new(encoding: Encoding) -> Self {
        let name = match encoding {
            Encoding::Ascii => "ascii",
            Encoding::Little => "binary_little_endian",
            Encoding::Big => "binary_big_endian",
        };
        Self { encoding, header: format!("ply\nformat {name} 1.0\n"), body: Vec::new() }
    }

    /// A line of the header.
    pub fn line(mut self, line: &str) -> Self {
        self.header += &format!("{line}\n");
        self
    }

    /// An element: its properties as in a header but for the word, and its records, lists with
    /// their counts.
    pub fn element(mut self, name: &str, properties: &[&str], records: &[Vec<f64>]) -> Self {
        self.header += &format!("element {name} {}\n", records.len());
        for property in properties {
            self.header += &format!("property {property}\n");
        }
        for record in records {
            let mut values = record.iter().copied();
            for property in properties {
                let words: Vec<&str> = property.split(' ').collect();
                if words[0] == "list" {
                    let count = values.next().unwrap();
                    self.number(words[1], count);
                    for _ in 0..count as usize {
                        self.number(words[2], values.next().unwrap());
                    }
                } else {
                    self.number(words[0], values.next().unwrap());
                }
            }
            assert_eq!(values.next(), None, "{name}");
            if self.encoding == Encoding::Ascii {
                self.body.push(b'\n');
            }
        }
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        let mut out = format!("{}end_header\n", self.header).into_bytes();
        out.extend(&self.body);
        out
    }

    fn number(&mut self, kind: &str, value: f64) {
        let mut bytes = match kind {
            _ if self.encoding == Encoding::Ascii => format!("{value} ").into_bytes(),
            "char" | "int8" => (value as i8).to_le_bytes().to_vec(),
            "uchar" | "uint8" => (value as u8).to_le_bytes().to_vec(),
            "short" | "int16" => (value as i16).to_le_bytes().to_vec(),
            "ushort" | "uint16" => (value as u16).to_le_bytes().to_vec(),
            "int" | "int32" => (value as i32).to_le_bytes().to_vec(),
            "uint" | "uint32" => (value as u32).to_le_bytes().to_vec(),
            "float" | "float32" => (value as f32).to_le_bytes().to_vec(),
            "double" | "float64" => value.to_le_bytes().to_vec(),
            other => panic!("{other} is no type"),
        };
        if self.encoding == Encoding::Big {
            bytes.reverse();
        }
        self.body.extend(bytes);
    }
}

/// A list with its count.
pub fn list(items: &[f64]) -> Vec<f64> {
    std::iter::once(items.len() as f64).chain(items.iter().copied()).collect()
}

pub const XYZ: [&str; 3] = ["float x", "float y", "float z"];
pub const INDICES: [&str; 1] = ["list uchar int vertex_indices"];

impl Solid {
    /// One record a vertex.
    pub fn vertex_records(&self) -> Vec<Vec<f64>> {
        self.positions.iter().map(|p| p.to_vec()).collect()
    }

    /// One record a polygon.
    pub fn face_records(&self) -> Vec<Vec<f64>> {
        let indices = |polygon: &Vec<u32>| polygon.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>();
        self.polygons.iter().map(|polygon| list(&indices(polygon))).collect()
    }

    pub fn ply(&self, encoding: Encoding) -> Vec<u8> {
        let ply = Ply::new(encoding).line("comment made by a test");
        ply.element("vertex", &XYZ, &self.vertex_records()).element("face", &INDICES, &self.face_records()).bytes()
    }
}
