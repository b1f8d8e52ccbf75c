//! The fixed scenes that every back-end draws, and how to make a mesh, a spec and a plan in a test.

use meshsnap_render::import::Bundle;
use meshsnap_render::limits::{Budget, Deadline, Limits};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan;
use meshsnap_render::plan::{DrawPlan, Faces, PlanError, Projection, ShadedMaterial, SkipKind, SurfacePass};
use meshsnap_render::request;
use meshsnap_render::request::Rules;
use meshsnap_render::spec::BackendChoice;
use meshsnap_render::spec::color::Rgba;
use meshsnap_render::spec::{DebugView, ImageSpec, Layers, Spec, WireEdges, WireThickness};

use crate::support::shapes;

/// A picture with a name.
pub struct Scene {
    pub name: &'static str,
    pub obj: fn() -> String,
    pub keys: &'static [(&'static str, &'static str)],
    /// Changes that the keys cannot express.
    pub edit: fn(&mut Spec),
}

impl Scene {
    /// The spec of the keys, with the scene's edit.
    pub fn spec(&self) -> Spec {
        let mut spec = spec(self.keys);
        let asks_for = |key: &str| self.keys.iter().any(|(given, _)| *given == key);
        if let Some(wire) = &mut spec.layers.wire {
            wire.edges = if asks_for("wire.edges") { wire.edges } else { WireEdges::Triangles };
            wire.thickness = if asks_for("wire.thickness") { wire.thickness } else { WireThickness::Given(1.0) };
        }
        (self.edit)(&mut spec);
        spec
    }
}

const SIZE: (&str, &str) = ("size", "200x160");

/// Every style, both wire techniques, polygons, both outline units, the views, and the awkward
/// cameras.
pub const SCENES: &[Scene] = &[
    scene("torus-flat", torus, &[SIZE, ("style", "flat")]),
    scene("torus-smooth", torus, &[SIZE, ("style", "smooth")]),
    scene("torus-unlit", torus, &[SIZE, ("style", "unlit"), ("surface.color", "c40")]),
    scene("torus-wire", torus, &[SIZE, ("style", "wire"), ("wire.edges", "polygons")]),
    scene("torus-wire-wide", torus, &[SIZE, ("style", "wire"), ("wire.thickness", "3.5")]),
    scene("torus-fwidth", torus, &[SIZE, ("style", "wire"), ("wire.method", "fwidth")]),
    scene("torus-wireframe", torus, &[SIZE, ("style", "wireframe"), ("background", "transparent")]),
    scene("gear-outline-px", gear, &[SIZE, ("style", "outline"), ("outline.unit", "px")]),
    scene("gear-outline-object", gear, &[SIZE, ("style", "outline"), ("outline.thickness", "0.04")]),
    scene("gear-hidden-line", gear, &[SIZE, ("style", "hidden-line"), ("view", "front")]),
    scene("cube-flat-one-sample", shapes::cube, &[SIZE, ("style", "flat"), ("samples", "1")]),
    scene("cube-wire-polygons", shapes::cube, &[SIZE, ("style", "wire"), ("wire.edges", "polygons")]),
    scene("sheet-wire-red", sheet, &[SIZE, ("style", "wire"), ("wire.color", "e02020"), ("view", "right")]),
    scene("sheet-back-faces", sheet, &[SIZE, ("style", "flat"), ("view", "bottom")]),
    scene("sheet-orthographic", sheet, &[SIZE, ("style", "wire"), ("camera.projection", "orthographic")]),
    scene("sheet-from-inside", sheet, INSIDE),
    scene("sheet-wire-from-inside", sheet, INSIDE_WIRE),
    edited(scene("torus-glass", torus, &[SIZE, ("style", "smooth")]), glass),
    edited(scene("gear-glass-outline", gear, &[SIZE, ("style", "outline")]), glass),
    scene("torus-wireframe-fwidth-show", torus, FWIDTH_SHOW),
    scene("torus-wireframe-fwidth-fade", torus, FWIDTH_FADE),
    scene("torus-wire-fwidth-fade", torus, FWIDTH_FILLED),
    edited(scene("two-one-outlined", two, &[SIZE, ("style", "outline"), ("outline.unit", "px")]), left_outlined),
    edited(scene("two-one-glass", two, &[SIZE, ("style", "flat"), ("view", "left")]), left_glass),
    scene("torus-derivative", torus, &[SIZE, ("style", "flat"), ("surface.normals", "derivative"), METAL]),
    scene("gear-metal", gear, &[SIZE, ("style", "flat"), METAL, ("surface.color", "d9a441"), SHINY]),
    scene("torus-metal", torus, &[SIZE, ("style", "smooth"), METAL, ("light.preset", "three-point"), SHINY]),
    scene("sheet-threshold", sheet, &[SIZE, ("style", "wire"), ("wire.method", "threshold"), ("samples", "1")]),
    scene("gear-fwidth-min", gear, &[SIZE, ("style", "wire"), ("wire.method", "fwidth-min"), ("view", "front")]),
    edited(scene("gear-barycentric-lit", gear, BARYCENTRIC_RED), |spec| spec.layers.wire.as_mut().unwrap().lit = true),
    edited(scene("torus-debug-normal", torus, &[SIZE, ("style", "smooth")]), |spec| debug(spec, DebugView::Normal)),
    edited(scene("gear-debug-edge-distance", gear, &[SIZE]), |spec| debug(spec, DebugView::EdgeDistance)),
    edited(scene("sheet-debug-barycentric", sheet, INSIDE), |spec| debug(spec, DebugView::Barycentric)),
    edited(scene("sheet-debug-face-orientation", sheet, LOW), |spec| debug(spec, DebugView::FaceOrientation)),
    scene("torus-contour", torus, CONTOUR),
    scene("gear-contour", gear, CONTOUR),
    scene("gear-feature-fade", gear, FEATURE_FADE),
    scene("fin-topology", fin, &[SIZE, ("style", "topology")]),
    scene("torus-wire-lit", torus, LIT_RED),
    scene(
        "spring-wireframe",
        spring,
        &[SIZE, ("style", "wireframe"), ("wire.color", "2060c0"), ("wire.thickness", "2")],
    ),
    scene("sheet-boundary", sheet, &[SIZE, ("style", "wire"), ("wire.edges", "boundary"), ("wire.thickness", "2")]),
    scene("ball-and-box-wire-auto", ball_and_box, AUTO_FADE),
];

const AUTO_FADE: &[(&str, &str)] =
    &[SIZE, ("style", "wire"), ("wire.edges", "polygons"), ("wire.hidden", "fade"), ("wire.thickness", "auto")];

const CONTOUR: &[(&str, &str)] =
    &[SIZE, ("style", "outline"), ("outline.method", "contour"), ("outline.unit", "px"), ("outline.thickness", "3")];
const FEATURE_FADE: &[(&str, &str)] =
    &[SIZE, ("style", "wire"), ("wire.edges", "feature"), ("wire.hidden", "fade"), ("wire.thickness", "1.5")];
const LIT_RED: &[(&str, &str)] = &[
    SIZE,
    ("style", "wire"),
    ("wire.edges", "polygons"),
    ("wire.color", "e02020"),
    ("wire.thickness", "2.5"),
    ("wire.lit", "true"),
];

const FWIDTH_SHOW: &[(&str, &str)] = &[SIZE, ("style", "wireframe"), ("wire.method", "fwidth")];
const FWIDTH_FADE: &[(&str, &str)] =
    &[SIZE, ("style", "wireframe"), ("wire.method", "fwidth"), ("wire.hidden", "fade"), ("wire.edges", "polygons")];
const FWIDTH_FILLED: &[(&str, &str)] =
    &[SIZE, ("style", "wire"), ("wire.method", "fwidth"), ("wire.hidden", "fade"), ("wire.edges", "polygons")];

const METAL: (&str, &str) = ("surface.metallic", "1");
const SHINY: (&str, &str) = ("surface.roughness", "0.25");
const LOW: &[(&str, &str)] = &[SIZE, ("style", "flat"), ("camera.elevation_deg", "-4")];
const BARYCENTRIC_RED: &[(&str, &str)] =
    &[SIZE, ("style", "wire"), ("wire.method", "barycentric"), ("wire.color", "c02020"), ("wire.thickness", "3")];

const INSIDE: &[(&str, &str)] = &[
    SIZE,
    ("style", "smooth"),
    ("camera.eye", "0.2,0.35,0.3"),
    ("camera.target", "-0.8,0,-0.9"),
    ("camera.fov_deg", "80"),
];
const INSIDE_WIRE: &[(&str, &str)] = &[
    SIZE,
    ("style", "wire"),
    ("camera.eye", "0.2,0.35,0.3"),
    ("camera.target", "-0.8,0,-0.9"),
    ("camera.fov_deg", "80"),
];

const fn scene(name: &'static str, obj: fn() -> String, keys: &'static [(&'static str, &'static str)]) -> Scene {
    Scene { name, obj, keys, edit: |_| () }
}

const fn edited(scene: Scene, edit: fn(&mut Spec)) -> Scene {
    Scene { edit, ..scene }
}

fn glass(spec: &mut Spec) {
    spec.layers.surface.iter_mut().for_each(|surface| surface.opacity = 0.4);
}

/// The part named "left" has the outline, the other has none.
fn left_outlined(spec: &mut Spec) {
    spec.materials = vec![("right".into(), Layers { outline: None, ..spec.layers })];
}

/// The part named "left" is glass.
fn left_glass(spec: &mut Spec) {
    let mut layers = spec.layers;
    layers.surface.iter_mut().for_each(|s| (s.opacity, s.color) = (0.45, Some(Rgba([0.1, 0.3, 0.8, 1.0]))));
    spec.materials = vec![("left".into(), layers)];
}

fn two() -> String {
    shapes::two_balls()
}

fn debug(spec: &mut Spec, view: DebugView) {
    spec.layers.surface.as_mut().unwrap().debug = view;
}

fn torus() -> String {
    shapes::torus(36)
}

fn fin() -> String {
    shapes::FIN.to_owned()
}

/// A cube in a spring of lines, with points between them.
fn spring() -> String {
    let mut obj = shapes::cube();
    let around = |i: u32, r: f64| {
        let a = std::f64::consts::TAU * f64::from(i) / 32.0;
        format!("v {} {} {}\n", r * libm::cos(a), f64::from(i) / 48.0 - 1.5, r * libm::sin(a))
    };
    for i in 0..=144 {
        obj += &around(i, 2.0);
    }
    obj += &format!("l {}\n", (9..=153).map(|v| v.to_string()).collect::<Vec<_>>().join(" "));
    for i in 0..12 {
        obj += &around(i * 12, 1.7);
        obj += "p -1\n";
    }
    obj
}

fn gear() -> String {
    shapes::gear(14)
}

/// A ball of many faces beside a box, so that automatic lines are fainter over the ball.
fn ball_and_box() -> String {
    let mut obj = shapes::Obj::default();
    obj.ball([-1.1, 0.0, 0.0], 1.0, 64);
    obj.cuboid([0.2, -0.8, -0.8], [1.8, 0.8, 0.8]);
    obj.finish()
}

fn sheet() -> String {
    shapes::sheet(18)
}

/// Imports an OBJ that must be good.
pub fn mesh(obj: &str) -> Mesh {
    mesh_of(obj.as_bytes()).unwrap()
}

/// Imports with default limits.
pub fn mesh_of(bytes: &[u8]) -> Result<Mesh, meshsnap_render::import::MeshError> {
    let limits = Limits::default();
    meshsnap_render::import::import(
        &Bundle::of_one(bytes.to_vec()),
        None,
        &limits,
        &mut Budget::new(&limits),
        &Deadline::default(),
    )
    .map(|(mesh, _)| mesh)
}

/// Reads dotted keys that must be good. The view is `iso` where they name none.
pub fn spec(keys: &[(&str, &str)]) -> Spec {
    const SAMPLES_BY: [&str; 5] = ["samples", "image.samples", "max_error", "image.max_error", "image.max_time_ms"];
    let keys: Vec<_> = [("view", "iso")].iter().chain(keys).map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    let rules = Rules { limits: Limits::default(), backend: BackendChoice::Auto };
    let mut spec = request::read(None, &keys, &rules).unwrap_or_else(|e| panic!("{e}"));
    // Small pictures have the samples of large ones here, and so take less time.
    if !keys.iter().any(|(key, _)| SAMPLES_BY.contains(&key.as_str())) {
        spec.image.samples = ImageSpec::default().samples;
    }
    spec
}

/// Plans with default limits.
pub fn plan<'a>(mesh: &'a Mesh, spec: &Spec) -> DrawPlan<'a> {
    try_plan(mesh, spec, &Limits::default(), &Deadline::default(), &[]).unwrap()
}

/// Plans within these limits; nothing in `keep` is skipped.
pub fn try_plan<'a>(
    mesh: &'a Mesh,
    spec: &Spec,
    limits: &Limits,
    deadline: &Deadline,
    keep: &[SkipKind],
) -> Result<DrawPlan<'a>, PlanError> {
    let mut budget = Budget::new(limits);
    let scene = meshsnap_render::scene::Scene::new(mesh, spec, &mut budget)?;
    plan::build_keeping(&scene, &mut budget, deadline, keep)
}

/// A plan made by hand: positions are pixels from the picture's centre over `scale`, y down, and a
/// depth; unlit white on black.
pub fn screen_plan<'a>(
    size_px: [u32; 2],
    samples: u32,
    scale: f32,
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
) -> DrawPlan<'a> {
    let projection = Projection {
        x: [scale * 256.0, 0.0, 0.0, 0.0],
        y: [0.0, scale * 256.0, 0.0, 0.0],
        z: [0.0, 0.0, 1.0, 0.0],
        w: [0.0, 0.0, 0.0, 1.0],
        near_w: 0.5,
        clip: false,
        to_viewer: [0.0, 0.0, 1.0],
        screen_up: [0.0, 1.0, 0.0],
        screen_right: [1.0, 0.0, 0.0],
    };
    DrawPlan {
        samples,
        surface: Some(SurfacePass::new(Faces::Both, vec![ShadedMaterial::unlit([1.0; 4])])),
        background: [0.0, 0.0, 0.0, 1.0],
        ..DrawPlan::new(size_px, positions, triangles, projection)
    }
}
