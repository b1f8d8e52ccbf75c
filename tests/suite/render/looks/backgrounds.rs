//! Gradients behind the mesh: each row is to the byte that of a picture whose background has the row's
//! colour everywhere, under surfaces, lines, hulls and layers; and the back-ends agree.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::srgb8_thresholds;
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::DrawPlan;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes;

const HEIGHT_PX: u32 = 70;

/// Every way to the bytes: flat colours, smooth surfaces, lines over them and alone, hulls, layers, and
/// nothing at all.
const LOOKS: &[&[(&str, &str)]] = &[
    &[("style", "flat")],
    &[("style", "smooth"), ("samples", "16")],
    &[("style", "wire"), ("samples", "1")],
    &[("style", "wireframe")],
    &[("style", "outline")],
    &[("style", "technical"), ("surface.opacity", "0.4")],
    &[("style", "outline"), ("surface.opacity", "0.4")],
    &[("surface", "null")],
];

const GRADIENTS: &[&str] = &["#fff..#dde", "#102030..#f0e0c0", "transparent..#f008", "#0f04..transparent"];

#[test]
fn each_row_is_that_of_a_picture_over_its_colour() {
    let obj = shapes::gear(9);
    let mesh = scenes::mesh(&obj);
    let mut rows = 0;
    for (look, gradient) in LOOKS.iter().flat_map(|look| GRADIENTS.iter().map(move |gradient| (look, gradient))) {
        let keys = [&[("size", "90x70"), ("background", gradient)], *look].concat();
        let spec = scenes::spec(&keys);
        let mut plan = scenes::plan(&mesh, &spec);
        assert!(plan.has_gradient());
        let (whole, row_len) = (draw(&plan), 4 * plan.width_px as usize);
        for row in [0, 1, HEIGHT_PX / 2, HEIGHT_PX - 1] {
            let at = row as usize * row_len..(row as usize + 1) * row_len;
            let (background, step) = (plan.background, plan.background_step);
            (plan.background, plan.background_step) = (plan.background_at(row), [0.0; 4]);
            assert!(whole[at.clone()] == draw(&plan)[at], "{look:?} {gradient} row {row}");
            (plan.background, plan.background_step) = (background, step);
            rows += 1;
        }
    }
    assert_eq!(rows, 4 * LOOKS.len() * GRADIENTS.len());
}

/// The bytes of a picture, which are the same from every instruction set and any number of threads.
fn draw(plan: &DrawPlan<'_>) -> Vec<u8> {
    let image = CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap();
    let other = CpuRenderer::with_isa(3, Isa::baseline()).draw(plan, &Deadline::default()).unwrap();
    assert!(image.rgba == other.rgba);
    image.rgba.into_vec()
}

#[test]
fn gradients_are_blended_in_linear_light() {
    let obj = shapes::cube();
    let mesh = scenes::mesh(&obj);
    let linear = |byte: u8| {
        let v = f64::from(byte) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
    };
    let thresholds = srgb8_thresholds();
    let spec = scenes::spec(&[("size", "9x70"), ("surface", "null"), ("background", "#204080..#ffe0c0")]);
    let image = CpuRenderer::new(1).draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap();
    for y in 0..HEIGHT_PX {
        let t = (f64::from(y) + 0.5) / f64::from(HEIGHT_PX);
        let blended = [(0x20, 0xff), (0x40, 0xe0), (0x80, 0xc0)].map(|(a, b)| linear(a) * (1.0 - t) + linear(b) * t);
        let [r, g, b] = blended.map(|v| thresholds.partition_point(|&t| f64::from(t) <= v) as u8);
        let pixel = image.pixel(4, y);
        for (byte, wanted) in pixel.into_iter().zip([r, g, b, 255]) {
            assert!(byte.abs_diff(wanted) <= 1, "row {y}: {pixel:?}");
        }
    }
    // A transparent end has no colour of its own: the other's does not darken on the way.
    let spec = scenes::spec(&[("size", "9x70"), ("surface", "null"), ("background", "transparent..#f00")]);
    let image = CpuRenderer::new(1).draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap();
    for y in 1..HEIGHT_PX {
        let [r, g, b, a] = image.pixel(4, y);
        assert_eq!([r, g, b], [255, 0, 0], "row {y}");
        assert_eq!(u32::from(a), ((y as f32 + 0.5) / HEIGHT_PX as f32 * 255.0 + 0.5) as u32);
    }
}

#[test]
fn gradients_are_the_same_on_both_back_ends() {
    let Some(gpus) = gpus() else { return };
    let obj = shapes::gear(9);
    let mesh = scenes::mesh(&obj);
    let mut renderer = GpuRenderer::new(gpus[0].clone());
    for (i, look) in LOOKS.iter().enumerate() {
        let keys = [&[("size", "90x70"), ("background", GRADIENTS[i % GRADIENTS.len()])], *look].concat();
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        let cpu = CpuRenderer::new(2).draw(&plan, &Deadline::default()).unwrap();
        let gpu = renderer.draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{keys:?}"));
    }
}
