//! The section of a report on topology, the way in which faces are connected: connected parts, edges, holes, and
//! faults such as edges with three faces. Vertices at the same position count as one.

use meshsnap_render::mesh::topology::Topology;
use meshsnap_render::pluralise::pluralise;
use serde::Serialize;

/// [`Topology`] under the names that clients read, with the faces that were dropped before.
#[derive(Clone, Debug, Serialize)]
pub struct TopologyReport {
    /// Connected components: sets of faces that share no vertex.
    pub components: u64,
    /// Undirected edges, each counted once.
    pub edges: u64,
    /// Edges with one face.
    pub open_edges: u64,
    /// Closed chains of open edges.
    pub boundary_loops: u64,
    /// Edges with three faces or more.
    pub nonmanifold_edges: u64,
    /// Vertices where surfaces touch that share no edge there.
    pub nonmanifold_vertices: u64,
    /// Vertices that lie exactly within an edge of another face; null where so many faces lie above
    /// each other that counting would take long.
    pub t_junctions: Option<u64>,
    /// Faces with the same three vertices as an earlier face.
    pub duplicate_faces: u64,
    /// Faces without area, and faces whose corners coincide in f32. They are not drawn.
    pub degenerate_faces: u64,
    /// Edges between two faces of opposite winding.
    pub inconsistent_edges: u64,
    /// Vertices - edges + triangles.
    pub euler_characteristic: i64,
    /// Handles of all surfaces; null unless the mesh consists of closed, orientable surfaces that
    /// do not touch.
    pub genus: Option<u64>,
    /// The closed, orientable surfaces in the mesh, by genus.
    pub closed_surfaces: Vec<ClosedSurfaces>,
    /// True if faces can be turned over so that all neighbours agree.
    pub is_orientable: bool,
    /// True if every edge has exactly two faces, which run along it in opposite directions.
    pub is_watertight: bool,
}

/// Surfaces of equal genus.
#[derive(Clone, Debug, Serialize)]
pub struct ClosedSurfaces {
    /// Handles of each surface.
    pub genus: u64,
    /// The number of these surfaces.
    pub count: u64,
}

impl TopologyReport {
    /// The report on a topology.
    pub fn new(topology: Topology, t_junctions: Option<u64>, degenerate_faces: u64) -> Self {
        let Topology {
            components,
            edges,
            open_edges,
            boundary_loops,
            nonmanifold_edges,
            nonmanifold_vertices,
            duplicate_faces,
            inconsistent_edges,
            euler_characteristic,
            is_watertight,
            is_orientable,
            genus,
            closed_surfaces,
        } = topology;
        let closed_surfaces = closed_surfaces.into_iter();
        Self {
            components,
            edges,
            open_edges,
            boundary_loops,
            nonmanifold_edges,
            nonmanifold_vertices,
            t_junctions,
            duplicate_faces,
            degenerate_faces,
            inconsistent_edges,
            euler_characteristic,
            genus,
            closed_surfaces: closed_surfaces.map(|(genus, count)| ClosedSurfaces { genus, count }).collect(),
            is_orientable,
            is_watertight,
        }
    }

    /// One line for a person: components, edges with their faults, characteristic, genus.
    pub fn text(&self) -> String {
        let mut said = vec![pluralise(self.components, "part", "parts")];
        let edges = pluralise(self.edges, "edge", "edges");
        if self.is_watertight {
            said.extend(["watertight".to_owned(), edges]);
        } else {
            let Self { open_edges, nonmanifold_edges, inconsistent_edges, .. } = self;
            said.push(format!(
                "{edges}: {open_edges} open, {nonmanifold_edges} non-manifold, \
                 {inconsistent_edges} between faces of opposite winding"
            ));
        }
        said.push(format!("Euler characteristic {}", self.euler_characteristic));
        said.extend(self.genus.map(|genus| format!("genus {genus}")));
        said.join(", ")
    }

    /// One line with the further faults of a surface that should bound a solid; None where there is
    /// none.
    pub fn faults(&self) -> Option<String> {
        let faults = [
            (self.boundary_loops, "boundary loop", "boundary loops"),
            (self.nonmanifold_vertices, "non-manifold vertex", "non-manifold vertices"),
            (self.t_junctions.unwrap_or(0), "T-junction", "T-junctions"),
            (self.duplicate_faces, "duplicate face", "duplicate faces"),
        ];
        let met = faults.into_iter().filter(|(count, ..)| *count > 0);
        let mut said: Vec<String> = met.map(|(count, one, more)| pluralise(count, one, more)).collect();
        if !self.is_orientable {
            said.push("a surface with one side only".to_owned());
        }
        (!said.is_empty()).then(|| said.join(", "))
    }
}
