//! The shortcuts that lines take on the CPU change no byte: pictures drawn with them and without.

use meshsnap_render::backend::Renderer as _;
use meshsnap_render::backend::cpu::{CpuRenderer, Isa};
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::support::scenes::{self, SCENES};
use crate::support::shapes;

/// A request's keys.
type Keys<'k> = &'k [(&'k str, &'k str)];

/// Open meshes, an edge of three faces, edges in the plane of another face, what covers itself
/// twice, and meshes whose triangles are smaller than a pixel.
fn meshes() -> Vec<(&'static str, Mesh)> {
    let mut fine = shapes::Obj::default();
    fine.ball([0.0; 3], 1.0, 160);
    let turned = ("bumps that turn away", shapes::bumps(true));
    let own = [("two balls", shapes::two_balls()), ("fine ball", fine.finish()), turned];
    let all = shapes::hard_for_lines().into_iter().chain(own);
    all.map(|(name, obj)| (name, scenes::mesh(&obj))).collect()
}

const ALL: (&str, &str) = ("wire.edges", "triangles");

const LOOKS: &[Keys<'_>] = &[
    &[("style", "wire"), ("size", "150x120")],
    &[("style", "wire"), ("size", "90"), ("samples", "1"), ("wire.thickness", "0.3"), ("view", "right")],
    &[("style", "wire"), ("size", "120"), ("samples", "8"), ("wire.thickness", "7"), ("wire.hidden", "fade")],
    &[("style", "hidden-line"), ("size", "110"), ("samples", "16"), ("wire.smoothing", "1.5")],
    &[("style", "wire"), ("size", "130"), ("wire.lit", "true"), ("wire.thickness", "2.5"), ("surface.opacity", "0.5")],
    // Holes at every number of samples.
    &[("style", "wire"), ("size", "90"), ("samples", "1"), ("wire.thickness", "1.6"), ("wire.lit", "true")],
    &[("style", "hidden-line"), ("size", "100"), ("samples", "8"), ("wire.thickness", "2.5")],
    &[("style", "wire"), ("size", "80x110"), ("samples", "16"), ("wire.thickness", "0.5"), ("view", "top")],
    // Fringes at every number of samples; the last of them behind the eye, too.
    &[("style", "wireframe"), ALL, ("size", "90"), ("samples", "1"), ("wire.thickness", "1.6"), ("wire.lit", "true")],
    &[("style", "wireframe"), ALL, ("size", "140"), ("wire.thickness", "1")],
    &[("style", "wireframe"), ALL, ("size", "100"), ("samples", "8"), ("wire.thickness", "7"), ("view", "right")],
    &[
        ("style", "wireframe"),
        ALL,
        ("size", "120x100"),
        ("samples", "16"),
        ("wire.thickness", "0.6"),
        ("camera.eye", "0.2,0.35,0.3"),
        ("camera.target", "-0.8,0,-0.9"),
        ("camera.fov_deg", "80"),
    ],
    // Behind the eye, and beyond the picture.
    &[
        ("style", "wire"),
        ("size", "120x100"),
        ("camera.eye", "0.2,0.35,0.3"),
        ("camera.target", "-0.8,0,-0.9"),
        ("camera.fov_deg", "80"),
    ],
    &[("style", "wire"), ("size", "100"), ("camera.projection", "orthographic"), ("camera.height", "0.6")],
];

#[test]
fn the_shortcuts_of_lines_change_no_byte() {
    let deadline = Deadline::default();
    let mut plain = CpuRenderer::plain(2);
    let mut renderers = [CpuRenderer::new(1), CpuRenderer::new(3), CpuRenderer::with_isa(2, Isa::baseline())];
    let (mut cases, mut with_lines) = (0, 0);
    let mut compare = |name: &str, mesh: &Mesh, spec: &meshsnap_render::spec::Spec| {
        let plan = scenes::plan(mesh, spec);
        let want = plain.draw(&plan, &deadline).unwrap();
        for renderer in &mut renderers {
            assert!(renderer.draw(&plan, &deadline).unwrap() == want, "{name}");
        }
        with_lines += usize::from(plan.hides_lines());
        cases += 1;
    };
    for scene in SCENES {
        compare(scene.name, &scenes::mesh(&(scene.obj)()), &scene.spec());
    }
    for (name, mesh) in &meshes() {
        for (i, keys) in LOOKS.iter().enumerate() {
            compare(&format!("{name}, look {i}"), mesh, &scenes::spec(keys));
        }
    }
    assert_eq!(cases, SCENES.len() + 11 * LOOKS.len());
    assert!(with_lines > 11 * LOOKS.len(), "{with_lines} pictures have lines that something may hide");
}
