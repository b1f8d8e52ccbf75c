//! Cut-out textures (alpha masks) seen from afar: they cover the same share of the picture as close
//! up.

use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use serde_json::json;

use crate::render::textures::levels::{encode, model};
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;

/// A square with a lattice whose bars are 2 of 16 texels wide.
fn lattice(cutoff: f64) -> Mesh {
    let is_bar = |x: u32, y: u32| x % 16 < 2 || y % 16 < 2;
    let image = RgbaImage::from_fn(256, 256, |x, y| Rgba([90, 140, 60, if is_bar(x, y) { 255 } else { 0 }]));
    let image = encode(&DynamicImage::ImageRgba8(image), ImageFormat::Png);
    let material = json!({
        "alphaMode": "MASK", "alphaCutoff": cutoff, "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
    });
    let corners =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];
    let uvs = [[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]];
    model(&corners, &uvs, &image, material)
}

#[test]
fn a_lattice_covers_as_much_from_afar() {
    let mut cpu = CpuRenderer::new(2);
    let mut gpu = gpus().map(|gpus| GpuRenderer::new(gpus[0].clone()));
    let mut sizes = 0;
    for cutoff in [0.5, 0.75, 0.9] {
        let mesh = lattice(cutoff);
        // Filtered alpha reaches the cutoff so many texels on each side of a texel's middle.
        let bar = 1.0 + 2.0 * (1.0 - cutoff);
        let whole = 1.0 - (1.0 - bar / 16.0_f64).powi(2);
        for size in ["512", "256", "128", "64", "32"] {
            let keys = [("view", "front"), ("style", "unlit"), ("background", "transparent"), ("samples", "16")];
            let spec = scenes::spec(
                &[&keys[..], &[("size", size), ("camera.margin", "0"), ("camera.projection", "orthographic")]].concat(),
            );
            let plan = scenes::plan(&mesh, &spec);
            let picture = cpu.draw(&plan, &Deadline::default()).unwrap();
            let alpha: f64 = picture.rgba.chunks(4).map(|pixel| f64::from(pixel[3]) / 255.0).sum();
            let covered = alpha / (picture.rgba.len() / 4) as f64;
            println!("cutoff {cutoff}, {size} px: {covered:.3} of {whole:.3}");
            let slack = if cutoff == 0.5 { 0.02 } else { 0.15 };
            assert!((covered / whole - 1.0).abs() < slack, "cutoff {cutoff}, {size} px: {covered} of {whole}");
            if let Some(gpu) = &mut gpu {
                let like = Likeness::of(&gpu.draw(&plan, &Deadline::default()).unwrap(), &picture);
                assert!(like.is_within(Tolerance::TWINS), "{size}: {like}");
            }
            sizes += 1;
        }
    }
    assert_eq!(sizes, 15);
}
