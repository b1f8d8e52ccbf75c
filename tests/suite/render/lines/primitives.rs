//! Line and point primitives, which have no area: they are drawn as wide as documented, and nothing
//! else changes because of them.

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::{LineOrPoint, Mesh};
use meshsnap_render::plan;
use meshsnap_render::plan::DrawPlan;
use meshsnap_render::scene::Scene;
use meshsnap_render::spec::Spec;
use meshsnap_render::warning::Warning;

use crate::support::gpus::gpus;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{scenes, shapes};

/// Pixels.
const LINE_PX: f64 = 1.5;
const POINT_PX: f64 = 3.0;

/// A mesh of nothing but these.
fn alone(positions: &[[f32; 3]], loose: &[LineOrPoint]) -> Mesh {
    let mut mesh = Mesh { positions: positions.to_vec(), lines_and_points: loose.to_vec(), ..Mesh::default() };
    mesh.materials.push(Default::default());
    mesh
}

/// A cube, a line from before it through it, one beside it, and points at its corners.
fn cube() -> Mesh {
    let mut mesh = scenes::mesh(&shapes::cube());
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([[0.0, 0.1, 1.4], [0.0, 0.0, -1.4], [0.9, -0.5, 0.0], [0.9, 0.5, 0.3]]);
    mesh.lines_and_points = vec![segment(first, first + 1), segment(first + 2, first + 3)];
    mesh.lines_and_points.extend((0..8).map(|v| LineOrPoint::point(v, 0)));
    mesh
}

fn segment(a: u32, b: u32) -> LineOrPoint {
    LineOrPoint { ends: [a, b], material: 0 }
}

fn warning(mesh: &Mesh, spec: &Spec) -> Option<Warning> {
    let scene = Scene::new(mesh, spec, &mut Budget::new(&Limits::default())).unwrap();
    plan::undrawn_primitives(&scene)
}

fn draw(plan: &DrawPlan<'_>) -> Image {
    CpuRenderer::new(1).draw(plan, &Deadline::default()).unwrap()
}

/// The area that black covers of white, pixels.
fn ink_px2(image: &Image) -> f64 {
    let linear = |v: u8| {
        let v = f64::from(v) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    image.rgba.chunks(4).map(|p| 1.0 - linear(p[0])).sum()
}

/// Pixels from the picture's centre.
fn on_screen(plan: &DrawPlan<'_>, v: usize) -> [f64; 2] {
    let (p, at) = (&plan.projection, plan.positions[v].map(f64::from));
    let row = |row: [f32; 4]| (0..3).map(|k| f64::from(row[k]) * at[k]).sum::<f64>() + f64::from(row[3]);
    [row(p.x) / row(p.w) / 256.0, row(p.y) / row(p.w) / 256.0]
}

const BLACK: &[(&str, &str)] = &[("style", "unlit"), ("surface.color", "000"), ("size", "200x160"), ("samples", "16")];

#[test]
fn widths_are_in_pixels_however_far_away() {
    let positions = [[-0.4, -0.3, 0.5], [0.45, 0.2, -0.5], [0.1, 0.4, 0.3], [-0.3, -0.5, -0.2]];
    let mut cases = 0;
    for (a, b) in [(0, 1), (1, 2), (2, 3), (0, 0), (1, 1), (2, 2), (3, 3)] {
        for projection in ["perspective", "orthographic"] {
            // The other positions keep the camera where it is.
            let mesh = alone(&positions, &[LineOrPoint { ends: [a, b], material: 0 }]);
            let spec = scenes::spec(&[BLACK, &[("camera.projection", projection)]].concat());
            assert_eq!(warning(&mesh, &spec), None);
            let plan = scenes::plan(&mesh, &spec);
            let [from, to] = [a, b].map(|v| on_screen(&plan, v as usize));
            let length = (from[0] - to[0]).hypot(from[1] - to[1]);
            let round = std::f64::consts::PI * 0.25 * POINT_PX * POINT_PX;
            let expected = if a == b { round } else { (length + LINE_PX) * LINE_PX };
            let ink = ink_px2(&draw(&plan));
            // A byte's steps at either end of the line count too.
            assert!((ink / expected - 1.0).abs() < 0.04, "{a} {b} {projection}: {ink} px^2 instead of {expected}");
            cases += 1;
        }
    }
    assert_eq!(cases, 14);
}

#[test]
fn what_is_behind_the_eye_is_cut_away() {
    let positions = [[0.0, 0.0, 0.5], [0.05, 0.02, -0.5], [0.3, 0.2, 0.5]];
    let camera = [("camera.eye", "[0,0,0]"), ("camera.target", "[0,0,-1]")];
    let ink = |loose: &[LineOrPoint]| {
        let mesh = alone(&positions, loose);
        let spec = scenes::spec(&[BLACK, &camera].concat());
        let plan = scenes::plan(&mesh, &spec);
        assert!(plan.positions.iter().flatten().all(|v| v.is_finite()));
        ink_px2(&draw(&plan))
    };
    assert!(ink(&[segment(0, 1)]) > 20.0);
    assert!(ink(&[segment(1, 2)]) > 20.0);
    assert_eq!(ink(&[segment(0, 2)]), 0.0);
    assert_eq!(ink(&[LineOrPoint::point(0, 0)]), 0.0);
}

#[test]
fn they_have_neither_edges_nor_outlines() {
    let mut cases = 0;
    for keys in [
        &[("style", "wire")][..],
        &[("style", "wire"), ("wire.method", "fwidth")],
        &[("style", "outline"), ("outline.unit", "px"), ("outline.thickness", "3")],
        &[("style", "outline"), ("outline.method", "contour")],
        &[("style", "topology")],
    ] {
        let spec = scenes::spec(&[keys, &[("size", "160x120")]].concat());
        // Seen by the same camera.
        let (mut bare, mesh) = (cube(), cube());
        bare.lines_and_points.clear();
        let (without, with) = (scenes::plan(&bare, &spec), scenes::plan(&mesh, &spec));
        assert_eq!(with.triangles.len(), without.triangles.len() + 2 * 2 + 8 * 4);
        assert!(without.lines.iter().zip(&with.lines).all(|(a, b)| a.edges.len() == b.edges.len()));
        assert_eq!(without.lines.len(), with.lines.len());
        let own = without.triangles.len();
        let hull = |plan: &DrawPlan<'_>| plan.hull.as_ref().map(|hull| hull.triangles.len());
        assert_eq!(hull(&with), hull(&without));
        if let Some(surface) = &with.surface {
            assert!(surface.edge_masks.iter().skip(own).all(|&mask| mask == 0));
        }
        cases += 1;
    }
    assert_eq!(cases, 5);
}

#[test]
fn both_back_ends_draw_them_alike() {
    let Some(gpus) = gpus() else { return };
    let mut gpu = GpuRenderer::new(Arc::clone(&gpus[0]));
    let mut cases = 0;
    for style in ["flat", "smooth", "wire", "outline", "hidden-line", "topology"] {
        for opacity in ["1", "0.5"] {
            let spec = scenes::spec(&[("style", style), ("size", "160x120"), ("surface.opacity", opacity)]);
            let mesh = cube();
            let plan = scenes::plan(&mesh, &spec);
            let picture = gpu.draw(&plan, &Deadline::default()).unwrap();
            Likeness::of(&draw(&plan), &picture).assert(Tolerance::TWINS, &format!("{style} {opacity}"));
            cases += 1;
        }
    }
    assert_eq!(cases, 12);
}

/// Looks without a surface, and how wide they draw lines.
const BARE: [(&[(&str, &str)], f64); 6] = [
    (&[("style", "wireframe"), ("wire.thickness", "2")], 2.0),
    (&[("style", "wireframe"), ("wire.hidden", "hide")], 1.0),
    (&[("style", "wireframe"), ("wire.hidden", "fade"), ("wire.thickness", "3")], 3.0),
    // In multiples of what only a triangle has.
    (&[("style", "wireframe"), ("wire.method", "fwidth")], LINE_PX),
    (&[("surface", "null"), ("style", "outline"), ("outline.method", "contour"), ("outline.unit", "px")], 3.0),
    (&[("surface", "null"), ("style", "outline"), ("outline.unit", "px"), ("outline.thickness", "4")], 4.0),
];

#[test]
fn looks_without_a_surface_draw_them_as_lines() {
    let positions = [[-0.4, -0.3, 0.5], [0.45, 0.2, -0.5], [0.1, 0.4, 0.3], [-0.3, -0.5, -0.2]];
    let mut cases = 0;
    for (look, width) in BARE {
        for (a, b) in [(0, 1), (2, 3), (0, 0), (3, 3)] {
            let mesh = alone(&positions, &[segment(a, b)]);
            let size: &[(&str, &str)] = &[("size", "200x160"), ("wire.opacity", "1")];
            let size = if look.iter().any(|(key, _)| key.starts_with("outline")) { &size[..1] } else { size };
            let spec = scenes::spec(&[look, size].concat());
            assert_eq!(warning(&mesh, &spec), None);
            let plan = scenes::plan(&mesh, &spec);
            assert_eq!((plan.positions.len(), plan.triangles.len()), (4, 0));
            let [from, to] = [a, b].map(|v| on_screen(&plan, v as usize));
            let length = (from[0] - to[0]).hypot(from[1] - to[1]);
            // With round ends; a point is twice as wide as a line.
            let disc = |width: f64| std::f64::consts::PI * 0.25 * width * width;
            let expected = if a == b { disc(2.0 * width) } else { length * width + disc(width) };
            let ink = ink_px2(&draw(&plan));
            assert!((ink / expected - 1.0).abs() < 0.04, "{look:?} {a} {b}: {ink} px^2 instead of {expected}");
            cases += 1;
        }
    }
    assert_eq!(cases, 24);
}

#[test]
fn both_back_ends_draw_them_alike_without_a_surface() {
    let Some(gpus) = gpus() else { return };
    let mut cases = 0;
    for gpu in gpus {
        let mut gpu = GpuRenderer::new(Arc::clone(gpu));
        for (look, _) in BARE {
            // With a cube, and with nothing else.
            for is_alone in [false, true] {
                let spec = scenes::spec(&[look, &[("size", "160x120")]].concat());
                let mut mesh = cube();
                if is_alone {
                    mesh = alone(&mesh.positions, &mesh.lines_and_points);
                }
                assert_eq!(warning(&mesh, &spec), None);
                let plan = scenes::plan(&mesh, &spec);
                let (picture, other) = (draw(&plan), gpu.draw(&plan, &Deadline::default()).unwrap());
                assert!(ink_px2(&picture) > 20.0, "{look:?} {is_alone}");
                Likeness::of(&picture, &other).assert(Tolerance::TWINS, &format!("{look:?} {is_alone}"));
                cases += 1;
            }
        }
    }
    assert_eq!(cases, 24);
}

#[test]
fn parts_with_and_without_a_fill_draw_their_own() {
    // The second part has no surface: its line is a line, and the first's an area.
    let positions = [[-0.4, -0.3, 0.0], [0.4, -0.3, 0.0], [-0.4, 0.3, 0.0], [0.4, 0.3, 0.0]];
    let mut mesh = alone(&positions, &[segment(0, 1), LineOrPoint { ends: [2, 3], material: 1 }]);
    mesh.materials[0].name = "filled".into();
    mesh.materials.push(Default::default());
    let mut spec =
        scenes::spec(&[("style", "wireframe"), ("wire.hidden", "show"), ("view", "front"), ("size", "200x160")]);
    spec.materials = vec![("filled".into(), scenes::spec(BLACK).layers)];
    assert_eq!(warning(&mesh, &spec), None);
    let plan = scenes::plan(&mesh, &spec);
    assert_eq!((plan.triangles.len(), plan.lines.len(), plan.lines[0].edges.len()), (2, 1, 1));
    assert_eq!(plan.lines[0].edges[0].vertices, [2, 3]);
    let length = on_screen(&plan, 1)[0] - on_screen(&plan, 0)[0];
    let ink = ink_px2(&draw(&plan));
    let expected = (length + LINE_PX) * LINE_PX + length + 0.8;
    assert!((ink / expected - 1.0).abs() < 0.04, "{ink} px^2 instead of {expected}");
}

#[test]
fn a_look_of_nothing_says_that_it_leaves_them_out() {
    let mut nothing = scenes::spec(&[("style", "wireframe")]);
    nothing.layers.wire = None;
    let mesh = cube();
    assert_eq!(warning(&mesh, &nothing).unwrap().code, "lines_not_drawn");
    let plan = scenes::plan(&mesh, &nothing);
    assert_eq!((plan.triangles.len(), plan.lines.len()), (mesh.triangles.len(), 0));
    let plain = scenes::mesh(&shapes::cube());
    assert_eq!(warning(&plain, &nothing), None);
}
