//! The CPU's shortcuts change no byte: small triangles in SIMD lanes, triangles left out where
//! tiles hide them, colours found once per triangle, samples kept from picture to picture, and rows
//! that are encoded while others are drawn.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::encode;
use meshsnap_render::image::{ImageFormat, RowSink};
use meshsnap_render::limits::Deadline;

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

/// Every row comes once and in order, on any number of threads, and gives the file of the whole picture.
#[test]
fn rows_come_in_order_while_others_are_drawn() {
    struct Rows(Vec<u8>);
    impl RowSink for Rows {
        fn write_rows(&mut self, rgba: &[u8]) {
            self.0.extend_from_slice(rgba);
        }
    }

    let deadline = Deadline::default();
    let mesh = scenes::mesh(&shapes::gear(9));
    let (mut pictures, mut early) = (0, 0);
    for (style, background) in [("flat", "#fff"), ("auto", "transparent"), ("wire", "#fff..#dde8")] {
        let spec = scenes::spec(&[("style", style), ("size", "333x700"), ("background", background)]);
        let plan = scenes::plan(&mesh, &spec);
        let want = CpuRenderer::new(1).draw(&plan, &deadline).unwrap();
        let file = encode::encode(&want, ImageFormat::Png, 3, &deadline).unwrap();
        for threads in [1, 2, 3, 7] {
            let mut renderer = CpuRenderer::new(threads);
            for _ in 0..10 {
                let mut rows = Rows(Vec::new());
                assert!(renderer.draw_rows(&plan, &mut rows, &deadline).unwrap() == want, "{style} {threads}");
                assert!(want.rgba.starts_with(&rows.0), "{style} {threads}");
                early += rows.0.len();
                let is_opaque = background == "#fff";
                let mut png = encode::row_encoder(ImageFormat::Png, 3, [333, 700], is_opaque).unwrap();
                let image = renderer.draw_rows(&plan, &mut png, &deadline).unwrap();
                assert!(png.finish(&image).unwrap() == file, "{style} {threads}");
                pictures += 1;
            }
        }
    }
    assert_eq!(pictures, 120);
    // A row may be left to the end, when a thread finishes it just as another leaves the sink; seldom.
    let all = pictures * 333 * 700 * 4;
    assert!(early > all * 9 / 10, "{early} of {all} bytes came early");
    assert!(encode::row_encoder(ImageFormat::Png, 9, [1, 1], true).is_none());
    assert!(encode::row_encoder(ImageFormat::Webp, 3, [1, 1], true).is_none());
}

/// A sink that panics ends its picture alone.
#[test]
fn a_panicking_sink_leaves_the_renderer_whole() {
    struct Panics;
    impl RowSink for Panics {
        fn write_rows(&mut self, _: &[u8]) {
            panic!("a sink that panics");
        }
    }

    let deadline = Deadline::default();
    let mesh = scenes::mesh(&shapes::gear(9));
    let plan = scenes::plan(&mesh, &scenes::spec(&[("size", "200x400")]));
    let mut renderer = CpuRenderer::new(2);
    let want = renderer.draw(&plan, &deadline).unwrap();
    let draws = std::panic::AssertUnwindSafe(|| renderer.draw_rows(&plan, &mut Panics, &deadline));
    assert!(std::panic::catch_unwind(draws).is_err());
    assert!(renderer.draw(&plan, &deadline).unwrap() == want);
}
