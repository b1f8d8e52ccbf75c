//! Classes of edges, which say along which edges of a mesh lines are drawn: all edges, edges of the
//! file's polygons, features (edges where the surface bends sharply, ends or branches), creases (where it
//! only bends sharply), open edges, or non-manifold edges.

use crate::mesh::Mesh;
use crate::mesh::creases::sharp_cos;
use crate::mesh::edges::MeshEdge;
use crate::spec::{Wire, WireEdges};

/// A class of edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Class {
    /// All edges.
    All,
    /// Edges of the file's polygons, without the diagonals of triangulation.
    Polygon,
    /// Edges whose faces meet at an angle with a cosine below this ([`sharp_cos`]), and edges without
    /// exactly two faces.
    Feature(f64),
    /// Edges of exactly two faces that meet at an angle with a cosine below this ([`sharp_cos`]).
    Crease(f64),
    /// Edges with one face.
    Boundary,
    /// Edges with more than two faces, or with two that disagree which side is out.
    Nonmanifold,
}

/// The class that a wire follows.
pub fn class_of(wire: &Wire) -> Class {
    match wire.edges {
        WireEdges::Triangles => Class::All,
        WireEdges::Polygons => Class::Polygon,
        WireEdges::Feature => Class::Feature(sharp_cos(wire.feature_angle_deg)),
        WireEdges::Boundary => Class::Boundary,
    }
}

/// True if an edge belongs to a class.
pub fn belongs_to(class: Class, mesh: &Mesh, edge: &MeshEdge) -> bool {
    let bends = |limit: f64| {
        let [a, b] = edge.faces.map(|face| mesh.face_normals[face as usize].map(f64::from));
        let cos = (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
        if a == [0.0; 3] || b == [0.0; 3] {
            // A face without area has no direction to bend from.
            return false;
        }
        // Two faces that disagree which side is out bend the other way round.
        (if edge.has_inconsistent_winding { -cos } else { cos }) < limit
    };
    match class {
        Class::All => true,
        Class::Polygon => edge.is_polygon_edge,
        Class::Feature(limit) => edge.face_count != 2 || bends(limit),
        Class::Crease(limit) => edge.face_count == 2 && bends(limit),
        Class::Boundary => edge.face_count == 1,
        Class::Nonmanifold => edge.face_count > 2 || (edge.face_count == 2 && edge.has_inconsistent_winding),
    }
}

#[cfg(test)]
mod tests;
