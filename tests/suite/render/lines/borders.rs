//! Lines at the picture's border, where the mesh goes on beyond it: their pixels are those of the
//! same place in the middle of a larger picture.

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{DrawPlan, SkipKind};
use meshsnap_render::spec::WireThickness::Given;
use meshsnap_render::spec::color::Rgba;
use meshsnap_render::spec::{Hidden, Outline, OutlineMethod, OutlineUnit, Spec};

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{scenes, shapes};

/// Pixels that a larger picture has more on each side: an even number, since derivatives are taken
/// in blocks of 2 x 2 pixels, and more than the widest lines look at.
const MORE_PX: u32 = 64;

/// The tolerance for a moved origin of pixel coordinates, which rounds differently.
const SAME: Tolerance = Tolerance { max: 1, share: 0.002 };

/// A request's keys.
type Keys<'k> = &'k [(&'k str, &'k str)];

const CAMERAS: &[Keys<'_>] = &[
    &[("camera.eye", "0.2,0.35,0.3"), ("camera.target", "-0.8,0,-0.9"), ("camera.fov_deg", "80")],
    &[("camera.projection", "orthographic"), ("camera.height", "0.9"), ("camera.azimuth_deg", "20")],
    &[("camera.eye", "1.2,0.9,1.4"), ("camera.target", "0.3,0.1,0"), ("camera.fov_deg", "25")],
    &[("camera.eye", "-0.1,1.5,0.9"), ("camera.target", "0.3,0,0.1"), ("camera.fov_deg", "35")],
];

const RED: Rgba = Rgba([0.7, 0.05, 0.1, 0.8]);

/// Lines of a width that something may hide, each in its own way.
const LOOKS: &[fn(&mut Spec, f32)] = &[
    |spec, px| wire(spec, px, Hidden::Hide),
    |spec, px| wire(spec, px, Hidden::Fade),
    |spec, px| {
        spec.layers.wire = None;
        spec.layers.outline = Some(Outline {
            method: OutlineMethod::Contour,
            color: RED,
            thickness: Some(px),
            unit: OutlineUnit::Px,
            min_length: None,
        });
    },
    |spec, px| {
        wire(spec, px, Hidden::Hide);
        spec.layers.wire.iter_mut().for_each(|wire| wire.lit = true);
    },
    // Half of what hides them is only seen through something else.
    |spec, px| {
        wire(spec, px, Hidden::Hide);
        let mut glass = spec.layers;
        glass.surface.iter_mut().for_each(|surface| surface.opacity = 0.45);
        spec.materials = vec![("left".into(), glass)];
    },
];

fn outline(method: OutlineMethod, px: f32) -> Option<Outline> {
    Some(Outline { method, color: RED, thickness: Some(px), unit: OutlineUnit::Px, min_length: None })
}

fn wire(spec: &mut Spec, px: f32, hidden: Hidden) {
    spec.layers.wire.iter_mut().for_each(|wire| (wire.thickness, wire.hidden, wire.color) = (Given(px), hidden, RED));
}

fn meshes() -> [Mesh; 4] {
    [shapes::gear(9), shapes::two_balls(), shapes::sheet(9), shapes::torus(14)].map(|obj| scenes::mesh(&obj))
}

fn draw(renderer: &mut dyn Renderer, plan: &DrawPlan<'_>) -> Image {
    renderer.draw(plan, &Deadline::default()).unwrap()
}

/// Makes the plan that of a larger picture with the same view in its middle.
fn enlarge(plan: &mut DrawPlan<'_>) {
    (plan.width_px, plan.height_px) = (plan.width_px + 2 * MORE_PX, plan.height_px + 2 * MORE_PX);
}

/// The middle of such a picture.
fn middle(image: &Image) -> Image {
    let [width_px, height_px] = [image.width_px, image.height_px].map(|size| size - 2 * MORE_PX);
    let pixels = (0..height_px).flat_map(|y| (0..width_px).map(move |x| [x + MORE_PX, y + MORE_PX]));
    let at = |[x, y]: [u32; 2]| ((y * image.width_px + x) * 4) as usize;
    Image { width_px, height_px, rgba: pixels.flat_map(|p| image.rgba[at(p)..at(p) + 4].to_vec()).collect() }
}

/// Calls `each` with plans of lines at the border, and what they are.
fn each_plan(meshes: &[Mesh], mut each: impl FnMut(&mut DrawPlan<'_>, &str)) {
    for (m, mesh) in meshes.iter().enumerate() {
        for (c, camera) in CAMERAS.iter().enumerate() {
            for (w, px) in [1.0, 2.5, 9.0, 40.0].into_iter().enumerate() {
                let (look, samples) = ((m + 2 * c + 3 * w) % LOOKS.len(), ["1", "4", "8", "16"][(m + c + w) % 4]);
                let keys = [("style", "wire"), ("wire.edges", "polygons"), ("size", "90x70"), ("samples", samples)];
                let mut spec = scenes::spec(&[&keys[..], camera].concat());
                LOOKS[look](&mut spec, px);
                let name = format!("mesh {m}, camera {c}, {px} px, look {look}, {samples} samples");
                each(&mut scenes::plan(mesh, &spec), &name);
            }
        }
    }
}

#[test]
fn a_border_is_the_middle_of_a_larger_picture() {
    let mut gpus: Vec<GpuRenderer> =
        gpus().map_or(Vec::new(), |gpus| gpus.iter().map(|gpu| GpuRenderer::new(Arc::clone(gpu))).collect());
    let mut cpu = CpuRenderer::new(1);
    let (mut cases, mut leaking, mut turn) = (0, 0, 0);
    each_plan(&meshes(), |plan, name| {
        assert_eq!(plan.margin_px, plan.line_margin_rows(), "{name}");
        assert!(plan.margin_px > 0, "{name}: all of it is inside");
        let drawn = draw(&mut cpu, plan);
        let on_gpu = match gpus.len() {
            // With 64-bit atomics and without, by turns; there are as many kernels as pictures.
            count if count > 0 && turn % 2 == 0 => Some(draw(&mut gpus[turn / 2 % count], plan)),
            _ => None,
        };
        let margin = std::mem::take(&mut plan.margin_px);
        leaking += usize::from(!Likeness::of(&draw(&mut cpu, plan), &drawn).is_within(SAME));
        enlarge(plan);
        let want = middle(&draw(&mut cpu, plan));
        assert!(want.rgba.chunks(4).any(|pixel| pixel != &want.rgba[..4]), "{name} is blank");
        Likeness::of(&want, &drawn).assert(SAME, name);
        // A margin changes nothing of what lies deep inside.
        plan.margin_px = margin;
        assert!(middle(&draw(&mut cpu, plan)) == want, "{name}: with a margin around the larger picture");
        cases += 1;
        if let Some(on_gpu) = on_gpu {
            Likeness::of(&drawn, &on_gpu).assert(Tolerance::TWINS, &format!("{name}, GPU"));
            cases += 1;
        }
        turn += 1;
    });
    assert_eq!(cases, 64 + if gpus.is_empty() { 0 } else { 32 });
    // Else no line would have been at a border that something beyond it hides.
    assert!(leaking >= 12, "only {leaking} pictures need what is beyond them");
}

#[test]
fn a_request_for_a_larger_picture_has_the_same_middle() {
    // Of 90 x 70 and 218 x 198 pixels.
    let more = 198.0 / 70.0_f64;
    let fov = |deg: f64| (2.0 * ((0.5 * deg).to_radians().tan() * more).atan().to_degrees()).to_string();
    let cameras = [
        [[("camera.fov_deg", "40".to_owned())], [("camera.fov_deg", fov(40.0))]],
        [[("camera.height", "0.7".to_owned())], [("camera.height", (0.7 * more).to_string())]],
    ];
    let eyes = [["0.6,0,0.2", "0,0.6,0"], ["0.5,0.2,0.9", "0.6,0,0"], ["1.1,0.3,0.4", "-0.3,0,0.1"]];
    let mut cpu = CpuRenderer::new(2);
    let (mut cases, mut leaking) = (0, 0);
    for mesh in &meshes() {
        for (turn, [eye, target]) in eyes.iter().cycle().take(4 * eyes.len()).enumerate() {
            let (camera, has_hull) = (&cameras[turn / eyes.len() % 2], turn / eyes.len() / 2 == 1);
            let plan = |size: &str, [(key, value)]: &[(&str, String); 1]| {
                let projection = if *key == "camera.height" { "orthographic" } else { "perspective" };
                let mut spec = scenes::spec(&[
                    ("style", "wire"),
                    ("size", size),
                    ("camera.projection", projection),
                    ("camera.eye", eye),
                    ("camera.target", target),
                    (key, value),
                    ("wire.edges", "polygons"),
                    ("wire.thickness", "20"),
                ]);
                spec.layers.outline = outline(OutlineMethod::Hull, 7.0).filter(|_| has_hull);
                scenes::plan(mesh, &spec)
            };
            let name = format!("{:?} from {eye}, hull: {has_hull}", camera[0]);
            let mut drawn = plan("90x70", &camera[0]);
            let image = draw(&mut cpu, &drawn);
            let want = middle(&draw(&mut cpu, &plan("218x198", &camera[1])));
            // The view's rows are rounded by themselves, which moves a vertex by 1/256 px here and
            // there.
            let allowed = Tolerance { max: 2, share: 0.01 };
            Likeness::of(&want, &image).assert(allowed, &name);
            drawn.margin_px = 0;
            leaking += usize::from(!Likeness::of(&want, &draw(&mut cpu, &drawn)).is_within(allowed));
            cases += 1;
        }
    }
    assert_eq!(cases, 48);
    assert!(leaking >= 6, "only {leaking} pictures need what is beyond them");
}

#[test]
fn only_where_the_mesh_goes_on_there_are_samples_beyond_the_picture() {
    let mesh = scenes::mesh(&shapes::gear(9));
    let close = ("camera.eye", "0.9,0.7,1.1");
    let wide = ("wire.thickness", "20");
    let cases: [(Keys<'_>, bool, &str); 5] = [
        (&[("style", "wire")], false, "the whole mesh lies inside the picture"),
        (&[("style", "wire"), wide, close, ("camera.target", "0,0,0")], true, ""),
        (&[("style", "flat"), close, ("camera.target", "0,0,0")], false, "nothing asks what lies beyond a pixel"),
        (
            &[("style", "wireframe"), ("wire.hidden", "show"), close, ("camera.target", "0,0,0")],
            false,
            "nothing asks what lies beyond a pixel",
        ),
        (&[("style", "hidden-line"), close, ("camera.target", "0,0,0")], true, ""),
    ];
    for (keys, goes_on, why) in cases {
        let plan = scenes::plan(&mesh, &scenes::spec(&[&[("size", "120x90")], keys].concat()));
        assert_eq!(plan.margin_px > 0, goes_on, "{keys:?}");
        let skip = plan.skips.iter().find(|skip| skip.kind == SkipKind::Margin);
        assert_eq!(skip.map_or("", |skip| skip.why), why, "{keys:?}");
    }
}

#[test]
fn the_longest_sides_have_borders_too() {
    let mesh = scenes::mesh(&shapes::sheet(9));
    let mut cases = 0;
    for (size, samples, px) in [("4096x60", "4", "100"), ("60x4096", "4", "100"), ("4096x60", "16", "9")] {
        let keys = [
            ("style", "wire"),
            ("size", size),
            ("samples", samples),
            ("wire.thickness", px),
            ("wire.smoothing", "10"),
            ("camera.eye", "0.2,0.35,0.3"),
            ("camera.target", "-0.8,0,-0.9"),
        ];
        let plan = scenes::plan(&mesh, &scenes::spec(&keys));
        assert!(plan.margin_px >= 20, "{size}: {}", plan.margin_px);
        let [one, two] = [1, 3].map(|threads| draw(&mut CpuRenderer::new(threads), &plan));
        assert!(one == two, "{size}: threads");
        cases += 1;
        if let Some(gpus) = gpus() {
            let gpu = draw(&mut GpuRenderer::new(Arc::clone(&gpus[0])), &plan);
            Likeness::of(&one, &gpu).assert(Tolerance::TWINS, size);
        }
    }
    assert_eq!(cases, 3);
}
