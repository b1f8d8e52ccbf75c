//! Meshes that the benchmark makes itself, as OBJ text. Flat ones lie in the x-y plane, one unit
//! per pixel.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use crate::oracle::obj::Shape;
use crate::oracle::vector::{V3, unit};
use crate::support::shapes::Random;

/// Straight lines across the whole picture, no two of which are near each other in it: a zigzag
/// whose corners lie outside.
pub fn lines(size_px: u32) -> String {
    let reach = f64::from(size_px);
    let mut random = Random(3);
    let mut shape = Shape::default();
    let count = (size_px / 12) as usize;
    for i in 0..=count {
        let x = (i as f64 / count as f64 - 0.5) * 2.0 * reach + random.range(-3.0, 3.0);
        shape.vertex([x, if i % 2 == 0 { -reach } else { reach }, 0.0]);
    }
    // Front faces alike: every other triangle the other way round.
    shape.polygons =
        (2..=count).map(|i| if i % 2 == 0 { vec![i - 2, i, i - 1] } else { vec![i - 2, i - 1, i] }).collect();
    turned(shape, 17.0)
}

/// Squares of 12 px with both triangles' edges.
pub fn grid(size_px: u32) -> String {
    let n = (f64::from(size_px) * 0.7 / 12.0) as usize;
    let middle = n as f64 * 6.0;
    let net = Shape::net([n, n], |i, j| [i as f64 * 12.0 - middle, j as f64 * 12.0 - middle, 0.0]);
    turned(net.triangulated(), 17.0)
}

/// 48 triangles around a point.
pub fn fan(size_px: u32) -> String {
    let radius = 0.45 * f64::from(size_px);
    let mut shape = Shape::default();
    shape.vertex([0.3, 0.2, 0.0]);
    for i in 0..48 {
        let a = f64::from(i) / 48.0 * TAU + 0.02;
        shape.vertex([radius * a.cos(), radius * a.sin(), 0.0]);
    }
    shape.polygons = (0..48).map(|i| vec![0, 1 + i, 1 + (i + 1) % 48]).collect();
    shape.text()
}

/// Lines of quads as large as the strokes of small print: upright lines along the pixels, others
/// turned.
pub fn print(size_px: u32) -> String {
    let mut random = Random(8);
    let mut shape = Shape::default();
    let half = 0.46 * f64::from(size_px);
    let rows = (2.0 * half / 16.0) as usize;
    for row in 0..rows {
        let turn_deg = [0.0, 0.0, 30.0, -11.0][row % 4];
        let mut x = -half;
        while x < half - 8.0 {
            let (w, h) = (random.range(1.5, 6.0), random.range(3.0, 9.0));
            let center = [x + 0.5 * w, (row as f64 + 0.5) * 16.0 - half];
            let (sin, cos) = f64::to_radians(turn_deg).sin_cos();
            let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[u, v]| {
                let (u, v) = (u * w, v * h);
                shape.vertex([center[0] + u * cos - v * sin, center[1] + u * sin + v * cos, 0.0])
            });
            shape.polygons.push(corners.to_vec());
            x += w + random.range(2.0, 5.0);
        }
    }
    shape.text()
}

/// A ball of 20 * 4^cuts triangles: an icosahedron whose triangles are cut in four, again and
/// again.
pub fn icosphere(cuts: u32) -> String {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut shape = Shape::default();
    for k in 0..3 {
        for (s, t) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let mut p = [0.0; 3];
            (p[k], p[(k + 1) % 3]) = (s, t * golden);
            shape.vertex(unit(p));
        }
    }
    // Its faces: three vertices that are neighbours, counter-clockwise from outside.
    let near = |a: V3, b: V3| a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > 0.4;
    let v = shape.vertices.clone();
    for (a, b, c) in (0..12).flat_map(|a| (a + 1..12).flat_map(move |b| (b + 1..12).map(move |c| (a, b, c)))) {
        if near(v[a], v[b]) && near(v[b], v[c]) && near(v[c], v[a]) {
            let out = crate::oracle::vector::dot(v[a], crate::oracle::vector::cross(v[b], v[c])) > 0.0;
            shape.polygons.push(if out { vec![a, b, c] } else { vec![a, c, b] });
        }
    }
    (0..cuts).for_each(|_| cut_in_four(&mut shape));
    shape.text()
}

fn cut_in_four(shape: &mut Shape) {
    let mut middles: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    let mut polygons = Vec::with_capacity(4 * shape.polygons.len());
    for t in std::mem::take(&mut shape.polygons) {
        let mut middle = |a: usize, b: usize| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let (p, q) = (shape.vertices[a], shape.vertices[b]);
                shape.vertex(unit([p[0] + q[0], p[1] + q[1], p[2] + q[2]]))
            })
        };
        let (ab, bc, ca) = (middle(t[0], t[1]), middle(t[1], t[2]), middle(t[2], t[0]));
        polygons.extend([vec![t[0], ab, ca], vec![t[1], bc, ab], vec![t[2], ca, bc], vec![ab, bc, ca]]);
    }
    shape.polygons = polygons;
}

/// Rings in a chain and around each other: up to ten surfaces lie behind a pixel.
pub fn rings() -> String {
    let mut shape = Shape::default();
    for i in 0..7 {
        let (radius, tube) = ([1.0, 0.7, 1.3][i % 3], 0.16);
        let (turn, tilt) = (i as f64 * 0.9, i as f64 * 1.7);
        let center = [(i as f64 - 3.0) * 0.35, 0.25 * (i as f64 * 2.0).sin(), 0.0];
        ring(&mut shape, 48, |u, v| {
            let (a, b) = (u * TAU, v * TAU);
            let r = radius + tube * b.cos();
            let [x, y, z] = [r * a.cos(), tube * b.sin(), -r * a.sin()];
            let (y, z) = (y * tilt.cos() - z * tilt.sin(), y * tilt.sin() + z * tilt.cos());
            let (x, z) = (x * turn.cos() - z * turn.sin(), x * turn.sin() + z * turn.cos());
            [x + center[0], y + center[1], z + center[2]]
        });
    }
    shape.text()
}

fn ring(shape: &mut Shape, n: usize, at: impl Fn(f64, f64) -> V3) {
    let (first, m) = (shape.vertices.len(), n / 3);
    for i in 0..n {
        for j in 0..m {
            shape.vertex(at(i as f64 / n as f64, j as f64 / m as f64));
        }
    }
    let index = |i: usize, j: usize| first + (i % n) * m + j % m;
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        shape.polygons.push(vec![index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]);
    }
}

fn turned(shape: Shape, degrees: f64) -> String {
    let (sin, cos) = degrees.to_radians().sin_cos();
    shape.map(|[x, y, z]| [x * cos - y * sin, x * sin + y * cos, z]).text()
}
