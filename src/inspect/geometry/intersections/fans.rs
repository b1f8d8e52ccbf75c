//! Fans: the faces around a vertex, the apex, which has 64 faces or more. A face is in one fan at most, that of its
//! corner with the most faces. The boxes of all faces of a fan overlap at the apex, so that the tree of boxes of the
//! mesh would find all of their pairs, whose number grows with the square of that of the faces.
//!
//! Each fan therefore has a tree of its own, of the directions from the apex to the points of each face. If two faces
//! have another point in common than the apex, one ray from the apex meets both. So faces whose directions do not
//! overlap need not be compared.

use super::tree::{Aabb, Tree};
use meshsnap_render::limits::{Budget, Deadline, Exhausted};
use meshsnap_render::mesh::Mesh;

/// Fewest faces around a vertex that make a fan.
const FACES_MIN: u32 = 64;

/// Memory per vertex: its number of faces, its fan. Per face: its fan twice, its box of directions.
const BYTES_PER_VERTEX: u64 = 4 + 4;
const BYTES_PER_FACE: u64 = 4 + 8 + 28;

/// The most that rounding changes of a direction.
const SLACK: f64 = 1e-6;

const NONE: u32 = u32::MAX;

/// The fans of a mesh. A face is in one of them at most.
pub struct Fans {
    /// By place in the tree of the mesh: the fan of the face.
    of_place: Vec<u32>,
    /// By node of that tree: the fan of all faces under it.
    of_node: Vec<u32>,
    /// By fan: the tree of the directions of its faces.
    pub trees: Vec<Tree>,
}

impl Fans {
    /// The fans of the faces of a tree.
    pub fn of(mesh: &Mesh, tree: &Tree, budget: &mut Budget, deadline: &Deadline) -> Result<Self, Exhausted> {
        budget.spend("the fans of faces", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
        budget.spend("the fans of faces", tree.len() as u64, BYTES_PER_FACE)?;
        let mut counts = vec![0_u32; mesh.positions.len()];
        let corners = |place: usize| mesh.triangles[tree.face(place) as usize];
        (0..tree.len()).flat_map(corners).for_each(|vertex| counts[vertex as usize] += 1);
        deadline.check()?;
        let mut of_vertex = vec![NONE; mesh.positions.len()];
        let mut boxes: Vec<Vec<(u32, Aabb)>> = Vec::new();
        let mut of_place = vec![NONE; tree.len()];
        for (place, fan) in of_place.iter_mut().enumerate() {
            // The corner with the most faces; of several, the first vertex.
            let rank = |vertex: &u32| (std::cmp::Reverse(counts[*vertex as usize]), *vertex);
            let Some(apex) = corners(place).into_iter().min_by_key(rank) else { continue };
            if counts[apex as usize] < FACES_MIN {
                continue;
            }
            let number = &mut of_vertex[apex as usize];
            if *number == NONE {
                *number = boxes.len() as u32;
                boxes.push(Vec::new());
            }
            *fan = *number;
            boxes[*number as usize].push((tree.face(place), directions(mesh, tree.face(place), apex)));
        }
        deadline.check()?;
        let trees = boxes.into_iter().map(|boxes| Tree::of_boxes(boxes, budget, deadline));
        let trees = trees.collect::<Result<Vec<_>, _>>()?;
        let of_node = tree.common_value(&of_place, NONE);
        Ok(Self { of_place, of_node, trees })
    }

    /// True if two places have faces of one fan.
    pub fn are_of_one(&self, place: usize, other: usize) -> bool {
        self.of_place[place] != NONE && self.of_place[place] == self.of_place[other]
    }

    /// True if all faces under a node are of the fan of the face at a place.
    pub fn is_own(&self, place: usize, node: usize) -> bool {
        self.of_place[place] != NONE && self.of_place[place] == self.of_node[node]
    }
}

/// A box around half the unit vectors from the apex to the points of a face.
fn directions(mesh: &Mesh, face: u32, apex: u32) -> Aabb {
    let corners = mesh.triangles[face as usize];
    let from = mesh.positions[apex as usize].map(f64::from);
    let direction = |vertex: u32| -> [f64; 3] {
        let to = mesh.positions[vertex as usize].map(f64::from);
        let way: [f64; 3] = std::array::from_fn(|k| to[k] - from[k]);
        let length = way.iter().map(|value| value * value).sum::<f64>().sqrt();
        way.map(|value| value / length)
    };
    let mut others = corners.into_iter().filter(|vertex| *vertex != apex).map(direction);
    let (Some(a), Some(b)) = (others.next(), others.next()) else { return Aabb::everything() };
    let middle: [f64; 3] = std::array::from_fn(|k| (a[k] + b[k]) / 2.0);
    // The arc from one direction to the other is so far from the line between them at the most.
    let bulge = 1.0 - middle.iter().map(|value| value * value).sum::<f64>().sqrt() + SLACK;
    if !bulge.is_finite() {
        return Aabb::everything();
    }
    let low = std::array::from_fn(|k| (0.5 * (a[k].min(b[k]) - bulge)) as f32);
    Aabb::between(low, std::array::from_fn(|k| (0.5 * (a[k].max(b[k]) + bulge)) as f32))
}
