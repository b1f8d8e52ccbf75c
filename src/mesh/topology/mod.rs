//! How a mesh hangs together, for `inspect`.
//!
//! Everything is found by union-find and sorting: n log n, whatever the mesh. Vertices are told apart by their fans ([`fans`]), and
//! faces by the surfaces that they make ([`surfaces`]).

mod fans;
mod surfaces;
#[cfg(test)]
mod tests;

use self::fans::Fans;
use self::surfaces::Surfaces;
use super::Mesh;
use super::edges::EdgeList;
use crate::import::MeshError;
use crate::limits::{Budget, Deadline};
use crate::mesh::union_find::Sets;

/// Counts over a welded mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Parts that share no vertex.
    pub components: u64,
    /// Unique edges.
    pub edges: u64,
    /// Edges with one face.
    pub open_edges: u64,
    /// Closed chains of open edges: 1 for a disc, 3 for a sphere with three holes. Two holes that touch in a vertex are one chain, which
    /// passes there twice.
    pub boundary_loops: u64,
    /// Edges with three faces or more.
    pub nonmanifold_edges: u64,
    /// Vertices where surfaces touch that share no edge there: the knot of a bow tie.
    pub nonmanifold_vertices: u64,
    /// Faces that have the same three vertices as an earlier one, in whatever order.
    pub duplicate_faces: u64,
    /// Edges whose two faces run along them in the same direction, so that one is inside out.
    pub inconsistent_edges: u64,
    /// Vertices - edges + triangles: 2 for a sphere, 0 for a torus.
    pub euler_characteristic: i64,
    /// Every edge has two faces of opposite directions.
    pub is_watertight: bool,
    /// Faces can be turned so that any two that share an edge with no third agree: not so for a Moebius strip.
    pub is_orientable: bool,
    /// Handles of all surfaces together: 0 for a sphere, 1 for a torus. None unless the mesh is made of closed, orientable surfaces that
    /// do not touch each other.
    pub genus: Option<u64>,
    /// The closed, orientable surfaces among what the mesh is made of, by their genus: genus and how many.
    pub closed_surfaces: Vec<(u64, u64)>,
}

/// The largest of what is held at once: the corners' sets and marks, the faces' sets, sums and flags.
const BYTES_PER_TRIANGLE: u64 = 3 * (4 + 1) + 4 + 4 + 1;
/// A vertex' set and mark.
const BYTES_PER_VERTEX: u64 = 4 + 1;

impl Topology {
    /// Counts.
    pub fn of(mesh: &Mesh, edges: &EdgeList, budget: &mut Budget, deadline: &Deadline) -> Result<Self, MeshError> {
        budget.spend("the topology", mesh.triangles.len() as u64, BYTES_PER_TRIANGLE)?;
        budget.spend("the topology", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
        let (_, components, vertices) = components(mesh);
        deadline.check()?;
        let duplicate_faces = duplicates(mesh);
        deadline.check()?;
        let mut fans = Fans::of(mesh, edges);
        let nonmanifold_vertices = fans.vertices_with_several();
        deadline.check()?;
        let surfaces = Surfaces::of(mesh, edges, &mut fans);
        deadline.check()?;
        let count = |test: fn(u32, bool) -> bool| {
            edges.edges.iter().filter(|e| test(e.face_count, e.is_wound_alike)).count() as u64
        };
        Ok(Self {
            components,
            edges: edges.edges.len() as u64,
            open_edges: count(|faces, _| faces == 1),
            boundary_loops: fans.into_boundary_loops(edges),
            nonmanifold_edges: count(|faces, _| faces > 2),
            nonmanifold_vertices,
            duplicate_faces,
            inconsistent_edges: count(|faces, alike| faces == 2 && alike),
            euler_characteristic: vertices as i64 - edges.edges.len() as i64 + mesh.triangles.len() as i64,
            is_watertight: !edges.edges.is_empty() && edges.is_closed(),
            is_orientable: surfaces.is_orientable,
            genus: surfaces.genus().filter(|_| nonmanifold_vertices == 0 && !edges.edges.is_empty()),
            closed_surfaces: surfaces.closed.into_iter().collect(),
        })
    }
}

/// Which way the fronts of a closed mesh's faces look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fronts {
    /// Outwards: no component encloses a negative volume.
    Outside,
    /// Inwards: none encloses a positive one.
    Inside,
    /// Some so, some so.
    Mixed,
}

/// Which way they look, all components of the mesh together.
pub fn fronts(mesh: &Mesh) -> Fronts {
    let mut sets = components(mesh).0;
    let mut volumes = vec![0.0_f64; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        volumes[sets.find(t[0]) as usize] += (a[0] * cross[0] + a[1] * cross[1]) + a[2] * cross[2];
    }
    if volumes.iter().all(|&volume| volume >= 0.0) {
        Fronts::Outside
    } else if volumes.iter().all(|&volume| volume <= 0.0) {
        Fronts::Inside
    } else {
        Fronts::Mixed
    }
}

/// Vertices that triangles connect, how many sets they are, and how many vertices: those of lines and points belong to no face.
fn components(mesh: &Mesh) -> (Sets, u64, u64) {
    let mut sets = Sets::new(mesh.positions.len());
    let mut is_met = vec![false; mesh.positions.len()];
    let (mut united, mut vertices) = (0, 0);
    for t in &mesh.triangles {
        united += u64::from(sets.unite(t[0], t[1])) + u64::from(sets.unite(t[0], t[2]));
        for v in *t {
            vertices += u64::from(!std::mem::replace(&mut is_met[v as usize], true));
        }
    }
    (sets, vertices - united, vertices)
}

fn duplicates(mesh: &Mesh) -> u64 {
    let mut faces = mesh.triangles.clone();
    faces.iter_mut().for_each(|face| face.sort_unstable());
    faces.sort_unstable();
    faces.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
}
