//! Lines of walls that stand on a floor without thickness: their feet lie in its plane, are visible from above,
//! and are hidden from below.

use std::fmt::Write as _;

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::spec::Spec;

use crate::support::gpus::gpus_of_case;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;

/// What stands on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Standing {
    Nothing,
    /// Four walls: all faces at the foot are above the floor.
    Walls,
    /// A box with a bottom, which lies in the floor's plane and may be seen as well as the floor.
    Box,
    /// Walls above and below, and the floor between them: their edges have three faces.
    Through,
    /// The same, those below first.
    ThroughTurnedOver,
}

/// A floor, and where it is.
#[derive(Clone, Copy, Debug)]
struct Floor {
    /// Squares per side.
    squares: u32,
    /// Added to all coordinates.
    offset: f64,
    /// Turn about two axes, radians.
    turn: f64,
}

impl Floor {
    /// A point of the floor's own axes, y up from it, in the mesh's.
    fn place(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.turn.sin_cos();
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        [x, cos * y - sin * z, sin * y + cos * z].map(|v| v + self.offset)
    }

    /// The floor and something on it.
    fn obj(self, standing: Standing) -> String {
        let n = self.squares;
        let places = (0..=n).flat_map(|row| (0..=n).map(move |column| [column, row]));
        let at = |v: u32| f64::from(v) * 4.0 / f64::from(n) - 2.0;
        let mut points: Vec<[f64; 3]> = places.map(|[x, z]| [at(x), 0.0, at(z)]).collect();
        let foot = points.len() as u32 + 1;
        for height in [0.0, 1.0, -0.4] {
            points.extend([[-0.9, -0.7], [0.8, -0.6], [0.7, 0.9], [-0.6, 0.8]].map(|[x, z]| [x, height, z]));
        }
        let squares = (0..n * n).map(|i| i / n * (n + 1) + i % n + 1).map(|v| [v, v + 1, v + n + 2, v + n + 1]);
        let walls = |to: u32| (0..4).map(move |k| [k, (k + 1) % 4, to + (k + 1) % 4, to + k].map(|v| foot + v));
        let bottom = [0, 1, 2, 3].map(|v| foot + v);
        let top = bottom.map(|v| v + 4);
        let mut faces: Vec<[u32; 4]> = squares.collect();
        match standing {
            Standing::Nothing => {}
            Standing::Walls => faces.extend(walls(4)),
            Standing::Box => faces.extend(walls(4).chain([bottom, top])),
            Standing::Through => faces.extend(walls(4).chain([bottom]).chain(walls(8))),
            Standing::ThroughTurnedOver => faces.extend(walls(8).chain([bottom]).chain(walls(4))),
        }
        let mut obj = String::new();
        for [x, y, z] in points.into_iter().map(|point| self.place(point)) {
            writeln!(obj, "v {x:.7} {y:.7} {z:.7}").unwrap();
        }
        for [a, b, c, d] in faces {
            writeln!(obj, "f {a} {b} {c} {d}").unwrap();
        }
        obj
    }
}

/// A picture on the CPU, and on the GPUs of a case with the same result.
fn draw(obj: &str, spec: &Spec, case: usize) -> Image {
    let mesh = scenes::mesh(obj);
    let plan = scenes::plan(&mesh, spec);
    let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
    for gpu in gpus_of_case(case) {
        let gpu = GpuRenderer::new(gpu.clone()).draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, "a sheet");
    }
    cpu
}

/// Pixels that differ by more than a sample's share of another face: a sample may lie just where wall and floor meet.
fn differing(a: &Image, b: &Image) -> usize {
    let is_far = |(a, b): (&[u8], &[u8])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 8);
    a.rgba.chunks(4).zip(b.rgba.chunks(4)).filter(|&pair| is_far(pair)).count()
}

/// A camera above the floor or below it.
fn spec(keys: &[(&str, &str)], floor: Floor, eye: [f64; 3], projection: &str) -> Spec {
    let text = |point: [f64; 3]| {
        let [x, y, z] = floor.place(point);
        format!("{x},{y},{z}")
    };
    let (eye, target) = (text(eye), text([0.0; 3]));
    let camera = [
        ("size", "150x120"),
        ("camera.eye", eye.as_str()),
        ("camera.target", target.as_str()),
        ("camera.projection", projection),
    ];
    scenes::spec(&[keys, &camera].concat())
}

/// At the origin, where coordinates are exact, and away from it, where those of a turned floor's squares are rounded.
const FLOORS: [Floor; 4] = [
    Floor { squares: 4, offset: 0.0, turn: 0.0 },
    Floor { squares: 4, offset: 0.0, turn: 0.4 },
    Floor { squares: 40, offset: 0.0, turn: 1.1 },
    Floor { squares: 20, offset: 50.0, turn: 0.7 },
];

const LOOKS: &[&[(&str, &str)]] = &[
    &[("style", "wire"), ("wire.edges", "feature"), ("wire.thickness", "1.5")],
    &[
        ("style", "outline"),
        ("outline.method", "contour"),
        ("outline.thickness", "2"),
        ("outline.unit", "px"),
        ("samples", "16"),
    ],
];

#[test]
fn feet_are_hidden_by_the_sheet_that_they_stand_on() {
    let mut cases = 0;
    for keys in LOOKS {
        for floor in FLOORS {
            // From the last place, a corner of the floor is behind the eye.
            for (projection, [x, y, z]) in [
                ("perspective", [1.3, 5.0, 3.0]),
                ("perspective", [2.0, 4.0, -2.5]),
                ("orthographic", [2.0, 4.0, -2.5]),
                ("orthographic", [0.0, 5.0, 0.01]),
                ("perspective", [1.7, 0.6, 1.8]),
            ] {
                let [above, below] = [y, -y].map(|y| spec(keys, floor, [x, y, z], projection));
                let with = |standing, spec| draw(&floor.obj(standing), spec, cases);
                let differing = |spec, a, b| differing(&with(a, spec), &with(b, spec));
                let name = format!("{keys:?} {floor:?} {projection} {x},{y},{z}");
                let walls = differing(&below, Standing::Nothing, Standing::Walls);
                let bottom = differing(&below, Standing::Nothing, Standing::Box);
                let seen = differing(&above, Standing::Nothing, Standing::Walls);
                // Where many triangles meet, an edge may be inside of none of them by the margin.
                assert!(walls < 6, "{name}: {walls} pixels show the walls from below");
                assert!(bottom > 80, "{name}: {bottom} pixels show the bottom from below");
                assert!(seen > 200, "{name}: {seen} pixels show the walls from above");
                cases += 1;
            }
        }
    }
    assert_eq!(cases, LOOKS.len() * FLOORS.len() * 5);
}

/// Edges that have more than two faces name only some of them, those that come first.
#[test]
fn the_order_of_faces_does_not_hide_a_foot() {
    let mut cases = 0;
    for (number, keys) in LOOKS.iter().enumerate() {
        let spec = spec(keys, FLOORS[1], [1.3, -3.0, -5.0], "perspective");
        let draw = |standing| draw(&FLOORS[1].obj(standing), &spec, number);
        let (one, other) = (draw(Standing::Through), draw(Standing::ThroughTurnedOver));
        assert_eq!(differing(&one, &other), 0, "{keys:?}");
        let without = differing(&one, &draw(Standing::Walls));
        assert!(without > 500, "{keys:?}: {without} pixels show what is below the floor");
        cases += 1;
    }
    assert_eq!(cases, LOOKS.len());
}

#[test]
fn what_is_painted_on_a_sheet_is_seen_from_both_sides() {
    let floor = FLOORS[0];
    let points = [[-0.9, 0.0, -0.7], [0.8, 0.0, 0.6], [0.3, 0.0, -0.6]].map(|point| floor.place(point));
    let mut obj = floor.obj(Standing::Nothing);
    points.iter().for_each(|[x, y, z]| writeln!(obj, "v {x} {y} {z}").unwrap());
    let painted = format!("{obj}usemtl paint\nl -3 -2\np -1\n");
    let keys = [("style", "wire"), ("materials.paint.surface", "null"), ("wire.thickness", "3")];
    let mut cases = 0;
    for eye in [[2.0, 3.0, 4.0], [2.0, -3.0, 4.0]] {
        let spec = spec(&keys, floor, eye, "perspective");
        let seen = differing(&draw(&painted, &spec, cases), &draw(&obj, &spec, cases));
        assert!(seen > 80, "{eye:?}: {seen} pixels show the line and the point");
        cases += 1;
    }
    assert_eq!(cases, 2);
}
