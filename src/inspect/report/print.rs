//! The section of a report on 3D printing: the thickness of walls, overhangs that need support, and the way in which
//! the mesh stands on the bed of the printer.

use std::collections::BTreeMap;

use serde::Serialize;

use super::without_rounding;
use crate::geometry::thickness::thicknesses;
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::vector::{cross, dot, sub};
use meshsnap_render::spec::words::word_for;

/// Faces that look down more than this from the vertical hang over: up to it, printers need no support.
const OVERHANG_DEG: f64 = 45.0;

/// Largest height above the bed that counts as lying on it, in the unit box.
const ON_BED: f64 = 1e-5;

/// Most planes that are tried for the one on which the mesh would stand.
const PLANES_MAX: usize = 64;

/// Memory per face: its plane.
const BYTES_PER_FACE: u64 = 96;

/// The figures of a mesh for printing, in the file's units.
#[derive(Clone, Debug, Serialize)]
pub struct PrintReport {
    /// The axis away from the bed.
    up: &'static str,
    /// Null without faces.
    wall_thickness: Option<WallReport>,
    overhangs: OverhangReport,
    bed: BedReport,
}

/// The thickness of walls, straight inwards from the middles of faces.
#[derive(Clone, Debug, Serialize)]
struct WallReport {
    min: f64,
    /// The middle of the face where it is thinnest.
    at: [f64; 3],
    median: f64,
    /// Faces that were measured: at most 50,000.
    faces: u64,
    /// Those of them below which there is nothing: the surface is open there, or inside out.
    open: u64,
}

/// Faces that look down and do not lie on the bed.
#[derive(Clone, Debug, Serialize)]
struct OverhangReport {
    /// From the vertical.
    limit_deg: f64,
    /// Of the faces beyond the limit that do not lie on the bed.
    area: f64,
    /// The same as a part of the whole area.
    share: f64,
    /// The largest angle from the vertical; 90 is a ceiling. Null where nothing looks down.
    steepest_deg: Option<f64>,
}

/// The way in which the mesh stands.
#[derive(Clone, Debug, Serialize)]
struct BedReport {
    /// The area that lies on the bed.
    contact_area: f64,
    /// The angle between the bed and the largest flat side on which the mesh could stand, if that looks down by 45
    /// degrees or more.
    tilt_deg: Option<f64>,
}

/// A face: its normal, its area, its corners.
struct Face {
    normal: [f64; 3],
    area: f64,
    corners: [[f64; 3]; 3],
}

impl PrintReport {
    /// On a mesh. None of its figures depends on the order of faces but for the choice of those that are measured.
    pub fn of(mesh: &Mesh, budget: &mut Budget, deadline: &Deadline) -> Result<Self, MeshError> {
        budget.spend("the report on printing", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
        let up = mesh.up.direction();
        let height = |position: [f64; 3]| dot(position, up);
        let lowest = mesh.positions.iter().map(|p| height(p.map(f64::from))).fold(f64::INFINITY, f64::min);
        let faces: Vec<Face> = mesh.triangles.iter().filter_map(|corners| face(mesh, *corners)).collect();
        deadline.check()?;
        let down = |face: &Face| libm::acos((-dot(face.normal, up)).clamp(-1.0, 1.0)).to_degrees();
        let is_on_bed = |face: &Face| face.corners.iter().all(|corner| height(*corner) - lowest <= ON_BED);
        let whole: f64 = faces.iter().map(|face| face.area).sum();
        let hanging = || faces.iter().filter(|face| !is_on_bed(face));
        let beyond: f64 = hanging().filter(|face| down(face) < 90.0 - OVERHANG_DEG).map(|face| face.area).sum();
        let steepest = hanging().map(|face| 90.0 - down(face)).filter(|angle| *angle > 0.0).reduce(f64::max);
        let scale = mesh.to_file.scale;
        // The sum of nothing is a negative zero.
        let area = |value: f64| without_rounding(value * scale * scale + 0.0, whole * scale * scale);
        let contact: f64 = faces.iter().filter(|face| is_on_bed(face)).map(|face| face.area).sum();
        let angle = |value: f64| without_rounding(value, 90.0);
        Ok(Self {
            up: word_for(mesh.up),
            wall_thickness: walls(mesh, budget, deadline)?,
            overhangs: OverhangReport {
                limit_deg: OVERHANG_DEG,
                area: area(beyond),
                share: if whole > 0.0 { without_rounding(beyond / whole, 1.0) } else { 0.0 },
                steepest_deg: steepest.map(angle),
            },
            bed: BedReport {
                contact_area: area(contact),
                tilt_deg: standing(mesh, &faces, |face| down(face) <= OVERHANG_DEG, deadline)?
                    .map(|normal| angle(libm::acos((-dot(normal, up)).clamp(-1.0, 1.0)).to_degrees())),
            },
        })
    }

    /// For a person to read.
    pub fn text(&self) -> String {
        let Self { up, wall_thickness, overhangs, bed } = self;
        let mut text = format!("print, with {up} up\n");
        if let Some(WallReport { min, at: [x, y, z], median, open, .. }) = wall_thickness {
            text += &format!("  walls      at least {min} thick, near ({x}, {y}, {z}); {median} in the middle");
            text += &if *open > 0 { format!("; {open} faces with nothing below\n") } else { "\n".to_owned() };
        }
        let OverhangReport { limit_deg, area, share, steepest_deg } = overhangs;
        let steepest = steepest_deg.map(|angle| format!(", up to {angle} degrees")).unwrap_or_default();
        text +=
            &format!("  overhangs  {area} beyond {limit_deg} degrees ({} % of the surface){steepest}\n", 100.0 * share);
        let tilt = bed.tilt_deg.map(|angle| format!(", tilted by {angle} degrees")).unwrap_or_default();
        text + &format!("  bed        {} in contact{tilt}\n", bed.contact_area)
    }
}

fn walls(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Option<WallReport>, MeshError> {
    let all = thicknesses(mesh, budget, deadline)?;
    let mut lengths: Vec<f64> = all.iter().filter_map(|one| one.length).collect();
    lengths.sort_by(f64::total_cmp);
    let thinnest = all.iter().filter(|one| one.length.is_some());
    let thinnest =
        thinnest.min_by(|a, b| a.length.unwrap_or(0.0).total_cmp(&b.length.unwrap_or(0.0)).then(a.face.cmp(&b.face)));
    let Some(thinnest) = thinnest else { return Ok(None) };
    let to_file = &mesh.to_file;
    let tidy = |value: f64| without_rounding(value, to_file.scale);
    Ok(Some(WallReport {
        min: tidy(lengths[0] * to_file.scale),
        at: std::array::from_fn(|k| tidy(to_file.centre[k] + to_file.scale * thinnest.at[k])),
        median: tidy(lengths[lengths.len() / 2] * to_file.scale),
        faces: all.len() as u64,
        open: (all.len() - lengths.len()) as u64,
    }))
}

/// The normal of the largest flat side that looks down and has the whole mesh on one side.
fn standing(
    mesh: &Mesh,
    faces: &[Face],
    looks_down: impl Fn(&Face) -> bool,
    deadline: &Deadline,
) -> Result<Option<[f64; 3]>, MeshError> {
    // Faces of one plane, by normal and distance as they are rounded.
    let mut planes: BTreeMap<[i64; 4], (f64, [f64; 3], f64)> = BTreeMap::new();
    for face in faces.iter().filter(|face| looks_down(face)) {
        let offset = dot(face.normal, face.corners[0]);
        let rounded = |value: f64, step: f64| (value / step).round() as i64;
        let [x, y, z] = face.normal.map(|value| rounded(value, 1e-4));
        let plane = planes.entry([x, y, z, rounded(offset, 1e-4)]).or_insert((0.0, face.normal, offset));
        plane.0 += face.area;
    }
    let mut planes: Vec<_> = planes.into_values().collect();
    planes.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, normal, offset) in planes.into_iter().take(PLANES_MAX) {
        deadline.check()?;
        if mesh.positions.iter().all(|position| dot(position.map(f64::from), normal) <= offset + ON_BED) {
            return Ok(Some(normal));
        }
    }
    Ok(None)
}

fn face(mesh: &Mesh, corners: [u32; 3]) -> Option<Face> {
    let corners = corners.map(|vertex| mesh.positions[vertex as usize].map(f64::from));
    let [a, b, c] = corners;
    let normal = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    (length > 0.0).then(|| Face { normal: normal.map(|value| value / length), area: length / 2.0, corners })
}
