//! The fans of faces around vertices. A vertex of a clean surface has one; where two surfaces touch in a vertex it has two.

use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, MeshEdge, NO_FACE};
use crate::mesh::union_find::Sets;

/// The corners of all triangles (three each, numbered triangle by triangle), united where their triangles share an edge at the
/// corners' vertex.
pub struct Fans<'a> {
    triangles: &'a [[u32; 3]],
    vertices: usize,
    corners: Sets,
}

impl<'a> Fans<'a> {
    /// Of a mesh and its edges.
    pub fn of(mesh: &'a Mesh, edges: &EdgeList) -> Self {
        let (triangles, vertices) = (&mesh.triangles, mesh.positions.len());
        let mut fans = Self { triangles, vertices, corners: Sets::new(triangles.len() * 3) };
        for edge in edges.edges.iter().filter(|edge| edge.faces[1] != NO_FACE) {
            fans.unite(edge, edge.faces[1]);
        }
        for &[edge, face] in &edges.further_faces {
            fans.unite(&edges.edges[edge as usize], face);
        }
        fans
    }

    /// Whether a corner stands for its fan: one of each fan's does. Its number is three times its face's and a bit.
    pub fn is_first(&mut self, corner: u32) -> bool {
        self.corners.find(corner) == corner
    }

    /// How many vertices have more than one fan.
    pub fn vertices_with_several(&mut self) -> u64 {
        let mut fans = vec![0_u8; self.vertices];
        for (face, triangle) in (0_u32..).zip(self.triangles) {
            for (corner, &vertex) in (face * 3..).zip(triangle) {
                let count = &mut fans[vertex as usize];
                *count = count.saturating_add(u8::from(self.corners.find(corner) == corner));
            }
        }
        fans.iter().filter(|count| **count > 1).count() as u64
    }

    /// How many chains the open edges make: what is connected by them, with a fan for a vertex. Ends the fans, which it unites.
    pub fn into_boundary_loops(mut self, edges: &EdgeList) -> u64 {
        let mut is_met = vec![false; self.triangles.len() * 3];
        let mut loops = 0;
        for edge in edges.edges.iter().filter(|edge| edge.face_count == 1) {
            let ends = edge.vertices.map(|vertex| self.corner(edge.faces[0], vertex));
            for end in ends {
                let fan = self.corners.find(end) as usize;
                loops += u64::from(!std::mem::replace(&mut is_met[fan], true));
            }
            loops -= u64::from(self.corners.unite(ends[0], ends[1]));
        }
        loops
    }

    fn unite(&mut self, edge: &MeshEdge, face: u32) {
        for vertex in edge.vertices {
            self.corners.unite(self.corner(edge.faces[0], vertex), self.corner(face, vertex));
        }
    }

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
