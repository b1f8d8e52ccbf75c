//! Pictures stay in the memory that the GPU has written, until their last reader drops them. No
//! other job overwrites them meanwhile, and their memory is reused or freed afterwards.

use std::sync::Arc;

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::gpu::{AtomicsChoice, Gpu, GpuKind, GpuRenderer};
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::plan;
use meshsnap_render::scene::Scene;

use crate::support::gpus::gpus;
use crate::support::{scenes, shapes};

#[test]
fn pictures_stay_as_they_are_while_others_are_drawn_and_dropped() {
    let Some(gpus) = gpus() else { return };
    let (mesh, limits, deadline) = (scenes::mesh(&shapes::torus(12)), Limits::default(), Deadline::default());
    for gpu in gpus {
        let mut renderer = GpuRenderer::new(gpu.clone());
        let mut draw = |azimuth: u32| -> Image {
            let spec = scenes::spec(&[("size", "48x40"), ("camera.azimuth_deg", &azimuth.to_string())]);
            let scene = Scene::new(&mesh, &spec, &mut Budget::new(&limits)).unwrap();
            let plan = plan::build(&scene, &mut Budget::new(&limits), &deadline).unwrap();
            renderer.draw(&plan, &deadline).unwrap()
        };
        let copies: Vec<Vec<u8>> = (0..6).map(|number| draw(20 * number).rgba.into_vec()).collect();
        assert!(copies.windows(2).all(|pair| pair[0] != pair[1]));
        let mut held: Vec<Option<Image>> = Vec::new();
        for round in 0..4 {
            held.extend((0..6).map(|number| Some(draw(20 * number))));
            // Every third is given back, so that those which follow are drawn where it was.
            held.iter_mut().skip(round).step_by(3).for_each(|image| *image = None);
            for (number, image) in held.iter().enumerate() {
                assert!(image.as_ref().is_none_or(|image| *image.rgba == copies[number % 6]), "{round} {number}");
            }
        }
        assert_eq!(held.iter().flatten().count(), 6);
        let image = draw(0);
        let mut painted = image.clone();
        painted.rgba[..4].copy_from_slice(&[1, 2, 3, 4]);
        assert_eq!((painted.pixel(0, 0), &*image.rgba), ([1, 2, 3, 4], &copies[0][..]));
        assert_eq!(painted.rgba[4..], copies[0][4..]);
    }
}

/// A renderer that is gone leaves its pictures, and what they lie in does not stay behind.
#[test]
fn pictures_outlive_their_renderer() {
    if gpus().is_none() {
        return;
    }
    // Nobody else draws on it.
    let gpu = Arc::new(Gpu::open(GpuKind::Any, AtomicsChoice::Best, None).unwrap());
    let (mesh, limits, deadline) = (scenes::mesh(&shapes::cube()), Limits::default(), Deadline::default());
    let spec = scenes::spec(&[("size", "48x40")]);
    let scene = Scene::new(&mesh, &spec, &mut Budget::new(&limits)).unwrap();
    let plan = plan::build(&scene, &mut Budget::new(&limits), &deadline).unwrap();
    let image = GpuRenderer::new(gpu.clone()).draw(&plan, &deadline).unwrap();
    let copy = image.rgba.to_vec();
    assert!(copy.chunks(4).any(|pixel| pixel != &copy[..4]));
    let mut renderer = GpuRenderer::new(gpu.clone());
    let again = renderer.draw(&plan, &deadline).unwrap();
    assert!(*image.rgba == copy && *again.rgba == copy);
    let before = gpu.spare_bytes();
    drop(image);
    assert!(gpu.spare_bytes() > before);
    drop(renderer);
    assert_eq!(gpu.spare_bytes(), 0);
    drop(again);
    assert_eq!(gpu.spare_bytes(), 0);
}
