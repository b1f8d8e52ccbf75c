//! The unique edges of a mesh and the faces at each.

use super::Mesh;
use crate::limits::{Budget, LimitExceeded};

/// The place of a missing face in [`MeshEdge::faces`].
pub const NO_FACE: u32 = u32::MAX;

/// An undirected edge and its first two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshEdge {
    /// The two ends, in the direction in which the first face runs along the edge.
    pub vertices: [u32; 2],
    /// The first two faces at the edge, in mesh order; [`NO_FACE`] where there is only one.
    pub faces: [u32; 2],
    /// The number of faces: 1 for an open edge, 2 for a manifold one, more for a non-manifold one.
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
    /// The edges.
    pub edges: Vec<MeshEdge>,
    /// The third and further faces at non-manifold edges: the edge's index and the face, in mesh
    /// order.
    pub further_faces: Vec<[u32; 2]>,
}

impl EdgeList {
    /// Collects the edges of `mesh`.
    pub fn of(mesh: &Mesh, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let half_edges = mesh.triangles.len() as u64 * 3;
        budget.spend("the edges", half_edges, 8 + 4 + size_of::<MeshEdge>() as u64)?;
        budget.spend("the edges", mesh.positions.len() as u64 + 1, 4)?;
        let buckets = Buckets::of(mesh);
        let first_half_edges = buckets.first_half_edges(half_edges as usize);
        Ok(collect(mesh, &first_half_edges))
    }

    /// True if every edge has exactly two faces, which run along it in opposite directions: then
    /// the mesh bounds a solid.
    pub fn is_closed(&self) -> bool {
        self.edges.iter().all(|e| e.face_count == 2 && !e.has_inconsistent_winding)
    }
}

/// Half-edges in buckets by their lower vertex, filled by counting sort. Half-edge `3 t + i` of
/// triangle `t` goes from corner `i` to corner `i + 1`.
struct Buckets {
    /// The end of each vertex's bucket in `half_edges`.
    ends: Vec<u32>,
    /// The upper vertex and the number of each half-edge.
    half_edges: Vec<(u32, u32)>,
}

impl Buckets {
    fn of(mesh: &Mesh) -> Self {
        let mut ends = vec![0_u32; mesh.positions.len() + 1];
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                ends[a.min(b) as usize + 1] += 1;
            }
        }
        for v in 1..ends.len() {
            ends[v] += ends[v - 1];
        }
        let mut half_edges = vec![(0, 0); mesh.triangles.len() * 3];
        let mut number = 0;
        // Filling a bucket moves `ends[v]` from the bucket's start to its end.
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let slot = &mut ends[a.min(b) as usize];
                half_edges[*slot as usize] = (a.max(b), number);
                *slot += 1;
                number += 1;
            }
        }
        ends.pop();
        Self { ends, half_edges }
    }

    /// The first half-edge on the same edge, for each half-edge.
    fn first_half_edges(mut self, count: usize) -> Vec<u32> {
        let mut first_half_edges = vec![0; count];
        let mut start = 0;
        for &end in &self.ends {
            let bucket = &mut self.half_edges[start..end as usize];
            start = end as usize;
            // A bucket holds about three entries, but the hub of a hostile fan millions: no
            // quadratic search.
            bucket.sort_unstable();
            let mut first = (u32::MAX, 0);
            for &(upper, half_edge) in bucket.iter() {
                if upper != first.0 {
                    first = (upper, half_edge);
                }
                first_half_edges[half_edge as usize] = first.1;
            }
        }
        first_half_edges
    }
}

/// Makes an edge of each half-edge that comes first on its edge, and adds the others to it.
fn collect(mesh: &Mesh, first_half_edges: &[u32]) -> EdgeList {
    let mut edges: Vec<MeshEdge> = Vec::with_capacity(first_half_edges.len() / 2 + 1);
    let mut further_faces = Vec::new();
    let mut edge_of_half_edge = vec![0_u32; first_half_edges.len()];
    for (i, &first) in first_half_edges.iter().enumerate() {
        let (face, corner) = (i / 3, i % 3);
        let t = mesh.triangles[face];
        let vertices = [t[corner], t[(corner + 1) % 3]];
        let is_polygon_edge = mesh.edge_masks[face] >> corner & 1 != 0;
        if first as usize == i {
            edge_of_half_edge[i] = edges.len() as u32;
            edges.push(MeshEdge {
                vertices,
                faces: [face as u32, NO_FACE],
                face_count: 1,
                is_polygon_edge,
                has_inconsistent_winding: false,
            });
        } else {
            // The first half-edge has a lower number, so its edge exists.
            let number = edge_of_half_edge[first as usize];
            let edge = &mut edges[number as usize];
            if edge.face_count == 1 {
                edge.faces[1] = face as u32;
            } else {
                further_faces.push([number, face as u32]);
            }
            edge.face_count += 1;
            edge.is_polygon_edge |= is_polygon_edge;
            edge.has_inconsistent_winding |= edge.vertices == vertices;
        }
    }
    EdgeList { edges, further_faces }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;

    fn edges(triangles: &[[u32; 3]], masks: &[u8]) -> EdgeList {
        let count = triangles.iter().flatten().max().map_or(0, |m| m + 1);
        let mesh = Mesh {
            positions: vec![[0.0; 3]; count as usize],
            triangles: triangles.to_vec(),
            edge_masks: masks.to_vec(),
            ..Mesh::default()
        };
        EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap()
    }

    #[test]
    fn a_tetrahedron_is_closed_and_has_six_edges() {
        let list = edges(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], &[7; 4]);
        assert_eq!(list.edges.len(), 6);
        assert!(list.is_closed());
        assert_eq!(list.edges[0].vertices, [0, 2]);
        assert_eq!(list.edges[0].faces, [0, 3]);
        let flipped = edges(&[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 2, 3]], &[7; 4]);
        assert!(!flipped.is_closed());
        assert_eq!(flipped.edges.iter().filter(|e| e.has_inconsistent_winding).count(), 3);
    }

    #[test]
    fn a_quad_has_one_diagonal_and_four_open_edges() {
        let list = edges(&[[0, 1, 2], [0, 2, 3]], &[0b011, 0b110]);
        assert_eq!(list.edges.len(), 5);
        assert_eq!(list.edges.iter().filter(|e| !e.is_polygon_edge).count(), 1);
        assert_eq!(list.edges.iter().filter(|e| e.face_count == 1).count(), 4);
        assert!(!list.is_closed());
    }

    #[test]
    fn three_faces_at_an_edge_are_counted() {
        let list = edges(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]], &[7; 3]);
        let hinge = list.edges[0];
        assert_eq!((hinge.face_count, hinge.faces), (3, [0, 1]));
        assert!(hinge.has_inconsistent_winding);
        assert_eq!(list.further_faces, [[0, 2]]);
    }

    #[test]
    fn agrees_with_a_map_on_a_large_grid() {
        let n = 200_u32;
        let mut triangles = Vec::new();
        for y in 0..n {
            for x in 0..n {
                let v = y * (n + 1) + x;
                triangles.push([v, v + 1, v + n + 2]);
                triangles.push([v, v + n + 2, v + n + 1]);
            }
        }
        let masks = vec![0b011; triangles.len()];
        let list = edges(&triangles, &masks);
        let mut map = std::collections::BTreeMap::new();
        for t in &triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *map.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
            }
        }
        assert_eq!(list.edges.len(), map.len());
        for e in &list.edges {
            let key = [e.vertices[0].min(e.vertices[1]), e.vertices[0].max(e.vertices[1])];
            assert_eq!(map[&key], e.face_count);
        }
        assert!(list.edges.windows(2).all(|w| w[0].faces[0] <= w[1].faces[0]));
    }
}
