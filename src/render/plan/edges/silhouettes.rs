//! The edges of a mesh that may be silhouette edges in some view, and the two faces of each that decide it. An edge
//! is a silhouette edge of a view if all its faces that are drawn lie on one side of it on screen. Around an edge
//! with more than two faces, the two beside the widest gap decide. If the gap is wider than half a turn, all faces
//! are on one side exactly where these two are. If it is not, no view makes the edge a silhouette edge.

use std::collections::BTreeMap;

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::mesh::edges::{EdgeList, MeshEdge};
use crate::mesh::topology::Orientation;
use crate::mesh::vector::{cross, dot};
use crate::plan::cut_outs::MaskedFaces;
use crate::plan::{Edge, FaceSide};
use crate::scene::{Fill, MaterialGroups, barycentric_wire};
use crate::spec::{Cull, Layers};

/// Finds the faces that decide whether an edge is a silhouette edge. Of an edge's faces only those
/// count that are drawn.
pub struct Silhouettes {
    /// By material: not drawn while others are, and without a hull. Empty where there is none.
    is_absent: Vec<bool>,
    /// Visible parts of faces with cut-out textures, and the materials whose cut-outs count.
    cut_outs: Option<MaskedFaces>,
    /// All faces of the edges that have more than two.
    crowded: BTreeMap<u32, Vec<u32>>,
}

impl Silhouettes {
    /// Those of a mesh with these edges.
    pub fn new(
        groups: &MaterialGroups<'_>,
        list: &EdgeList,
        cut_outs: Option<MaskedFaces>,
        budget: &mut Budget,
    ) -> Result<Self, LimitExceeded> {
        // A list per edge, and a place in the map.
        budget.spend("edges of many faces", list.further_faces.len() as u64, 100)?;
        budget.spend("materials", groups.material_count() as u64, 1)?;
        let has_fill = groups.has_fill();
        let is_absent = |m: usize| has_fill && groups.fill(m) == Fill::None && !groups.is_outlined(m);
        let mut is_absent: Vec<bool> = (0..groups.material_count()).map(is_absent).collect();
        if !is_absent.contains(&true) {
            is_absent = Vec::new();
        }
        let mut crowded: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &[edge, face] in &list.further_faces {
            let first_two = list.edges[edge as usize].faces;
            crowded.entry(edge).or_insert_with(|| first_two.to_vec()).push(face);
        }
        Ok(Self { is_absent, cut_outs, crowded })
    }

    /// The edge numbered `index` with the faces that decide whether it is a silhouette edge; None
    /// where no view makes it one.
    pub fn edge(&self, mesh: &Mesh, index: usize, edge: &MeshEdge) -> Option<Edge> {
        let is_drawn = |face: &u32| {
            *face != Edge::NO_FACE && !self.is_absent(mesh, *face) && !self.is_cut_out(mesh, *face, edge.vertices)
        };
        let crowded = if edge.face_count > 2 { self.crowded.get(&(index as u32)) } else { None };
        let faces = if let Some(all) = crowded {
            let faces: Vec<u32> = all.iter().copied().filter(is_drawn).collect();
            match faces[..] {
                [] => [Edge::NO_FACE; 2],
                [a] => [a, Edge::NO_FACE],
                [a, b] => [a, b],
                _ => outermost(mesh, edge.vertices, &faces)?,
            }
        } else {
            let [a, b] = edge.faces.map(|face| if is_drawn(&face) { face } else { Edge::NO_FACE });
            if a == Edge::NO_FACE { [b, a] } else { [a, b] }
        };
        (faces[0] != Edge::NO_FACE).then_some(Edge { vertices: edge.vertices, faces })
    }

    /// True if a face's texture has nothing at one of its sides.
    fn is_cut_out(&self, mesh: &Mesh, face: u32, side: [u32; 2]) -> bool {
        self.cut_outs.as_ref().is_some_and(|(cut_outs, masked)| {
            let is_masked = masked.get(mesh.triangle_materials[face as usize] as usize) == Some(&true);
            is_masked && cut_outs.is_free(mesh, face as usize, side)
        })
    }

    fn is_absent(&self, mesh: &Mesh, face: u32) -> bool {
        !self.is_absent.is_empty() && self.is_absent.get(mesh.triangle_materials[face as usize] as usize) == Some(&true)
    }
}

/// Of more than two faces around an edge, the two beside the widest gap.
///
/// If the gap is wider than half a turn, all faces lie on one side on screen exactly where these
/// two do. If it is not, there are faces on both sides in every view, and the result is None.
fn outermost(mesh: &Mesh, ends: [u32; 2], faces: &[u32]) -> Option<[u32; 2]> {
    let at = |v: u32| mesh.positions[v as usize].map(f64::from);
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let origin = at(ends[0]);
    let axis = minus(at(ends[1]), origin);
    // Two directions across the axis.
    let across = cross(axis, least_axis(axis));
    let up = cross(axis, across);
    let length = dot(axis, axis).sqrt();
    let angle = |face: u32| {
        let corners = mesh.triangles[face as usize];
        let corner = corners.into_iter().find(|v| !ends.contains(v)).unwrap_or(corners[2]);
        let way = minus(at(corner), origin);
        libm::atan2(dot(way, up), dot(way, across) * length)
    };
    let mut angles: Vec<(f64, u32)> = faces.iter().map(|&face| (angle(face), face)).collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let count = angles.len();
    let gap = |i: usize| {
        let turned = angles[i].0 - angles[(i + count - 1) % count].0;
        if i == 0 { turned + std::f64::consts::TAU } else { turned }
    };
    let widest = (0..count).max_by(|&a, &b| gap(a).total_cmp(&gap(b)))?;
    (gap(widest) > std::f64::consts::PI).then(|| [angles[(widest + count - 1) % count].1, angles[widest].1])
}

/// The coordinate axis that is farthest from a direction.
fn least_axis(v: [f64; 3]) -> [f64; 3] {
    let least = (0..3).min_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs()));
    std::array::from_fn(|k| if Some(k) == least { 1.0 } else { 0.0 })
}

/// By material, true if its faces hide what is behind them.
pub fn hiding_materials(groups: &MaterialGroups<'_>) -> Vec<bool> {
    let hides = |(layers, fill): (&&Layers, &Fill)| match fill {
        Fill::Opaque => true,
        Fill::Transparent => false,
        Fill::None => groups.needs_hiding_surface() && barycentric_wire(layers).is_none(),
    };
    groups.by_material.iter().zip(groups.fills()).map(hides).collect()
}

/// True if a closed surface of these materials hides its inside.
pub fn hides_inside(groups: &MaterialGroups<'_>) -> bool {
    let covers = if groups.has_fill() { Fill::Opaque } else { Fill::None };
    (0..groups.material_count()).all(|m| groups.fill(m) == covers)
}

/// The side that no face shows: the inside of a closed, opaque surface that is seen from outside.
pub fn unseen_side(groups: &MaterialGroups<'_>, orientation: Orientation) -> Option<FaceSide> {
    let (unseen, culled) = match orientation {
        Orientation::Outward => (FaceSide::Back, Cull::Front),
        Orientation::Inward => (FaceSide::Front, Cull::Back),
        Orientation::Mixed => return None,
    };
    let is_drawn = |layers: &&Layers| layers.surface.is_none_or(|s| s.cull != culled);
    groups.by_material.iter().all(is_drawn).then_some(unseen)
}
