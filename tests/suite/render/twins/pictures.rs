//! GPU against CPU: pictures that agree, within named tolerances, and workers that share a device.

use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::backend::{DrawError, Renderer};
use meshsnap_render::limits::Deadline;
use meshsnap_render::plan::ShadedMaterial;

use crate::render::golden;
use crate::support::gpus::{gpus, gpus_of_case};
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes::{self, SCENES};
use crate::support::shapes;
use crate::support::truth;

#[test]
fn pictures_of_the_scenes_agree() {
    if gpus().is_none() {
        return;
    }
    let (mut cases, mut drawn) = (0, 0);
    for scene in SCENES {
        let cpu = golden::draw(scene, &mut CpuRenderer::new(1));
        assert!(cpu.rgba.chunks(4).any(|pixel| pixel != &cpu.rgba[..4]), "{} is blank", scene.name);
        for gpu in gpus_of_case(drawn) {
            let mut renderer = GpuRenderer::new(gpu.clone());
            // Twice for some: the second picture comes from buffers that the first has used.
            for _ in 0..truth::cases(1 + usize::from(drawn % 3 == 0), 2) {
                let picture = golden::draw(scene, &mut renderer);
                Likeness::of(&cpu, &picture).assert(Tolerance::TWINS, scene.name);
                cases += 1;
            }
        }
        drawn += 1;
    }
    assert_eq!(cases, truth::cases(SCENES.len() + SCENES.len().div_ceil(3), 4 * SCENES.len()));
}

#[test]
fn long_and_wide_lines_on_large_pictures_agree() {
    if gpus().is_none() {
        return;
    }
    let obj = shapes::cube();
    let mesh = scenes::mesh(&obj);
    let looks: [&[(&str, &str)]; 4] = [
        &[("size", "4096x300"), ("style", "wire"), ("wire.thickness", "9")],
        &[("size", "300x4096"), ("style", "wireframe"), ("view", "front")],
        &[("size", "2000x2000"), ("style", "wire"), ("wire.smoothing", "4"), ("samples", "1")],
        // More than one band.
        &[("size", "4096x4096"), ("style", "wire"), ("wire.edges", "polygons"), ("background", "transparent")],
    ];
    let mut cases = 0;
    for keys in looks {
        let spec = scenes::spec(keys);
        let plan = scenes::plan(&mesh, &spec);
        let deadline = Deadline::default();
        let cpu = CpuRenderer::new(2).draw(&plan, &deadline).unwrap();
        let gpu = GpuRenderer::new(gpus().unwrap()[0].clone()).draw(&plan, &deadline).unwrap();
        Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{keys:?}"));
        cases += 1;
    }
    assert_eq!(cases, 4);
}

#[test]
fn a_stopped_job_leaves_a_working_renderer() {
    let Some(gpus) = gpus() else { return };
    let mut renderer = GpuRenderer::new(gpus[0].clone());
    let want = golden::draw(&SCENES[0], &mut CpuRenderer::new(1));
    let mesh = scenes::mesh(&(SCENES[0].obj)());
    let spec = SCENES[0].spec();
    let plan = scenes::plan(&mesh, &spec);
    let mut stopped = 0;
    // Raised at once, and by another thread at some point on the way.
    for delay_us in [0, 1, 300, 1000, 3000] {
        let deadline = Deadline::default();
        let other = deadline.clone();
        let clock = std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_micros(delay_us));
            other.stop();
        });
        if delay_us == 0 {
            deadline.stop();
        }
        match renderer.draw(&plan, &deadline) {
            Err(DrawError::Stopped(_)) => stopped += 1,
            Err(error) => panic!("{error}"),
            Ok(_) => {}
        }
        clock.join().unwrap();
        let image = renderer.draw(&plan, &Deadline::default()).unwrap();
        Likeness::of(&want, &image).assert(Tolerance::TWINS, "after a stopped job");
    }
    assert!(stopped >= 1);
}

#[test]
fn workers_share_a_device() {
    let Some(gpus) = gpus() else { return };
    let drawn = std::sync::atomic::AtomicUsize::new(0);
    let each = truth::cases(10, SCENES.len());
    std::thread::scope(|scope| {
        for worker in 0..4 {
            let drawn = &drawn;
            scope.spawn(move || {
                let mut renderer = GpuRenderer::new(gpus[0].clone());
                for i in 0..each {
                    let scene = &SCENES[(i * 5 + worker) % SCENES.len()];
                    let cpu = golden::draw(scene, &mut CpuRenderer::new(1));
                    Likeness::of(&cpu, &golden::draw(scene, &mut renderer)).assert(Tolerance::TWINS, scene.name);
                    drawn.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                }
            });
        }
    });
    assert_eq!(drawn.into_inner(), 4 * each);
}

#[test]
fn materials_masks_and_normals_agree() {
    let Some(gpus) = gpus() else { return };
    let mesh = scenes::mesh(&shapes::torus(20));
    let materials: Vec<u32> = (0..mesh.triangles.len() as u32).map(|t| t / 7 % 3).collect();
    let mut cases = 0;
    for style in ["flat", "smooth", "unlit"] {
        for edges in ["triangles", "polygons"] {
            for samples in ["1", "4", "8", "16"] {
                let spec = scenes::spec(&[
                    ("style", style),
                    ("size", "150x110"),
                    ("samples", samples),
                    ("wire.method", "fwidth"),
                    ("wire.edges", edges),
                    ("wire.opacity", "0.7"),
                ]);
                let mut plan = scenes::plan(&mesh, &spec);
                let surface = plan.surface.as_mut().unwrap();
                let colors = [[0.8, 0.1, 0.1, 1.0], [0.1, 0.7, 0.2, 1.0], [0.2, 0.2, 0.9, 0.5]];
                let first = surface.materials[0];
                surface.materials = colors.map(|base_color| ShadedMaterial { base_color, ..first }).to_vec();
                surface.triangle_materials = (&materials).into();
                plan.background = [0.0; 4];
                let cpu = CpuRenderer::new(1).draw(&plan, &Deadline::default()).unwrap();
                let is_mostly = |channel: usize| cpu.rgba.chunks(4).any(|p| p[channel] > 128 && p[2 - channel] < 100);
                assert!(is_mostly(0) && is_mostly(2), "{style}: not all materials are seen");
                let gpu = GpuRenderer::new(gpus[0].clone()).draw(&plan, &Deadline::default()).unwrap();
                Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{style} {edges} {samples}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 24);
}
