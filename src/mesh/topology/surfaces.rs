//! The surfaces that a mesh is made of: faces that are connected through edges of two faces, and cut apart everywhere else.

use super::fans::Fans;
use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, NO_FACE};
use crate::mesh::union_find::SidedSets;
use std::collections::BTreeMap;

/// What is known of all surfaces.
#[derive(Debug, PartialEq, Eq)]
pub struct Surfaces {
    /// No surface has one side only.
    pub is_orientable: bool,
    /// How many closed, orientable ones there are, by genus.
    pub closed: BTreeMap<u64, u64>,
    is_all_closed: bool,
}

/// Flags of a surface: it has an edge with one face or with more than two; it has one side only.
const IS_OPEN: u8 = 1;
const IS_ONE_SIDED: u8 = 2;

impl Surfaces {
    /// Cuts a mesh into its surfaces.
    pub fn of(mesh: &Mesh, edges: &EdgeList, fans: &mut Fans<'_>) -> Self {
        let count = mesh.triangles.len();
        let mut faces = SidedSets::new(count);
        for edge in edges.edges.iter().filter(|edge| edge.face_count == 2) {
            faces.unite(edge.faces[0], edge.faces[1], edge.is_wound_alike);
        }
        // Vertices, of which each fan counts, less edges and plus faces; by the face that stands for the surface.
        let (mut euler, mut flags) = (vec![0_i32; count], vec![0_u8; count]);
        for edge in &edges.edges {
            let (surface, side) = faces.find(edge.faces[0]);
            if edge.face_count == 2 {
                euler[surface as usize] -= 1;
                let agrees = side ^ faces.find(edge.faces[1]).1 == edge.is_wound_alike;
                flags[surface as usize] |= if agrees { 0 } else { IS_ONE_SIDED };
            } else {
                flags[surface as usize] |= IS_OPEN;
                if edge.faces[1] != NO_FACE {
                    flags[faces.find(edge.faces[1]).0 as usize] |= IS_OPEN;
                }
            }
        }
        for &[_, face] in &edges.further_faces {
            flags[faces.find(face).0 as usize] |= IS_OPEN;
        }
        for face in 0..count as u32 {
            let own_fans = (face * 3..face * 3 + 3).filter(|&corner| fans.is_first(corner)).count();
            euler[faces.find(face).0 as usize] += own_fans as i32 + 1;
        }
        let mut all = Self { is_orientable: true, closed: BTreeMap::new(), is_all_closed: true };
        for face in 0..count as u32 {
            if faces.find(face).0 == face {
                all.add(euler[face as usize], flags[face as usize]);
            }
        }
        all
    }

    /// Handles in all; None where a surface is open or has one side only.
    pub fn genus(&self) -> Option<u64> {
        self.is_all_closed.then(|| self.closed.iter().map(|(genus, count)| genus * count).sum())
    }

    fn add(&mut self, euler: i32, flags: u8) {
        self.is_orientable &= flags & IS_ONE_SIDED == 0;
        self.is_all_closed &= flags == 0;
        if flags == 0 {
            // A closed, orientable surface of genus g has the characteristic 2 - 2g.
            let genus = u64::try_from((2 - euler) / 2).unwrap_or(0);
            *self.closed.entry(genus).or_insert(0) += 1;
        }
    }
}
