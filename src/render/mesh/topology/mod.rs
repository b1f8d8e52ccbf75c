//! The topology of a mesh: components, open and non-manifold edges, boundary loops, duplicate faces,
//! Euler characteristic, orientation, genus.
//!
//! Union-find and sorting find everything in O(n log n), whatever the mesh. [`fans`] groups the
//! faces around each vertex, [`surfaces`] the faces of each surface.

mod fans;
mod surfaces;
#[cfg(test)]
mod tests;

use self::fans::Fans;
use self::surfaces::Surfaces;
use super::Mesh;
use super::edges::EdgeList;
use crate::limits::{Budget, Deadline, Exhausted};
use crate::mesh::union_find::UnionFind;
use crate::mesh::vector::{cross, dot};

/// The topology of a welded mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Connected components: sets of faces that share no vertex with each other.
    pub components: u64,
    /// Undirected edges, each counted once.
    pub edges: u64,
    /// Edges with one face.
    pub open_edges: u64,
    /// Closed chains of open edges: 1 for a disc, 3 for a sphere with three holes. Two holes that
    /// touch in a vertex make one chain, which passes the vertex twice.
    pub boundary_loops: u64,
    /// Edges with three faces or more.
    pub nonmanifold_edges: u64,
    /// Vertices where surfaces touch that share no edge there, like the centre of a bow tie.
    pub nonmanifold_vertices: u64,
    /// Faces with the same three vertices as an earlier face, in any order.
    pub duplicate_faces: u64,
    /// Edges with two faces that run along them in the same direction, so that one face is inside
    /// out.
    pub inconsistent_edges: u64,
    /// Vertices - edges + triangles: 2 for a sphere, 0 for a torus. Only vertices of triangles
    /// count.
    pub euler_characteristic: i64,
    /// Every edge has exactly two faces, which run along it in opposite directions.
    pub is_watertight: bool,
    /// Faces can be turned over so that any two faces at a manifold edge agree. A Moebius strip is
    /// not orientable.
    pub is_orientable: bool,
    /// Handles of all surfaces together: 0 for a sphere, 1 for a torus. None unless the mesh
    /// consists of closed, orientable surfaces that do not touch each other.
    pub genus: Option<u64>,
    /// The closed, orientable surfaces in the mesh, by genus: pairs of a genus and the number of
    /// such surfaces.
    pub closed_surfaces: Vec<(u64, u64)>,
}

/// Memory at the peak: sets and marks of the three corners; set, Euler sum and flags of the face.
const BYTES_PER_TRIANGLE: u64 = 3 * (4 + 1) + 4 + 4 + 1;
/// Memory at the peak: the vertex's set and mark.
const BYTES_PER_VERTEX: u64 = 4 + 1;

/// Memory of [`orientation`] per vertex: its set, and a volume.
pub const ORIENTATION_BYTES: u64 = 4 + 8;

impl Topology {
    /// Finds the topology of `mesh`, whose edges are `edges`.
    pub fn of(mesh: &Mesh, edges: &EdgeList, budget: &mut Budget, deadline: &Deadline) -> Result<Self, Exhausted> {
        budget.spend("the topology", mesh.triangles.len() as u64, BYTES_PER_TRIANGLE)?;
        budget.spend("the topology", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
        let (components, vertices) = components(mesh);
        deadline.check()?;
        let duplicate_faces = duplicates(mesh);
        deadline.check()?;
        let mut fans = Fans::of(mesh, edges);
        let nonmanifold_vertices = fans.count_nonmanifold_vertices();
        deadline.check()?;
        let surfaces = Surfaces::of(mesh, edges, &mut fans);
        deadline.check()?;
        let count = |test: fn(u32, bool) -> bool| {
            edges.iter().filter(|e| test(e.face_count, e.has_inconsistent_winding)).count() as u64
        };
        Ok(Self {
            components,
            edges: edges.len() as u64,
            open_edges: count(|faces, _| faces == 1),
            boundary_loops: fans.into_boundary_loops(edges),
            nonmanifold_edges: count(|faces, _| faces > 2),
            nonmanifold_vertices,
            duplicate_faces,
            inconsistent_edges: count(|faces, is_inconsistent| faces == 2 && is_inconsistent),
            euler_characteristic: vertices as i64 - edges.len() as i64 + mesh.triangles.len() as i64,
            is_watertight: !edges.is_empty() && edges.is_closed(),
            is_orientable: surfaces.is_orientable,
            genus: surfaces.genus().filter(|_| nonmanifold_vertices == 0 && !edges.is_empty()),
            closed_surfaces: surfaces.closed.into_iter().collect(),
        })
    }
}

/// The vertices that [`Topology::nonmanifold_vertices`] counts, in order. Spends what they take.
pub fn nonmanifold_vertices(mesh: &Mesh, edges: &EdgeList, budget: &mut Budget) -> Result<Vec<u32>, Exhausted> {
    budget.spend("the fans of faces", mesh.triangles.len() as u64, 3 * 4)?;
    budget.spend("the fans of faces", mesh.positions.len() as u64, 1 + 4)?;
    let counts = Fans::of(mesh, edges).counts();
    Ok((0_u32..).zip(counts).filter(|(_, count)| *count > 1).map(|(vertex, _)| vertex).collect())
}

/// The faces that [`Topology::duplicate_faces`] counts, in mesh order. Spends what they take.
pub fn duplicate_faces(mesh: &Mesh, budget: &mut Budget) -> Result<Vec<u32>, Exhausted> {
    budget.spend("the comparison of faces", mesh.triangles.len() as u64, 16 + 4)?;
    let mut faces: Vec<([u32; 3], u32)> = mesh.triangles.iter().copied().zip(0..).collect();
    faces.iter_mut().for_each(|(face, _)| face.sort_unstable());
    faces.sort_unstable();
    let pairs = faces.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    let mut later: Vec<u32> = pairs.map(|pair| pair[1].1).collect();
    later.sort_unstable();
    Ok(later)
}

/// The orientation of a closed mesh: the side to which the fronts of its faces look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// Outwards: no component encloses a negative volume.
    Outward,
    /// Inwards: no component encloses a positive volume.
    Inward,
    /// Outwards for some components, inwards for others.
    Mixed,
}

/// The orientation of a closed mesh, by the signed volume of each component: the sum of
/// `a . (b x c)` over its faces.
///
/// The caller has spent [`ORIENTATION_BYTES`] for each vertex.
pub fn orientation(mesh: &Mesh) -> Orientation {
    let mut sets = UnionFind::new(mesh.positions.len());
    for t in &mesh.triangles {
        sets.unite(t[0], t[1]);
        sets.unite(t[0], t[2]);
    }
    let mut volumes = vec![0.0_f64; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
        volumes[sets.find(t[0]) as usize] += dot(a, cross(b, c));
    }
    if volumes.iter().all(|&volume| volume >= 0.0) {
        Orientation::Outward
    } else if volumes.iter().all(|&volume| volume <= 0.0) {
        Orientation::Inward
    } else {
        Orientation::Mixed
    }
}

/// The number of sets of vertices that triangles connect, and the number of vertices in them.
/// Vertices of lines and points alone do not count.
fn components(mesh: &Mesh) -> (u64, u64) {
    let mut sets = UnionFind::new(mesh.positions.len());
    let mut is_met = vec![false; mesh.positions.len()];
    let (mut united, mut vertices) = (0, 0);
    for t in &mesh.triangles {
        united += u64::from(sets.unite(t[0], t[1])) + u64::from(sets.unite(t[0], t[2]));
        for v in *t {
            vertices += u64::from(!std::mem::replace(&mut is_met[v as usize], true));
        }
    }
    (vertices - united, vertices)
}

/// The number of faces with the vertices of an earlier face.
fn duplicates(mesh: &Mesh) -> u64 {
    let mut faces = mesh.triangles.clone();
    faces.iter_mut().for_each(|face| face.sort_unstable());
    faces.sort_unstable();
    faces.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}
