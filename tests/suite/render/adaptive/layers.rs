//! Adaptive samples in pictures with transparent layers: mixed pixels that show no layer are drawn
//! from points, as if there were no layers. All other pixels have 16 samples.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::plan::DrawPlan;

use super::{draw, last_of_each};
use crate::support::gpus::gpus_of_case;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes::{self, Obj};

/// An opaque ball behind one of glass, which hides half of it. The last keys count.
fn keys<'a>(more: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    let view = [("size", "240x200"), ("camera.eye", "-4,1.2,5"), ("camera.target", "0,0,0"), ("style", "flat")];
    [&view[..], &[("samples", "adaptive"), ("surface.color", "c84"), ("light.preset", "three-point")], more].concat()
}

const GLASS: [(&str, &str); 2] = [("materials.left.surface.opacity", "0.4"), ("materials.left.surface.color", "48c")];

fn ball(x: f64, radius: f64) -> String {
    let mut obj = Obj::default();
    obj.ball([x, 0.0, 0.0], radius, 20);
    obj.finish()
}

#[test]
fn pixels_without_a_layer_are_as_if_there_were_none() {
    let mesh = scenes::mesh(&shapes::two_balls());
    let mut plan = scenes::plan(&mesh, &scenes::spec(&keys(&GLASS)));
    assert_eq!((plan.samples, plan.is_adaptive, plan.warnings.len()), (16, true, 0));
    let mut renderer = CpuRenderer::new(2);
    let found = draw(&mut renderer, &plan);
    let mixed = renderer.draw_times().mixed_pixels as usize;
    plan.is_adaptive = false;
    let fixed = draw(&mut renderer, &plan);
    let opaque = scenes::mesh(&ball(1.1, 1.0));
    let alone = draw(&mut renderer, &scenes::plan(&opaque, &scenes::spec(&keys(&[]))));
    let glass = scenes::mesh(&ball(-1.1, 0.9));
    let clear = [("background", "transparent"), ("samples", "16")];
    let glass = draw(&mut renderer, &scenes::plan(&glass, &scenes::spec(&last_of_each(&keys(&clear)))));

    let pixels = |image: &meshsnap_render::image::Image| image.rgba.as_chunks::<4>().0.to_vec();
    let [found, fixed, alone, glass] = [&found, &fixed, &alone, &glass].map(pixels);
    let (mut changed, mut as_alone) = (0, 0);
    for i in (0..found.len()).filter(|&i| found[i] != fixed[i]) {
        assert_eq!(glass[i][3], 0, "a pixel with a layer, {i}");
        changed += 1;
        as_alone += usize::from(found[i] == alone[i]);
    }
    assert!(changed > 150 && changed <= mixed, "{changed} of {mixed}");
    // Depths have other roundings where the mesh has another extent.
    assert!(as_alone * 100 >= changed * 97, "{as_alone} of {changed}");
    // Else the above would say nothing of the border of the glass.
    let borders = glass.iter().filter(|pixel| pixel[3] > 0 && pixel[3] < 255).count();
    assert!(borders > 150, "{borders}");
}

/// Shortcuts, threads, instruction sets, and GPUs with a band or more.
#[test]
fn every_way_of_drawing_gives_the_same_picture() {
    let mesh = scenes::mesh(&shapes::two_balls());
    let mut plain = CpuRenderer::plain(1);
    let mut others: Vec<CpuRenderer> = Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    others.extend([1, 3].map(CpuRenderer::new));
    let shadow = [("scene.ground", "shadow")];
    let looks: [&[(&str, &str)]; 7] = [
        &GLASS,
        &[GLASS[0], GLASS[1], ("style", "technical")],
        &[GLASS[0], ("style", "smooth"), ("outline.thickness", "2"), ("outline.unit", "px")],
        &[GLASS[0], ("outline.method", "contour"), ("wire.thickness", "1"), ("wire.lit", "true")],
        &[GLASS[0], ("size", "480x420"), ("style", "wire")],
        &shadow,
        // What faces the viewer is clear: its alpha is nearly 0.
        &[GLASS[1], ("materials.left.surface.facing_opacity", "0"), GLASS[0]],
    ];
    for (number, look) in looks.into_iter().enumerate() {
        let plan: DrawPlan<'_> = scenes::plan(&mesh, &scenes::spec(&last_of_each(&keys(look))));
        assert!(plan.is_adaptive && plan.peeling.is_some() && plan.samples == 16, "{look:?}");
        let want = draw(&mut plain, &plan);
        let mixed = plain.draw_times().mixed_pixels;
        assert!(mixed > 150, "{look:?}: {mixed}");
        for renderer in &mut others {
            assert!(draw(renderer, &plan) == want, "{look:?}");
        }
        for gpu in gpus_of_case(number) {
            let mut renderer = GpuRenderer::new(gpu.clone());
            let found = draw(&mut renderer, &plan);
            assert_eq!(renderer.draw_times().mixed_pixels, mixed, "{look:?}");
            Likeness::of(&found, &want).assert(Tolerance::TWINS, &format!("{look:?}"));
        }
    }
}

#[test]
fn pictures_of_layers_alone_have_fixed_samples() {
    let mesh = scenes::mesh(&shapes::cube());
    let cases = [
        (&[("surface.opacity", "0.5")][..], "all faces are transparent"),
        (&[("style", "wire"), ("wire.method", "barycentric"), ("wire.hidden", "show")][..], "wires show through faces"),
    ];
    for (more, reason) in cases {
        let plan = scenes::plan(&mesh, &scenes::spec(&[&[("samples", "adaptive")], more].concat()));
        assert_eq!((plan.samples, plan.is_adaptive), (16, false));
        let [warning] = &plan.warnings[..] else { panic!("{:?}", plan.warnings) };
        assert!(warning.code == "samples_fixed" && warning.detail.contains(reason), "{warning:?}");
    }
}
