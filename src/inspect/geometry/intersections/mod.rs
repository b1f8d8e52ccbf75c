//! Faces that intersect each other, and vertices that lie on edges of other faces (T-junctions).
//!
//! Two faces intersect if they have a point in common that does not belong to the corners or the edge that they
//! share. So these count: crossing, overlap in one plane, a corner that touches a face or an edge of another. These
//! do not: a common corner, a common edge, and a face that repeats another. Faces without area in the mesh's own f32
//! positions take no part.
//!
//! All decisions are exact on these positions: `orient` and [`robust`] give the signs. [`Tree`] finds the pairs of
//! faces whose boxes overlap. Pairs of many faces around one vertex ([`fans`]) are found by a tree of the directions
//! from that vertex. The results depend neither on the order of work nor on the number of threads.

mod fans;
mod orient;
mod pair;
mod plane;
mod tree;

#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use self::fans::Fans;
pub(super) use self::tree::{Aabb, Tree};
use meshsnap_render::limits::{Budget, Deadline, Exhausted, Stopped};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::parallel::map;

/// A position in f64, which has every f32 exactly.
type Point = [f64; 3];

/// Faces or vertices handed to a thread at a time.
const PIECE: usize = 1024;

/// Pairs between two looks at the deadline.
const PAIRS_PER_POLL: u64 = 256;

/// Nodes of the tree that the search for T-junctions looks at, for each vertex of a piece on an
/// average. Some 50 are usual.
const NODES_PER_VERTEX: usize = 512;

/// Faces of each tree by which the number of pairs is estimated, and most pairs of each of them.
const SAMPLES: usize = 64;
const PAIRS_OF_SAMPLE_MAX: u64 = 1 << 16;

/// Most pairs that are looked at, as estimated: some 30 for each face are usual.
const PAIRS_MAX: f64 = 3e8;

/// Memory per face beside the tree: its mark, that of a node, its number in the result.
const BYTES_PER_FACE: u64 = 1 + 1 + 4;

/// The faces that intersect another one, in mesh order. Takes what it needs of the budget while it
/// runs. None where so many faces lie above each other that comparing them would take long.
pub fn self_intersections(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Option<Vec<u32>>, Exhausted> {
    let mut budget = budget.clone();
    budget.spend("the search for intersections", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
    let tree = Tree::of(mesh, &mut budget, deadline)?;
    let fans = Fans::of(mesh, &tree, &mut budget, deadline)?;
    let of_fans = fans.trees.iter().map(|tree| Search { mesh, tree, fans: None, deadline });
    let searches: Vec<_> =
        [Search { mesh, tree: &tree, fans: Some(&fans), deadline }].into_iter().chain(of_fans).collect();
    let pairs = map(searches.iter().collect(), |search: &Search<'_>| search.estimate());
    if pairs.into_iter().sum::<Result<f64, Stopped>>()? > PAIRS_MAX {
        return Ok(None);
    }
    let marks: Vec<AtomicBool> = mesh.triangles.iter().map(|_| AtomicBool::new(false)).collect();
    let marked = map(searches.iter().collect(), |search: &Search<'_>| search.mark_first_pairs(&marks));
    marked.into_iter().collect::<Result<(), Stopped>>()?;
    let mut marks: Vec<bool> = marks.into_iter().map(AtomicBool::into_inner).collect();
    if marks.contains(&true) {
        let others = map(searches.iter().collect(), |search: &Search<'_>| search.partners_of_marked(&marks));
        let others = others.into_iter().collect::<Result<Vec<_>, Stopped>>()?;
        others.into_iter().flatten().for_each(|face| marks[face as usize] = true);
    }
    Ok(Some((0..mesh.triangles.len() as u32).filter(|face| marks[*face as usize]).collect()))
}

/// The number of vertices that lie within an edge of a face, and are none of its ends. None where
/// so many faces lie above each other that counting would take long.
pub fn t_junctions(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Option<u64>, Exhausted> {
    let mut budget = budget.clone();
    budget.spend("the search for T-junctions", mesh.positions.len() as u64, 1)?;
    let tree = Tree::of(mesh, &mut budget, deadline)?;
    let mut is_corner = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&v| is_corner[v as usize] = true);
    let search = Search { mesh, tree: &tree, fans: None, deadline };
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
    /// The fans, whose own pairs are not looked at in this tree. None: the tree is that of a fan's directions.
    fans: Option<&'a Fans>,
    deadline: &'a Deadline,
}

impl Search<'_> {
    /// The number of pairs that will be looked at, by some faces at equal distances in the order of the tree.
    fn estimate(&self) -> Result<f64, Stopped> {
        let count = self.tree.len();
        let step = count.div_ceil(SAMPLES).max(1);
        let (mut pairs, mut samples) = (0, 0_u32);
        for place in (0..count).step_by(step) {
            samples += 1;
            pairs += self.look(place, PAIRS_OF_SAMPLE_MAX, |_| true, |_| true)?.1;
        }
        Ok(pairs as f64 / f64::from(samples.max(1)) * count as f64)
    }

    /// For each face, marks the first pair of it and a later one that intersects. A face that is
    /// marked already may be passed over: [`Search::partners_of_marked`] finds the rest.
    fn mark_first_pairs(&self, marks: &[AtomicBool]) -> Result<(), Stopped> {
        let pieces = map((0..self.tree.len()).step_by(PIECE).collect(), |start| {
            (start..self.tree.len().min(start + PIECE)).try_for_each(|place| {
                self.deadline.check()?;
                let mark = |place: usize| &marks[self.tree.face(place) as usize];
                if mark(place).load(Relaxed) {
                    return Ok(());
                }
                if let Some(other) = self.partner(place, |node| self.tree.last(node) > place, |other| other > place)? {
                    mark(place).store(true, Relaxed);
                    mark(other).store(true, Relaxed);
                }
                Ok(())
            })
        });
        pieces.into_iter().collect()
    }

    /// The faces that are not marked and intersect one that is. Pairs of two that are not marked do
    /// not intersect: the earlier one was compared with all later ones.
    fn partners_of_marked(&self, marks: &[bool]) -> Result<Vec<u32>, Stopped> {
        let marks: Vec<bool> = (0..self.tree.len()).map(|place| marks[self.tree.face(place) as usize]).collect();
        let marked_nodes = self.tree.nodes_with(&marks);
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
        self.look(place, u64::MAX, is_wanted_node, is_wanted).map(|(found, _)| found)
    }

    /// The same, and the number of pairs that were looked at, of which there are so many at the most.
    fn look(
        &self,
        place: usize,
        pairs_max: u64,
        is_wanted_node: impl Fn(usize) -> bool,
        is_wanted: impl Fn(usize) -> bool,
    ) -> Result<(Option<usize>, u64), Stopped> {
        let triangles = &self.mesh.triangles;
        let own = triangles[self.tree.face(place) as usize];
        let around = self.tree.aabb(place);
        let mut pairs = 0_u64;
        let is_own_node = |node: usize| self.fans.is_some_and(|fans| fans.is_own(place, node));
        let is_own = |other: usize| other == place || self.fans.is_some_and(|fans| fans.are_of_one(place, other));
        let met = self.tree.visit(
            around,
            |node| is_wanted_node(node) && !is_own_node(node),
            |other| {
                if !is_wanted(other) {
                    return ControlFlow::Continue(());
                }
                pairs += 1;
                if pairs.is_multiple_of(PAIRS_PER_POLL)
                    && let Err(stopped) = self.deadline.check()
                {
                    return ControlFlow::Break(Err(stopped));
                }
                if pairs >= pairs_max {
                    return ControlFlow::Break(Ok(None));
                }
                if is_own(other) {
                    return ControlFlow::Continue(());
                }
                let theirs = triangles[self.tree.face(other) as usize];
                let is_point = self.fans.is_some() && around.overlap(self.tree.aabb(other)).is_point();
                match pair::intersect(own, theirs, is_point, |v| self.position(v)) {
                    true => ControlFlow::Break(Ok(Some(other))),
                    false => ControlFlow::Continue(()),
                }
            },
        );
        Ok((met.transpose()?.flatten(), pairs))
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
