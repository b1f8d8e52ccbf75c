//! The warning `up_unlikely`: the axis that a format has pointing up by custom is most likely not the
//! one that points up in this file.
//!
//! Only formats whose files may have either axis are looked at, and only clear evidence counts: the
//! file's comment (it names the axis, or a program known for it), or a tall shape with a flat base on the
//! other axis alone.

use super::{Format, ImportReport};
use crate::mesh::vector::{cross, dot, sub};
use crate::mesh::{Mesh, UpAxis};
use crate::warning::Warning;

/// The code of the warning.
pub const CODE: &str = "up_unlikely";

/// Fewest triangles: boxes and other simple shapes lie on any side.
const TRIANGLES_MIN: usize = 100;

/// Smallest share of the box's side that a base covers.
const BASE_MIN: f64 = 0.25;

/// Largest share that counts as no base.
const NO_BASE_MAX: f64 = 0.01;

/// Least height of a shape that stands on its base, in multiples of the longer side of the base: what is
/// flatter may hang on a wall.
const TALL_MIN: f64 = 0.8;

/// Largest distance from the box's side of a corner that lies on it, as a share of the box's height.
const BASE_DEPTH: f64 = 1e-3;

/// Programs that write files with z up, by what begins their comments, and in which formats.
const Z_UP_PROGRAMS: &[(&str, &[Format])] = &[
    // Its OBJ exporter turns the axes, its PLY exporter does not.
    ("created by blender", &[Format::Ply]),
    ("openscad", &[Format::Obj, Format::Off]),
    ("freecad", &[Format::Obj, Format::Ply]),
    ("created by cloudcompare", &[Format::Ply]),
];

/// The warning, if the other axis is much likelier.
pub fn warning(mesh: &Mesh, report: &ImportReport) -> Option<Warning> {
    let (taken, other) = match (report.format, mesh.up) {
        (Format::Obj | Format::Ply | Format::Off, UpAxis::Y) => (Axis { index: 1, name: "y" }, Axis::Z),
        (Format::StlBinary | Format::StlAscii, UpAxis::Z) => (Axis::Z, Axis { index: 1, name: "y" }),
        _ => return None,
    };
    let why = match said_to_be_up(mesh, report) {
        Some(said) if said == other.index => "as the comment of the program that wrote it tells",
        Some(_) => return None,
        None if stands_on(mesh, other, taken) => "the axis along which it is tall and stands on a flat base",
        None => return None,
    };
    let detail = format!(
        "the file is drawn with {} up, by the custom of its format, and {} is likelier: {why}; `camera.up` decides",
        taken.name, other.name
    );
    Some(Warning { code: CODE, detail })
}

#[derive(Clone, Copy)]
struct Axis {
    index: usize,
    name: &'static str,
}

impl Axis {
    const Z: Self = Self { index: 2, name: "z" };
}

/// The axis that the file's comment names, or that its program is known for.
fn said_to_be_up(mesh: &Mesh, report: &ImportReport) -> Option<usize> {
    let comment = report.metadata.generator.as_ref()?.to_ascii_lowercase();
    let says = |axis: char| {
        let words = [format!("{axis}-up"), format!("{axis} up"), format!("{axis}up"), format!("{axis}_up")];
        let named =
            [format!("up axis: {axis}"), format!("up-axis: {axis}"), format!("up={axis}"), format!("up: {axis}")];
        words.iter().chain(&named).any(|phrase| has_phrase(&comment, phrase))
    };
    match (says('y'), says('z')) {
        (true, false) => Some(1),
        (false, true) => Some(2),
        (true, true) => None,
        (false, false) if mesh.triangles.len() < TRIANGLES_MIN => None,
        (false, false) => {
            let is_known =
                |(start, formats): &&(&str, &[Format])| comment.starts_with(start) && formats.contains(&report.format);
            Z_UP_PROGRAMS.iter().find(is_known).map(|_| 2)
        }
    }
}

/// True if a text has a phrase that is no part of a longer word.
fn has_phrase(text: &str, phrase: &str) -> bool {
    let is_word = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_alphanumeric);
    let bytes = text.as_bytes();
    text.match_indices(phrase).any(|(at, _)| {
        let before = at.checked_sub(1).and_then(|before| bytes.get(before));
        !is_word(before) && !is_word(bytes.get(at + phrase.len()))
    })
}

/// True if a mesh is tall along one axis and has a flat base there, while no other side of its box along
/// the two axes has any.
fn stands_on(mesh: &Mesh, other: Axis, taken: Axis) -> bool {
    if mesh.triangles.len() < TRIANGLES_MIN || !mesh.lines_and_points.is_empty() {
        return false;
    }
    let [low, high] = mesh.bounds;
    let size: [f64; 3] = std::array::from_fn(|k| f64::from(high[k]) - f64::from(low[k]));
    let sides = [size[taken.index], size[0]];
    if size[other.index] < TALL_MIN * sides[0].max(sides[1]) || sides[0].min(sides[1]) <= 0.0 {
        return false;
    }
    // Areas on the two sides of the box across each axis, as shares of the sides.
    let mut shares = [[0.0; 2]; 2];
    for (triangle, normal) in mesh.triangles.iter().zip(&mesh.face_normals) {
        for (axis, shares) in [other.index, taken.index].into_iter().zip(&mut shares) {
            if normal[axis].abs() < 0.999 {
                continue;
            }
            let corners = triangle.map(|v| mesh.positions[v as usize].map(f64::from));
            let is_high = usize::from(normal[axis] > 0.0);
            let plane = f64::from([low, high][is_high][axis]);
            if corners.iter().all(|corner| (corner[axis] - plane).abs() <= BASE_DEPTH * size[axis]) {
                let [a, b, c] = corners;
                let area = cross(sub(b, a), sub(c, a));
                shares[is_high] += 0.5 * dot(area, area).sqrt() * size[axis] / (size[0] * size[1] * size[2]);
            }
        }
    }
    let [[base, top], [taken_low, taken_high]] = shares;
    base >= BASE_MIN && top.max(taken_low).max(taken_high) <= NO_BASE_MAX
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Bundle, FileMetadata, import};
    use crate::limits::{Budget, Deadline, Limits};

    /// A vase as OBJ: rings around an axis (1 is y, 2 is z), closed by a flat base at its lower end.
    fn vase(axis: usize, comment: &str) -> String {
        let (rings, around) = (12, 24);
        let mut obj = format!("# {comment}\n");
        for ring in 0..=rings {
            for k in 0..around {
                let (h, a) = (f64::from(ring) / 6.0, std::f64::consts::TAU * f64::from(k) / f64::from(around));
                let r = 0.5 + 0.2 * libm::sin(4.0 * h);
                let (x, z) = (r * libm::cos(a), r * libm::sin(a));
                obj += &if axis == 1 { format!("v {x} {h} {z}\n") } else { format!("v {x} {} {h}\n", -z) };
            }
        }
        for ring in 0..rings {
            for k in 0..around {
                let at = |ring: i32, k: i32| ring * around + k % around + 1;
                obj += &format!("f {} {} {} {}\n", at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1));
            }
        }
        let base: Vec<String> = (1..=around).map(|k| k.to_string()).collect();
        obj + &format!("f {}\n", base.join(" "))
    }

    fn warned(text: &str, up: UpAxis, format: Format) -> bool {
        let limits = Limits::default();
        let bundle = Bundle::of_one(text.as_bytes().to_vec());
        let (mesh, report) = import(&bundle, None, &limits, &mut Budget::new(&limits), &Deadline::default()).unwrap();
        let mesh = Mesh { up, ..mesh };
        warning(&mesh, &ImportReport { format, ..report }).is_some()
    }

    #[test]
    fn a_vase_that_stands_on_the_other_axis_is_seen() {
        let cases = [
            (1, UpAxis::Y, Format::Obj, false),
            (2, UpAxis::Y, Format::Obj, true),
            (2, UpAxis::Y, Format::Off, true),
            (2, UpAxis::Y, Format::Gltf, false),
            (1, UpAxis::Z, Format::StlBinary, true),
            (2, UpAxis::Z, Format::StlBinary, false),
        ];
        for (axis, up, format, warns) in cases {
            assert_eq!(warned(&vase(axis, "by hand"), up, format), warns, "{axis} {up:?} {format}");
        }
    }

    #[test]
    fn a_comment_counts_more_than_the_shape() {
        let cases = [
            ("units mm, Z-up", 1, true),
            ("up axis: z", 1, true),
            ("Y-up", 2, false),
            ("y up or z up", 2, true),
            ("fuzzy upper lazy-upright", 1, false),
            ("OpenSCAD obj exporter", 1, true),
        ];
        for (comment, axis, warns) in cases {
            assert_eq!(warned(&vase(axis, comment), UpAxis::Y, Format::Obj), warns, "{comment}");
        }
        let metadata = FileMetadata::by(Some("Created by Blender 4.2".into()));
        for (format, is_up) in [(Format::Ply, Some(2)), (Format::Obj, None)] {
            let report = ImportReport { format, metadata: metadata.clone(), ..ImportReport::default() };
            let mesh = |count| Mesh { triangles: vec![[0, 1, 2]; count], ..Mesh::default() };
            assert_eq!(said_to_be_up(&mesh(TRIANGLES_MIN), &report), is_up, "{format}");
            assert_eq!(said_to_be_up(&mesh(12), &report), None, "{format}");
        }
    }
}
