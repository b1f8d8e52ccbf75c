//! The fans of faces around vertices.
//!
//! A fan is a set of faces at a vertex that are connected through edges at this vertex. A vertex of
//! a manifold surface has one fan; a vertex where two surfaces touch without a common edge has two.

use crate::mesh::Mesh;
use crate::mesh::edges::{Edge, EdgeList};
use crate::mesh::union_find::UnionFind;

/// The fans of a mesh, as sets of triangle corners. Corner `3 t + i` is corner `i` of triangle `t`.
/// Two corners at a vertex are in one set where an edge at this vertex connects their triangles.
pub struct Fans<'a> {
    triangles: &'a [[u32; 3]],
    vertices: usize,
    corners: UnionFind,
}

impl<'a> Fans<'a> {
    /// The fans of `mesh`, whose edges are `edges`.
    pub fn of(mesh: &'a Mesh, edges: &EdgeList) -> Self {
        let (triangles, vertices) = (&mesh.triangles, mesh.positions.len());
        let mut fans = Self { triangles, vertices, corners: UnionFind::new(triangles.len() * 3) };
        for edge in edges.edges.iter().filter(|edge| edge.faces[1] != Edge::NO_FACE) {
            fans.unite(edge, edge.faces[1]);
        }
        for &[edge, face] in &edges.further_faces {
            fans.unite(&edges.edges[edge as usize], face);
        }
        fans
    }

    /// True if a corner is the representative of its fan. Each fan has exactly one.
    pub fn is_representative(&mut self, corner: u32) -> bool {
        self.corners.find(corner) == corner
    }

    /// The number of vertices that have more than one fan.
    pub fn count_nonmanifold_vertices(&mut self) -> u64 {
        self.counts().iter().filter(|count| **count > 1).count() as u64
    }

    /// The number of fans of each vertex; 255 for all numbers above.
    pub fn counts(&mut self) -> Vec<u8> {
        let mut fans = vec![0_u8; self.vertices];
        for (face, triangle) in (0_u32..).zip(self.triangles) {
            for (corner, &vertex) in (face * 3..).zip(triangle) {
                let count = &mut fans[vertex as usize];
                *count = count.saturating_add(u8::from(self.corners.find(corner) == corner));
            }
        }
        fans
    }

    /// The number of closed chains that open edges form. Within a chain, edges connect fans rather
    /// than vertices, so that loops which touch in a vertex of one fan are one. The count unites
    /// fans, and so it consumes them.
    pub fn into_boundary_loops(mut self, edges: &EdgeList) -> u64 {
        let mut is_met = vec![false; self.triangles.len() * 3];
        let mut loops = 0;
        for edge in edges.iter().filter(|edge| edge.face_count == 1) {
            let ends = edge.vertices.map(|vertex| self.corner(edge.faces[0], vertex));
            for end in ends {
                let fan = self.corners.find(end) as usize;
                loops += u64::from(!std::mem::replace(&mut is_met[fan], true));
            }
            loops -= u64::from(self.corners.unite(ends[0], ends[1]));
        }
        loops
    }

    /// Unites the fans of the edge's first face and of `face`, at both ends of the edge.
    fn unite(&mut self, edge: &Edge, face: u32) {
        for vertex in edge.vertices {
            self.corners.unite(self.corner(edge.faces[0], vertex), self.corner(face, vertex));
        }
    }

    /// The number of the corner that `face` has at `vertex`.
    fn corner(&self, face: u32, vertex: u32) -> u32 {
        let [a, b, _] = self.triangles[face as usize];
        face * 3
            + if a == vertex {
                0
            } else if b == vertex {
                1
            } else {
                2
            }
    }
}
