//! A mask for each triangle that says which of its three edges its material's wire follows (all, if
//! there is no wire). It is for wires that are drawn by barycentric coordinates while the surface is
//! shaded, and for the debug view of distances to edges.

use crate::mesh::Mesh;
use crate::mesh::edges::{Edge, EdgeList};
use crate::plan::PlanError;
use crate::plan::context::PlanContext;
use crate::plan::edges::edge_class::{Class, belongs_to, class_of};
use crate::plan::geometry::Geometry;
use crate::scene::Scene;

/// A mask per triangle (bit i: corner i to i + 1); empty where wires follow all edges.
pub fn edge_masks(
    scene: &Scene<'_, '_>,
    geometry: &Geometry<'_>,
    cx: &mut PlanContext<'_>,
) -> Result<Vec<u8>, PlanError> {
    let mesh = scene.mesh;
    let classes: Vec<Class> =
        scene.groups.by_material.iter().map(|layers| layers.wire.as_ref().map_or(Class::All, class_of)).collect();
    let has_diagonals = mesh.edge_masks.iter().any(|&mask| mask != 0b111);
    let is_mesh_alone = geometry.mesh_triangle_count == geometry.triangles.len();
    if is_mesh_alone && classes.iter().all(|class| *class == Class::All || (*class == Class::Polygon && !has_diagonals))
    {
        return Ok(Vec::new());
    }
    cx.budget.spend("edge masks", geometry.triangles.len() as u64, 1)?;
    let class_at = |t: usize| classes.get(mesh.triangle_materials[t] as usize).copied().unwrap_or(Class::All);
    // The triangles of lines and points follow those of the mesh and have no edges.
    let mut masks = vec![0; geometry.triangles.len()];
    for (t, mask) in masks.iter_mut().take(geometry.mesh_triangle_count).enumerate() {
        *mask = match class_at(t) {
            Class::All => 0b111,
            Class::Polygon => mesh.edge_masks[t],
            _ => 0,
        };
    }
    let depends_on_neighbours = |class: &Class| !matches!(class, Class::All | Class::Polygon);
    if classes.iter().any(depends_on_neighbours) {
        let edges = cx.edges(mesh)?;
        mark(mesh, &edges, &mut masks, class_at);
    }
    Ok(masks)
}

/// Sets the bits of edges that belong to their triangle's class, where that depends on neighbours.
fn mark(mesh: &Mesh, list: &EdgeList, masks: &mut [u8], class_at: impl Fn(usize) -> Class) {
    let first_two = list.iter().flat_map(|edge| edge.faces.map(|face| (edge, face)));
    let further = list.further_faces.iter().map(|&[edge, face]| (list.get(edge as usize), face));
    for (edge, face) in first_two.chain(further).filter(|&(_, face)| face != Edge::NO_FACE) {
        if belongs_to(class_at(face as usize), mesh, &edge) {
            masks[face as usize] |= corner_bit(&mesh.triangles[face as usize], edge.vertices);
        }
    }
}

fn corner_bit(triangle: &[u32; 3], [a, b]: [u32; 2]) -> u8 {
    (0..3).filter(|&k| [[a, b], [b, a]].contains(&[triangle[k], triangle[(k + 1) % 3]])).map(|k| 1 << k).sum()
}
