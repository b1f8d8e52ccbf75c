//! Shapes for outlines: corners, teeth, notches, smooth and concave parts, and open borders.

use crate::oracle::vector::V2;
use crate::support::shapes::{self, Obj};

/// A mesh, and where it is seen from.
pub struct Shape {
    pub name: &'static str,
    pub obj: fn() -> String,
    pub eye: &'static str,
}

const fn shape(name: &'static str, obj: fn() -> String, eye: &'static str) -> Shape {
    Shape { name, obj, eye }
}

/// All of them.
pub const SHAPES: [Shape; 8] = [
    shape("cube", shapes::cube, "5.3,4.1,6.1"),
    shape("gear", || shapes::gear(9), "3.1,2.2,8.2"),
    shape("L", || prism(&ELL), "3,4,7.5"),
    shape("star", star, "2.5,1.5,8.5"),
    shape("torus", || shapes::torus(24), "4,6,5"),
    shape("blob", blob, "4,3,6"),
    shape("fin", || shapes::FIN.into(), "3.5,4.5,7"),
    shape("sheet", || shapes::sheet(12), "4,5,6"),
];

const ELL: [V2; 6] = [[-1.2, -1.2], [1.2, -1.2], [1.2, -0.4], [-0.3, -0.4], [-0.3, 1.2], [-1.2, 1.2]];

fn star() -> String {
    let corner = |i: u32| {
        let (radius, a) = (if i.is_multiple_of(2) { 1.4 } else { 0.55 }, f64::from(i) / 10.0 * std::f64::consts::TAU);
        [-radius * a.sin(), radius * a.cos()]
    };
    prism(&(0..10).map(corner).collect::<Vec<_>>())
}

/// A closed surface with horns and hollows.
fn blob() -> String {
    let (mut obj, n) = (Obj::default(), 28);
    let at = |i: usize, j: usize| {
        let (a, b) = (i as f64 / n as f64 * std::f64::consts::TAU, j as f64 / n as f64 * std::f64::consts::PI);
        let radius = 1.0 + 0.45 * (3.0 * a).sin() * b.sin() + 0.3 * (4.0 * b).cos() * (2.0 * a).cos() * b.sin();
        [radius * b.sin() * a.cos(), radius * b.cos(), -radius * b.sin() * a.sin()]
    };
    let poles = [obj.vertex(at(0, 0)), obj.vertex(at(0, n))];
    let rings: Vec<Vec<usize>> = (1..n).map(|j| (0..n).map(|i| obj.vertex(at(i, j))).collect()).collect();
    for i in 0..n {
        let next = (i + 1) % n;
        obj.face(&[poles[0], rings[0][i], rings[0][next]]);
        obj.face(&[poles[1], rings[n - 2][next], rings[n - 2][i]]);
        rings.windows(2).for_each(|pair| obj.face(&[pair[0][i], pair[1][i], pair[1][next], pair[0][next]]));
    }
    obj.finish()
}

/// A polygon, counter-clockwise, between two planes.
fn prism(polygon: &[V2]) -> String {
    let mut obj = Obj::default();
    let n = polygon.len();
    for z in [-0.4, 0.4] {
        polygon.iter().for_each(|p| _ = obj.vertex([p[0], p[1], z]));
    }
    obj.face(&(1..=n).rev().collect::<Vec<_>>());
    obj.face(&(n + 1..=2 * n).collect::<Vec<_>>());
    for i in 0..n {
        let next = (i + 1) % n;
        obj.face(&[i + 1, next + 1, n + next + 1, n + i + 1]);
    }
    obj.finish()
}
