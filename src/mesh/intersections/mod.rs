//! Faces that intersect each other, and vertices that lie on edges of other faces (T-junctions).
//!
//! Two faces intersect if they have a point in common that does not belong to the corners or the
//! edge that they share. So these count: crossing, overlap in one plane, a corner that touches a
//! face or an edge of another. These do not: a common corner, a common edge, and a face that repeats
//! another. Faces without area in the mesh's own f32 positions take no part.
//!
//! All decisions are exact on these positions: [`robust`] gives the signs. [`Tree`] finds the pairs
//! whose boxes overlap. The results depend neither on the order of work nor on the number of threads.

mod pair;
mod plane;
mod tree;

#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use self::tree::{Aabb, Tree};
use super::Mesh;
use crate::limits::{Budget, Deadline, Exhausted, Stopped};
use crate::parallel::map;

/// A position in f64, which has every f32 exactly.
type Point = [f64; 3];

/// Faces or vertices handed to a thread at a time.
const PIECE: usize = 1024;

/// Pairs between two looks at the deadline.
const PAIRS_PER_POLL: u32 = 256;

/// Nodes of the tree that the search for T-junctions looks at, for each vertex of a piece on an
/// average. Some 50 are usual.
const NODES_PER_VERTEX: usize = 512;

/// Memory per face beside the tree: its mark, that of a node, its number in the result.
const BYTES_PER_FACE: u64 = 1 + 1 + 4;

/// The faces that intersect another one, in mesh order. Takes what it needs of the budget while it
/// runs.
pub fn self_intersections(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Vec<u32>, Exhausted> {
    let mut budget = budget.clone();
    budget.spend("the search for intersections", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
    let tree = Tree::of(mesh, &mut budget, deadline)?;
    let search = Search { mesh, tree: &tree, deadline };
    let marks: Vec<AtomicBool> = (0..tree.len()).map(|_| AtomicBool::new(false)).collect();
    search.mark_first_pairs(&marks)?;
    let marks: Vec<bool> = marks.into_iter().map(AtomicBool::into_inner).collect();
    if !marks.contains(&true) {
        return Ok(Vec::new());
    }
    let others = search.partners_of_marked(&marks)?;
    let first = (0..tree.len()).filter(|&place| marks[place]).map(|place| tree.face(place));
    let mut faces: Vec<u32> = first.chain(others).collect();
    faces.sort_unstable();
    Ok(faces)
}

/// The number of vertices that lie within an edge of a face, and are none of its ends. None where
/// so many faces lie above each other that counting would take long.
pub fn t_junctions(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Option<u64>, Exhausted> {
    let mut budget = budget.clone();
    budget.spend("the search for T-junctions", mesh.positions.len() as u64, 1)?;
    let tree = Tree::of(mesh, &mut budget, deadline)?;
    let mut is_corner = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&v| is_corner[v as usize] = true);
    let search = Search { mesh, tree: &tree, deadline };
    let is_too_much = AtomicBool::new(false);
    let vertices = 0..mesh.positions.len();
    let counts = map(vertices.step_by(PIECE).collect(), |start| {
        let (mut count, mut nodes) = (0, NODES_PER_VERTEX * PIECE);
        for vertex in (start..mesh.positions.len().min(start + PIECE)).filter(|&v| is_corner[v]) {
            deadline.check()?;
            if is_too_much.load(Relaxed) {
                break;
            }
            count += u64::from(search.is_on_an_edge(vertex as u32, &mut nodes));
            if nodes == 0 {
                is_too_much.store(true, Relaxed);
            }
        }
        Ok(count)
    });
    let count = counts.into_iter().sum::<Result<u64, Stopped>>()?;
    Ok((!is_too_much.into_inner()).then_some(count))
}

/// A search for pairs. Faces go by their place in the tree.
struct Search<'a> {
    mesh: &'a Mesh,
    tree: &'a Tree,
    deadline: &'a Deadline,
}

impl Search<'_> {
    /// For each face, marks the first pair of it and a later one that intersects. A face that is
    /// marked already may be passed over: [`Search::partners_of_marked`] finds the rest.
    fn mark_first_pairs(&self, marks: &[AtomicBool]) -> Result<(), Stopped> {
        let pieces = map((0..self.tree.len()).step_by(PIECE).collect(), |start| {
            (start..self.tree.len().min(start + PIECE)).try_for_each(|place| {
                self.deadline.check()?;
                if marks[place].load(Relaxed) {
                    return Ok(());
                }
                if let Some(other) = self.partner(place, |node| self.tree.last(node) > place, |other| other > place)? {
                    marks[place].store(true, Relaxed);
                    marks[other].store(true, Relaxed);
                }
                Ok(())
            })
        });
        pieces.into_iter().collect()
    }

    /// The faces that are not marked and intersect one that is. Pairs of two that are not marked do
    /// not intersect: the earlier one was compared with all later ones.
    fn partners_of_marked(&self, marks: &[bool]) -> Result<Vec<u32>, Stopped> {
        let marked_nodes = self.tree.nodes_with(marks);
        let pieces = map((0..self.tree.len()).step_by(PIECE).collect(), |start| {
            let mut found = Vec::new();
            for place in (start..self.tree.len().min(start + PIECE)).filter(|&place| !marks[place]) {
                self.deadline.check()?;
                if self.partner(place, |node| marked_nodes[node], |other| marks[other])?.is_some() {
                    found.push(self.tree.face(place));
                }
            }
            Ok(found)
        });
        Ok(pieces.into_iter().collect::<Result<Vec<_>, Stopped>>()?.concat())
    }

    /// The first face found that intersects this one, of those that are wanted.
    fn partner(
        &self,
        place: usize,
        is_wanted_node: impl Fn(usize) -> bool,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Result<Option<usize>, Stopped> {
        let triangles = &self.mesh.triangles;
        let own = triangles[self.tree.face(place) as usize];
        let around = self.tree.aabb(place);
        let mut pairs = 0_u32;
        let met = self.tree.visit(around, is_wanted_node, |other| {
            if !is_wanted(other) {
                return ControlFlow::Continue(());
            }
            pairs += 1;
            if pairs.is_multiple_of(PAIRS_PER_POLL)
                && let Err(stopped) = self.deadline.check()
            {
                return ControlFlow::Break(Err(stopped));
            }
            let theirs = triangles[self.tree.face(other) as usize];
            let overlap = around.overlap(self.tree.aabb(other));
            match pair::intersect(own, theirs, overlap.is_point(), |v| self.position(v)) {
                true => ControlFlow::Break(Ok(other)),
                false => ControlFlow::Continue(()),
            }
        });
        met.transpose()
    }

    /// True if a vertex lies within an edge of a face, and is none of its ends. Looks at so many
    /// nodes, and leaves what it has not used.
    fn is_on_an_edge(&self, vertex: u32, nodes: &mut usize) -> bool {
        let at = self.position(vertex);
        let around = Aabb::of([self.mesh.positions[vertex as usize]; 3]);
        let is_left = |_| {
            *nodes = nodes.saturating_sub(1);
            *nodes > 0
        };
        let met = self.tree.visit(&around, is_left, |place| {
            let [a, b, c] = self.mesh.triangles[self.tree.face(place) as usize];
            let edges = [[a, b], [b, c], [c, a]];
            let is_met = ![a, b, c].contains(&vertex)
                && edges.iter().any(|edge| pair::is_within(at, edge.map(|v| self.position(v))));
            if is_met { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        met.is_some()
    }

    fn position(&self, vertex: u32) -> Point {
        self.mesh.positions[vertex as usize].map(f64::from)
    }
}
