//! The edges of a mesh: each is listed once, with the faces that meet there. Lines, outlines and reports
//! on a mesh are made from this list.

mod collect;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use super::Mesh;
use crate::limits::{Budget, LimitExceeded};
use crate::mesh::vector::is_in_order;

/// An edge and the two faces it belongs to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Edge {
    /// Indices into the positions.
    pub vertices: [u32; 2],
    /// Triangle indices; [`Edge::NO_FACE`] where there is no second face.
    pub faces: [u32; 2],
}

impl Edge {
    /// No triangle.
    pub const NO_FACE: u32 = u32::MAX;

    /// An edge that runs from the smaller position to the larger, so that a line's bytes do not
    /// depend on the order, the numbers and the winding of the faces that have the edge.
    #[inline]
    pub fn new(positions: &[[f32; 3]], [a, b]: [u32; 2], faces: [u32; 2]) -> Self {
        let is_in_order = is_in_order(positions[a as usize], positions[b as usize]);
        Self { vertices: if is_in_order { [a, b] } else { [b, a] }, faces }
    }
}

/// An undirected edge, its first two faces, and its properties.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshEdge {
    /// The two ends, from the smaller position to the larger.
    pub vertices: [u32; 2],
    /// The first two faces at the edge, in mesh order; [`Edge::NO_FACE`] where there is only one.
    pub faces: [u32; 2],
    /// The number of faces: 1 for an open edge, 2 for a manifold one, 3 for a non-manifold one, however
    /// many it has.
    pub face_count: u32,
    /// True if the file's polygon has this edge; false for a diagonal that triangulation added.
    pub is_polygon_edge: bool,
    /// True if a further face runs along the edge in the first one's direction, so that one of the
    /// two is inside out.
    pub has_inconsistent_winding: bool,
}

/// All edges of a mesh, in the order of the first triangles at them. Neighbours in the list are
/// near on the mesh.
#[derive(Clone, Debug, Default)]
pub struct EdgeList {
    /// The edges, each with its first two faces in mesh order.
    pub edges: Arc<Vec<Edge>>,
    /// The third and further faces at non-manifold edges: the edge's index and the face, in mesh
    /// order.
    pub further_faces: Vec<[u32; 2]>,
    /// By edge: the number of faces in the lowest bits, and flags.
    kinds: Vec<u8>,
}

/// Bits of a kind: the number of faces, 3 for all numbers above 2.
const FACE_COUNT: u8 = 0b11;
/// Flag: [`MeshEdge::is_polygon_edge`].
const IS_POLYGON_EDGE: u8 = 1 << 2;
/// Flag: [`MeshEdge::has_inconsistent_winding`].
const HAS_INCONSISTENT_WINDING: u8 = 1 << 3;

impl EdgeList {
    /// Collects the edges of `mesh`.
    pub fn of(mesh: &Mesh, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        collect::collect(mesh, budget)
    }

    /// The number of edges.
    pub fn len(&self) -> usize {
        self.edges.len()
    }

    /// Memory of the list, bytes.
    pub fn bytes(&self) -> usize {
        self.len() * (size_of::<Edge>() + 1) + size_of_val(&self.further_faces[..])
    }

    /// True if there are no edges.
    pub fn is_empty(&self) -> bool {
        self.edges.is_empty()
    }

    /// The edge with this number.
    pub fn get(&self, index: usize) -> MeshEdge {
        MeshEdge::new(self.edges[index], self.kinds[index])
    }

    /// The edges, in order.
    pub fn iter(&self) -> impl Iterator<Item = MeshEdge> {
        self.edges.iter().zip(&self.kinds).map(|(edge, kind)| MeshEdge::new(*edge, *kind))
    }

    /// True if every edge has exactly two faces, which run along it in opposite directions: then
    /// the mesh bounds a solid.
    pub fn is_closed(&self) -> bool {
        self.all(|kind| kind & (FACE_COUNT | HAS_INCONSISTENT_WINDING) == 2)
    }

    /// True if every edge is one of the file's polygons.
    pub fn has_polygon_edges_alone(&self) -> bool {
        self.all(|kind| kind & IS_POLYGON_EDGE != 0)
    }

    /// True if all kinds pass a test. It is made block by block, without a branch for each.
    fn all(&self, passes: impl Fn(u8) -> bool) -> bool {
        self.kinds.chunks(4096).all(|kinds| kinds.iter().fold(true, |all, &kind| all & passes(kind)))
    }
}

impl MeshEdge {
    fn new(Edge { vertices, faces }: Edge, kind: u8) -> Self {
        Self {
            vertices,
            faces,
            face_count: u32::from(kind & FACE_COUNT),
            is_polygon_edge: kind & IS_POLYGON_EDGE != 0,
            has_inconsistent_winding: kind & HAS_INCONSISTENT_WINDING != 0,
        }
    }
}
