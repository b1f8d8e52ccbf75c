//! Holes: the areas of faces that lines leave free, from which most pixels get their coverage where
//! all edges are lines. They give the same lines as strokes alone, on both back-ends. What the
//! lines should be, the accuracy suite tests.

use std::sync::Arc;

use meshsnap_render::backend::Renderer;
use meshsnap_render::backend::cpu::CpuRenderer;
use meshsnap_render::backend::gpu::GpuRenderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{DrawPlan, Edge, LinePass, Shown};

use crate::support::gpus::gpus_of_case;
use crate::support::likeness::{Likeness, Tolerance};
use crate::support::{scenes, shapes};

/// A request's keys.
type Keys<'k> = &'k [(&'k str, &'k str)];

const ALL: (&str, &str) = ("wire.edges", "triangles");

/// Every number of samples, at the least width and others.
const LOOKS: &[Keys<'_>] = &[
    &[("style", "wire"), ALL, ("size", "150x120"), ("wire.thickness", "1")],
    &[("style", "hidden-line"), ALL, ("size", "200"), ("wire.thickness", "0.8"), ("view", "right")],
    &[("style", "wire"), ALL, ("size", "120"), ("samples", "1"), ("wire.thickness", "1.5")],
    &[("style", "wire"), ALL, ("size", "120"), ("samples", "8"), ("wire.thickness", "3"), ("wire.lit", "true")],
    &[("style", "wire"), ALL, ("size", "110"), ("samples", "16"), ("wire.thickness", "0.4")],
    &[("style", "wire"), ALL, ("size", "160"), ("wire.thickness", "8"), ("view", "top")],
    &[("style", "wire"), ALL, ("size", "100"), ("camera.projection", "orthographic"), ("camera.height", "0.6")],
    &[
        ("style", "wire"),
        ALL,
        ("size", "120x100"),
        ("camera.eye", "0.2,0.35,0.3"),
        ("camera.target", "-0.8,0,-0.9"),
        ("camera.fov_deg", "80"),
    ],
];

/// Looks in which hidden parts of lines fade: fringes and strokes tell what whole edges cover.
const FADED: &[Keys<'_>] = &[
    &[("style", "wireframe"), ALL, ("size", "150x120"), ("wire.thickness", "1")],
    &[("style", "wireframe"), ALL, ("size", "120"), ("samples", "1"), ("wire.thickness", "1.5")],
    &[("style", "wireframe"), ALL, ("size", "140"), ("samples", "8"), ("wire.thickness", "2"), ("wire.lit", "true")],
    &[("style", "wireframe"), ALL, ("size", "110"), ("samples", "16"), ("wire.thickness", "0.4"), ("view", "right")],
    &[("style", "wireframe"), ALL, ("size", "160"), ("wire.thickness", "8"), ("view", "top")],
    &[
        ("style", "wireframe"),
        ALL,
        ("size", "120x100"),
        ("wire.thickness", "1.2"),
        ("camera.eye", "0.2,0.35,0.3"),
        ("camera.target", "-0.8,0,-0.9"),
        ("camera.fov_deg", "80"),
    ],
];

/// Sheets, what touches or passes through itself, borders, and an edge of three faces.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let own = [("balls that pass through each other", balls_through_each_other()), ("hairs", hairs())];
    let all = shapes::hard_for_lines().into_iter().chain(own);
    all.map(|(name, obj)| (name, scenes::mesh(&obj))).collect()
}

fn balls_through_each_other() -> String {
    let mut shape = shapes::Obj::default();
    shape.ball([0.0; 3], 1.0, 14);
    shape.ball([0.7, 0.4, 0.2], 0.8, 11);
    shape.finish()
}

/// Slivers without a sample before a wall of large faces.
fn hairs() -> String {
    let mut shape = shapes::Obj::default();
    shape.cuboid([-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]);
    for i in 0..8 {
        let at = f64::from(i) * 0.2 - 0.7;
        let corners = [[at, -0.8, 0.3], [at + 1e-5, -0.8, 0.3], [at + 0.1, 0.8, 0.35]].map(|p| shape.vertex(p));
        shape.face(&corners);
    }
    shape.finish()
}

/// The plan's picture, and that by strokes alone.
fn both(renderer: &mut dyn Renderer, plan: &mut DrawPlan<'_>) -> [Image; 2] {
    let deadline = Deadline::default();
    let by_holes = renderer.draw(plan, &deadline).unwrap();
    plan.lines.iter_mut().for_each(|pass| pass.is_complete = false);
    [by_holes, renderer.draw(plan, &deadline).unwrap()]
}

#[test]
fn holes_and_strokes_tell_of_the_same_lines() {
    let (mut pictures, mut cases, mut different) = (0, 0, 0);
    for (number, (name, mesh)) in meshes().iter().enumerate() {
        for (i, keys) in LOOKS.iter().chain(FADED).enumerate() {
            let mut renderers: Vec<Box<dyn Renderer>> = vec![Box::new(CpuRenderer::new(2))];
            let gpus = gpus_of_case(number + i).iter();
            renderers.extend(gpus.map(|gpu| Box::new(GpuRenderer::new(gpu.clone())) as Box<dyn Renderer>));
            pictures += renderers.len();
            for renderer in &mut renderers {
                let mut plan = scenes::plan(mesh, &scenes::spec(keys));
                assert!(plan.has_holes(), "{name}, look {i}");
                assert_eq!(plan.has_fringes(), i >= LOOKS.len(), "{name}, look {i}");
                let [by_holes, by_strokes] = both(renderer.as_mut(), &mut plan);
                let likeness = Likeness::of(&by_holes, &by_strokes);
                // Where strokes overlap, their union is an estimate: that is what holes are for.
                // The visible part of a line that comes out of a wall may end early: by an eighth of a pixel, by a fourth with
                // one sample.
                // Wireframes are black on white, without a surface, which is more contrast.
                let max = match (*name, i >= LOOKS.len()) {
                    ("bumps", false) => 64,
                    ("bumps", true) => 96,
                    _ => 32,
                };
                likeness.assert(Tolerance { max, share: 0.15 }, &format!("{name}, look {i}, {:?}", renderer.kind()));
                different += usize::from(likeness.differing() > 0);
                cases += 1;
            }
        }
    }
    assert_eq!(cases, pictures);
    assert!(cases >= 10 * (LOOKS.len() + FADED.len()), "{cases}");
    assert!(different > cases / 2, "{different} of {cases} pictures have a pixel that holes tell");
}

/// Both faces of a sheet, exactly edge-on: no sample shows them, none of their edges is a rim, and they have no fringe.
#[test]
fn edges_between_faces_seen_edge_on_are_drawn_alike() {
    let mut cases = 0;
    for half_px in [30.0, 3.0] {
        let positions = [[-half_px, -0.5 * half_px, 0.5], [half_px, 0.5 * half_px, 0.4], [0.0, 0.0, 0.6]];
        let triangles = [[0, 1, 2], [0, 2, 1]];
        let edges = [[0, 1], [1, 2], [2, 0]].map(|vertices| Edge { vertices, faces: [0, 1] });
        let mut plan = scenes::screen_plan([96, 64], 4, 1.0, &positions, &triangles);
        let pass = LinePass::new(Arc::new(edges.to_vec()), 1.5);
        let color = [1.0, 0.0, 0.0, 1.0];
        plan.lines = vec![LinePass { color, shown: Shown::Faded, is_complete: true, keeps_short_parts: true, ..pass }];
        assert!(plan.has_fringes());
        let deadline = Deadline::default();
        let cpu = CpuRenderer::new(2).draw(&plan, &deadline).unwrap();
        assert!(CpuRenderer::plain(1).draw(&plan, &deadline).unwrap() == cpu);
        let drawn = cpu.rgba.chunks(4).filter(|p| p[0] > p[2].saturating_add(10)).count();
        assert!(drawn as f32 > 2.0 * half_px, "{half_px}: {drawn} pixels");
        for gpu in gpus_of_case(cases) {
            let gpu = GpuRenderer::new(gpu.clone()).draw(&plan, &deadline).unwrap();
            Likeness::of(&cpu, &gpu).assert(Tolerance::TWINS, &format!("{half_px} px"));
        }
        cases += 1;
    }
    assert_eq!(cases, 2);
}

#[test]
fn what_holes_cannot_tell_is_left_to_strokes() {
    let mesh = scenes::mesh(&shapes::sheet(8));
    let wire = ("style", "wire");
    // Keys, and if holes may tell the lines, and if short parts of these are kept.
    let cases: &[(Keys<'_>, bool, bool)] = &[
        (&[wire, ALL, ("wire.thickness", "1")], true, true),
        (&[wire, ALL, ("wire.thickness", "0.79")], false, true),
        (&[wire, ALL, ("wire.thickness", "8.1")], false, true),
        (&[wire, ALL, ("samples", "1")], false, true),
        (&[wire, ALL, ("samples", "16"), ("wire.thickness", "0.5")], true, true),
        (&[wire, ALL, ("wire.smoothing", "0.5")], false, true),
        (&[wire, ALL, ("wire.hidden", "show")], false, true),
        (&[wire], false, false),
        (&[wire, ALL, ("surface.opacity", "0.5")], false, false),
        (&[wire, ALL, ("surface.cull", "back")], false, true),
        (&[("style", "outline"), ("outline.method", "contour")], false, false),
        (&[("style", "hidden-line"), ALL], true, true),
    ];
    for (keys, has_holes, keeps_short_parts) in cases {
        let plan = scenes::plan(&mesh, &scenes::spec(keys));
        assert_eq!(plan.has_holes(), *has_holes, "{keys:?}");
        assert!(plan.lines.iter().all(|pass| pass.keeps_short_parts == *keeps_short_parts), "{keys:?}");
        assert!(!plan.lines.is_empty(), "{keys:?}");
    }
}
