//! The CPU's shortcuts change nothing: small triangles in lanes, what lies behind tiles, colours
//! found once per triangle.

use meshsnap::backend::Renderer;
use meshsnap::backend::cpu::{CpuRenderer, Isa};
use meshsnap::limits::Deadline;

use crate::support::scenes::{self, SCENES};

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
