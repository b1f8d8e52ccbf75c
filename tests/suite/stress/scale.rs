//! Scaled models. A scale of 2^k changes no byte, and another one hardly a pixel. No style depends
//! on the unit or the axes of a file.

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::oracle::obj::Shape;
use crate::oracle::vector::V3;
use crate::support::families::moved::{LOOKS, MESHES, differing, draw, is_blank, shape};
use crate::support::scenes;
use crate::support::truth::{cases, renderers};

/// Share of pixels, where the scale is no power of two.
const DIFFERING_MAX: f64 = 1e-4;
/// The same of one picture: a vertex that lies between two multiples of 1/256 px may be snapped to
/// the other one, and then every line that it ends moves by that, which is one step of a byte.
const DIFFERING_IN_ONE_MAX: f64 = 1e-3;

fn scaled(obj: &str, factor: f64) -> Mesh {
    scenes::mesh(&shape(obj).map(|v| v.map(|c| c * factor)).text())
}

#[test]
fn powers_of_two_give_the_same_mesh() {
    let mut compared = 0;
    for (name, obj) in MESHES {
        let obj = obj();
        let want = scaled(&obj, 1.0);
        for k in -100..=100 {
            let factor = f64::powi(2.0, k);
            let got = scaled(&obj, factor);
            assert!(got.positions == want.positions && got.face_normals == want.face_normals, "{name} times 2^{k}");
            assert!(got.triangles == want.triangles && got.bounds == want.bounds, "{name} times 2^{k}");
            assert_eq!(got.to_file.scale, want.to_file.scale * factor, "{name} times 2^{k}");
            compared += 1;
        }
    }
    assert_eq!(compared, 5 * 201);
}

#[test]
fn powers_of_two_give_the_same_bytes() {
    let exponents: Vec<i32> =
        cases(vec![-100, 100], (-100..=100).filter(|k: &i32| k % 10 == 0 || k.abs() < 4).collect());
    let mut compared = 0;
    let mut renderers = renderers();
    for (name, obj) in MESHES {
        let obj = obj();
        let original = scaled(&obj, 1.0);
        let copies: Vec<Mesh> = exponents.iter().map(|&k| scaled(&obj, f64::powi(2.0, k))).collect();
        for (look, keys) in LOOKS {
            for renderer in &mut renderers {
                let want = draw(&original, keys, "96x80", renderer.as_mut());
                assert!(!is_blank(&want), "{name}, {look}");
                for (copy, k) in copies.iter().zip(&exponents) {
                    let got = draw(copy, keys, "96x80", renderer.as_mut());
                    let kind = renderer.kind().name();
                    assert!(want.rgba == got.rgba, "{name} times 2^{k}, {look}, {kind}: other bytes");
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, MESHES.len() * LOOKS.len() * renderers.len() * exponents.len());
}

#[test]
fn other_scales_differ_in_hardly_a_pixel() {
    let (mut compared, mut pixels, mut different) = (0, 0, 0);
    let mut missed = Vec::new();
    let mut renderer = CpuRenderer::new(2);
    for (name, obj) in MESHES {
        let obj = obj();
        let original = scaled(&obj, 1.0);
        for factor in [1e30, 1e-30] {
            let copy = scaled(&obj, factor);
            for (look, keys) in LOOKS {
                let want = draw(&original, keys, "512", &mut renderer);
                let count = differing(&want, &draw(&copy, keys, "512", &mut renderer));
                let share = count as f64 / want.rgba.len() as f64 * 4.0;
                println!(
                    "- {name} times {factor:e}, {look:<40} {count} pixels differ (gate {DIFFERING_IN_ONE_MAX} of them)"
                );
                if share > DIFFERING_IN_ONE_MAX {
                    missed.push(format!("{name} times {factor}, {look}: {count} pixels differ"));
                }
                pixels += want.rgba.len() / 4;
                different += count;
                compared += 1;
            }
        }
    }
    println!("- other scales: {different} of {pixels} pixels differ");
    assert_eq!(compared, MESHES.len() * 2 * LOOKS.len());
    assert!(different as f64 <= DIFFERING_MAX * pixels as f64, "{different} of {pixels} pixels differ");
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// All presets.
const STYLES: [&str; 12] = [
    "auto",
    "flat",
    "smooth",
    "unlit",
    "wire",
    "wireframe",
    "outline",
    "hidden-line",
    "topology",
    "technical",
    "clay",
    "xray",
];

/// A sheet of so many faces that the width of its lines is found by some of them. They grow from one corner on, so that a few
/// large ones have most of the area.
fn uneven() -> Shape {
    let along = |i: usize, n: f64| (i as f64 / n).powf(2.5);
    Shape::net([120, 60], |i, j| {
        let [u, v] = [along(i, 120.0), along(j, 60.0)];
        [2.0 * u - 1.0, 2.0 * v - 1.0, 0.3 * (5.0 * u).sin() * (4.0 * v).cos()]
    })
}

/// Pixels of which some channel differs by more than two steps.
fn differing_clearly(a: &Image, b: &Image) -> usize {
    let pixels = a.rgba.chunks(4).zip(b.rgba.chunks(4));
    pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2)).count()
}

#[test]
fn no_style_depends_on_the_unit_or_the_axes_of_a_file() {
    let original = scenes::mesh(&uneven().text());
    assert!(original.triangles.len() > 8192);
    // The same mesh with z up: seen from where the other one is seen from.
    let turned = uneven().map(|[x, y, z]: V3| [x, -z, y]).text();
    let mut copies = vec![("turned".to_owned(), scenes::mesh(&turned), "z")];
    for factor in [3.0, 0.1, 7e10, 1e30, 1e-30] {
        let scaled = uneven().map(|v| v.map(|c| c * factor)).text();
        copies.push((format!("times {factor:e}"), scenes::mesh(&scaled), "y"));
    }
    let mut renderer = CpuRenderer::new(2);
    let mut compared = 0;
    for style in STYLES {
        let mut draw = |mesh: &Mesh, up: &'static str| {
            let keys = [("style", style), ("camera.up", up), ("size", "384")];
            renderer.draw(&scenes::plan(mesh, &scenes::spec(&keys)), &Deadline::default()).unwrap()
        };
        let want = draw(&original, "y");
        let pixels = want.rgba.len() / 4;
        for (name, copy, up) in &copies {
            let count = differing_clearly(&want, &draw(copy, up));
            println!("- {style}, {name}: {count} of {pixels} pixels differ");
            assert!(
                count as f64 <= DIFFERING_MAX * pixels as f64,
                "{style}, {name}: {count} of {pixels} pixels differ"
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 12 * 6);
}
