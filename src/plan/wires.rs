//! Which edges a wire follows, once each.

use super::{Edge, LinePass};
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::mesh::edges::EdgeList;
use crate::scene::{Hidden, Spec, Wire, WireEdges};

/// The line pass of an exact wire.
pub fn pass(mesh: &Mesh, wire: &Wire, spec: &Spec, budget: &mut Budget) -> Result<LinePass, LimitExceeded> {
    let list = EdgeList::of(mesh, budget)?;
    let hide_behind_surface = wire.hidden == Hidden::Hide && spec.surface.is_some();
    let skip_back_edges = hide_behind_surface && list.is_closed();
    let every = draws_every_edge(mesh, wire);
    let edges = list
        .edges
        .iter()
        .filter(|edge| every || edge.is_polygon_edge)
        .map(|edge| Edge { vertices: edge.vertices, faces: edge.faces })
        .collect::<Vec<_>>();
    budget.spend("drawn edges", edges.len() as u64, 16)?;
    Ok(LinePass {
        edges,
        width_px: wire.thickness,
        smoothing_px: wire.smoothing,
        color: color(wire),
        hide_behind_surface,
        skip_back_edges,
    })
}

/// Whether the wire follows every edge of every triangle.
pub fn draws_every_edge(mesh: &Mesh, wire: &Wire) -> bool {
    wire.edges == WireEdges::Triangles || mesh.edge_masks.iter().all(|&mask| mask == 0b111)
}

/// Premultiplied, opacity included.
pub fn color(wire: &Wire) -> [f32; 4] {
    wire.color.premultiplied().map(|v| v * wire.opacity)
}
