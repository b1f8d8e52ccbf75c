//! The removal of short lines along feature edges, which are edges where the surface bends sharply, ends
//! or branches. Feature edges that are joined at vertices form a chain. Chains that are shorter on screen
//! than `wire.min_length` are left out.
//!
//! The surface of a scan has a multitude of small folds, a few pixels long, that bend as sharply as true features.
//! Lines along them would look like hatching without a meaning.

use crate::limits::LimitExceeded;
use crate::mesh::Mesh;
use crate::mesh::union_find::UnionFind;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::{Edge, PX, PlanError, Projector};

/// Leaves out the edges of chains that are shorter on screen than `min_px`, their hidden parts included. Those
/// that reach behind the eye stay. Returns the number of chains that are gone.
pub fn remove_short(
    edges: &mut Vec<Edge>,
    mesh: &Mesh,
    projector: &Projector,
    min_px: f64,
    cx: &mut PlanContext<'_>,
) -> Result<u32, PlanError> {
    if min_px <= 0.0 || edges.is_empty() {
        return Ok(0);
    }
    let mut chains = Chains::new(mesh, cx)?;
    for (i, edge) in edges.iter().enumerate() {
        if i % CHECK_EVERY == 0 {
            cx.deadline.check()?;
        }
        chains.sets.unite(edge.vertices[0], edge.vertices[1]);
    }
    for (i, edge) in edges.iter().enumerate() {
        if i % CHECK_EVERY == 0 {
            cx.deadline.check()?;
        }
        let root = chains.sets.find(edge.vertices[0]);
        chains.lengths_px[root as usize] += length_px(mesh, projector, edge);
    }
    let mut removed = 0;
    edges.retain(|edge| {
        let length_px = &mut chains.lengths_px[chains.sets.find(edge.vertices[0]) as usize];
        let is_long = *length_px >= min_px;
        if !is_long && *length_px >= 0.0 {
            removed += 1;
            // Counted once.
            *length_px = -1.0;
        }
        is_long
    });
    Ok(removed)
}

/// The chains of some edges, by vertex.
struct Chains {
    sets: UnionFind,
    /// By representative.
    lengths_px: Vec<f64>,
}

impl Chains {
    fn new(mesh: &Mesh, cx: &mut PlanContext<'_>) -> Result<Self, LimitExceeded> {
        let count = mesh.positions.len();
        cx.budget.spend("chains of feature edges", count as u64, 4 + 8)?;
        Ok(Self { sets: UnionFind::new(count), lengths_px: vec![0.0; count] })
    }
}

/// The length of an edge on screen; without end if it reaches behind the eye.
fn length_px(mesh: &Mesh, projector: &Projector, edge: &Edge) -> f64 {
    let near_w = projector.near_w(0.0);
    match edge.vertices.map(|v| projector.on_screen(mesh.positions[v as usize], near_w)) {
        [Some(a), Some(b)] => libm::hypot((b[0] - a[0]) / PX, (b[1] - a[1]) / PX),
        _ => f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::{Budget, Deadline, Limits};
    use crate::plan::Projection;

    fn projector() -> Projector {
        Projector::new(&Projection::for_tests())
    }

    /// Chains of 1, 2, ... edges beside each other, each edge 0.1 of a unit long: at the distance 1.4, 60 px a
    /// unit make 4.29 px of it.
    fn combs(chains: u32) -> (Mesh, Vec<Edge>) {
        let (mut positions, mut edges) = (Vec::new(), Vec::new());
        for chain in 1..=chains {
            let first = positions.len() as u32;
            positions.extend((0..=chain).map(|i| [0.1 * i as f32 - 0.5, 0.05 * chain as f32, 0.0]));
            edges.extend((0..chain).map(|i| Edge { vertices: [first + i, first + i + 1], faces: [0, Edge::NO_FACE] }));
        }
        (Mesh { positions, ..Mesh::default() }, edges)
    }

    fn left(min_px: f64) -> (u32, usize) {
        let (mesh, mut edges) = combs(6);
        let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        let removed = remove_short(&mut edges, &mesh, &projector(), min_px, &mut cx).unwrap();
        (removed, edges.len())
    }

    #[test]
    fn chains_count_as_a_whole() {
        assert_eq!(left(0.0), (0, 21));
        assert_eq!(left(4.2), (0, 21));
        assert_eq!(left(4.4), (1, 20));
        assert_eq!(left(4.0 * 4.2857), (3, 15));
        assert_eq!(left(1e6), (6, 0));
    }

    #[test]
    fn what_reaches_behind_the_eye_stays() {
        let (mut mesh, mut edges) = combs(1);
        mesh.positions[1][2] = 3.0;
        let (mut budget, deadline) = (Budget::new(&Limits::default()), Deadline::default());
        let mut cx = PlanContext::new(&mut budget, &deadline, &[]);
        assert_eq!(remove_short(&mut edges, &mesh, &projector(), 1e6, &mut cx).unwrap(), 0);
        assert_eq!(edges.len(), 1);
    }
}
