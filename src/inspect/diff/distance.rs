//! The one-sided distance of a surface from another: over all its points, the largest and the mean
//! distance to the nearest point of the other. The mean is that of samples.
//!
//! The largest is found by branch and bound. The distance to a single face of the other surface is convex, so over a
//! triangle it is largest at a corner. That corner's distance is a bound for all points of the triangle. It is
//! computed for the faces nearest to the three corners, and the smallest counts. Triangles whose bound is above the
//! largest distance found so far are divided, until the difference is small enough or there were too many divisions.
//! The difference that is left is the error that the result states.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::frame::{Frame, in_file};
use crate::geometry::nearest::{Hit, NearestFaces};
use meshsnap_render::limits::{Budget, Deadline, Exhausted};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Most triangles that are divided to make the bound smaller.
const DIVISIONS_MAX: usize = 100_000;

/// Samples of the mean that all triangles together have at least.
const SAMPLES: f64 = 50_000.0;

/// Most parts of a triangle's side for these samples.
const PARTS_MAX: f64 = 64.0;

/// Faces between two looks at the deadline.
const FACES_PER_CHECK: usize = 1 << 14;

/// Memory of a vertex and of a triangle, while both are worked on.
const BYTES_PER_VERTEX: u64 = 2 * size_of::<Option<Hit>>() as u64;
const BYTES_PER_FACE: u64 = size_of::<Piece>() as u64 + 24;

/// The distance from one surface to another, in units of the other's box.
#[derive(Clone, Debug, Default)]
pub struct OneWay {
    /// The largest.
    pub max: f64,
    /// What the largest may be more.
    pub max_error: f64,
    /// The place of the largest, in the file's space.
    pub at: [f64; 3],
    /// The mean over the surface.
    pub mean: f64,
    /// What the mean may be off.
    pub mean_error: f64,
    /// The distance of each vertex; 0 for those of common faces alone.
    pub of_vertices: Vec<f64>,
}

/// What is measured.
pub struct Measured<'m> {
    /// The surface whose points are taken.
    pub from: &'m Mesh,
    /// Its faces that the other surface does not have. All others are at a distance of 0.
    pub faces: &'m [u32],
    /// The other surface.
    pub to: &'m Mesh,
    /// The error of the largest distance at which the search ends, file units.
    pub error: f64,
    /// The search goes on while the largest distance may be below this or above, file units.
    pub decided_by: f64,
}

/// A part of a face, with the hits of its corners.
#[derive(Clone, Copy, Debug)]
struct Piece {
    bound: f64,
    /// In the order in which they were made, so that equal bounds have an order.
    number: u32,
    corners: [[f64; 3]; 3],
    hits: [Hit; 3],
}

/// The halves of a piece, with the point between them.
struct Halves {
    pieces: [Piece; 2],
    middle: [f64; 3],
    hit: Hit,
}

impl PartialEq for Piece {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Piece {}

impl PartialOrd for Piece {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Piece {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound.total_cmp(&other.bound).then(other.number.cmp(&self.number))
    }
}

impl Measured<'_> {
    /// Measures. None where an f64 cannot hold the distances.
    pub fn one_way(&self, budget: &mut Budget, deadline: &Deadline) -> Result<Option<OneWay>, Exhausted> {
        let Self { from, to, .. } = *self;
        budget.spend("distances between surfaces", from.positions.len() as u64, BYTES_PER_VERTEX)?;
        let pieces = self.faces.len() + from.lines_and_points.len() + 2 * DIVISIONS_MAX;
        budget.spend("distances between surfaces", pieces as u64, BYTES_PER_FACE)?;
        let tree = NearestFaces::new(to, budget)?;
        deadline.check()?;
        let frame = Frame::between(&from.to_file, &to.to_file);
        let Some(hits) = self.of_vertices(&tree, frame, deadline)? else { return Ok(None) };
        let mut found = OneWay { of_vertices: vec![0.0; from.positions.len()], ..OneWay::default() };
        let mut at = None;
        for (vertex, hit) in hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            found.of_vertices[vertex] = hit.distance;
            if at.is_none() || hit.distance > found.max {
                found.max = hit.distance;
                at = Some(frame.map(from.positions[vertex]));
            }
        }
        let at = self.refine(&tree, frame, &hits, &mut found, at.unwrap_or_default(), deadline)?;
        found.at = in_file(&to.to_file, at);
        self.mean(&tree, frame, &hits, &mut found, deadline)?;
        Ok(Some(found))
    }

    /// The corners of all pieces to begin with: faces, lines and points.
    fn pieces(&self) -> impl Iterator<Item = [u32; 3]> {
        let others = self.from.lines_and_points.iter().map(|one| [one.ends[0], one.ends[1], one.ends[1]]);
        self.faces.iter().map(|face| self.from.triangles[*face as usize]).chain(others)
    }

    /// The hit of each vertex that is needed; the outer None where there is one without.
    fn of_vertices(
        &self,
        tree: &NearestFaces<'_>,
        frame: Frame,
        deadline: &Deadline,
    ) -> Result<Option<Vec<Option<Hit>>>, Exhausted> {
        let mut is_needed = vec![false; self.from.positions.len()];
        self.pieces().flatten().for_each(|vertex| is_needed[vertex as usize] = true);
        let mut hits = vec![None; is_needed.len()];
        for (n, chunk) in hits.chunks_mut(FACES_PER_CHECK).enumerate() {
            deadline.check()?;
            let first = n * FACES_PER_CHECK;
            chunk.par_iter_mut().enumerate().for_each(|(i, hit)| {
                if is_needed[first + i] {
                    *hit = tree.nearest(frame.map(self.from.positions[first + i]), None);
                }
            });
        }
        let all_hit = hits.iter().zip(&is_needed).all(|(hit, is_needed)| hit.is_some() || !is_needed);
        Ok(all_hit.then_some(hits))
    }

    /// Looks within faces for larger distances, until the error is small enough. Returns the place of the largest.
    fn refine(
        &self,
        tree: &NearestFaces<'_>,
        frame: Frame,
        hits: &[Option<Hit>],
        found: &mut OneWay,
        mut at: [f64; 3],
        deadline: &Deadline,
    ) -> Result<[f64; 3], Exhausted> {
        let [error, decided_by] = [self.error, self.decided_by].map(|length| length / self.to.to_file.scale);
        let (mut heap, mut number) = (BinaryHeap::new(), 0);
        for corners in self.pieces() {
            let [Some(a), Some(b), Some(c)] = corners.map(|vertex| hits[vertex as usize]) else { continue };
            let corners = corners.map(|vertex| frame.map(self.from.positions[vertex as usize]));
            let piece = Piece::new(tree, number, corners, [a, b, c]);
            number += 1;
            if piece.bound > found.max {
                heap.push(piece);
            }
        }
        for n in 0..DIVISIONS_MAX {
            if n % 256 == 0 {
                deadline.check()?;
            }
            let is_open = |bound: f64| bound > found.max + error || (bound > decided_by && found.max <= decided_by);
            let Some(piece) = heap.peek().filter(|piece| is_open(piece.bound)).copied() else { break };
            heap.pop();
            let Some(Halves { pieces, middle, hit }) = piece.halves(tree, &mut number) else { continue };
            if hit.distance > found.max {
                (found.max, at) = (hit.distance, middle);
            }
            heap.extend(pieces.into_iter().filter(|half| half.bound > found.max));
        }
        found.max_error = heap.peek().map_or(0.0, |piece| (piece.bound - found.max).max(0.0));
        Ok(at)
    }

    /// The mean over the whole surface, by samples in the middles of small triangles of equal size.
    fn mean(
        &self,
        tree: &NearestFaces<'_>,
        frame: Frame,
        hits: &[Option<Hit>],
        found: &mut OneWay,
        deadline: &Deadline,
    ) -> Result<(), Exhausted> {
        let corners_of = |t: [u32; 3]| t.map(|vertex| frame.map(self.from.positions[vertex as usize]));
        let total: f64 = self.from.triangles.iter().map(|t| area(corners_of(*t))).sum();
        let of_faces: f64 = self.faces.iter().map(|face| area(corners_of(self.from.triangles[*face as usize]))).sum();
        if total <= 0.0 {
            // Lines and points: the mean of their vertices.
            let used: Vec<f64> = hits.iter().flatten().map(|hit| hit.distance).collect();
            found.mean = used.iter().sum::<f64>() / used.len().max(1) as f64;
            return Ok(());
        }
        let (mut sum, mut error) = (0.0, 0.0);
        for faces in self.faces.chunks(FACES_PER_CHECK) {
            deadline.check()?;
            let of_face = |face: &u32| {
                let t = self.from.triangles[*face as usize];
                let corners = corners_of(t);
                let own = area(corners);
                let parts = (SAMPLES * own / of_faces.max(f64::MIN_POSITIVE)).sqrt().ceil().clamp(1.0, PARTS_MAX);
                let (mean, error) = mean_of_face(tree, corners, hits[t[0] as usize], parts as u32);
                (own * mean, own * error)
            };
            let all: Vec<(f64, f64)> = faces.par_iter().map(of_face).collect();
            for (of_face, error_of_face) in all {
                sum += of_face;
                error += error_of_face;
            }
        }
        (found.mean, found.mean_error) = (sum / total, error / total);
        Ok(())
    }
}

impl Piece {
    fn new(tree: &NearestFaces<'_>, number: u32, corners: [[f64; 3]; 3], hits: [Hit; 3]) -> Self {
        let to_face = |hit: &Hit| corners.iter().map(|corner| tree.distance_to(hit.face, *corner)).fold(0.0, f64::max);
        let bound = hits.iter().map(to_face).fold(f64::INFINITY, f64::min);
        Self { bound, number, corners, hits }
    }

    /// Divides the longest side.
    fn halves(&self, tree: &NearestFaces<'_>, number: &mut u32) -> Option<Halves> {
        let Self { corners, hits, .. } = *self;
        let length = |k: usize| {
            let side = sub(corners[(k + 1) % 3], corners[k]);
            dot(side, side)
        };
        let longest = (0..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
        let [i, j, k] = [longest, (longest + 1) % 3, (longest + 2) % 3];
        let middle: [f64; 3] = std::array::from_fn(|axis| (corners[i][axis] + corners[j][axis]) / 2.0);
        let hit = tree.nearest(middle, Some(hits[i].face))?;
        *number += 2;
        let first = Self::new(tree, *number - 1, [corners[i], middle, corners[k]], [hits[i], hit, hits[k]]);
        let second = Self::new(tree, *number, [middle, corners[j], corners[k]], [hit, hits[j], hits[k]]);
        Some(Halves { pieces: [first, second], middle, hit })
    }
}

/// The mean distance of a face, and what it may be off: no point of a small triangle is farther from its sample
/// than its corners are, and distances change no faster than places do.
fn mean_of_face(tree: &NearestFaces<'_>, [a, b, c]: [[f64; 3]; 3], hint: Option<Hit>, parts: u32) -> (f64, f64) {
    let middle: [f64; 3] = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
    let to_corner = |corner: [f64; 3]| {
        let way = sub(corner, middle);
        dot(way, way).sqrt()
    };
    let radius = to_corner(a).max(to_corner(b)).max(to_corner(c)) / f64::from(parts);
    let (mut sum, mut count) = (0.0, 0_u32);
    let mut face = hint.map(|hit| hit.face);
    let mut sample = |u: f64, v: f64| {
        let place = std::array::from_fn(|k| a[k] + (u * (b[k] - a[k]) + v * (c[k] - a[k])) / f64::from(parts));
        if let Some(hit) = tree.nearest(place, face) {
            (sum, count, face) = (sum + hit.distance, count + 1, Some(hit.face));
        }
    };
    for i in 0..parts {
        for j in 0..parts - i {
            sample(f64::from(i) + 1.0 / 3.0, f64::from(j) + 1.0 / 3.0);
            if i + j + 1 < parts {
                sample(f64::from(i) + 2.0 / 3.0, f64::from(j) + 2.0 / 3.0);
            }
        }
    }
    (sum / f64::from(count.max(1)), radius)
}

fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let normal = cross(sub(b, a), sub(c, a));
    dot(normal, normal).sqrt() / 2.0
}
