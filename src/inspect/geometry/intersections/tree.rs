//! A tree of boxes (a bounding volume hierarchy), one around each face of a mesh: in space, in the texture, or around
//! its directions from a vertex. It finds the faces whose boxes overlap a given box, in the searches for faces that
//! intersect or overlap and for T-junctions.
//!
//! Faces are sorted along a space-filling curve (Morton order of the middles of their boxes), and cut into leaves of
//! at most four. The tree above them is complete, so that nodes need no pointers: the children of node `i` are `2 i`
//! and `2 i + 1`, and node 1 is the root.

use std::ops::ControlFlow;

use rayon::slice::ParallelSliceMut;

use super::Point;
use super::pair::has_area;
use meshsnap_render::limits::{Budget, Deadline, Exhausted};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::parallel::{concat, map, map_items};

/// Faces of a leaf.
const LEAF: usize = 4;

/// Faces handed to a thread at a time.
const PIECE: usize = 16_384;

/// Memory per face: its key twice, its number, its box. A complete tree has up to two leaves for one
/// that is needed, and as many nodes above them.
const BYTES_PER_FACE: u64 = 2 * 16 + 4 + 24 + 4 * 24 / LEAF as u64;

/// Bits of a key along each axis.
const KEY_BITS: u32 = 21;

/// A box. An empty one has its limits the wrong way round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    low: [f32; 3],
    high: [f32; 3],
}

impl Default for Aabb {
    fn default() -> Self {
        Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] }
    }
}

impl Aabb {
    /// The box around some points.
    pub fn of(points: [[f32; 3]; 3]) -> Self {
        points.into_iter().fold(Self::default(), |around, p| around.union(&Self { low: p, high: p }))
    }

    /// The box with these limits.
    pub fn between(low: [f32; 3], high: [f32; 3]) -> Self {
        Self { low, high }
    }

    /// A box that overlaps every other.
    pub fn everything() -> Self {
        Self { low: [f32::NEG_INFINITY; 3], high: [f32::INFINITY; 3] }
    }

    /// The points that both have.
    pub fn overlap(&self, other: &Self) -> Self {
        let low = std::array::from_fn(|k| self.low[k].max(other.low[k]));
        Self { low, high: std::array::from_fn(|k| self.high[k].min(other.high[k])) }
    }

    /// True if it has a single point.
    pub fn is_point(&self) -> bool {
        self.low == self.high
    }

    fn union(&self, other: &Self) -> Self {
        let low = std::array::from_fn(|k| self.low[k].min(other.low[k]));
        Self { low, high: std::array::from_fn(|k| self.high[k].max(other.high[k])) }
    }

    fn overlaps(&self, other: &Self) -> bool {
        // Without a branch for each axis.
        (0..3).fold(true, |all, k| all & (self.low[k] <= other.high[k]) & (other.low[k] <= self.high[k]))
    }
}

/// The tree. A face goes by its place in the order of the leaves.
pub struct Tree {
    /// By place: the face.
    faces: Vec<u32>,
    /// By place: its box.
    boxes: Vec<Aabb>,
    /// The nodes; the first is not used.
    nodes: Vec<Aabb>,
    /// The number of leaves, a power of two.
    leaves: usize,
}

impl Tree {
    /// The tree of the faces that have an area.
    pub fn of(mesh: &Mesh, budget: &mut Budget, deadline: &Deadline) -> Result<Self, Exhausted> {
        budget.spend("the tree of faces", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
        let faces = in_order(keys(mesh), deadline)?;
        let boxes = map_items(&faces, |&face| Aabb::of(corners(mesh, face)));
        Self::above(faces, boxes, deadline)
    }

    /// The tree of faces with boxes of their own, which lie in the unit box.
    pub fn of_boxes(boxed: Vec<(u32, Aabb)>, budget: &mut Budget, deadline: &Deadline) -> Result<Self, Exhausted> {
        budget.spend("the tree of faces", boxed.len() as u64, BYTES_PER_FACE)?;
        let order =
            in_order(boxed.iter().zip(0..).map(|((_, around), index)| (key(around), index)).collect(), deadline)?;
        let (faces, boxes) = order.into_iter().map(|index| boxed[index as usize]).unzip();
        Self::above(faces, boxes, deadline)
    }

    /// The tree above faces in the order of the curve.
    fn above(faces: Vec<u32>, boxes: Vec<Aabb>, deadline: &Deadline) -> Result<Self, Exhausted> {
        let leaves = faces.len().div_ceil(LEAF).next_power_of_two();
        let mut nodes = vec![Aabb::default(); 2 * leaves];
        for (node, boxes) in nodes[leaves..].iter_mut().zip(boxes.chunks(LEAF)) {
            *node = boxes.iter().fold(Aabb::default(), |around, one| around.union(one));
        }
        for node in (1..leaves).rev() {
            nodes[node] = nodes[2 * node].union(&nodes[2 * node + 1]);
        }
        deadline.check()?;
        Ok(Self { faces, boxes, nodes, leaves })
    }

    /// The number of faces.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// The face at a place.
    pub fn face(&self, place: usize) -> u32 {
        self.faces[place]
    }

    /// The box of the face at a place.
    pub fn aabb(&self, place: usize) -> &Aabb {
        &self.boxes[place]
    }

    /// The last place under a node, or a later one.
    pub fn last(&self, node: usize) -> usize {
        let levels_below = self.leaves.ilog2() - node.ilog2();
        (((node + 1) << levels_below) - self.leaves) * LEAF - 1
    }

    /// By node: whether a face under it is marked.
    pub fn nodes_with(&self, marks: &[bool]) -> Vec<bool> {
        let mut nodes = vec![false; 2 * self.leaves];
        for (node, marks) in nodes[self.leaves..].iter_mut().zip(marks.chunks(LEAF)) {
            *node = marks.contains(&true);
        }
        for node in (1..self.leaves).rev() {
            nodes[node] = nodes[2 * node] | nodes[2 * node + 1];
        }
        nodes
    }

    /// By node: the value that all places under it have; `none` where there are several.
    pub fn common_value(&self, values: &[u32], none: u32) -> Vec<u32> {
        let common = |one: Option<u32>, other: Option<u32>| match (one, other) {
            (None, value) | (value, None) => value,
            (Some(one), Some(other)) => Some(if one == other { one } else { none }),
        };
        let mut nodes: Vec<Option<u32>> = vec![None; 2 * self.leaves];
        for (node, values) in nodes[self.leaves..].iter_mut().zip(values.chunks(LEAF)) {
            *node = values.iter().fold(None, |all, value| common(all, Some(*value)));
        }
        for node in (1..self.leaves).rev() {
            nodes[node] = common(nodes[2 * node], nodes[2 * node + 1]);
        }
        nodes.into_iter().map(|value| value.unwrap_or(none)).collect()
    }

    /// Calls `each` with the places of the faces whose boxes overlap a box, until it breaks. Passes
    /// over nodes that are not wanted.
    pub fn visit<B>(
        &self,
        around: &Aabb,
        mut is_wanted: impl FnMut(usize) -> bool,
        mut each: impl FnMut(usize) -> ControlFlow<B>,
    ) -> Option<B> {
        // Two nodes wait at the most for each level.
        let mut waiting = [1_usize; 2 * usize::BITS as usize];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = waiting[count];
            if !self.nodes[node].overlaps(around) || !is_wanted(node) {
                continue;
            }
            if node < self.leaves {
                waiting[count..count + 2].copy_from_slice(&[2 * node + 1, 2 * node]);
                count += 2;
                continue;
            }
            let start = ((node - self.leaves) * LEAF).min(self.len());
            for place in start..self.len().min(start + LEAF) {
                if self.boxes[place].overlaps(around)
                    && let ControlFlow::Break(found) = each(place)
                {
                    return Some(found);
                }
            }
        }
        None
    }
}

/// The second numbers of some pairs, in the order of the first ones.
fn in_order(mut keyed: Vec<(u64, u32)>, deadline: &Deadline) -> Result<Vec<u32>, Exhausted> {
    deadline.check()?;
    keyed.par_sort_unstable();
    deadline.check()?;
    Ok(map_items(&keyed, |&(_, number)| number))
}

fn corners(mesh: &Mesh, face: u32) -> [[f32; 3]; 3] {
    mesh.triangles[face as usize].map(|v| mesh.positions[v as usize])
}

/// The faces that have an area, with their places on the curve.
fn keys(mesh: &Mesh) -> Vec<(u64, u32)> {
    let count = mesh.triangles.len();
    concat(map((0..count).step_by(PIECE).collect(), |start| {
        let faces = start as u32..count.min(start + PIECE) as u32;
        let with_area = faces.filter(|&face| has_area(corners(mesh, face).map(to_f64)));
        with_area.map(|face| (key(&Aabb::of(corners(mesh, face))), face)).collect()
    }))
}

fn to_f64(position: [f32; 3]) -> Point {
    position.map(f64::from)
}

/// The place of a box of the unit box on the curve: the bits of its middle's coordinates, by turns.
fn key(Aabb { low, high }: &Aabb) -> u64 {
    let bits = |k: usize| {
        let middle = f64::from(low[k]) * 0.5 + f64::from(high[k]) * 0.5 + 0.5;
        // A cast ends at the limits of the type.
        let cell = (middle * f64::from(1 << KEY_BITS)) as u32;
        spread(cell.min((1 << KEY_BITS) - 1))
    };
    bits(0) | bits(1) << 1 | bits(2) << 2
}

/// Puts two zeros before each of the lowest 21 bits.
fn spread(bits: u32) -> u64 {
    let steps = [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    steps.into_iter().fold(u64::from(bits), |bits, (shift, mask)| (bits | bits << shift) & mask)
}
