//! The memory that a plan's pixels, vertices, triangles and materials take, in the plan and in the
//! back-end that draws it. It is computed from their numbers, and taken from the job's budget before
//! it is allocated. If the budget does not suffice, the picture is refused. Other parts, such as
//! lines, spend theirs themselves.

use super::HullPass;
use super::geometry::Geometry;
use super::peeling::needed_pass;
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::normals::working_bytes;
use crate::scene::Scene;
use crate::spec::{Samples, Shading};

/// Bytes per material: what the shaders read of it, and flags.
const MATERIAL_BYTES: u64 = 307;

/// Bytes that a back-end takes per vertex on screen.
const VERTEX_BYTES: u64 = 32;

/// Bytes per triangle: up to four entries in the lists of the picture's bands, each with an id and
/// vertex indices, or an id and its box (or eight ids in lists of tiles), two ids in lists that are not by band, and a
/// colour.
const LISTED_BYTES: u64 = 4 * 16 + 2 * 4 + 16;

/// Bytes more per triangle where samples are adaptive: up to four entries, with boxes, in the lists of thin triangles.
const THIN_BYTES: u64 = 4 * 16;

/// Bytes more per triangle where a plan has layers: it may be in the lists of the visibility buffer
/// and in those of the layers, and each thread notes which triangles are done.
const LAYERED_BYTES: u64 = 4 * 16 + 2 * 4 + 8;

/// Bytes per position for computed vertex normals: a sum in f64, then the unit normal in f32.
const NORMAL_BYTES: u64 = 36;

/// Spends what the plan and both back-ends will allocate, hulls and lines aside.
pub fn spend_plan(scene: &Scene<'_, '_>, geometry: &Geometry<'_>, budget: &mut Budget) -> Result<(), LimitExceeded> {
    let Scene { mesh, groups, .. } = scene;
    let [width, height] = scene.size_px().map(u64::from);
    let (vertices, triangles) = (geometry.positions.len() as u64, geometry.triangles.len() as u64);
    budget.spend("materials", mesh.materials.len() as u64, MATERIAL_BYTES)?;
    budget.spend("the picture", width * height, 4)?;
    budget.spend("vertices on screen", vertices, VERTEX_BYTES)?;
    // Two bytes more are the pass mask, and the bits of the side that it shows.
    budget.spend("lists of triangles", triangles, LISTED_BYTES + 2)?;
    budget.spend("lists of thin triangles", triangles, thin_bytes(scene.spec.image.samples))?;
    if needed_pass(groups).is_some() {
        // Layers are drawn band by band, so what they take per sample is bounded.
        budget.spend("lists of layers", triangles, LAYERED_BYTES)?;
    }
    let is_smooth = groups.styles.iter().any(|l| l.surface.is_some_and(|s| s.shading == Shading::Smooth));
    if is_smooth && mesh.normals.is_empty() {
        budget.spend("vertex normals", vertices, NORMAL_BYTES)?;
        budget.spend("vertex normals", working_bytes(geometry.triangles.len()), 1)?;
    }
    Ok(())
}

/// Spends what both back-ends will allocate for a hull: as much as for the mesh's own vertices and
/// triangles.
pub fn spend_hull(hull: &HullPass<'_>, scene: &Scene<'_, '_>, budget: &mut Budget) -> Result<(), LimitExceeded> {
    let (vertices, triangles) = (hull.vertices.len() as u64, hull.triangles.len() as u64);
    budget.spend("an outline's vertices on screen", vertices, VERTEX_BYTES)?;
    budget.spend("lists of an outline's triangles", triangles, LISTED_BYTES)?;
    budget.spend("lists of an outline's thin triangles", triangles, thin_bytes(scene.spec.image.samples))?;
    let layers = if needed_pass(&scene.groups).is_some() { LAYERED_BYTES } else { 0 };
    budget.spend("lists of an outline's layers", triangles, layers)
}

fn thin_bytes(samples: Samples) -> u64 {
    match samples {
        Samples::Adaptive => THIN_BYTES,
        Samples::Fixed(_) => 0,
    }
}
