//! The CPU's shortcuts change nothing: small triangles in lanes, what lies behind tiles, colours
//! found once per triangle.

use meshsnap::backend::Renderer;
use meshsnap::backend::cpu::{CpuRenderer, Isa};
use meshsnap::limits::Deadline;

use crate::support::scenes::{self, SCENES};
use crate::support::shapes;

#[test]
fn pictures_and_samples_are_the_same_without_shortcuts() {
    let deadline = Deadline::default();
    let mut plain = CpuRenderer::plain(1);
    let mut hastened: Vec<CpuRenderer> =
        Isa::available().into_iter().map(|isa| CpuRenderer::with_isa(2, isa)).collect();
    let mut shown = 0;
    for (i, scene) in SCENES.iter().enumerate() {
        let mesh = scenes::mesh(&(scene.obj)());
        let mut plan = scenes::plan(&mesh, &scene.spec());
        // Each number of samples comes along with other scenes, and 4 with all.
        for samples in [4, [1, 8, 16][i % 3]] {
            plan.samples = samples;
            let want = plain.draw(&plan, &deadline).unwrap();
            let words = plain.draw_visibility(&plan, &deadline).unwrap();
            shown += words.iter().filter(|word| **word != 0).count();
            for renderer in &mut hastened {
                let case = format!("{} at {samples} samples", scene.name);
                assert!(renderer.draw_visibility(&plan, &deadline).unwrap() == words, "samples of {case}");
                assert!(renderer.draw(&plan, &deadline).unwrap() == want, "picture of {case}");
            }
        }
    }
    assert!(shown > 1_000_000, "{shown} samples show something");
}

/// Occlusion: the first picture of a size draws its samples twice, and those that follow keep them. Another
/// mesh, other lines and another size in between leave nothing behind.
#[test]
fn kept_samples_change_nothing() {
    let deadline = Deadline::default();
    let (mut plain, mut renderer) = (CpuRenderer::plain(1), CpuRenderer::new(2));
    let meshes = [shapes::gear(9), shapes::boxes_on_a_floor()].map(|obj| scenes::mesh(&obj));
    let mut pictures = 0;
    for size in ["200x160", "200x160", "200x160", "64x200", "64x200", "200x160", "900", "900"] {
        for (mesh, style) in meshes.iter().flat_map(|mesh| ["auto", "outline", "technical"].map(|style| (mesh, style)))
        {
            let plan = scenes::plan(mesh, &scenes::spec(&[("style", style), ("size", size)]));
            assert!(plan.occlusion.is_some());
            for _ in 0..2 {
                assert!(
                    renderer.draw(&plan, &deadline).unwrap() == plain.draw(&plan, &deadline).unwrap(),
                    "{size} {style}"
                );
                pictures += 1;
            }
        }
    }
    assert_eq!(pictures, 8 * 6 * 2);
}
