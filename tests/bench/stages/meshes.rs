//! The meshes that are timed: made here, so that a clone measures the same as everybody.

use std::fmt::Write as _;

/// A mesh file in memory.
pub struct MeshFile {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// A bumpy torus of about 1 k, 70 k and 1 M triangles; the largest as binary STL too.
pub fn made() -> Vec<MeshFile> {
    let obj = |name: &str, n| MeshFile { name: name.into(), bytes: obj(&Torus { n }) };
    vec![
        obj("torus 1 k OBJ", 23),
        obj("torus 70 k OBJ", 187),
        obj("torus 1 M OBJ", 707),
        MeshFile { name: "torus 1 M STL".into(), bytes: stl(&Torus { n: 707 }) },
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
