//! Outlines of glass, and outlines that differ from part to part.

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::spec::{Hidden, Layers, Spec};

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::scenes;
use crate::support::shapes::{self, Obj};

/// Draws on the CPU, and on the GPU what must be the same.
fn draw(plan: &DrawPlan<'_>, what: &str) -> Image {
    let picture = CpuRenderer::new(2).draw(plan, &Deadline::default()).unwrap();
    for gpu in gpus().into_iter().flatten() {
        let other = GpuRenderer::new(gpu.clone()).draw(plan, &Deadline::default()).unwrap();
        Likeness::of(&picture, &other).assert(Tolerance::TWINS, what);
    }
    picture
}

fn outlined(view: &'static str) -> Spec {
    scenes::spec(&[
        ("style", "outline"),
        ("surface.shading", "unlit"),
        ("surface.color", "e0e0e0"),
        ("outline.unit", "px"),
        ("outline.thickness", "4"),
        ("view", view),
        ("size", "200x160"),
        ("background", "transparent"),
    ])
}

fn glass(layers: &mut Layers) {
    layers.surface.iter_mut().for_each(|surface| surface.opacity = 0.4);
}

fn is_black(pixel: &[u8]) -> bool {
    pixel[3] > 200 && pixel[..3].iter().all(|&v| v < 60)
}

#[test]
fn glass_does_not_show_the_back_of_its_own_outline() {
    let mut obj = Obj::default();
    obj.ball([0.0; 3], 1.0, 40);
    let mesh = scenes::mesh(&obj.finish());
    let mut spec = outlined("front");
    glass(&mut spec.layers);
    let mut plan = scenes::plan(&mesh, &spec);
    let with = draw(&plan, "with its outline");
    plan.hull = None;
    let without = draw(&plan, "without");
    let (mut inside, mut ring) = (0, 0);
    for (with, without) in with.rgba.chunks(4).zip(without.rgba.chunks(4)) {
        // Two layers of opacity 0.4 in all samples.
        if without[3] == 163 {
            assert_eq!(with, without);
            inside += 1;
        }
        ring += usize::from(without[3] == 0 && is_black(with));
    }
    assert!(inside > 5000 && ring > 800, "{inside} pixels of glass, {ring} around it");
}

#[test]
fn glass_shows_the_outlines_of_others_behind_it() {
    // From the left, the ball named "right" is larger and behind the other.
    let mesh = scenes::mesh(&shapes::two_balls());
    let mut spec = outlined("left");
    spec.camera.projection = meshsnap_render::spec::ProjectionKind::Orthographic;
    glass(&mut spec.layers);
    let mut rear = spec.layers;
    spec.layers.outline = None;
    rear.outline.iter_mut().for_each(|outline| outline.thickness = Some(2.0));
    spec.materials = vec![("left".into(), rear)];
    spec.camera.view = meshsnap_render::spec::NamedView::Right;
    // Now the one named "left", which has an outline, is behind.
    let plan = scenes::plan(&mesh, &spec);
    let shown = draw(&plan, "another's outline behind glass");
    let mut merged = scenes::plan(&mesh, &spec);
    if let Some(hull) = &mut merged.hull {
        hull.surface_materials = Default::default();
        hull.triangle_materials = Vec::new();
    }
    let hidden = draw(&merged, "its own outline behind glass");
    let darker = shown.rgba.chunks(4).zip(hidden.rgba.chunks(4)).filter(|(a, b)| a[3] > b[3] + 20).count();
    assert!(darker > 300, "{darker} pixels of outline shine through");
}

#[test]
fn only_the_parts_that_want_one_have_an_outline() {
    let mesh = scenes::mesh(&shapes::two_balls());
    for is_glass in [false, true] {
        let mut spec = outlined("front");
        if is_glass {
            glass(&mut spec.layers);
        }
        spec.materials = vec![("right".into(), Layers { outline: None, ..spec.layers })];
        let [left, right] = black_by_side(&mesh, &spec);
        assert!(left > 300 && right == 0, "{left} and {right} black pixels, glass: {is_glass}");
    }
}

#[test]
fn outlines_may_be_thicker_on_one_part() {
    let mesh = scenes::mesh(&shapes::two_balls());
    for (unit, thin, thick) in [("px", 2.0, 8.0), ("object", 0.03, 0.12)] {
        let mut spec = outlined("front");
        let thickness = |mut layers: Layers, t| {
            if let Some(outline) = &mut layers.outline {
                outline.unit = match unit {
                    "px" => meshsnap_render::spec::OutlineUnit::Px,
                    _ => meshsnap_render::spec::OutlineUnit::Object,
                };
                outline.thickness = Some(t);
            }
            layers
        };
        spec.materials = vec![("left".into(), thickness(spec.layers, thin))];
        spec.layers = thickness(spec.layers, thick);
        let [left, right] = black_by_side(&mesh, &spec);
        assert!(left > 50 && right > 3 * left, "{unit}: {left} and {right} black pixels");
    }
}

/// Black pixels in each half of the picture.
fn black_by_side(mesh: &Mesh, spec: &Spec) -> [usize; 2] {
    let picture = draw(&scenes::plan(mesh, spec), "two balls");
    let width = picture.width_px as usize;
    let black = |right: bool| {
        let is_there = |i: usize| (i % width >= width / 2) == right;
        picture.rgba.chunks(4).enumerate().filter(|(i, pixel)| is_there(*i) && is_black(pixel)).count()
    };
    [black(false), black(true)]
}

#[test]
fn a_part_that_hides_its_wires_keeps_those_in_front_where_another_shows_all() {
    let mesh = scenes::mesh(&shapes::two_balls());
    let mut spec =
        scenes::spec(&[("style", "wire"), ("wire.method", "fwidth"), ("view", "front"), ("size", "200x160")]);
    spec.layers.wire.iter_mut().for_each(|wire| wire.hidden = Hidden::Hide);
    let all_hide = draw(&scenes::plan(&mesh, &spec), "all hide");
    let mut shows = spec.layers;
    shows.wire.iter_mut().for_each(|wire| wire.hidden = Hidden::Show);
    spec.materials = vec![("right".into(), shows)];
    let plan = scenes::plan(&mesh, &spec);
    assert!(plan.peeling.is_some_and(|layers| layers.wires_only && layers.behind_surface));
    let one_shows = draw(&plan, "one shows");
    let differing = |right: bool| {
        let pixels = all_hide.rgba.chunks(4).zip(one_shows.rgba.chunks(4)).enumerate();
        pixels.filter(|(i, (a, b))| (i % 200 >= 100) == right && a != b).count()
    };
    assert_eq!(differing(false), 0);
    assert!(differing(true) > 300, "{} pixels", differing(true));
}
