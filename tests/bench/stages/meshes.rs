//! The meshes that are timed. They are made here, so that every checkout measures the same ones.

use std::fmt::Write as _;

/// A mesh file in memory.
pub struct MeshFile {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// A bumpy torus of about 1 k, 70 k and 1 M triangles; the largest as binary STL, PLY and GLB too.
pub fn made() -> Vec<MeshFile> {
    let obj = |name: &str, n| MeshFile { name: name.into(), bytes: obj(&Torus { n }) };
    vec![
        obj("torus 1 k OBJ", 23),
        obj("torus 70 k OBJ", 187),
        obj("torus 1 M OBJ", 707),
        MeshFile { name: "torus 1 M STL".into(), bytes: stl(&Torus { n: 707 }) },
        MeshFile { name: "torus 1 M PLY".into(), bytes: ply(&Torus { n: 707 }) },
        MeshFile { name: "torus 1 M GLB".into(), bytes: glb(&Torus { n: 707 }) },
    ]
}

/// A file's own name and bytes.
pub fn file(path: &str) -> MeshFile {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let name = path.rsplit('/').next().unwrap_or(path).to_owned();
    MeshFile { name, bytes }
}

/// A torus of n x n quads, two triangles each, with bumps.
pub struct Torus {
    pub n: usize,
}

impl Torus {
    fn point(&self, i: usize, j: usize) -> [f32; 3] {
        let turn = std::f64::consts::TAU / self.n as f64;
        let (u, v) = (i as f64 * turn, j as f64 * turn);
        let tube = 0.4 + 0.03 * (9.0 * u).sin() * (7.0 * v).cos();
        let from_axis = 1.0 + tube * v.cos();
        [from_axis * u.cos(), tube * v.sin(), from_axis * u.sin()].map(|c| c as f32)
    }

    fn corners(&self) -> impl Iterator<Item = [[usize; 2]; 3]> + '_ {
        let n = self.n;
        (0..n * n).flat_map(move |k| {
            let (i, j) = (k / n, k % n);
            let (k, l) = ((i + 1) % n, (j + 1) % n);
            [[[i, j], [i, l], [k, l]], [[i, j], [k, l], [k, j]]]
        })
    }
}

/// As exporters write it: six decimals.
pub fn obj(torus: &Torus) -> Vec<u8> {
    let n = torus.n;
    let mut text = String::new();
    for k in 0..n * n {
        let [x, y, z] = torus.point(k / n, k % n);
        writeln!(text, "v {x:.6} {y:.6} {z:.6}").unwrap();
    }
    for corners in torus.corners() {
        let [a, b, c] = corners.map(|[i, j]| i * n + j + 1);
        writeln!(text, "f {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

/// Binary STL.
pub fn stl(torus: &Torus) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((2 * torus.n as u32 * torus.n as u32).to_le_bytes());
    for corners in torus.corners() {
        bytes.extend([0; 12]);
        for [i, j] in corners {
            torus.point(i, j).iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// Binary PLY: floats, and lists of int with their length in a byte.
pub fn ply(torus: &Torus) -> Vec<u8> {
    let vertices = torus.n * torus.n;
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        2 * vertices
    )
    .into_bytes();
    bytes.extend(positions(torus));
    for corners in torus.corners() {
        bytes.push(3);
        bytes.extend(corners.map(|[i, j]| (i * torus.n + j) as u32).iter().flat_map(|index| index.to_le_bytes()));
    }
    bytes
}

/// GLB: one primitive, positions as floats, indices of 32 bits.
pub fn glb(torus: &Torus) -> Vec<u8> {
    let mut data = positions(torus);
    let (vertices, indices_at) = (torus.n * torus.n, data.len());
    for corners in torus.corners() {
        data.extend(corners.map(|[i, j]| (i * torus.n + j) as u32).iter().flat_map(|index| index.to_le_bytes()));
    }
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "byteLength": data.len() }],
        "bufferViews": [
            { "buffer": 0, "byteLength": indices_at },
            { "buffer": 0, "byteOffset": indices_at, "byteLength": data.len() - indices_at },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3", "min": [-2, -1, -2], "max": [2, 1, 2] },
            { "bufferView": 1, "componentType": 5125, "count": 6 * vertices, "type": "SCALAR" },
        ],
    });
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((12 + 8 + json.len() as u32 + 8 + data.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", data)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn positions(torus: &Torus) -> Vec<u8> {
    let n = torus.n;
    (0..n * n).flat_map(|k| torus.point(k / n, k % n)).flat_map(f32::to_le_bytes).collect()
}

/// Squares behind each other, as OBJ.
pub fn layers(count: usize) -> Vec<u8> {
    let mut text = String::new();
    for k in 0..count {
        let z = k as f64 / count as f64;
        writeln!(text, "v -1 -1 {z:.6}\nv 1 -1 {z:.6}\nv 1 1 {z:.6}\nv -1 1 {z:.6}\nf -4 -3 -2 -1").unwrap();
    }
    text.into_bytes()
}

/// Triangles as long as the picture and a thousandth of it wide, in all directions, as OBJ.
pub fn needles(count: usize) -> Vec<u8> {
    let mut text = String::new();
    for k in 0..count {
        let turn = k as f64 * 2.399_963;
        let (x, y, z) = (turn.cos(), turn.sin(), (k as f64 * 0.618_034).fract() - 0.5);
        writeln!(
            text,
            "v {x:.6} {y:.6} {z:.6}\nv {:.6} {:.6} {z:.6}\nv {:.6} {:.6} {:.6}\nf -3 -2 -1",
            -x,
            -y,
            -x + 0.002 * y,
            -y - 0.002 * x,
            -z
        )
        .unwrap();
    }
    text.into_bytes()
}

/// Small triangles around the middle of one large one, as binary STL.
pub fn specks(count: usize) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((count as u32 + 1).to_le_bytes());
    let mut push = |corners: [[f32; 3]; 3]| {
        bytes.extend([0; 12]);
        corners.iter().flatten().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend([0; 2]);
    };
    push([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
    for k in 0..count {
        let turn = k as f32 * 2.399_963;
        let at = [turn.cos(), turn.sin(), (k as f32 * 0.618_034).fract()].map(|c| c * 1e-3);
        push([at, [at[0] + 1e-4, at[1], at[2]], [at[0], at[1] + 1e-4, at[2] + 1e-4]]);
    }
    bytes
}
