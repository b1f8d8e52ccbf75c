//! The test whether a mesh is another one that was scaled by one factor or shifted as a whole, or both, as by a
//! change of the unit from millimetres to inches. Such a change can then be told in one sentence, and not as a change
//! of each part.

use super::faces::Faces;
use super::frame::{Frame, diagonal};
use super::vertices::Grid;
use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;

/// What happened to all vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whole {
    /// How many times as large as before.
    pub factor: f64,
    /// The shift of the lower corner of the box, file units.
    pub by: [f64; 3],
}

/// How `b` comes from `a` by one factor and one shift, where no face stayed. `tolerance` is in the unit box of `a`.
pub fn find(
    a: &Mesh,
    b: &Mesh,
    faces: &Faces,
    tolerance: f64,
    budget: &mut Budget,
) -> Result<Option<Whole>, LimitExceeded> {
    let have_same_counts = a.positions.len() == b.positions.len() && a.triangles.len() == b.triangles.len();
    if !have_same_counts || !faces.common.is_empty() || a.positions.is_empty() {
        return Ok(None);
    }
    let diagonals = [a, b].map(|mesh| diagonal([mesh, mesh]));
    let factor = diagonals[1] / diagonals[0];
    if !factor.is_normal() {
        return Ok(None);
    }
    // Whole factors and those between units are exact, what is found is rounded.
    let factor = nearest_known(factor);
    let to_a = Frame::between(&b.to_file, &a.to_file);
    let lower = [a.bounds[0].map(f64::from), to_a.map(b.bounds[0])];
    // Rounding in a larger file is larger, too.
    let tolerance = 4.0 * (tolerance / factor).max(tolerance.min(1e-5));
    let points = a.positions.iter().map(|position| position.map(f64::from)).collect();
    // The memory of the grid is free again afterwards.
    let grid = Grid::new(points, tolerance, &mut budget.clone())?;
    let is_there = |position: &[f32; 3]| {
        let place = to_a.map(*position);
        grid.find(std::array::from_fn(|k| lower[0][k] + (place[k] - lower[1][k]) / factor)).is_some()
    };
    if !b.positions.iter().all(is_there) {
        return Ok(None);
    }
    let scale = a.to_file.scale;
    Ok(Some(Whole { factor, by: std::array::from_fn(|k| (lower[1][k] - lower[0][k]) * scale) }))
}

/// The factor between two units that this is, within rounding, or else the same.
fn nearest_known(factor: f64) -> f64 {
    let units =
        [0.001, 0.01, 0.0254, 0.1, 0.3048, 1.0, 2.54, 10.0, 12.0, 25.4, 39.370_078_740_157_48, 100.0, 304.8, 1000.0];
    units.into_iter().find(|unit| (factor / unit - 1.0).abs() < 1e-6).unwrap_or(factor)
}
