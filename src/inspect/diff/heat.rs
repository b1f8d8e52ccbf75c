//! A mesh painted by its distance from another mesh, for the picture that shows where two meshes differ: its vertices
//! are grey where there is no distance, and red at the largest one. Also the points to which one camera for both
//! meshes is fitted, and the legend of the colours.

use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::{MaterialSlot, Mesh};
use meshsnap_render::plan::heat::{DIVERGING, Legend, color};

use super::frame::Frame;

/// Memory of a vertex: position, colour, and the place to which the camera is fitted.
const BYTES_PER_VERTEX: u64 = 12 + 16 + 12;

/// Memory of a face: corners and attributes, normal, mask and material.
const BYTES_PER_FACE: u64 = 12 + 12 + 12 + 1 + 4;

/// The name of what the colours mean.
const TITLE: &str = "distance";

/// The request's keys of a picture of a difference: both sides in one picture, lit so that colours can be compared,
/// drawn by the CPU, so that its bytes are the same everywhere.
pub const PICTURE_KEYS: [(&str, &str); 4] =
    [("style", "smooth"), ("size", "1024x512"), ("light.ambient", "0.5"), ("backend", "cpu")];

/// A mesh without materials of its own, whose vertices have colours from grey, for no distance, to red, for `most`.
pub fn painted(mesh: &Mesh, distances: &[f64], most: f64, budget: &mut Budget) -> Result<Mesh, LimitExceeded> {
    budget.spend("the colours of a difference", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
    budget.spend("the colours of a difference", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
    budget.spend("the colours of a difference", mesh.lines_and_points.len() as u64, 12 + 8)?;
    let of_vertex = |vertex: usize| {
        let distance = distances.get(vertex).copied().unwrap_or(0.0);
        let share = if most > 0.0 { (distance / most).min(1.0) } else { 0.0 };
        // The map's second half begins with grey.
        color(&DIVERGING, (0.5 + 0.5 * share) as f32)
    };
    let lines_and_points: Vec<_> =
        mesh.lines_and_points.iter().map(|one| meshsnap_render::mesh::LineOrPoint { material: 0, ..*one }).collect();
    let white = MaterialSlot { base_color: Some([1.0; 4]), ..MaterialSlot::default() };
    Ok(Mesh {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.clone(),
        face_normals: mesh.face_normals.clone(),
        edge_masks: mesh.edge_masks.clone(),
        triangle_materials: vec![0; mesh.triangles.len()],
        materials: vec![white],
        attribute_triangles: mesh.triangles.clone(),
        line_point_attributes: lines_and_points.iter().map(|one| one.ends).collect(),
        lines_and_points,
        colors: (0..mesh.positions.len()).map(of_vertex).collect(),
        bounds: mesh.bounds,
        to_file: mesh.to_file,
        up: mesh.up,
        ..Mesh::default()
    })
}

/// All positions of both meshes in the unit box of the first, to which one camera is fitted.
pub fn framing(mesh: &Mesh, other: &Mesh, budget: &mut Budget) -> Result<Vec<[f32; 3]>, LimitExceeded> {
    let count = mesh.positions.len() + other.positions.len();
    budget.spend("the view of a difference", count as u64, 12)?;
    let frame = Frame::between(&other.to_file, &mesh.to_file);
    // Beyond this size a camera cannot be placed in f32, and nothing of the smaller mesh would be seen.
    let held = |value: f64| value.clamp(-1e6, 1e6) as f32;
    let others = other.positions.iter().map(|position| frame.map(*position).map(held));
    Ok(mesh.positions.iter().copied().chain(others).collect())
}

/// What the colours mean.
pub fn legend(most: f64) -> Legend {
    let whole = Legend::new(TITLE, [0.0, most], &DIVERGING);
    let half = whole.colors.len() / 2;
    Legend { colors: whole.colors[half..].to_vec(), ..whole }
}
