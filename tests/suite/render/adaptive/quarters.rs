//! With adaptive samples, metals that mirror sharply and have smooth normals are shaded in each
//! quarter of a pixel, because reflections change within it. Both back-ends agree, and threads,
//! instruction sets and shortcuts change no byte.

use image::ImageFormat;
use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::mesh::Mesh;
use serde_json::json;

use super::{draw, last_of_each};
use crate::render::textures::levels::{encode, model};
use crate::support::gpus::gpus_of_case;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes;

const METAL: [(&str, &str); 5] = [
    ("style", "smooth"),
    ("samples", "adaptive"),
    ("surface.metallic", "1"),
    ("surface.roughness", "0.1"),
    ("light.preset", "studio"),
];

/// A tent whose texture bends normals, and says how rough and how much of a metal it is.
fn textured() -> Mesh {
    let random = |x: u32, y: u32| (x * 7919 + y * 104_729) % 251;
    let texel = |x, y| image::Rgb([100 + (random(x, y) / 5) as u8, (random(y, x) / 2) as u8, 255]);
    let picture = encode(&image::RgbImage::from_fn(64, 64, texel).into(), ImageFormat::Png);
    let tent =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.4]], [[1.0, 0.0, 0.0], [1.4, 0.9, -0.3], [0.5, 1.0, 0.4]]];
    let uvs = [[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]], [[2.0, 0.0], [3.0, 2.0], [0.0, 2.0]]];
    let texture = json!({ "index": 0 });
    let material = json!({
        "pbrMetallicRoughness": { "metallicRoughnessTexture": texture }, "normalTexture": texture, "doubleSided": true
    });
    model(&tent, &uvs, &picture, material)
}

#[test]
fn every_way_of_drawing_gives_the_same_picture() {
    let [coarse, fine, balls] =
        [shapes::torus(24), shapes::torus(120), shapes::two_balls()].map(|obj| scenes::mesh(&obj));
    let meshes = [coarse, fine, balls, textured()];
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    others.extend([1, 3].map(CpuRenderer::new));
    let looks: [&[(&str, &str)]; 7] = [
        &[("size", "160x120")],
        // Many faces in a pixel.
        &[("size", "30"), ("light.ambient_occlusion", "1")],
        &[("size", "200"), ("outline.thickness", "2")],
        // Metal beside glass, and beside what is neither.
        &[("size", "160x120"), ("materials.left.surface.opacity", "0.4")],
        &[("size", "160x120"), ("materials.left.surface.metallic", "0")],
        &[("size", "160x120"), ("wire.thickness", "1"), ("wire.edges", "triangles"), ("wire.lit", "true")],
        // Faces that reach behind the eye.
        &[
            ("size", "160x120"),
            ("camera.eye", "0.6,0.1,0.9"),
            ("camera.target", "0,0,0"),
            ("camera.fov_deg", "90"),
            ("light.ambient_occlusion", "1"),
        ],
    ];
    let mut compared = 0;
    for (number, look) in looks.into_iter().enumerate() {
        for (i, mesh) in meshes.iter().enumerate() {
            let plan = scenes::plan(mesh, &scenes::spec(&last_of_each(&[&METAL[..], look].concat())));
            assert!(plan.is_adaptive && plan.has_quarters(), "{look:?}");
            let want = draw(&mut plain, &plan);
            for renderer in &mut others {
                assert!(draw(renderer, &plan) == want, "{look:?} of mesh {i}");
                compared += 1;
            }
            for gpu in gpus_of_case(number + i) {
                let mut renderer = GpuRenderer::new(gpu.clone());
                let found = draw(&mut renderer, &plan);
                assert_eq!(renderer.draw_times().mixed_pixels, plain.draw_times().mixed_pixels, "{look:?} of mesh {i}");
                Likeness::of(&found, &want).assert(Tolerance::TWINS, &format!("{look:?} of mesh {i}"));
            }
        }
    }
    assert!(compared >= 4 * 7 * 3, "{compared}");
}

#[test]
fn what_does_not_mirror_sharply_is_shaded_once() {
    let mesh = scenes::mesh(&shapes::torus(24));
    let mut cases = 0;
    for (more, has_quarters) in [
        (&[][..], true),
        (&[("surface.roughness", "0.5")], false),
        (&[("surface.metallic", "0")], false),
        (&[("style", "flat")], false),
        (&[("samples", "16")], false),
        (&[("surface.metallic", "0.2"), ("surface.roughness", "0.45")], true),
    ] {
        let plan = scenes::plan(&mesh, &scenes::spec(&last_of_each(&[&METAL[..], more].concat())));
        assert_eq!(plan.has_quarters(), has_quarters, "{more:?}");
        cases += 1;
    }
    assert_eq!(cases, 6);
}
