//! The surfaces of a mesh: their orientability, and the genus of those that are closed and orientable. A
//! surface is a set of faces that are connected through manifold edges, which are edges with exactly two
//! faces. At all other edges, faces count as cut apart.

use super::fans::Fans;
use crate::mesh::Mesh;
use crate::mesh::edges::{Edge, EdgeList};
use crate::mesh::union_find::ParityUnionFind;
use std::collections::BTreeMap;

/// Orientability and genus of a mesh's surfaces.
#[derive(Debug, PartialEq, Eq)]
pub struct Surfaces {
    /// No surface is one-sided, as a Moebius strip is.
    pub is_orientable: bool,
    /// The number of closed, orientable surfaces, by genus.
    pub closed: BTreeMap<u64, u64>,
    is_all_closed: bool,
}

/// Flag of a surface: it has an edge with one face, or with more than two.
const IS_OPEN: u8 = 1;
/// Flag of a surface: it is one-sided.
const IS_ONE_SIDED: u8 = 2;

impl Surfaces {
    /// Finds the surfaces of `mesh`, whose edges and fans are given.
    pub fn of(mesh: &Mesh, edges: &EdgeList, fans: &mut Fans<'_>) -> Self {
        let count = mesh.triangles.len();
        let mut faces = ParityUnionFind::new(count);
        for edge in edges.iter().filter(|edge| edge.face_count == 2) {
            faces.unite(edge.faces[0], edge.faces[1], edge.has_inconsistent_winding);
        }
        // Euler characteristic and flags, at the representative face of each surface. Fans count as
        // vertices, because a surface that is cut apart at a vertex has that vertex twice.
        let (mut euler, mut flags) = (vec![0_i32; count], vec![0_u8; count]);
        for edge in edges.iter() {
            let (surface, side) = faces.find(edge.faces[0]);
            if edge.face_count == 2 {
                euler[surface as usize] -= 1;
                let agrees = side ^ faces.find(edge.faces[1]).1 == edge.has_inconsistent_winding;
                flags[surface as usize] |= if agrees { 0 } else { IS_ONE_SIDED };
            } else {
                flags[surface as usize] |= IS_OPEN;
                if edge.faces[1] != Edge::NO_FACE {
                    flags[faces.find(edge.faces[1]).0 as usize] |= IS_OPEN;
                }
            }
        }
        for &[_, face] in &edges.further_faces {
            flags[faces.find(face).0 as usize] |= IS_OPEN;
        }
        for face in 0..count as u32 {
            let fans_here = (face * 3..face * 3 + 3).filter(|&corner| fans.is_representative(corner)).count();
            euler[faces.find(face).0 as usize] += fans_here as i32 + 1;
        }
        let mut all = Self { is_orientable: true, closed: BTreeMap::new(), is_all_closed: true };
        for face in 0..count as u32 {
            if faces.find(face).0 == face {
                all.add(euler[face as usize], flags[face as usize]);
            }
        }
        all
    }

    /// Handles of all surfaces together; None where a surface is open or one-sided.
    pub fn genus(&self) -> Option<u64> {
        self.is_all_closed.then(|| self.closed.iter().map(|(genus, count)| genus * count).sum())
    }

    fn add(&mut self, euler: i32, flags: u8) {
        self.is_orientable &= flags & IS_ONE_SIDED == 0;
        self.is_all_closed &= flags == 0;
        if flags == 0 {
            // The Euler characteristic of a closed, orientable surface of genus g is 2 - 2g.
            let genus = u64::try_from((2 - euler) / 2).unwrap_or(0);
            *self.closed.entry(genus).or_insert(0) += 1;
        }
    }
}
