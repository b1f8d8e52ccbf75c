//! The positions of the mesh to which the camera is fitted. These are all positions, except those that
//! belong only to faces on which a texture's alpha mask shows nothing: invisible faces must not make the
//! visible ones small. If the picture does not show the mask, or nothing is visible, all positions count.

use super::PlanError;
use super::cut_outs::{CutOuts, masked};
use super::prepared::Prepared;
use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::AlphaMode;
use crate::scene::MaterialGroups;
use crate::spec::Spec;

/// The positions that frame the picture; None if all do.
pub fn framing(
    mesh: &Mesh,
    spec: &Spec,
    prepared: &Prepared,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Option<Vec<[f32; 3]>>, PlanError> {
    let has_masks = || mesh.materials.iter().any(|slot| matches!(slot.alpha, AlphaMode::Mask(_)));
    if spec.camera.from_file || spec.camera.eye.is_some() || !has_masks() {
        return Ok(None);
    }
    budget.spend("materials", mesh.materials.len() as u64, 16)?;
    let masked = masked(mesh, &MaterialGroups::new(mesh, spec));
    if masked.is_empty() {
        return Ok(None);
    }
    let cut_outs = prepared.cut_outs.get_or_find(budget, |budget| CutOuts::of(mesh, budget, deadline))?;
    let is_absent =
        |face: usize| masked.get(mesh.triangle_materials[face] as usize) == Some(&true) && cut_outs.is_absent(face);
    if !(0..mesh.triangles.len()).any(is_absent) {
        return Ok(None);
    }
    budget.spend("the framing", mesh.positions.len() as u64, 12 + 1)?;
    let mut is_framing = vec![false; mesh.positions.len()];
    let faces = mesh.triangles.iter().enumerate().filter(|(face, _)| !is_absent(*face));
    let ends = mesh.lines_and_points.iter().flat_map(|one| one.ends);
    faces.flat_map(|(_, corners)| *corners).chain(ends).for_each(|v| is_framing[v as usize] = true);
    let framing = mesh.positions.iter().zip(&is_framing).filter(|(_, is_framing)| **is_framing);
    let framing: Vec<[f32; 3]> = framing.map(|(position, _)| *position).collect();
    // A mesh of which nothing shows is framed as it is.
    Ok(Some(framing).filter(|framing| !framing.is_empty()))
}
