//! Meshes that the tests make themselves, as OBJ text.

use std::f64::consts::TAU;
use std::fmt::Write;

/// A growing OBJ file.
#[derive(Default)]
pub struct Obj {
    text: String,
    vertices: usize,
}

impl Obj {
    pub fn vertex(&mut self, p: [f64; 3]) -> usize {
        writeln!(self.text, "v {} {} {}", p[0], p[1], p[2]).unwrap();
        self.vertices += 1;
        self.vertices
    }

    pub fn face(&mut self, corners: &[usize]) {
        let words: Vec<String> = corners.iter().map(usize::to_string).collect();
        writeln!(self.text, "f {}", words.join(" ")).unwrap();
    }

    pub fn finish(self) -> String {
        self.text
    }

    /// A closed box of six quads.
    pub fn cuboid(&mut self, low: [f64; 3], high: [f64; 3]) {
        let corners: [usize; 8] = std::array::from_fn(|i| {
            self.vertex(std::array::from_fn(|k| if i >> k & 1 == 1 { high[k] } else { low[k] }))
        });
        for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            self.face(&face.map(|i: usize| corners[i]));
        }
    }

    /// A closed ball: quads, and triangles at its poles.
    pub fn ball(&mut self, centre: [f64; 3], radius: f64, n: usize) {
        let at = |i: usize, j: usize| {
            let (a, b) = (i as f64 / n as f64 * TAU, j as f64 / (n / 2) as f64 * 0.5 * TAU);
            let p = [b.sin() * a.cos(), b.cos(), -b.sin() * a.sin()];
            [0, 1, 2].map(|k| centre[k] + radius * p[k])
        };
        let rows: Vec<Vec<usize>> = (0..=n / 2)
            .map(|j| {
                let ring = if j == 0 || j == n / 2 { 1 } else { n };
                (0..ring).map(|i| self.vertex(at(i, j))).collect()
            })
            .collect();
        for pair in rows.windows(2) {
            for i in 0..n {
                let at = |row: &[usize], i: usize| row[i % row.len()];
                let corners = [at(&pair[0], i), at(&pair[1], i), at(&pair[1], i + 1), at(&pair[0], i + 1)];
                match (pair[0].len(), pair[1].len()) {
                    (1, _) => self.face(&[corners[0], corners[1], corners[2]]),
                    (_, 1) => self.face(&[corners[0], corners[1], corners[3]]),
                    _ => self.face(&corners),
                }
            }
        }
    }

    /// A grid of quads over (u, v) in the unit square; `wrap` closes it in u and v.
    pub fn grid(&mut self, n: [usize; 2], wrap: [bool; 2], at: impl Fn(f64, f64) -> [f64; 3]) {
        let points = [n[0] + usize::from(!wrap[0]), n[1] + usize::from(!wrap[1])];
        let first = self.vertices + 1;
        for i in 0..points[0] {
            for j in 0..points[1] {
                self.vertex(at(i as f64 / n[0] as f64, j as f64 / n[1] as f64));
            }
        }
        let index = |i: usize, j: usize| first + (i % points[0]) * points[1] + j % points[1];
        for i in 0..n[0] {
            for j in 0..n[1] {
                self.face(&[index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
            }
        }
    }
}

/// Three quads that share an edge.
pub const FIN: &str = "v 0 0 0\nv 0 1 0\nv 1 0 .2\nv 1 1 .2\nv -1 0 .4\nv -1 1 .4\nv .2 0 -1\nv .2 1 -1\nf 1 2 4 3\nf 1 2 6 5\nf 1 2 8 7\n";

/// Six quads.
pub fn cube() -> String {
    let mut obj = Obj::default();
    obj.cuboid([-1.0; 3], [1.0; 3]);
    obj.finish()
}

/// Two boxes on a floor.
pub fn boxes_on_a_floor() -> String {
    let mut obj = Obj::default();
    let floor = [[-3.0, -3.0], [-3.0, 3.0], [3.0, 3.0], [3.0, -3.0]].map(|[x, z]| obj.vertex([x, 0.0, z]));
    obj.face(&floor);
    obj.cuboid([-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]);
    obj.cuboid([1.2, 0.0, 0.8], [1.8, 1.5, 1.6]);
    obj.finish()
}

/// A box on a box, and one beside them that touches its side.
pub fn stacked_boxes() -> String {
    let mut obj = Obj::default();
    obj.cuboid([-1.0; 3], [1.0; 3]);
    obj.cuboid([-0.5, 1.0, -0.5], [0.5, 2.0, 0.5]);
    obj.cuboid([1.0, -1.0, -0.25], [2.0, 0.25, 0.75]);
    obj.finish()
}

/// A room whose ceiling is of nine quads, so that three of their sides lie on one of each wall's.
pub fn room_with_t_junctions() -> String {
    let mut obj = Obj::default();
    let corners: [usize; 8] =
        std::array::from_fn(|i| obj.vertex([0, 1, 2].map(|k| f64::from((i >> k & 1) as u8) * 3.0 - 1.5)));
    for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [0, 4, 6, 2], [1, 3, 7, 5]] {
        obj.face(&face.map(|i: usize| corners[i]));
    }
    obj.grid([3, 3], [false, false], |u, v| [(3.0 * u).round() - 1.5, 1.5, 1.5 - (3.0 * v).round()]);
    obj.finish()
}

/// A closed torus of quads.
pub fn torus(n: usize) -> String {
    let mut obj = Obj::default();
    obj.grid([n, n / 2], [true, true], |u, v| {
        let (a, b) = (u * TAU, v * TAU);
        let r = 1.0 + 0.4 * b.cos();
        [r * a.cos(), 0.4 * b.sin(), -r * a.sin()]
    });
    obj.finish()
}

/// Two balls side by side, of the materials "left" and "right"; seen from the left, one before the
/// other.
pub fn two_balls() -> String {
    let mut obj = Obj::default();
    for (name, x, radius) in [("left", -1.1, 0.9), ("right", 1.1, 1.0)] {
        obj.text.push_str(&format!("usemtl {name}\n"));
        obj.ball([x, 0.0, 0.0], radius, 20);
    }
    obj.finish()
}

/// An open, wavy sheet.
pub fn sheet(n: usize) -> String {
    let mut obj = Obj::default();
    obj.grid([n, n], [false, false], |u, v| [u * 2.0 - 1.0, 0.3 * (u * 7.0).sin() * (v * 5.0).cos(), 1.0 - v * 2.0]);
    obj.finish()
}

/// A gear: a ring of teeth with hard edges, inside and out.
pub fn gear(teeth: usize) -> String {
    let mut obj = Obj::default();
    let steps = teeth * 4;
    obj.grid([steps, 4], [true, true], |u, v| {
        let step = (u * steps as f64).round() as usize;
        let outer = if step % 4 < 2 { 1.0 } else { 0.78 };
        let (radius, z) = [(0.4, -0.15), (outer, -0.15), (outer, 0.15), (0.4, 0.15)][(v * 4.0).round() as usize % 4];
        let a = (step as f64 + if step.is_multiple_of(2) { 0.15 } else { -0.15 }) / steps as f64 * TAU;
        [radius * a.cos(), radius * a.sin(), z]
    });
    obj.finish()
}

/// A small generator with a fixed sequence (Steele and Vigna's SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in `from..to`.
    pub fn range(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// What makes lines hard: an open sheet, an edge of three faces, faces that touch, seams with
/// T-junctions, silhouettes, tips that come out of a face.
pub fn hard_for_lines() -> [(&'static str, String); 8] {
    let mut ball = Obj::default();
    ball.ball([0.0; 3], 1.0, 40);
    [
        ("sheet", sheet(30)),
        ("fin", FIN.to_owned()),
        ("boxes on a floor", boxes_on_a_floor()),
        ("stacked boxes", stacked_boxes()),
        ("room", room_with_t_junctions()),
        ("gear", gear(12)),
        ("ball", ball.finish()),
        ("bumps", bumps(false)),
    ]
}

/// A wall of large faces, and flat pyramids behind it whose tips come out of it, most of them without a sample. All sides
/// of a pyramid face the viewer, or turn away, so that none of its visible edges is a rim.
pub fn bumps(turn_away: bool) -> String {
    let mut shape = Obj::default();
    shape.cuboid([-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]);
    for i in 0..16 {
        let n = f64::from(i);
        let [x, y] = [0.48 * f64::from(i % 4) - 0.723, 0.48 * f64::from(i / 4) - 0.717];
        let around = |k: u32| (25.0 * n + 120.0 * f64::from(k)).to_radians().sin_cos();
        let base = [0, 1, 2].map(around).map(|(sin, cos)| shape.vertex([x + 0.23 * cos, y + 0.23 * sin, -0.03]));
        let tip = shape.vertex([x, y, 0.0005 + 0.0001 * n]);
        for k in 0..3 {
            let [a, b] = if turn_away { [(k + 1) % 3, k] } else { [k, (k + 1) % 3] };
            shape.face(&[base[a], base[b], tip]);
        }
    }
    shape.finish()
}
