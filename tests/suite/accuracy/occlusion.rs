//! The accuracy of ambient occlusion, the light that hollows lose, against the oracle's many rays
//! per pixel; and that planes lose none.

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::oracle::screen::Screen;
use crate::oracle::surface::occlusion::shut;
use crate::oracle::surface::srgb;
use crate::support::scenes;
use crate::support::seen::only_triangle;
use crate::support::shapes;
use crate::support::truth::{cases, renderers, scene};

/// RMSE of a picture's bytes against 4096 rays per pixel.
const GOAL: f64 = 3.0;

/// Pixels from one that is compared to the next.
const STEP: u32 = 7;

/// Directions, and distances in each.
const SIDE: u32 = 64;

/// A picture in light from everywhere, with the strength of its occlusion.
fn keys<'a>(view: &'a str, projection: &'a str, strength: &'a str) -> [(&'a str, &'a str); 7] {
    [
        ("size", "200x160"),
        ("style", "flat"),
        ("light.preset", "none"),
        ("surface.color", "c08040"),
        ("view", view),
        ("camera.projection", projection),
        ("light.ambient_occlusion", strength),
    ]
}

#[test]
fn occlusion_is_that_of_many_rays() {
    type Case = (&'static str, fn() -> String);
    let shapes: [Case; 5] = [
        ("boxes", shapes::boxes_on_a_floor),
        ("gear", || shapes::gear(9)),
        ("torus", || shapes::torus(24)),
        ("balls", shapes::two_balls),
        ("sheet", || shapes::sheet(12)),
    ];
    let mut missed = Vec::new();
    let mut renderers = renderers();
    let (mut compared, mut drawn) = (0, 0);
    let views = [("auto", "perspective"), ("front", "orthographic"), ("top", "perspective")];
    for (name, obj) in shapes {
        let mesh = scenes::mesh(&obj());
        for (view, projection) in &views[..cases(2, 3)] {
            let [plain, dark] = ["0", "1"].map(|strength| scenes::spec(&keys(view, projection, strength)));
            let truth = truth(&mesh, &plain);
            for renderer in &mut renderers {
                let [plain, dark] = [&plain, &dark]
                    .map(|spec| renderer.draw(&scenes::plan(&mesh, spec), &Deadline::default()).unwrap());
                let (rmse, without) = (rmse(&truth, &plain, &dark), rmse(&truth, &plain, &plain));
                let what = format!("- {name}, {view}, {projection}, {}", renderer.kind().name());
                println!("{what:<44} RMSE {rmse:.2} of {} pixels (goal {GOAL}; without it {without:.2})", truth.len());
                if rmse > GOAL {
                    missed.push(format!("{what}: {rmse}"));
                }
                drawn += 1;
            }
            compared += truth.len();
        }
    }
    assert_eq!(drawn, 5 * cases(2, 3) * renderers.len());
    assert!(compared > 1000, "{compared}");
    assert!(missed.is_empty(), "{}", missed.join("\n"));
}

/// Pixels that show one face, and the light that they go without.
fn truth(mesh: &Mesh, spec: &meshsnap_render::spec::Spec) -> Vec<([u32; 2], f64)> {
    let plan = scenes::plan(mesh, spec);
    let scene = scene(&plan);
    let screen = Screen::new(&scene);
    let mut truth = Vec::new();
    for y in (0..plan.height_px).step_by(STEP as usize) {
        for x in (0..plan.width_px).step_by(STEP as usize) {
            if only_triangle(&screen, [x, y]).is_some() {
                let center = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                truth.extend(shut(&scene, &screen, center, SIDE).map(|shut| ([x, y], shut)));
            }
        }
    }
    truth
}

/// Of a picture's bytes, given one without occlusion.
fn rmse(truth: &[([u32; 2], f64)], plain: &Image, dark: &Image) -> f64 {
    let mut squares = 0.0;
    for &([x, y], shut) in truth {
        let (plain, dark) = (plain.pixel(x, y), dark.pixel(x, y));
        for k in 0..3 {
            let light = srgb::to_linear(f64::from(plain[k]) / 255.0) * (1.0 - shut);
            squares += (255.0 * srgb::from_linear(light) - f64::from(dark[k])).powi(2);
        }
    }
    (squares / (3 * truth.len()) as f64).sqrt()
}

/// However it is seen, what is flat stays as it is, to the byte, and so does what bends outwards, but for
/// corners that are thinner than two pixels: there a normal may lie between those of two faces.
#[test]
fn planes_and_cubes_lose_no_light() {
    let plane = "v -1 -1 0\nv 1 -1 0.3\nv 1 1 0.1\nv -1 1 -0.2\nf 1 2 3\n";
    let mut renderers = renderers();
    let mut compared = 0;
    for (obj, pixels_max, steps_max) in [(plane.to_owned(), 0, 0), (shapes::cube(), 64, 24)] {
        let mesh = scenes::mesh(&obj);
        for view in ["auto", "iso", "front", "left", "top"] {
            for (projection, fov) in
                [("perspective", "35"), ("perspective", "120"), ("perspective", "0.5"), ("orthographic", "35")]
            {
                let specs = ["0", "1"].map(|strength| {
                    let mut keys = keys(view, projection, strength).to_vec();
                    keys.push(("camera.fov_deg", fov));
                    scenes::spec(&keys)
                });
                for renderer in &mut renderers {
                    let [plain, dark] = specs
                        .each_ref()
                        .map(|spec| renderer.draw(&scenes::plan(&mesh, spec), &Deadline::default()).unwrap());
                    let steps = plain.rgba.chunks(4).zip(dark.rgba.chunks(4));
                    let steps = steps.map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0));
                    let (pixels, most) = (steps.clone().filter(|&v| v > 0).count(), steps.max().unwrap_or(0));
                    let what = format!("{view}, {projection}, {fov}, {}", renderer.kind().name());
                    assert!(pixels <= pixels_max && most <= steps_max, "{what}: {pixels} pixels, up to {most}");
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, 40 * renderers.len());
}

/// A renderer keeps its buffers from picture to picture, and nothing of what was in them shows.
#[test]
fn pictures_do_not_depend_on_those_before() {
    let mesh = scenes::mesh(&shapes::gear(9));
    let mut kept = CpuRenderer::new(1);
    let sizes = ["120x80", "97x61", "61x97", "96x62", "120x80"];
    for size in sizes {
        let keys = [("size", size), ("style", "outline"), ("camera.margin", "0"), ("outline.unit", "px")];
        let spec = scenes::spec(&keys);
        let plan = scenes::plan(&mesh, &spec);
        let [again, fresh] =
            [&mut kept, &mut CpuRenderer::new(1)].map(|r| r.draw(&plan, &Deadline::default()).unwrap());
        assert!(again.rgba == fresh.rgba, "{size}");
    }
}
