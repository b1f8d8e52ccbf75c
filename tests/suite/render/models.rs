//! Every real mesh in five styles on the CPU: drawn, the right size, not blank. The GPU draws every
//! third of the pictures (all in a long run), and they are alike.
//!
//! `MESHSNAP_CONTACT_SHEET=FILE.png` also stores them all in one picture, to be looked at.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{data, scenes, truth};

const STYLES: [&str; 5] = ["flat", "smooth", "wire", "wireframe", "outline"];
const SIZE_PX: u32 = 256;

#[test]
fn every_model_is_drawn_in_every_style_alike_on_both_back_ends() {
    let meshes = readable(&data::folder("models"));
    assert_eq!(meshes.len(), MODELS, "models that this version reads");
    all_are_drawn_alike(&meshes);
}

#[test]
fn every_large_model_is_drawn_in_every_style_alike_on_both_back_ends() {
    let Some(folder) = data::large_folder("models") else { return };
    let meshes = readable(&folder);
    assert!(meshes.len() >= 36, "only {} models are read", meshes.len());
    all_are_drawn_alike(&meshes);
}

/// Models of `tests/data` with triangles.
const MODELS: usize = 16;

fn all_are_drawn_alike(meshes: &[(String, Mesh)]) {
    let mut cpu = CpuRenderer::new(2);
    let mut gpu = gpus().map(|gpus| GpuRenderer::new(gpus[0].clone()));
    let (mut drawn, mut compared) = (0, 0);
    let mut sheet = Sheet::default();
    for (name, mesh) in meshes {
        for style in STYLES {
            let spec = scenes::spec(&[("style", style), ("size", &SIZE_PX.to_string())]);
            let plan = scenes::plan(mesh, &spec);
            let picture = cpu.draw(&plan, &Deadline::default()).unwrap();
            assert_drawn(name, style, &picture);
            drawn += 1;
            // The GPU draws every third picture; all of them in a long run.
            if let Some(gpu) = gpu.as_mut().filter(|_| truth::is_long() || drawn % 3 == 0) {
                let other = gpu.draw(&plan, &Deadline::default()).unwrap();
                Likeness::of(&picture, &other).assert(Tolerance::TWINS, &format!("{name}, {style}"));
                compared += 1;
            }
            sheet.add(&picture);
        }
    }
    println!("{drawn} pictures drawn, {compared} compared");
    assert_eq!(drawn, meshes.len() * STYLES.len());
    sheet.store();
}

/// The models that this version reads: OBJ, STL, PLY, OFF, GLB and single-file glTF without
/// compression, and not of points alone.
pub fn readable(folder: &std::path::Path) -> Vec<(String, Mesh)> {
    let kinds = ["obj", "stl", "ply", "off", "glb", "gltf"];
    let is_mesh = |path: &std::path::PathBuf| {
        path.extension().is_some_and(|e| kinds.contains(&e.to_string_lossy().to_lowercase().as_str()))
    };
    data::files(folder)
        .into_iter()
        .filter(is_mesh)
        .filter_map(|path| {
            let mesh =
                scenes::mesh_of(&std::fs::read(&path).unwrap()).ok().filter(|mesh| !mesh.triangles.is_empty())?;
            Some((path.file_name().unwrap().to_string_lossy().into_owned(), mesh))
        })
        .collect()
}

fn assert_drawn(name: &str, style: &str, picture: &Image) {
    assert_eq!((picture.width_px, picture.height_px), (SIZE_PX, SIZE_PX), "{name}, {style}");
    let inked = picture.rgba.chunks(4).filter(|p| *p != [255; 4]).count();
    assert!(inked > 300, "{name}, {style}: only {inked} pixels are not background");
    // Fitted: something within 12 % of the border on two opposite sides, nothing on the border
    // itself.
    let at = |x: u32, y: u32| picture.pixel(x, y) != [255; 4];
    let last = SIZE_PX - 1;
    let edge = (0..SIZE_PX).any(|i| at(i, 0) || at(i, last) || at(0, i) || at(last, i));
    assert!(!edge, "{name}, {style}: cut off at the border");
    let band = SIZE_PX / 8;
    let touches = |f: &dyn Fn(u32, u32) -> bool| (0..band).any(|d| (0..SIZE_PX).any(|i| f(d, i)));
    let across = touches(&|d, i| at(d, i)) && touches(&|d, i| at(last - d, i));
    let along = touches(&|d, i| at(i, d)) && touches(&|d, i| at(i, last - d));
    assert!(across || along, "{name}, {style}: does not fill the frame");
}

/// All pictures, ten per row.
#[derive(Default)]
struct Sheet {
    pictures: Vec<Image>,
}

impl Sheet {
    fn add(&mut self, picture: &Image) {
        self.pictures.push(picture.clone());
    }

    fn store(&self) {
        let Some(path) = std::env::var_os("MESHSNAP_CONTACT_SHEET") else { return };
        let (columns, rows) = (10, self.pictures.len().div_ceil(10) as u32);
        let mut sheet = image::RgbaImage::new(columns * SIZE_PX, rows * SIZE_PX);
        for (i, picture) in (0..).zip(&self.pictures) {
            let tile = image::RgbaImage::from_raw(SIZE_PX, SIZE_PX, picture.rgba.to_vec()).unwrap();
            let (x, y) = (i % columns * SIZE_PX, i / columns * SIZE_PX);
            image::imageops::replace(&mut sheet, &tile, i64::from(x), i64::from(y));
        }
        sheet.save(path).unwrap();
    }
}
