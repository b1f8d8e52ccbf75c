//! Occlusion textures: they take ambient light away by the formula, and nothing else.

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::{Image, srgb8_thresholds};
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use serde_json::{Value, json};

use crate::render::textures::levels::{encode, model};
use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;

/// A square that faces the viewer, whose image is red on its left half: all other channels are misleading.
fn square(material: Value) -> Mesh {
    let image = RgbImage::from_fn(64, 64, |x, _| if x < 32 { Rgb([255, 0, 90]) } else { Rgb([51, 255, 200]) });
    let image = encode(&DynamicImage::ImageRgb8(image), ImageFormat::Png);
    let corners =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];
    let uvs = [[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]];
    model(&corners, &uvs, &image, material)
}

fn material(strength: f64, metallic: f64) -> Value {
    json!({
        "occlusionTexture": { "index": 0, "strength": strength },
        "pbrMetallicRoughness": { "baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": metallic, "roughnessFactor": 1 },
    })
}

fn draw(mesh: &Mesh, keys: &[(&str, &str)]) -> Image {
    let always = [("view", "front"), ("size", "64"), ("camera.projection", "orthographic"), ("camera.margin", "0")];
    let spec = scenes::spec(&[&always, keys].concat());
    let plan = scenes::plan(mesh, &spec);
    let picture = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
    if let Some(gpus) = gpus() {
        let other = GpuRenderer::new(gpus[0].clone()).draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&picture, &other).assert(Tolerance::TWINS, &format!("{keys:?}"));
    }
    picture
}

/// Grey of the left half, and of the right one.
fn halves(mesh: &Mesh, keys: &[(&str, &str)]) -> [u8; 2] {
    let picture = draw(mesh, keys);
    [picture.pixel(10, 32)[0], picture.pixel(54, 32)[0]]
}

fn byte(linear: f64) -> u8 {
    srgb8_thresholds().partition_point(|&t| f64::from(t) <= linear) as u8
}

#[test]
fn ambient_light_is_darker_by_the_red_channel() {
    let mut cases = 0;
    for strength in [0.0, 0.5, 1.0] {
        let mesh = square(material(strength, 0.0));
        for (ambient, shading) in [(1.0_f64, "flat"), (0.5, "smooth")] {
            let text = ambient.to_string();
            let keys = [("light.preset", "none"), ("light.ambient", text.as_str()), ("surface.shading", shading)];
            let [open, dark] = halves(&mesh, &keys);
            let light = 0.6 * ambient * 0.7;
            let wanted = [byte(light), byte(light * (1.0 - strength * (1.0 - 0.2)))];
            assert!(
                open.abs_diff(wanted[0]) <= 1 && dark.abs_diff(wanted[1]) <= 1,
                "{strength}: {open} {dark}, not {wanted:?}"
            );
            cases += 1;
        }
    }
    assert_eq!(cases, 6);
}

#[test]
fn lamps_metals_and_unlit_surfaces_are_not() {
    let mesh = square(material(1.0, 0.0));
    let lamp = [("light.ambient", "0")];
    let [open, dark] = halves(&mesh, &lamp);
    assert_eq!(open, dark, "the lamp alone");
    let [open, dark] = halves(&mesh, &[]);
    assert!(open > dark + 10 && dark > 60, "{open} {dark}: the lamp shines into the dark half too");
    for keys in [[("style", "unlit")], [("surface.textures", "false")], [("surface.debug", "normal")]] {
        let [open, dark] = halves(&mesh, &keys);
        assert_eq!(open, dark, "{keys:?}");
    }
    let [open, dark] = halves(&square(material(1.0, 1.0)), &[]);
    assert_eq!(open, dark, "bare metal");
}
