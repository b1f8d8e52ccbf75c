//! Every scene on every back-end: the CPU's picture equals the stored one to the byte, whatever the profile, the number
//! of threads or the instruction set; the GPU's is as close as its named tolerance says.
//!
//! `MESHSNAP_GOLDEN=write` stores new pictures, and then fails: a run that wrote its own truth has tested nothing.

use std::path::PathBuf;

use meshsnap::backend::Renderer;
use meshsnap::backend::cpu::{CpuRenderer, Isa};
use meshsnap::image::Image;
use meshsnap::limits::Deadline;

use crate::support::scenes::{self, SCENES, Scene};
use crate::support::truth::goal;

const THREADS: [usize; 4] = [1, 2, 3, 8];

#[test]
fn cpu_pictures_equal_the_stored_ones_to_the_byte() {
    let isas = Isa::available();
    let of = |threads: usize, isa: Isa| (format!("{threads} threads, {isa:?}"), CpuRenderer::with_isa(threads, isa));
    let mut renderers: Vec<_> = isas.iter().flat_map(|&isa| THREADS.map(|threads| of(threads, isa))).collect();
    let mut compared = 0;
    for scene in SCENES {
        let stored = stored(scene, &mut renderers[0].1);
        for (name, renderer) in &mut renderers {
            // Twice: the second picture comes from buffers that the first has used.
            for run in 0..2 {
                let picture = draw(scene, renderer);
                assert_same(scene, name, run, &picture, &stored);
                compared += 1;
            }
        }
    }
    goal(7, &format!("identical: {compared} pictures with {isas:?} instructions on {THREADS:?} threads"));
    assert_eq!(compared, SCENES.len() * 2 * THREADS.len() * isas.len());
    assert_eq!(SCENES.len(), 41);
}

/// Draws a scene.
pub fn draw(scene: &Scene, renderer: &mut dyn Renderer) -> Image {
    let mesh = scenes::mesh(&(scene.obj)());
    let spec = scene.spec();
    renderer.draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap()
}

fn stored(scene: &Scene, renderer: &mut CpuRenderer) -> Image {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{}.png", scene.name));
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|v| v == "write") {
        let picture = draw(scene, renderer);
        image::save_buffer(&path, &picture.rgba, picture.width_px, picture.height_px, image::ColorType::Rgba8).unwrap();
    }
    let file =
        image::open(&path).unwrap_or_else(|e| panic!("{}: {e}; MESHSNAP_GOLDEN=write stores it", path.display()));
    let file = file.into_rgba8();
    Image { width_px: file.width(), height_px: file.height(), rgba: file.into_raw() }
}

#[test]
fn a_run_that_writes_goldens_fails() {
    assert!(std::env::var_os("MESHSNAP_GOLDEN").is_none(), "goldens were written: look at them, then run without");
}

fn assert_same(scene: &Scene, renderer: &str, run: i32, picture: &Image, stored: &Image) {
    assert_eq!((picture.width_px, picture.height_px), (stored.width_px, stored.height_px), "{}", scene.name);
    let differing = picture.rgba.chunks(4).zip(stored.rgba.chunks(4)).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "{}: {renderer}, run {run}: pixels differ from tests/golden", scene.name);
}
