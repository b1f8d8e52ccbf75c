//! The number of faces that overlap others in the texture, and the areas that any face, and that two
//! faces or more, cover.
//!
//! Two faces overlap if their interiors have a point in common: if no line along an edge of either
//! face separates them. Exact predicates decide on which side of a line a point lies. Areas are
//! those of polygons in f64, with a bound of their rounding. A tree of boxes finds the pairs of
//! faces that may overlap.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use super::cover::Uncovered;
use super::{Uv, orientation, twice_area, uvs};
use crate::geometry::intersections::{Aabb, Tree};
use meshsnap_render::limits::{Budget, Deadline, Exhausted, Stopped};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::parallel::map;

/// Faces handed to a thread at a time.
const PIECE: usize = 1024;

/// Pairs between two looks at the deadline.
const PAIRS_PER_POLL: u64 = 256;

/// Most pairs of faces with overlapping boxes: for each face, and in any case. Some 15 for each face are usual.
const PAIRS_PER_FACE_MAX: u64 = 64;
const PAIRS_MAX: u64 = 4_000_000;

/// Most cuts of polygons, likewise. A face that lies across ten others has some 30.
const CUTS_PER_FACE_MAX: u64 = 64;
const CUTS_MAX: u64 = 20_000_000;

/// Most polygons into which one face is cut.
const POLYGONS_MAX: usize = 4096;

/// Memory per face: its box with its number, and its areas.
const BYTES_PER_FACE: u64 = 28 + 32;

/// The overlaps of a mesh in its texture, in areas of the texture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlaps {
    /// Faces that overlap others.
    pub faces: u64,
    /// The area that any face covers.
    pub covered: f64,
    /// The area that two faces or more cover.
    pub overlapping: f64,
    /// The most by which rounding has changed either area.
    pub error: f64,
}

/// The overlaps of a mesh. None where so many faces lie above each other that looking at all would take long.
pub fn overlaps(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Option<Overlaps>, Exhausted> {
    if mesh.uvs.is_empty() {
        return Ok(Some(Overlaps::default()));
    }
    let mut budget = budget.clone();
    budget.spend("the overlaps in the texture", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
    let boxes = boxes(mesh);
    deadline.check()?;
    let tree = Tree::of_boxes(boxes, &mut budget, deadline)?;
    let (pairs, cuts, has_shreds) = (AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
    let search = Search { mesh, tree: &tree, deadline, pairs, cuts, has_shreds };
    let places: Vec<usize> = (0..tree.len()).step_by(PIECE).collect();
    let pieces = map(places, |start| {
        let mut of_piece = Vec::new();
        for place in start..tree.len().min(start + PIECE) {
            deadline.check()?;
            // The sums of pairs and cuts do not depend on the order, so all threads agree that they are too large.
            let Some(found) = search.face(place)? else { return Ok(None) };
            of_piece.push((tree.face(place), found));
        }
        Ok(Some(of_piece))
    });
    let mut all = Vec::with_capacity(tree.len());
    for piece in pieces.into_iter().collect::<Result<Vec<_>, Stopped>>()? {
        let Some(piece) = piece else { return Ok(None) };
        all.extend(piece);
    }
    if search.is_too_much() {
        return Ok(None);
    }
    all.sort_unstable_by_key(|(face, _)| *face);
    let mut sums = Overlaps::default();
    let mut once = 0.0;
    for (_, found) in all {
        sums.faces += u64::from(found.is_overlapping);
        sums.covered += found.first;
        once += found.alone;
        sums.error += found.error;
    }
    sums.overlapping = (sums.covered - once).max(0.0);
    sums.error += sums.covered * f64::EPSILON * 4.0 * mesh.triangles.len() as f64;
    if sums.faces == 0 {
        sums.overlapping = 0.0;
    }
    Ok(Some(sums))
}

/// A face and those that it overlaps.
struct FaceOverlap {
    is_overlapping: bool,
    /// The area that no earlier face covers.
    first: f64,
    /// The area that no other face covers.
    alone: f64,
    error: f64,
}

struct Search<'a> {
    mesh: &'a Mesh,
    tree: &'a Tree,
    deadline: &'a Deadline,
    pairs: AtomicU64,
    cuts: AtomicU64,
    /// A face was cut into too many polygons.
    has_shreds: AtomicBool,
}

impl Search<'_> {
    fn is_too_much(&self) -> bool {
        let faces = self.tree.len() as u64;
        self.pairs.load(Relaxed) > PAIRS_MAX + PAIRS_PER_FACE_MAX * faces
            || self.cuts.load(Relaxed) > CUTS_MAX + CUTS_PER_FACE_MAX * faces
            || self.has_shreds.load(Relaxed)
    }

    /// The overlaps of a face; none if there are too many of them.
    fn face(&self, place: usize) -> Result<Option<FaceOverlap>, Stopped> {
        let face = self.tree.face(place);
        let own = uvs(self.mesh, face);
        let whole = twice_area(own).abs() / 2.0;
        let Some(mut others) = self.partners(place, own)? else { return Ok(None) };
        if others.is_empty() {
            return Ok(Some(FaceOverlap { is_overlapping: false, first: whole, alone: whole, error: 0.0 }));
        }
        others.sort_unstable();
        let (earlier, later) = others.split_at(others.partition_point(|other| *other < face));
        let mut left = Uncovered::of(own);
        if !self.take(&mut left, earlier)? {
            return Ok(None);
        }
        let first = left.area();
        if !self.take(&mut left, later)? {
            return Ok(None);
        }
        Ok(Some(FaceOverlap { is_overlapping: true, first, alone: left.area(), error: 2.0 * left.error() }))
    }

    /// Takes away what other faces cover. False if that takes too long.
    fn take(&self, left: &mut Uncovered, others: &[u32]) -> Result<bool, Stopped> {
        for other in others {
            if left.pieces() == 0 {
                break;
            }
            let before = left.cuts;
            left.take(uvs(self.mesh, *other));
            self.cuts.fetch_add(left.cuts - before, Relaxed);
            if left.pieces() > POLYGONS_MAX {
                self.has_shreds.store(true, Relaxed);
            }
            if self.is_too_much() {
                return Ok(false);
            }
            self.deadline.check()?;
        }
        Ok(true)
    }

    /// The faces that overlap a face; none if there are too many to look at.
    fn partners(&self, place: usize, own: [Uv; 3]) -> Result<Option<Vec<u32>>, Stopped> {
        let (mut found, mut pairs) = (Vec::new(), 0_u64);
        let stopped = self.tree.visit(
            self.tree.aabb(place),
            |_| true,
            |other| {
                pairs += 1;
                if pairs.is_multiple_of(PAIRS_PER_POLL) {
                    self.pairs.fetch_add(PAIRS_PER_POLL, Relaxed);
                    if self.is_too_much() {
                        return ControlFlow::Break(Ok(()));
                    }
                    if let Err(stopped) = self.deadline.check() {
                        return ControlFlow::Break(Err(stopped));
                    }
                }
                let face = self.tree.face(other);
                if other != place && do_overlap(own, uvs(self.mesh, face)) {
                    found.push(face);
                }
                ControlFlow::Continue(())
            },
        );
        self.pairs.fetch_add(pairs % PAIRS_PER_POLL, Relaxed);
        match stopped {
            Some(Err(stopped)) => Err(stopped),
            Some(Ok(())) => Ok(None),
            None => Ok(Some(found)),
        }
    }
}

/// True if the interiors of two triangles have a point in common. Both have an area.
fn do_overlap(one: [Uv; 3], other: [Uv; 3]) -> bool {
    let is_parted_by = |one: [Uv; 3], other: [Uv; 3]| {
        let turn = twice_area(one).signum();
        let edges = [[one[0], one[1]], [one[1], one[2]], [one[2], one[0]]];
        edges.iter().any(|[from, to]| other.iter().all(|at| turn * orientation(*from, *to, *at) <= 0.0))
    };
    !is_parted_by(one, other) && !is_parted_by(other, one)
}

/// The boxes of the faces that have an area, within the unit box. Rounding keeps the order of numbers, so
/// boxes that overlap still do.
fn boxes(mesh: &Mesh) -> Vec<(u32, Aabb)> {
    let faces = || (0..mesh.triangles.len() as u32).filter(|&face| twice_area(uvs(mesh, face)) != 0.0);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for at in faces().flat_map(|face| uvs(mesh, face)) {
        low = std::array::from_fn(|k| low[k].min(at[k]));
        high = std::array::from_fn(|k| high[k].max(at[k]));
    }
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    let point = |at: Uv| [((at[0] - low[0]) / side - 0.5) as f32, ((at[1] - low[1]) / side - 0.5) as f32, 0.0];
    faces().map(|face| (face, Aabb::of(uvs(mesh, face).map(point)))).collect()
}
