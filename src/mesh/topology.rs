//! How a mesh hangs together, for `inspect`.

use super::Mesh;
use super::edges::EdgeList;

/// Counts over a welded mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Parts that share no vertex.
    pub components: u64,
    /// Unique edges.
    pub edges: u64,
    /// Edges with one face.
    pub open_edges: u64,
    /// Edges with three faces or more.
    pub nonmanifold_edges: u64,
    /// Edges whose two faces run along them in the same direction, so that one is inside out.
    pub inconsistent_edges: u64,
    /// Vertices - edges + triangles: 2 for a sphere, 0 for a torus.
    pub euler_characteristic: i64,
    /// Every edge has two faces of opposite directions.
    pub is_watertight: bool,
}

impl Topology {
    /// Counts.
    pub fn of(mesh: &Mesh, edges: &EdgeList) -> Self {
        let count = |test: fn(u32, bool) -> bool| {
            edges.edges.iter().filter(|e| test(e.face_count, e.is_wound_alike)).count() as u64
        };
        Self {
            components: components(mesh),
            edges: edges.edges.len() as u64,
            open_edges: count(|faces, _| faces == 1),
            nonmanifold_edges: count(|faces, _| faces > 2),
            inconsistent_edges: count(|faces, alike| faces == 2 && alike),
            euler_characteristic: mesh.positions.len() as i64 - edges.edges.len() as i64 + mesh.triangles.len() as i64,
            is_watertight: edges.is_closed(),
        }
    }
}

/// Whether every component of a closed mesh has its faces' fronts outside: none encloses a negative volume.
pub fn is_outward(mesh: &Mesh) -> bool {
    let roots = union(mesh).0;
    let mut volumes = vec![0.0_f64; mesh.positions.len()];
    for t in mesh.own_triangles() {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        volumes[roots[t[0] as usize] as usize] += (a[0] * cross[0] + a[1] * cross[1]) + a[2] * cross[2];
    }
    volumes.iter().all(|&volume| volume >= 0.0)
}

fn components(mesh: &Mesh) -> u64 {
    union(mesh).1
}

/// Connected components by union-find with path halving: each vertex's component, by its lowest vertex, and how many there
/// are.
fn union(mesh: &Mesh) -> (Vec<u32>, u64) {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let find = |mut v: u32, parent: &mut Vec<u32>| {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    };
    let mut count = mesh.positions.len() as u64;
    for t in mesh.own_triangles() {
        for v in [t[1], t[2]] {
            let (a, b) = (find(t[0], &mut parent), find(v, &mut parent));
            if a != b {
                // The lower number wins, which keeps trees shallow for meshes in any sensible order.
                parent[a.max(b) as usize] = a.min(b);
                count -= 1;
            }
        }
    }
    // No parent has a higher number than its child, so that one pass upwards leads every vertex to its root.
    for v in 0..parent.len() {
        parent[v] = parent[parent[v] as usize];
    }
    (parent, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{Budget, Limits};

    fn topology(triangles: &[[u32; 3]]) -> Topology {
        let count = triangles.iter().flatten().max().map_or(0, |m| m + 1);
        let mesh = Mesh {
            positions: vec![[0.0; 3]; count as usize],
            triangles: triangles.to_vec(),
            edge_masks: vec![7; triangles.len()],
            ..Mesh::default()
        };
        let edges = EdgeList::of(&mesh, &mut Budget::new(&Limits::default())).unwrap();
        Topology::of(&mesh, &edges)
    }

    #[test]
    fn two_tetrahedra_are_two_watertight_spheres() {
        let one = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let two = one.map(|t| t.map(|v| v + 4));
        let t = topology(&[one, two].concat());
        assert_eq!((t.components, t.edges, t.euler_characteristic, t.is_watertight), (2, 12, 4, true));
        assert_eq!((t.open_edges, t.nonmanifold_edges, t.inconsistent_edges), (0, 0, 0));
    }

    #[test]
    fn faults_are_told_apart() {
        let t = topology(&[[0, 1, 2], [0, 1, 3], [4, 5, 6], [5, 4, 7], [4, 5, 8]]);
        assert_eq!((t.components, t.open_edges, t.nonmanifold_edges, t.inconsistent_edges), (2, 10, 1, 1));
        assert!(!t.is_watertight);
    }
}
