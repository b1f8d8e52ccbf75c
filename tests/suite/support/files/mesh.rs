//! Small mesh files (OBJ, STL, glTF), made from one description, so that tests can compare what
//! comes out. Also imports with default limits.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use meshsnap_render::import::{Bundle, Format, ImportReport, MeshError, Options, import};
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use serde_json::{Value, json};
use std::ops::{Deref, DerefMut};

/// A mesh with the report of its import: as a mesh to whatever takes one.
#[derive(Clone, Debug)]
pub struct Read {
    pub mesh: Mesh,
    pub report: ImportReport,
}

impl From<(Mesh, ImportReport)> for Read {
    fn from((mesh, report): (Mesh, ImportReport)) -> Self {
        Self { mesh, report }
    }
}

impl Deref for Read {
    type Target = Mesh;

    fn deref(&self) -> &Mesh {
        &self.mesh
    }
}

impl DerefMut for Read {
    fn deref_mut(&mut self) -> &mut Mesh {
        &mut self.mesh
    }
}

/// Imports with default limits.
pub fn read(bytes: &[u8]) -> Result<Read, MeshError> {
    read_as(bytes, None)
}

/// Imports as a given format.
pub fn read_as(bytes: &[u8], format: Option<Format>) -> Result<Read, MeshError> {
    read_limited(bytes, format, &Limits::default())
}

/// Imports with limits.
pub fn read_limited(bytes: &[u8], format: Option<Format>, limits: &Limits) -> Result<Read, MeshError> {
    import(&Bundle::of_one(bytes.to_vec()), format, limits, &mut Budget::new(limits), &Deadline::default())
        .map(Read::from)
}

/// Imports at a moment of the file's first animation.
pub fn read_at(bytes: &[u8], time_s: f64) -> Result<Read, MeshError> {
    let (limits, options) = (Limits::default(), Options { time_s: Some(time_s), ..Options::default() });
    import(&Bundle::of_one(bytes.to_vec()), options, &limits, &mut Budget::new(&limits), &Deadline::default())
        .map(Read::from)
}

/// Codes of the warnings that an import gave.
pub fn codes(mesh: &Read) -> Vec<&'static str> {
    mesh.report.warnings.iter().map(|w| w.code).collect()
}

/// The corners of all triangles in file space.
pub fn corners(mesh: &Mesh) -> Vec<[[f64; 3]; 3]> {
    let at = |v: u32| {
        let p = mesh.positions[v as usize];
        std::array::from_fn(|k| mesh.to_file.centre[k] + mesh.to_file.scale * f64::from(p[k]))
    };
    mesh.triangles.iter().map(|t| t.map(at)).collect()
}

/// Sets the value at a place of a document, whether there is one already or not.
pub fn set(json: &mut Value, place: &str, value: Value) {
    let (parent, key) = place.rsplit_once('/').unwrap();
    match json.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        object => object[key] = value,
    }
}

/// Fails where two meshes have not the same triangles, within a distance.
pub fn assert_close(a: &Mesh, b: &Mesh, tolerance: f64) {
    let (a, b) = (corners(a), corners(b));
    assert_eq!(a.len(), b.len());
    let coordinates = |triangles: &[[[f64; 3]; 3]]| triangles.iter().flatten().flatten().copied().collect::<Vec<f64>>();
    for (a, b) in coordinates(&a).into_iter().zip(coordinates(&b)) {
        assert!((a - b).abs() <= tolerance, "{a} is not {b}");
    }
}

/// Polygons over positions that f32 and short decimals hold exactly.
#[derive(Clone, Debug)]
pub struct Solid {
    pub positions: Vec<[f64; 3]>,
    pub polygons: Vec<Vec<u32>>,
}

impl Solid {
    /// A box of three different sides, away from the origin; outward windings.
    pub fn cuboid() -> Self {
        let positions = (0..8)
            .map(|i| [1.5 + f64::from(i & 1), 2.25 + 2.0 * f64::from(i >> 1 & 1), -4.0 + 0.5 * f64::from(i >> 2)])
            .collect();
        let polygons = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Self { positions, polygons: polygons.map(|p| p.to_vec()).to_vec() }
    }

    /// A sheet of `n` times `n` quads, wavy, so that no two triangles lie in a plane.
    pub fn grid(n: u32) -> Self {
        let mut solid = Self { positions: Vec::new(), polygons: Vec::new() };
        for y in 0..=n {
            for x in 0..=n {
                let z = f64::from(x * 7 % 5) * 0.125 + f64::from(y * 3 % 4) * 0.25;
                solid.positions.push([f64::from(x), f64::from(y), z]);
            }
        }
        for y in 0..n {
            for x in 0..n {
                let v = y * (n + 1) + x;
                solid.polygons.push(vec![v, v + 1, v + n + 2, v + n + 1]);
            }
        }
        solid
    }

    pub fn obj(&self) -> String {
        let mut out = String::from("# made by a test\n");
        for [x, y, z] in &self.positions {
            out += &format!("v {x} {y} {z}\n");
        }
        for polygon in &self.polygons {
            let corners: Vec<String> = polygon.iter().map(|v| (v + 1).to_string()).collect();
            out += &format!("f {}\n", corners.join(" "));
        }
        out
    }

    /// The same with triangles in place of polygons.
    pub fn triangulated(&self, triangles: &[[u32; 3]]) -> Self {
        Self { positions: self.positions.clone(), polygons: triangles.iter().map(|t| t.to_vec()).collect() }
    }

    fn corners(&self) -> impl Iterator<Item = [f32; 3]> {
        self.polygons.iter().flatten().map(|&v| self.positions[v as usize].map(|c| c as f32))
    }

    /// Triangles only.
    pub fn stl_binary(&self) -> Vec<u8> {
        let mut out = vec![b' '; 80];
        out[..5].copy_from_slice(b"solid"); // as some exporters do
        out.extend((self.polygons.len() as u32).to_le_bytes());
        let corners: Vec<[f32; 3]> = self.corners().collect();
        for triangle in corners.chunks_exact(3) {
            out.extend([0; 12]);
            out.extend(triangle.iter().flatten().flat_map(|c| c.to_le_bytes()));
            out.extend([0; 2]);
        }
        out
    }

    /// Triangles only.
    pub fn stl_ascii(&self) -> String {
        let mut out = String::from("solid a test\n");
        let corners: Vec<[f32; 3]> = self.corners().collect();
        for triangle in corners.chunks_exact(3) {
            out += "  facet normal 0 0 0\n    outer loop\n";
            for [x, y, z] in triangle {
                out += &format!("      vertex {x} {y} {z}\n");
            }
            out += "    endloop\n  endfacet\n";
        }
        out + "endsolid a test\n"
    }

    /// Triangles only.
    pub fn gltf(&self) -> Gltf {
        let mut gltf = Gltf::default();
        let positions: Vec<f32> = self.positions.iter().flatten().map(|c| *c as f32).collect();
        let indices: Vec<u16> = self.polygons.iter().flatten().map(|v| *v as u16).collect();
        let position = gltf.floats("VEC3", &positions);
        let index = gltf.shorts("SCALAR", &indices);
        gltf.mesh(json!({ "attributes": { "POSITION": position }, "indices": index }));
        gltf.json["nodes"] = json!([{ "mesh": 0 }]);
        gltf
    }
}

/// A glTF file in the making.
#[derive(Clone, Debug)]
pub struct Gltf {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Default for Gltf {
    fn default() -> Self {
        let json = json!({ "asset": { "version": "2.0" }, "buffers": [{ "byteLength": 0 }], "bufferViews": [],
                           "accessors": [], "meshes": [], "nodes": [], "scenes": [{ "nodes": [0] }], "scene": 0 });
        Self { json, bin: Vec::new() }
    }
}

impl Gltf {
    fn push(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    pub fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({ "bufferView": view, "type": kind, "componentType": component, "count": count }))
    }

    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, 5126, values.len() / components(kind), &bytes)
    }

    pub fn shorts(&mut self, kind: &str, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, 5123, values.len() / components(kind), &bytes)
    }

    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"][0]["byteLength"] = self.bin.len().into();
        glb(&json.to_string(), &self.bin)
    }

    /// As JSON with the buffer in a data URI.
    pub fn gltf(&self) -> String {
        use base64::Engine;
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        json["buffers"][0] =
            json!({ "byteLength": self.bin.len(), "uri": format!("data:application/octet-stream;base64,{data}") });
        json.to_string()
    }
}

fn components(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "MAT4" => 16,
        _ => 4,
    }
}

/// A GLB container.
pub fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + json.len() + 8 + bin.len();
    let mut out = b"glTF".to_vec();
    for word in [2, length as u32, json.len() as u32] {
        out.extend(word.to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(bin);
    out
}

/// Deterministic noise.
pub struct Noise(pub u64);

impl Noise {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| (self.next() >> 32) as u8).collect()
    }
}
