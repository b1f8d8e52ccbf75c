//! Meshes and views whose lines the accuracy tests measure, with the errors that are allowed.

use std::f64::consts::TAU;

use crate::oracle::obj::Shape;
use crate::support::shapes;
use crate::support::truth::Gate;

/// A mesh whose edges are drawn in white on nothing, hidden by a surface that is not seen.
pub struct MeshScene {
    pub name: &'static str,
    pub obj: fn() -> String,
    /// The request's keys: lines and view.
    pub keys: &'static [(&'static str, &'static str)],
    /// The gate as measured now.
    pub now: Gate,
}

type Keys = &'static [(&'static str, &'static str)];

const fn scene(name: &'static str, obj: fn() -> String, keys: Keys) -> MeshScene {
    MeshScene { name, obj, keys, now: MESHES_GOAL }
}

/// Goal 2.
pub const MESHES_GOAL: Gate = Gate { rmse: 1.5, max: f64::INFINITY, ink: 0.005 };

/// One model unit is one pixel.
const FLAT: Keys = &[("view", "front"), ("camera.projection", "orthographic"), ("camera.height", "160")];
const FLAT_POLYGONS: Keys =
    &[("view", "front"), ("camera.projection", "orthographic"), ("camera.height", "160"), ("wire.edges", "polygons")];
const SOLID: Keys = &[];
const POLYGONS: Keys = &[("wire.edges", "polygons")];
const SEE_THROUGH: Keys = &[("wire.hidden", "show")];
const INSIDE: Keys = &[("camera.eye", "0.2,0.35,0.3"), ("camera.target", "-0.8,0,-0.9"), ("camera.fov_deg", "80")];

const FROM_ABOVE: Keys = &[("camera.azimuth_deg", "20"), ("camera.elevation_deg", "28")];
const IN_ROOM: Keys = &[
    ("camera.eye", "0.9,-0.4,1.1"),
    ("camera.target", "-0.6,0.7,-1"),
    ("camera.fov_deg", "90"),
    ("wire.edges", "polygons"),
];
const IN_CORNER: Keys = &[("camera.eye", "-1.2,1.1,1.3"), ("camera.target", "0.7,0.5,-0.6"), ("camera.fov_deg", "100")];

/// Goal 2's scenes.
pub const MESHES: &[MeshScene] = &[
    scene("triangle", triangle, FLAT),
    scene("12 px grid", grid_12, FLAT),
    scene("4 px grid", grid_4, FLAT),
    scene("48-fan", fan, FLAT),
    scene("slivers", slivers, FLAT),
    scene("12 px quads, hidden diagonals", quads_12, FLAT_POLYGONS),
    scene("wavy quads, hidden diagonals", sheet, POLYGONS),
    scene("wavy sheet, from inside", sheet, INSIDE),
    scene("cube", shapes::cube, SOLID),
    scene("torus", torus, SOLID),
    scene("gear", gear, SOLID),
    scene("torus, see-through", torus, SEE_THROUGH),
    scene("boxes on a floor", shapes::boxes_on_a_floor, POLYGONS),
    scene("boxes on a floor, triangles", shapes::boxes_on_a_floor, FROM_ABOVE),
    scene("box on box", shapes::stacked_boxes, POLYGONS),
    scene("box on box, triangles", shapes::stacked_boxes, FROM_ABOVE),
    scene("room with T-junctions", shapes::room_with_t_junctions, IN_ROOM),
    scene("room with T-junctions, triangles", shapes::room_with_t_junctions, IN_CORNER),
];

/// Goal 3's scenes: lines on the silhouette alone. The goal is 0.01 of the ink, and the same RMSE
/// as of other lines.
pub const CONTOURS: &[MeshScene] = &[
    scene("triangle", triangle, FLAT),
    scene("quad", quad, FLAT_POLYGONS),
    scene("cube contour", shapes::cube, CONTOUR),
    scene("torus contour", torus, CONTOUR),
    scene("gear contour", gear, CONTOUR),
    scene("sheet contour", sheet, CONTOUR),
];

const CONTOUR: Keys = &[("outline.method", "contour"), ("outline.unit", "px")];

/// The request for a scene's lines at a width in pixels.
pub fn plan_keys<'a>(scene: &MeshScene, width: &'a str) -> Vec<(&'static str, &'a str)> {
    let mut keys = vec![("size", "200x160"), ("background", "transparent")];
    if scene.keys.iter().any(|(key, _)| key.starts_with("outline")) {
        keys.extend([("style", "unlit"), ("surface", "null"), ("outline.color", "fff"), ("outline.thickness", width)]);
    } else {
        keys.extend([
            ("style", "wireframe"),
            ("wire.hidden", "hide"),
            ("wire.color", "fff"),
            ("wire.thickness", width),
        ]);
    }
    keys.extend(scene.keys);
    keys
}

fn turned(shape: Shape, degrees: f64) -> String {
    let (sin, cos) = degrees.to_radians().sin_cos();
    shape.map(|[x, y, z]| [x * cos - y * sin, x * sin + y * cos, z]).text()
}

fn triangle() -> String {
    let vertices = vec![[-71.3, -50.2, 0.0], [64.9, -20.7, 0.0], [-10.4, 61.1, 0.0]];
    Shape { vertices, polygons: vec![vec![0, 1, 2]] }.text()
}

fn quad() -> String {
    let vertices = vec![[-71.3, -50.2, 0.0], [64.9, -40.7, 0.0], [50.4, 61.1, 0.0], [-60.0, 40.3, 0.0]];
    Shape { vertices, polygons: vec![vec![0, 1, 2, 3]] }.text()
}

fn net(n: [usize; 2], side: f64) -> Shape {
    Shape::net(n, |i, j| [i as f64 * side, j as f64 * side, 0.0])
}

fn grid_12() -> String {
    turned(net([12, 8], 12.0).triangulated(), 17.0)
}

fn grid_4() -> String {
    turned(net([36, 24], 4.0).triangulated(), 17.0)
}

fn quads_12() -> String {
    turned(net([12, 8], 12.0), 17.0)
}

/// 48 triangles around a point.
fn fan() -> String {
    let mut shape = Shape::default();
    shape.vertex([0.3, 0.2, 0.0]);
    for i in 0..48 {
        let a = f64::from(i) / 48.0 * TAU + 0.02;
        shape.vertex([72.0 * a.cos(), 72.0 * a.sin(), 0.0]);
    }
    shape.polygons = (0..48).map(|i| vec![0, 1 + i, 1 + (i + 1) % 48]).collect();
    shape.text()
}

/// Rows 9 px apart with rows of a fifth of a pixel between them: triangles 750 times as long as
/// high.
fn slivers() -> String {
    let row = |j: usize| (j / 2) as f64 * 9.0 + (j % 2) as f64 * 0.2;
    turned(Shape::net([1, 19], |i, j| [i as f64 * 150.0, row(j), 0.0]).triangulated(), 11.0)
}

fn sheet() -> String {
    shapes::sheet(14)
}

fn torus() -> String {
    shapes::torus(28)
}

fn gear() -> String {
    shapes::gear(10)
}
