//! Pictures that the GPU draws together are those that it draws one by one, to the bit.

use std::sync::Arc;
use std::thread;

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{self, DrawPlan, Prepared};
use meshsnap_render::scene::Scene;

use crate::support::gpus::gpus;
use crate::support::{scenes, shapes};

type Keys<'a> = &'a [(&'a str, &'a str)];

const LOOKS: &[Keys<'static>] = &[
    &[("style", "flat")],
    &[("style", "smooth"), ("samples", "1")],
    &[("style", "flat"), ("samples", "16"), ("background", "transparent")],
    &[("style", "flat"), ("samples", "8"), ("image.background", "#fff..#224")],
    &[("style", "smooth"), ("light.preset", "three-point"), ("surface.metallic", "1")],
    &[("style", "wire"), ("wire.method", "fwidth"), ("wire.edges", "triangles")],
    &[("style", "unlit"), ("surface.color", "c40")],
    &[("style", "auto")],
    &[("style", "clay"), ("samples", "1")],
];

/// Plans of a mesh from as many sides, and what they have in common.
fn with_plans<T>(mesh: &Mesh, look: Keys<'_>, sizes: &[&str], then: impl FnOnce(&[DrawPlan<'_>]) -> T) -> T {
    let (limits, deadline, prepared) = (Limits::default(), Deadline::default(), Prepared::default());
    let specs: Vec<_> = sizes
        .iter()
        .enumerate()
        .map(|(number, size)| {
            let azimuth = (23 * number).to_string();
            scenes::spec(&[look, &[("size", size), ("camera.azimuth_deg", &azimuth)]].concat())
        })
        .collect();
    let scenes: Vec<_> = specs.iter().map(|spec| Scene::new(mesh, spec, &mut Budget::new(&limits)).unwrap()).collect();
    let build = |scene| plan::build_from(scene, &prepared, &mut Budget::new(&limits), &deadline).unwrap();
    then(&scenes.iter().map(build).collect::<Vec<_>>())
}

#[test]
fn a_gang_draws_what_its_jobs_draw_alone() {
    let Some(gpus) = gpus() else { return };
    let deadline = Deadline::default();
    let meshes = [shapes::cube(), shapes::torus(12), shapes::gear(7)].map(|obj| scenes::mesh(&obj));
    let (mut together, mut alone) = (0, 0);
    for (mesh, look) in meshes.iter().flat_map(|mesh| LOOKS.iter().map(move |look| (mesh, *look))) {
        for gpu in gpus {
            let mut renderer = GpuRenderer::new(gpu.clone());
            for count in [3, 16] {
                with_plans(mesh, look, &vec!["40x28"; count], |plans| {
                    let Some(drawn) = renderer.draw_together(&plans.iter().collect::<Vec<_>>()).unwrap() else {
                        alone += 1;
                        return;
                    };
                    assert_eq!(drawn.len(), count);
                    for (number, (plan, rgba)) in plans.iter().zip(drawn).enumerate() {
                        let want = renderer.draw(plan, &deadline).unwrap();
                        assert!(want.rgba == rgba, "{look:?}, {number} of {count}");
                    }
                    together += 1;
                });
            }
        }
    }
    println!("{together} gangs, {alone} that were none");
    // A software device with 64-bit atomics reads how long its work lists are, unless they are short.
    assert!(together >= 3 * LOOKS.len() * 2, "{together}");
    assert_eq!(together + alone, 3 * LOOKS.len() * 2 * 2);
}

#[test]
fn plans_that_differ_in_more_than_the_camera_are_drawn_alone() {
    let Some([_, gpu]) = gpus() else { return };
    let mut renderer = GpuRenderer::new(gpu.clone());
    let (cube, other) = (scenes::mesh(&shapes::cube()), scenes::mesh(&shapes::cube()));
    let mut refused = 0;
    let mut is_refused = |plans: &[&DrawPlan<'_>]| {
        assert!(renderer.draw_together(plans).unwrap().is_none());
        refused += 1;
    };
    const FLAT: Keys<'static> = &[("style", "flat")];
    for look in [&[("style", "outline")], &[("style", "wire")], &[("style", "technical")]] {
        with_plans(&cube, look, &["60", "60"], |plans| is_refused(&plans.iter().collect::<Vec<_>>()));
    }
    with_plans(&cube, FLAT, &["60", "61"], |plans| is_refused(&plans.iter().collect::<Vec<_>>()));
    with_plans(&cube, FLAT, &["60"; 17], |plans| is_refused(&plans.iter().collect::<Vec<_>>()));
    with_plans(&cube, FLAT, &["60"], |a| {
        with_plans(&other, FLAT, &["60"], |b| is_refused(&[&a[0], &b[0]]));
        let red = [("style", "flat"), ("surface.color", "f00")];
        with_plans(&cube, &red, &["60"], |b| is_refused(&[&a[0], &b[0]]));
        let finer = [("style", "flat"), ("samples", "8")];
        with_plans(&cube, &finer, &["60"], |b| is_refused(&[&a[0], &b[0]]));
    });
    assert_eq!(refused, 8);
}

/// Many workers draw at the same time; one device behaves as hardware does, and lets jobs share.
#[test]
fn pictures_of_many_workers_are_right_whoever_shares() {
    let Some(gpus) = gpus() else { return };
    let mesh = Arc::new(scenes::mesh(&shapes::torus(12)));
    let gpu = &gpus[1];
    let before = gpu.jobs_shared();
    let drawn = with_plans(&mesh, LOOKS[0], &["64"; 24], |plans| {
        let mut renderer = GpuRenderer::new(gpu.clone());
        let want: Vec<_> = plans.iter().map(|plan| renderer.draw(plan, &Deadline::default()).unwrap().rgba).collect();
        thread::scope(|scope| {
            let worker = |first: usize| {
                let (mut renderer, mut drawn) = (GpuRenderer::new(gpu.clone()), 0);
                for at in (0..20).map(|n| (first * 5 + n) % plans.len()) {
                    // Some give up.
                    let deadline = if at % 11 == 3 { Deadline::after_polls(4) } else { Deadline::default() };
                    if let Ok(image) = renderer.draw(&plans[at], &deadline) {
                        assert!(image.rgba == want[at], "picture {at}");
                        drawn += 1;
                    }
                }
                drawn
            };
            let workers: Vec<_> = (0..24).map(|first| scope.spawn(move || worker(first))).collect();
            workers.into_iter().map(|worker| worker.join().unwrap()).sum::<usize>()
        })
    });
    let shared = gpu.jobs_shared() - before;
    println!("{drawn} drawn, {shared} of them together with others");
    assert!(drawn > 300 && shared > 50, "{drawn} {shared}");
}
