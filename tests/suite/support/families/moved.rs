//! Meshes for the stress tests: meshes as lists that can be moved, scaled and shuffled, and the
//! looks they are drawn in.

use meshsnap_render::backend::Renderer;
use meshsnap_render::image::Image;
use meshsnap_render::limits::Deadline;
use meshsnap_render::mesh::Mesh;

use crate::oracle::obj::Shape;
use crate::oracle::vector::V3;
use crate::support::scenes;
use crate::support::shapes::{self, Obj};

type Keys = &'static [(&'static str, &'static str)];
/// A name and what writes an OBJ text.
type Named = (&'static str, fn() -> String);

/// Names and OBJ texts: smooth, with hard edges, open, coarse, and with poles.
pub const MESHES: [Named; 5] = [
    ("torus", || shapes::torus(24)),
    ("gear", || shapes::gear(10)),
    ("sheet", || shapes::sheet(12)),
    ("cube", shapes::cube),
    ("ball", ball),
];

/// Every kind of pass.
pub const LOOKS: [(&str, Keys); 9] = [
    ("flat", &[("style", "flat"), ("surface.metallic", "1"), ("light.preset", "three-point")]),
    ("smooth", &[("style", "smooth"), ("camera.projection", "orthographic")]),
    // Strokes: an area of a hole may be rounded otherwise if its face begins at another corner.
    ("wire", &[("style", "wire"), ("wire.thickness", "0.7")]),
    ("wireframe", &[("style", "wireframe"), ("background", "transparent")]),
    ("fwidth", &[("style", "wireframe"), ("wire.method", "fwidth")]),
    (
        "hidden-line",
        &[("style", "hidden-line"), ("wire.hidden", "fade"), ("wire.edges", "feature"), ("background", "888")],
    ),
    ("hull", &[("style", "outline")]),
    ("hull px", &[("style", "outline"), ("outline.unit", "px"), ("surface.opacity", "0.5")]),
    ("contour", &[("style", "outline"), ("outline.method", "contour"), ("outline.unit", "px")]),
];

fn ball() -> String {
    let mut obj = Obj::default();
    obj.ball([0.0; 3], 1.0, 16);
    obj.finish()
}

/// The vertices and polygons of an OBJ text that has nothing else.
pub fn shape(obj: &str) -> Shape {
    let mut shape = Shape::default();
    for line in obj.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "v" => {
                let position: V3 = std::array::from_fn(|k| words[1 + k].parse().unwrap());
                shape.vertex(position);
            }
            "f" => shape.polygons.push(words[1..].iter().map(|w| w.parse::<usize>().unwrap() - 1).collect()),
            other => panic!("{other}"),
        }
    }
    shape
}

/// Draws a mesh in a look at a size.
pub fn draw(mesh: &Mesh, look: Keys, size: &str, renderer: &mut dyn Renderer) -> Image {
    let mut keys = vec![("size", size)];
    keys.extend(look);
    renderer.draw(&scenes::plan(mesh, &scenes::spec(&keys)), &Deadline::default()).unwrap()
}

/// Pixels that differ at all.
pub fn differing(a: &Image, b: &Image) -> usize {
    assert_eq!((a.width_px, a.height_px), (b.width_px, b.height_px));
    a.rgba.chunks(4).zip(b.rgba.chunks(4)).filter(|(a, b)| a != b).count()
}

/// True if all pixels are the same.
pub fn is_blank(image: &Image) -> bool {
    image.rgba.chunks(4).all(|p| p == &image.rgba[..4])
}
