//! Tests of the oracle's FLIP, against results of its authors' program, and of its rims (the true
//! outlines of silhouettes), against areas in closed form.

use crate::oracle::camera::Camera;
use crate::oracle::flip::Seen;
use crate::oracle::lines::silhouette::{ink, rims};
use crate::oracle::screen::{Scene, Screen, Sides};
use crate::oracle::surface::srgb;
use crate::oracle::vector::V3;

const WIDTH: i32 = 48;
const HEIGHT: i32 = 40;

/// A colour channel of a pixel, 0 to 255.
type Pattern = fn(i32, i32, i32) -> i32;

fn black(_: i32, _: i32, _: i32) -> i32 {
    0
}

fn white(_: i32, _: i32, _: i32) -> i32 {
    255
}

fn noise(x: i32, y: i32, c: i32) -> i32 {
    (x * 37 + y * 11 + c * 53 + (x * y) % 17 * 9) % 256
}

fn smooth(x: i32, y: i32, c: i32) -> i32 {
    (x * 5 + y * 2 * c) % 256
}

fn lines(x: i32, y: i32, _: i32) -> i32 {
    if (3 * x + 7 * y) % 60 < 12 { 0 } else { 255 }
}

fn moved_lines(x: i32, y: i32, _: i32) -> i32 {
    if (3 * x + 7 * y + 3) % 60 < 12 { 0 } else { 255 }
}

fn squares(x: i32, y: i32, c: i32) -> i32 {
    [[40, 90, 200], [200, 90, 40]][((x / 8 + y / 8) % 2) as usize][c as usize]
}

fn seen(pattern: impl Fn(i32, i32, i32) -> i32) -> Seen {
    let pixel =
        |i: i32| -> V3 { [0, 1, 2].map(|c| srgb::to_linear(f64::from(pattern(i % WIDTH, i / WIDTH, c)) / 255.0)) };
    Seen::new(WIDTH as usize, &(0..WIDTH * HEIGHT).map(pixel).collect::<Vec<_>>())
}

/// Results of version 1.7 of the authors' own program, `flip-evaluator`, at 67 pixels per degree;
/// it computes in f32.
#[test]
fn flip_is_what_its_authors_program_says() {
    let known: [(&str, Pattern, Pattern, f64); 8] = [
        ("black, white", black, white, 0.967_400_8),
        ("two greys", |_, _, _| 100, |_, _, _| 120, 0.247_924_7),
        ("noise, ramps", noise, smooth, 0.779_257_7),
        ("lines, moved", lines, moved_lines, 0.167_741_8),
        ("squares, noise", squares, noise, 0.755_093_6),
        ("squares, ramps", squares, smooth, 0.804_463_5),
        ("green, blue", |_, _, c| 255 * i32::from(c == 1), |_, _, c| 255 * i32::from(c == 2), 1.0),
        ("the same", squares, squares, 0.0),
    ];
    let mut compared = 0;
    for (what, a, b, want) in known {
        let (a, b) = (seen(a), seen(b));
        let got = a.difference(&b);
        println!("{what:<16} {got:.6}, known {want:.6}");
        assert!((got - want).abs() < 5e-4, "{what}: {got}, not {want}");
        assert_eq!(got, b.difference(&a), "{what}: not symmetric");
        compared += 1;
    }
    assert_eq!(compared, 8);
}

#[test]
fn flip_grows_with_contrast() {
    let grey = seen(|_, _, _| 128);
    let mut last = 0.0;
    let mut steps = 0;
    for contrast in [0, 1, 2, 4, 8, 16, 32, 64, 127] {
        let squares = seen(|x, y, _| 128 + if (x / 6 + y / 6) % 2 == 0 { contrast } else { -contrast });
        let difference = grey.difference(&squares);
        assert!(difference > last || contrast == 0 && difference == 0.0, "{contrast}: {difference}, before {last}");
        last = difference;
        steps += 1;
    }
    assert_eq!(steps, 9);
    assert!(last > 0.5 && last <= 1.0, "{last}");
}

/// The rim of a square is what Steiner's formula says of a strip around a convex shape, and nothing
/// where another surface is; before what is near it is as narrow as it recedes.
#[test]
fn rims_lie_beyond_the_silhouette_and_recede_behind_what_is_near() {
    let square = |at: [f64; 2], side: f64, z: f64| {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| [at[0] + u * side, at[1] + v * side, z])
    };
    let scene = |squares: &[[V3; 4]]| Scene {
        // A unit is a pixel, and a hundredth of depth.
        camera: Camera { z: [0.0, 0.0, 0.01, 0.5], ..Camera::of_pixels([64, 64]) },
        positions: squares.concat(),
        triangles: (0..squares.len() as u32)
            .flat_map(|i| [[0, 2, 1], [0, 3, 2]].map(|t| t.map(|v| 4 * i + v)))
            .collect(),
        sides: Sides::Both,
        edges: Vec::new(),
    };
    let total = |scene: &Scene| ink(&Screen::new(scene), &rims(scene, 4.0), 4.0, 16).iter().sum::<f64>();
    let assert_near = |found: f64, whole: f64| assert!((found - whole).abs() < 0.004 * whole, "{found}, not {whole}");
    // Alone: a strip along each side, and a quarter of a disc at each corner.
    let alone = square([20.3, 18.6], 20.0, 0.0);
    let around = |width: f64| 4.0 * 20.0 * width + std::f64::consts::PI * width * width;
    assert_near(total(&scene(&[alone])), around(4.0));
    // Before a large one, whose own rim is out of sight: all of it, or as much as is not yet behind
    // it. Behind a large one: nothing.
    let wall = |z: f64| square([-40.0, -40.0], 200.0, z);
    assert_near(total(&scene(&[alone, wall(-30.0)])), around(4.0));
    assert_near(total(&scene(&[alone, wall(-1.0)])), around(2.0));
    assert_eq!(total(&scene(&[alone, wall(30.0)])), 0.0);
    // One that rises to the right is followed beyond its left side, down to 4.2 units behind: half
    // of that strip is behind the wall.
    let rises = alone.map(|[x, y, _]| [x, y, x - 20.3]);
    assert_near(total(&scene(&[rises, wall(-30.0)])), around(4.0));
    assert_near(total(&scene(&[rises, wall(-2.1)])), around(4.0) - 20.0 * 2.0);
}
