//! The golden scenes, one test each. The CPU's picture equals the stored one to the byte, with 1,
//! 2, 3 and 8 threads and every instruction set of the machine. `twins/pictures.rs` holds the GPU
//! to the CPU.
//!
//! A failure writes the actual, the expected and the difference picture under
//! `target/golden-failures/NAME/`. `MESHSNAP_GOLDEN=write` stores new pictures, and then fails: a
//! run that wrote its own truth has tested nothing.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::{CpuRenderer, DrawingThreads, Isa};
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;

use crate::support::scenes::{self, SCENES, Scene};
use crate::support::truth::goal;

const THREADS: [usize; 4] = [1, 2, 3, 8];
/// Pictures per set-up. The second comes from buffers that the first has used.
const RUNS: usize = 2;

/// A test per scene, named after it with `_` for `-`.
macro_rules! golden_tests {
    ($($name:ident,)*) => {
        const TESTED: &[&str] = &[$(stringify!($name)),*];
        $(
            #[test]
            fn $name() {
                picture_equals_the_stored_one(&stringify!($name).replace('_', "-"));
            }
        )*
    };
}

golden_tests! {
    torus_flat,
    torus_smooth,
    torus_unlit,
    torus_wire,
    torus_wire_wide,
    torus_fwidth,
    torus_wireframe,
    gear_outline_px,
    gear_outline_object,
    gear_hidden_line,
    cube_flat_one_sample,
    cube_wire_polygons,
    sheet_wire_red,
    sheet_back_faces,
    sheet_orthographic,
    sheet_from_inside,
    sheet_wire_from_inside,
    torus_glass,
    gear_glass_outline,
    torus_wireframe_fwidth_show,
    torus_wireframe_fwidth_fade,
    torus_wire_fwidth_fade,
    two_one_outlined,
    two_one_glass,
    torus_derivative,
    gear_metal,
    torus_metal,
    sheet_threshold,
    gear_fwidth_min,
    gear_barycentric_lit,
    torus_debug_normal,
    gear_debug_edge_distance,
    sheet_debug_barycentric,
    sheet_debug_face_orientation,
    torus_contour,
    gear_contour,
    gear_feature_fade,
    fin_topology,
    torus_wire_lit,
    spring_wireframe,
    sheet_boundary,
    ball_and_box_wire_auto,
}

#[test]
fn every_scene_has_a_test_and_every_picture_a_scene() {
    let scenes: BTreeSet<String> = SCENES.iter().map(|scene| scene.name.to_owned()).collect();
    let tested: BTreeSet<String> = TESTED.iter().map(|name| name.replace('_', "-")).collect();
    assert_eq!(scenes, tested);
    let entries = std::fs::read_dir(folder()).unwrap();
    let stored: BTreeSet<String> =
        entries.map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    assert_eq!(scenes, stored, "tests/golden");
    assert_eq!(SCENES.len(), 42);
    let compared = SCENES.len() * 2 * THREADS.len() * RUNS;
    goal(7, &format!("identical: {compared} pictures with {:?} instructions on {THREADS:?} threads", isas()));
}

/// Renderers that draw at the same time on the same threads do not disturb one another.
#[test]
fn golden_on_shared_threads() {
    let threads = Arc::new(DrawingThreads::new(3));
    let drawn: usize = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4)
            .map(|worker| {
                let mut renderer = CpuRenderer::on(threads.clone());
                scope.spawn(move || {
                    let scenes = SCENES.iter().skip(worker).step_by(5);
                    let same = |scene: &Scene| {
                        let alone = draw(scene, &mut CpuRenderer::new(1));
                        assert_same(scene.name, "shared threads", &draw(scene, &mut renderer), &alone);
                    };
                    scenes.map(same).count()
                })
            })
            .collect();
        workers.into_iter().map(|worker| worker.join().unwrap()).sum()
    });
    let drawn_by = |worker: usize| SCENES.iter().skip(worker).step_by(5).count();
    assert_eq!(drawn, (0..4).map(drawn_by).sum::<usize>());
}

/// Draws a scene.
pub fn draw(scene: &Scene, renderer: &mut dyn Renderer) -> Image {
    let mesh = scenes::mesh(&(scene.obj)());
    let spec = scene.spec();
    renderer.draw(&scenes::plan(&mesh, &spec), &Deadline::default()).unwrap()
}

fn isas() -> Vec<Isa> {
    Isa::available()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

fn picture_equals_the_stored_one(name: &str) {
    let scene = SCENES.iter().find(|scene| scene.name == name).expect("a scene of this name");
    let path = folder().join(format!("{name}.png"));
    if std::env::var_os("MESHSNAP_GOLDEN").is_some_and(|value| value == "write") {
        save(&path, &draw(scene, &mut CpuRenderer::new(1)));
        panic!("{} was written: look at it, then run without MESHSNAP_GOLDEN", path.display());
    }
    let stored = image::open(&path)
        .unwrap_or_else(|error| panic!("{}: {error}; MESHSNAP_GOLDEN=write stores it", path.display()))
        .into_rgba8();
    let stored = Image { width_px: stored.width(), height_px: stored.height(), rgba: stored.into_raw().into() };
    for isa in isas() {
        for threads in THREADS {
            let mut renderer = CpuRenderer::with_isa(threads, isa);
            for run in 0..RUNS {
                let setup = format!("{threads} threads, {isa:?}, run {run}");
                assert_same(name, &setup, &draw(scene, &mut renderer), &stored);
            }
        }
    }
}

fn assert_same(name: &str, setup: &str, actual: &Image, expected: &Image) {
    let sizes = [actual, expected].map(|image| [image.width_px, image.height_px]);
    let pixels = actual.rgba.chunks(4).zip(expected.rgba.chunks(4));
    let differing = pixels.filter(|(a, b)| a != b).count();
    if sizes[0] == sizes[1] && differing == 0 {
        return;
    }
    let folder = failure_folder(name);
    save(&folder.join("actual.png"), actual);
    save(&folder.join("expected.png"), expected);
    if sizes[0] == sizes[1] {
        save(&folder.join("difference.png"), &difference(actual, expected));
    }
    panic!("{name}, {setup}: {differing} pixels of {sizes:?} differ; see {}", folder.display());
}

/// Every differing pixel in white, on black: a difference of 1/255 is as easy to see as a large
/// one.
fn difference(actual: &Image, expected: &Image) -> Image {
    let pixels = actual.rgba.chunks(4).zip(expected.rgba.chunks(4));
    let rgba = pixels.flat_map(|(a, b)| if a == b { [0, 0, 0, 255] } else { [255; 4] }).collect();
    Image { rgba, ..*actual }
}

/// Made anew in `target/golden-failures/`.
fn failure_folder(name: &str) -> PathBuf {
    // Cargo's folder for tests lies directly in the target folder.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a target folder");
    let folder = target.join("golden-failures").join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn save(path: &Path, picture: &Image) {
    image::save_buffer(path, &picture.rgba, picture.width_px, picture.height_px, image::ColorType::Rgba8).unwrap();
}

#[test]
fn a_differing_picture_leaves_three_files() {
    let image = |byte: u8| Image { width_px: 2, height_px: 1, rgba: vec![byte, 0, 0, 255, 9, 9, 9, 255].into() };
    let failed = std::panic::catch_unwind(|| assert_same("self-test", "none", &image(1), &image(2)));
    let message = failed.unwrap_err();
    assert!(message.downcast_ref::<String>().unwrap().contains("1 pixels"));
    let folder = failure_folder("self-test");
    for file in ["actual.png", "expected.png", "difference.png"] {
        assert_eq!(image::open(folder.join(file)).unwrap().to_rgba8().dimensions(), (2, 1), "{file}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
