//! Holes that one mesh has and the other has not: connected edges that have one face in the first mesh, and two or
//! more in the other.

use rapidhash::RapidHashMap;

use super::frame::in_file;
use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::union_find::UnionFind;

/// Memory of an open edge: its entry in a set, and in a list.
const BYTES_PER_EDGE: u64 = 48;

/// Memory of a vertex: its set.
const BYTES_PER_VERTEX: u64 = 4;

/// A closed chain of open edges, or several that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// Its edges.
    pub edges: u64,
    /// The mean of their ends, in the file's space.
    pub at: [f64; 3],
}

/// A mesh with its edges, and its vertices in common numbers.
#[derive(Clone, Copy)]
pub struct Numbered<'m> {
    /// The mesh.
    pub mesh: &'m Mesh,
    /// Its edges.
    pub edges: &'m EdgeList,
    /// The number of each vertex; None: its index.
    pub numbers: Option<&'m [u32]>,
}

impl Numbered<'_> {
    fn number(&self, vertex: u32) -> u32 {
        self.numbers.map_or(vertex, |numbers| numbers[vertex as usize])
    }

    /// The edges with such numbers of faces: the numbers of their ends, and their own vertices.
    fn of_faces(&self, is_meant: impl Fn(u32) -> bool) -> impl Iterator<Item = ([u32; 2], [u32; 2])> {
        self.edges.iter().filter(move |edge| is_meant(edge.face_count)).map(|edge| {
            let mut numbers = edge.vertices.map(|vertex| self.number(vertex));
            numbers.sort_unstable();
            (numbers, edge.vertices)
        })
    }
}

/// The holes of `one` along edges that have two faces or more in `other`. Edges that the other has not at all, as of
/// another part or a surface that is divided otherwise, are thereby left out.
pub fn only_in(one: Numbered<'_>, other: Numbered<'_>, budget: &mut Budget) -> Result<Vec<Hole>, LimitExceeded> {
    let open_count = one.of_faces(|count| count == 1).count() as u64;
    budget.spend("holes to compare", open_count, BYTES_PER_EDGE)?;
    budget.spend("holes to compare", one.mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
    let open: RapidHashMap<[u32; 2], [u32; 2]> = one.of_faces(|count| count == 1).collect();
    let mut edges: Vec<[u32; 2]> =
        other.of_faces(|count| count > 1).filter_map(|(numbers, _)| open.get(&numbers).copied()).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut sets = UnionFind::new(one.mesh.positions.len());
    for [a, b] in &edges {
        sets.unite(*a, *b);
    }
    let mut holes: RapidHashMap<u32, (u64, [f64; 3])> = RapidHashMap::default();
    for edge in &edges {
        let hole = holes.entry(sets.find(edge[0])).or_default();
        hole.0 += 1;
        for (vertex, k) in edge.iter().flat_map(|vertex| (0..3).map(move |k| (vertex, k))) {
            hole.1[k] += f64::from(one.mesh.positions[*vertex as usize][k]) / 2.0;
        }
    }
    let mut holes: Vec<(u32, (u64, [f64; 3]))> = holes.into_iter().collect();
    holes.sort_by_key(|(first, _)| *first);
    let hole = |(_, (edges, sum)): (u32, (u64, [f64; 3]))| {
        let at = in_file(&one.mesh.to_file, sum.map(|value| value / edges as f64));
        Hole { edges, at }
    };
    Ok(holes.into_iter().map(hole).collect())
}
