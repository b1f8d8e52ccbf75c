//! Faces that are thinner than the distance between samples: adaptive samples draw their true
//! coverage, and fixed samples lose some of them.

use meshsnap_render::backend::Renderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::oracle::obj::Shape;
use crate::oracle::surface::srgb;
use crate::oracle::vector::V2;
use crate::support::scenes;
use crate::support::shapes::Random;
use crate::support::truth::{goal, renderers};

/// Pixels on a side of a picture, and of each of its cells, which show one hair each.
const SIZE_PX: usize = 240;
const CELL_PX: usize = 60;
const CELLS: usize = SIZE_PX / CELL_PX;

/// Goal: coverage that is drawn, as a share of the true one. Of all hairs of a picture.
const INK: [f64; 2] = [0.98, 1.02];
/// The same of each hair, whose coverage is stored in bytes and counted in 256 points.
const INK_OF_ONE: [f64; 2] = [0.94, 1.06];

/// Outlines of hairs around the origin, pixels.
type Kind = (&'static str, fn(&mut Random) -> Vec<V2>);

const KINDS: [Kind; 4] = [
    ("hairs of 1/8 px", |random| bar(random.range(25.0, 50.0), 0.125)),
    ("slivers of 1/16 px", |random| bar(random.range(25.0, 50.0), 1.0 / 16.0)),
    ("short hairs of 1/8 px", |random| bar(random.range(3.0, 5.0), 0.125)),
    ("needles", |random| vec![[-25.0, 0.0], [25.0, -0.12], [25.0, 0.12 * random.range(0.5, 1.0)]]),
];

fn bar(length: f64, width: f64) -> Vec<V2> {
    let [x, y] = [0.5 * length, 0.5 * width];
    vec![[-x, -y], [x, -y], [x, y], [-x, y]]
}

/// A hair in each cell, at any angle, some along pixels; and the area of each. Before a sheet, or before nothing.
fn hairs((_, outline): Kind, has_sheet: bool) -> (String, Vec<f64>) {
    let mut random = Random(5);
    let mut shape = Shape::default();
    let mut areas = Vec::new();
    for cell in 0..CELLS * CELLS {
        let middle = [cell % CELLS, cell / CELLS].map(|i| ((i as f64 + 0.5) - 0.5 * CELLS as f64) * CELL_PX as f64);
        let turn = if cell % 4 == 0 { 0.0 } else { random.range(0.0, std::f64::consts::TAU) };
        let shift = [0; 2].map(|_| random.range(-0.5, 0.5));
        let outline = outline(&mut random);
        let (sin, cos) = turn.sin_cos();
        let corners = outline.iter().map(|[x, y]| {
            shape.vertex([middle[0] + shift[0] + cos * x - sin * y, middle[1] + shift[1] + sin * x + cos * y, 0.5])
        });
        let corners: Vec<usize> = corners.collect();
        shape.polygons.push(corners);
        let next = outline.iter().cycle().skip(1);
        areas.push(0.5 * outline.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>());
    }
    if has_sheet {
        let half = SIZE_PX as f64;
        let corners =
            [[-half, -half], [half, -half], [half, half], [-half, half]].map(|[x, y]| shape.vertex([x, y, 0.0]));
        shape.polygons.push(corners.to_vec());
    }
    (shape.text(), areas)
}

/// The hairs have a material of their own.
fn painted(obj: &str) -> String {
    let faces = CELLS * CELLS;
    let mut seen = 0;
    let mut text = String::from("usemtl hair\n");
    for line in obj.lines() {
        if line.starts_with("f ") {
            if seen == faces {
                text += "usemtl sheet\n";
            }
            seen += 1;
        }
        text += line;
        text.push('\n');
    }
    text
}

fn spec_of(samples: &str, has_sheet: bool) -> meshsnap_render::spec::Spec {
    let size = SIZE_PX.to_string();
    let mut keys = vec![
        ("size", &size[..]),
        ("camera.projection", "orthographic"),
        ("camera.height", &size),
        ("camera.eye", "0,0,100"),
        ("camera.target", "0,0,0"),
        ("style", "unlit"),
        ("samples", samples),
        ("background", "transparent"),
        ("materials.hair.surface.color", "fff"),
    ];
    if has_sheet {
        keys.push(("materials.sheet.surface.color", "000"));
    }
    scenes::spec(&keys)
}

/// The coverage of each cell's hair as a share of the true one.
fn inks(image: &Image, areas: &[f64], has_sheet: bool) -> Vec<f64> {
    let mut drawn = [0.0; CELLS * CELLS];
    for (i, pixel) in image.rgba.chunks(4).enumerate() {
        let (x, y) = (i % SIZE_PX, i / SIZE_PX);
        // The first cells are at the bottom.
        let cell = (CELLS - 1 - y / CELL_PX) * CELLS + x / CELL_PX;
        let value = if has_sheet { pixel[0] } else { pixel[3] };
        let value = f64::from(value) / 255.0;
        drawn[cell] += if has_sheet { srgb::to_linear(value) } else { value };
    }
    drawn.iter().zip(areas).map(|(drawn, area)| drawn / area).collect()
}

fn is_within(ink: f64, [low, high]: [f64; 2]) -> bool {
    (low..=high).contains(&ink)
}

fn draw(renderer: &mut dyn Renderer, plan: &DrawPlan<'_>) -> Image {
    renderer.draw(plan, &Deadline::default()).unwrap()
}

#[test]
fn as_much_is_seen_of_hairs_as_there_is() {
    let mut renderers = renderers();
    let (mut missed, mut range) = (Vec::new(), [f64::INFINITY, 0.0_f64]);
    for (kind, has_sheet) in KINDS.iter().flat_map(|&kind| [(kind, false), (kind, true)]) {
        let (obj, areas) = hairs(kind, has_sheet);
        let mesh = scenes::mesh(&painted(&obj));
        let spec = spec_of("adaptive", has_sheet);
        let plan = scenes::plan(&mesh, &spec);
        assert!(plan.is_adaptive);
        let mut mixed = Vec::new();
        for renderer in &mut renderers {
            let inks = inks(&draw(renderer.as_mut(), &plan), &areas, has_sheet);
            mixed.push(renderer.draw_times().mixed_pixels);
            let mean = inks.iter().zip(&areas).map(|(ink, area)| ink * area).sum::<f64>() / areas.iter().sum::<f64>();
            let of_one = inks.iter().fold([f64::INFINITY, 0.0_f64], |[l, h], &ink| [l.min(ink), h.max(ink)]);
            let before = if has_sheet { "a sheet" } else { "nothing" };
            let what = format!("- {} before {before}, {}", kind.0, renderer.kind().name());
            println!("{what:<44} ink {mean:.4}, of one {:.3} to {:.3}", of_one[0], of_one[1]);
            if !is_within(mean, INK) || of_one.iter().any(|&ink| !is_within(ink, INK_OF_ONE)) {
                missed.push(what);
            }
            range = [range[0].min(mean), range[1].max(mean)];
        }
        assert!(mixed.iter().all(|&count| count == mixed[0] && count > 50), "{mixed:?}");
    }
    goal(12, &format!("ink {:.3} to {:.3} of hairs, slivers and needles", range[0], range[1]));
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Pictures that lose hairs do not get through.
#[test]
fn fixed_samples_lose_hairs() {
    let (obj, areas) = hairs(KINDS[0], false);
    let mesh = scenes::mesh(&painted(&obj));
    let mut renderers = renderers();
    for samples in ["4", "16"] {
        let spec = spec_of(samples, false);
        let inks = inks(&draw(renderers[0].as_mut(), &scenes::plan(&mesh, &spec)), &areas, false);
        let lost = inks.iter().filter(|&&ink| !is_within(ink, INK_OF_ONE)).count();
        println!("{samples} samples: {lost} of {} hairs are off", inks.len());
        assert!(lost > 2, "{samples}: {lost}");
    }
}
