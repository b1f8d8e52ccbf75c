//! Measures what a viewer sees at once: wires that hide the surface of a small picture, surfaces
//! bleached by light, and forms that are hard to tell. Each real mesh is drawn in the default
//! style, and with wires at 128 px.
//!
//! `cargo test --test suite -- first_sight outlines_specks --nocapture` prints the figures of each
//! mesh. Local contrast is the RMS of luminance minus its mean over 9 x 9 pixels: how clearly a
//! picture shows small forms.

#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::render::models::readable;
use crate::support::{data, scenes};

/// Bytes below which a pixel is dark.
const DARK: u8 = 32;

/// Bytes from which a pixel is bleached.
const BLEACHED: u8 = 250;

/// Share of a mesh's pixels that may be dark under wires at 128 px.
const DARK_MAX: f64 = 0.25;

/// Share of a mesh's pixels that may be bleached at 512 px.
const BLEACHED_MAX: f64 = 0.02;

/// Alpha of a pixel that shows nothing but the mesh. Other programs round it down.
const WHOLE: u8 = 254;

/// Pixels beside one whose mean it is compared to.
const REACH: usize = 4;

/// Meshes that are bleached because they shine by themselves or are without light.
const BRIGHT: [&str; 0] = [];

#[test]
fn first_sight_of_the_models_of_the_repository() {
    let meshes = readable(&data::folder("models"));
    assert!(meshes.len() >= 16, "{}", meshes.len());
    look_at(&meshes);
}

#[test]
fn first_sight_of_large_models() {
    let Some(folder) = data::large_folder("models") else { return };
    let meshes = readable(&folder);
    assert!(meshes.len() >= 36, "only {} models are read", meshes.len());
    look_at(&meshes);
}

#[test]
fn first_sight_tells_dark_from_bright() {
    let mesh = scenes::mesh(&crate::support::shapes::torus(48));
    let black = figures(&mesh, &[("style", "unlit"), ("surface.color", "000"), ("size", "64")]);
    let white = figures(&mesh, &[("style", "unlit"), ("surface.color", "fff"), ("size", "64")]);
    assert_eq!((black.dark, black.bleached), (1.0, 0.0));
    assert_eq!((white.dark, white.bleached), (0.0, 1.0));
    let wires = figures(&mesh, &[("style", "wire"), ("wire.thickness", "3"), ("size", "256")]);
    assert!(wires.dark > DARK_MAX && wires.contrast > 20.0 && white.contrast < 1e-9, "{wires:?}");
}

/// Local contrast of the default picture, as a share of that of Blender's Workbench (studio light, cavity) from the
/// same side and of the same size.
const CLARITY_MIN: f64 = 0.9;

#[test]
fn first_sight_is_as_clear_as_that_of_workbench() {
    let folders = (data::large_folder("models"), data::large_folder("references"));
    let (Some(models), Some(references)) = folders else { return };
    let mut missed = Vec::new();
    for name in ["fandisk.obj", "stanford-bunny.obj", "featuretype.STL"] {
        let mesh = scenes::mesh_of(&std::fs::read(models.join(name)).unwrap()).unwrap();
        let stem = name.split('.').next().unwrap();
        let reference = image::open(references.join(format!("workbench-{stem}.png"))).unwrap().into_rgba8();
        let reference =
            Image { width_px: reference.width(), height_px: reference.height(), rgba: reference.into_raw().into() };
        let own = of_height(&mesh, height_px(&reference));
        let share = contrast(&own) / contrast(&reference);
        println!("{name:<32} local contrast {:4.2}: {share:.2} of Workbench's", contrast(&own));
        if share < CLARITY_MIN {
            missed.push(format!("{name}: {share:.3}"));
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// The default picture of a mesh, with the margin with which it is as high as asked.
fn of_height(mesh: &Mesh, wanted_px: usize) -> Image {
    let [mut low, mut high] = [0.0, 0.4];
    let mut picture = None;
    for _ in 0..8 {
        let margin = 0.5 * (low + high);
        let keys = [("size", "512"), ("background", "transparent"), ("camera.margin", &margin.to_string())];
        let drawn = CpuRenderer::new(2).draw(&scenes::plan(mesh, &scenes::spec(&keys)), &Deadline::default()).unwrap();
        if height_px(&drawn) > wanted_px {
            low = margin
        } else {
            high = margin
        }
        picture = Some(drawn);
    }
    picture.unwrap()
}

/// Rows from the first to the last that shows the mesh.
fn height_px(picture: &Image) -> usize {
    let rows = || picture.rgba.chunks_exact(4 * picture.width_px as usize);
    let shows = |row: &[u8]| row.chunks_exact(4).any(|pixel| pixel[3] > 127);
    let (first, last) = (rows().position(shows), rows().rposition(shows));
    first.zip(last).map_or(0, |(first, last)| last - first + 1)
}

/// Prints the figures of all meshes, and compares them to the goals.
fn look_at(meshes: &[(String, Mesh)]) {
    let mut missed = Vec::new();
    for (name, mesh) in meshes {
        let wires = figures(mesh, &[("style", "wire"), ("size", "128")]);
        let plain = figures(mesh, &[("size", "512")]);
        println!(
            "{name:<32} wire 128 px: {:4.1} % dark; auto 512 px: {:4.2} % bleached, local contrast {:4.1}",
            100.0 * wires.dark,
            100.0 * plain.bleached,
            plain.contrast
        );
        let may_be_bright = BRIGHT.contains(&name.as_str());
        if wires.dark > DARK_MAX || (plain.bleached > BLEACHED_MAX && !may_be_bright) {
            missed.push(format!("{name}: {wires:?} {plain:?}"));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Figures of a picture, of the pixels that show nothing but the mesh.
#[derive(Debug)]
struct Figures {
    /// Share of dark pixels.
    dark: f64,
    /// Share of bleached pixels.
    bleached: f64,
    /// RMS of luminance minus its local mean, bytes.
    contrast: f64,
}

fn figures(mesh: &Mesh, keys: &[(&str, &str)]) -> Figures {
    let spec = scenes::spec(&[keys, &[("background", "transparent")]].concat());
    let picture = CpuRenderer::new(2).draw(&scenes::plan(mesh, &spec), &Deadline::default()).unwrap();
    let whole: Vec<&[u8]> = picture.rgba.chunks_exact(4).filter(|pixel| pixel[3] == 255).collect();
    let count = whole.len().max(1) as f64;
    let share = |is: &dyn Fn(&[u8]) -> bool| whole.iter().filter(|pixel| is(pixel)).count() as f64 / count;
    Figures {
        dark: share(&|pixel| pixel[..3].iter().all(|v| *v < DARK)),
        bleached: share(&|pixel| pixel[..3].iter().all(|v| *v >= BLEACHED)),
        contrast: contrast(&picture),
    }
}

/// The RMS over pixels around which all others belong to the mesh, too.
fn contrast(picture: &Image) -> f64 {
    let [width, height] = [picture.width_px as usize, picture.height_px as usize];
    let pixel = |x: usize, y: usize| &picture.rgba[4 * (y * width + x)..][..4];
    let luminance =
        |pixel: &[u8]| 0.2126 * f64::from(pixel[0]) + 0.7152 * f64::from(pixel[1]) + 0.0722 * f64::from(pixel[2]);
    let (mut squares, mut count) = (0.0, 0);
    for y in REACH..height.saturating_sub(REACH) {
        for x in REACH..width.saturating_sub(REACH) {
            let around = || (y - REACH..=y + REACH).flat_map(|y| (x - REACH..=x + REACH).map(move |x| (x, y)));
            if around().any(|(x, y)| pixel(x, y)[3] < WHOLE) {
                continue;
            }
            let sum: f64 = around().map(|(x, y)| luminance(pixel(x, y))).sum();
            let mean = sum / ((2 * REACH + 1) * (2 * REACH + 1)) as f64;
            squares += (luminance(pixel(x, y)) - mean).powi(2);
            count += 1;
        }
    }
    (squares / f64::from(count.max(1))).sqrt()
}
