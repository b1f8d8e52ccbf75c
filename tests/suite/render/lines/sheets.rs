//! Walls that stand on a floor of one sheet: their feet lie in its plane, are visible from above, and are
//! hidden from below.

use std::fmt::Write as _;

use meshsnap::backend::Renderer as _;
use meshsnap::backend::cpu::CpuRenderer;
use meshsnap::backend::gpu::GpuRenderer;
use meshsnap::image::Image;
use meshsnap::limits::Deadline;
use meshsnap::spec::Spec;

use crate::support::gpus::gpus;
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
}

/// A floor of 16 squares and something on it, turned about two axes.
fn obj(standing: Standing, turn: f64) -> String {
    let mut obj = String::new();
    let (sin, cos) = turn.sin_cos();
    let mut vertex = |x: f64, y: f64, z: f64| {
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        let (y, z) = (cos * y - sin * z, sin * y + cos * z);
        writeln!(obj, "v {x:.7} {y:.7} {z:.7}").unwrap();
    };
    for i in 0..25 {
        vertex(f64::from(i % 5) - 2.0, 0.0, f64::from(i / 5) - 2.0);
    }
    for height in [0.0, 1.0] {
        for [x, z] in [[-0.9, -0.7], [0.8, -0.6], [0.7, 0.9], [-0.6, 0.8]] {
            vertex(x, height, z);
        }
    }
    let squares = (0..16).map(|i| i / 4 * 5 + i % 4 + 1).map(|v| [v, v + 1, v + 6, v + 5]);
    let walls = (0..4).map(|k| [26 + k, 26 + (k + 1) % 4, 30 + (k + 1) % 4, 30 + k]);
    let ends = [[26, 27, 28, 29], [30, 31, 32, 33]];
    let mut faces: Vec<[u32; 4]> = squares.collect();
    match standing {
        Standing::Nothing => {}
        Standing::Walls => faces.extend(walls),
        Standing::Box => faces.extend(walls.chain(ends)),
    }
    for [a, b, c, d] in faces {
        writeln!(obj, "f {a} {b} {c} {d}").unwrap();
    }
    obj
}

/// A picture on the CPU, and on each GPU with the same result.
fn draw(standing: Standing, turn: f64, spec: &Spec) -> Option<Image> {
    let mesh = scenes::mesh(&obj(standing, turn));
    let plan = scenes::plan(&mesh, spec);
    let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
    for gpu in gpus()? {
        let gpu = GpuRenderer::new(gpu.clone()).draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{standing:?} {turn}"));
    }
    Some(cpu)
}

/// Pixels that differ by more than a sample's share of another face: a sample may lie just where wall and floor meet.
fn differing(a: &Image, b: &Image) -> usize {
    let is_far = |(a, b): (&[u8], &[u8])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 8);
    a.rgba.chunks(4).zip(b.rgba.chunks(4)).filter(|&pair| is_far(pair)).count()
}

/// A camera above the floor or below it, which is turned with it.
fn spec(keys: &[(&str, &str)], [x, y, z]: [f64; 3], turn: f64, projection: &str) -> Spec {
    let (sin, cos) = turn.sin_cos();
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let (y, z) = (cos * y - sin * z, sin * y + cos * z);
    let eye = format!("{x},{y},{z}");
    let camera = [
        ("size", "150x120"),
        ("camera.eye", eye.as_str()),
        ("camera.target", "0,0,0"),
        ("camera.projection", projection),
    ];
    scenes::spec(&[keys, &camera].concat())
}

const LOOKS: &[&[(&str, &str)]] = &[
    &[("style", "wire"), ("wire.edges", "feature"), ("wire.thickness", "1.5")],
    &[("style", "hidden-line"), ("wire.min_length", "0")],
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
        for turn in [0.0, 0.4, 1.1] {
            for projection in ["perspective", "orthographic"] {
                for side in [[1.3, 5.0, 3.0], [2.0, 4.0, -2.5]] {
                    let [x, y, z] = side;
                    let [above, below] = [[x, y, z], [x, -y, z]].map(|eye| spec(keys, eye, turn, projection));
                    let name = format!("{keys:?} {turn} {projection} {side:?}");
                    let Some(floor) = draw(Standing::Nothing, turn, &below) else { return };
                    let with = |standing, spec| draw(standing, turn, spec).unwrap();
                    assert_eq!(differing(&floor, &with(Standing::Walls, &below)), 0, "{name}: the walls can be seen");
                    let bottom = differing(&floor, &with(Standing::Box, &below));
                    assert!(bottom > 100, "{name}: {bottom} pixels show the bottom");
                    let walls = differing(&with(Standing::Nothing, &above), &with(Standing::Walls, &above));
                    assert!(walls > 500, "{name}: {walls} pixels show the walls");
                    cases += 1;
                }
            }
        }
    }
    assert_eq!(cases, LOOKS.len() * 3 * 2 * 2);
}
