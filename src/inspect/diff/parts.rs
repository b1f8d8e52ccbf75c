//! The connected parts of two meshes, matched with each other: each part is unchanged, moved, turned, changed, added
//! or removed. Faces with a common edge are of one part; surfaces that touch in a vertex alone are two parts.

use std::collections::VecDeque;

use rapidhash::RapidHashMap;

use super::faces::Faces;
use super::frame::Frame;
use super::vertices::Grid;
use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::{Edge, EdgeList};
use meshsnap_render::mesh::union_find::UnionFind;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Most parts of one mesh that are compared by their shape with a part of the other.
const CANDIDATES_MAX: usize = 256;

/// Most of them that are compared vertex by vertex: the nearest.
const VERIFIED_MAX: usize = 8;

/// Memory of a vertex (its position) and of a face (set, number of a part, its corners in a list that doubles).
const BYTES_PER_VERTEX: u64 = 24;
const BYTES_PER_FACE: u64 = 4 + 4 + 24 + size_of::<Part>() as u64 / 4;

const NONE: u32 = u32::MAX;

/// A connected part, in the unit box of `a`.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its faces.
    pub faces: u32,
    /// Those of them that the other mesh does not have.
    pub own_faces: u32,
    /// Its vertices.
    pub vertices: Vec<u32>,
    /// The middle of its bounding box.
    pub middle: [f64; 3],
    /// The sides of its bounding box.
    pub size: [f64; 3],
    area: f64,
    /// Six times its volume about its first vertex.
    volume: f64,
}

/// What happened to a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fate {
    /// It is elsewhere: shifted by this, in the unit box of `a`.
    Moved([f64; 3]),
    /// It is elsewhere, and turned.
    Turned,
    /// Only `b` has it.
    Added,
    /// Only `a` has it.
    Removed,
    /// Both have it, with other faces.
    Changed,
}

/// A part that is not as it was.
#[derive(Clone, Debug)]
pub struct Changed {
    /// What happened.
    pub fate: Fate,
    /// The part of `a`, unless it was added.
    pub before: Option<Part>,
    /// The part of `b`, unless it was removed.
    pub after: Option<Part>,
}

/// Parts that changed, and how many did not.
#[derive(Debug, Default)]
pub struct Parts {
    /// Parts that are not as they were: first those of `b` in its order, then those that went.
    pub changed: Vec<Changed>,
    /// Parts of `b` that are as they were.
    pub unchanged: u64,
}

/// Compares the parts. `tolerance` is in the unit box of `a`.
pub fn compare(
    [(a, edges_a), (b, edges_b)]: [(&Mesh, &EdgeList); 2],
    faces: &Faces,
    tolerance: f64,
    budget: &mut Budget,
) -> Result<Parts, LimitExceeded> {
    let to_a = Frame::between(&b.to_file, &a.to_file);
    let own = Frame::between(&a.to_file, &a.to_file);
    let of_a = Labelled::of((a, edges_a), &faces.removed, own, budget)?;
    let of_b = Labelled::of((b, edges_b), &faces.added, to_a, budget)?;
    let mut parts = Parts::default();
    // Parts that share faces are one part that changed.
    let mut partner = vec![NONE; of_b.parts.len()];
    let mut is_met = vec![false; of_a.parts.len()];
    for [face_a, face_b] in &faces.common {
        let (part_a, part_b) = (of_a.of_face[*face_a as usize], of_b.of_face[*face_b as usize]);
        is_met[part_a as usize] = true;
        if partner[part_b as usize] == NONE {
            partner[part_b as usize] = part_a;
        }
    }
    let mut left = Left::of(&of_a.parts, is_met);
    let mut alone = Vec::new();
    for (part, after) in of_b.parts.iter().enumerate() {
        match of_a.parts.get(partner[part] as usize) {
            Some(before) if after.own_faces == 0 && before.own_faces == 0 => parts.unchanged += 1,
            Some(before) => parts.changed.push(Changed {
                fate: Fate::Changed,
                before: Some(before.clone()),
                after: Some(after.clone()),
            }),
            None => alone.push(part),
        }
    }
    for same_shape in [true, false] {
        for part in std::mem::take(&mut alone) {
            let after = &of_b.parts[part];
            let met = match same_shape {
                true => of_same_shape(&of_a, &mut left, after, &of_b, tolerance, budget)?,
                false => overlapping(&of_a.parts, &mut left, after).map(|part| (part, Fate::Changed)),
            };
            match met {
                // In its place, with other faces on the same surface.
                Some((part, Fate::Moved(by))) if dot(by, by).sqrt() <= 4.0 * tolerance => {
                    left.is_taken[part as usize] = true;
                    parts.unchanged += 1;
                }
                Some((part, fate)) => {
                    left.is_taken[part as usize] = true;
                    let before = Some(of_a.parts[part as usize].clone());
                    parts.changed.push(Changed { fate, before, after: Some(after.clone()) });
                }
                None => alone.push(part),
            }
        }
    }
    let added = alone.into_iter().map(|part| (Fate::Added, None, Some(of_b.parts[part].clone())));
    let gone = of_a.parts.iter().zip(&left.is_taken).filter(|(_, is_taken)| !**is_taken);
    let removed = gone.map(|(part, _)| (Fate::Removed, Some(part.clone()), None));
    parts.changed.extend(added.chain(removed).map(|(fate, before, after)| Changed { fate, before, after }));
    Ok(parts)
}

/// The parts of `a` that have no partner yet.
struct Left {
    is_taken: Vec<bool>,
    /// All of them.
    all: VecDeque<u32>,
    /// Those with the same numbers of faces and vertices.
    alike: RapidHashMap<(u32, usize), VecDeque<u32>>,
}

impl Left {
    fn of(parts: &[Part], is_taken: Vec<bool>) -> Self {
        let all: VecDeque<u32> = (0..parts.len() as u32).filter(|part| !is_taken[*part as usize]).collect();
        let mut alike: RapidHashMap<_, VecDeque<u32>> = RapidHashMap::default();
        for part in &all {
            alike.entry(parts[*part as usize].key()).or_default().push_back(*part);
        }
        Self { is_taken, all, alike }
    }

    /// The first parts of a list that have no partner; those before them that have one are forgotten.
    fn first<'l>(is_taken: &'l [bool], list: &'l mut VecDeque<u32>) -> impl Iterator<Item = u32> {
        while list.front().is_some_and(|part| is_taken[*part as usize]) {
            list.pop_front();
        }
        list.iter().copied().take(CANDIDATES_MAX).filter(|part| !is_taken[*part as usize])
    }
}

/// The parts of a mesh.
struct Labelled {
    parts: Vec<Part>,
    of_face: Vec<u32>,
    /// All positions, in the unit box of `a`.
    positions: Vec<[f64; 3]>,
}

impl Labelled {
    fn of(
        (mesh, edges): (&Mesh, &EdgeList),
        own_faces: &[u32],
        frame: Frame,
        budget: &mut Budget,
    ) -> Result<Self, LimitExceeded> {
        budget.spend("the parts of a mesh", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
        budget.spend("the parts of a mesh", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
        let mut sets = UnionFind::new(mesh.triangles.len());
        for [first, second] in edges.edges.iter().map(|edge| edge.faces).filter(|faces| faces[1] != Edge::NO_FACE) {
            sets.unite(first, second);
        }
        for [edge, face] in &edges.further_faces {
            sets.unite(edges.edges[*edge as usize].faces[0], *face);
        }
        let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|position| frame.map(*position)).collect();
        let mut numbers = vec![NONE; mesh.triangles.len()];
        let mut parts: Vec<Part> = Vec::new();
        let mut of_face = Vec::with_capacity(mesh.triangles.len());
        for (face, t) in (0_u32..).zip(&mesh.triangles) {
            let set = sets.find(face);
            let number = &mut numbers[set as usize];
            if *number == NONE {
                *number = parts.len() as u32;
                parts.push(Part::new());
            }
            of_face.push(*number);
            let part = &mut parts[*number as usize];
            part.vertices.extend(t);
            let origin = positions[part.vertices[0] as usize];
            let [a, b, c] = t.map(|vertex| sub(positions[vertex as usize], origin));
            let normal = cross(sub(b, a), sub(c, a));
            part.faces += 1;
            part.area += dot(normal, normal).sqrt() / 2.0;
            part.volume += dot(a, cross(b, c));
        }
        for part in &mut parts {
            part.vertices.sort_unstable();
            part.vertices.dedup();
        }
        own_faces.iter().for_each(|face| parts[of_face[*face as usize] as usize].own_faces += 1);
        parts.iter_mut().for_each(|part| part.measure(&positions));
        Ok(Self { parts, of_face, positions })
    }

    fn points(&self, part: &Part) -> Vec<[f64; 3]> {
        part.vertices.iter().map(|vertex| self.positions[*vertex as usize]).collect()
    }
}

impl Part {
    fn new() -> Self {
        let (middle, size) = ([0.0; 3], [0.0; 3]);
        Self { faces: 0, own_faces: 0, vertices: Vec::new(), middle, size, area: 0.0, volume: 0.0 }
    }

    fn measure(&mut self, positions: &[[f64; 3]]) {
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for position in self.vertices.iter().map(|vertex| positions[*vertex as usize]) {
            min = std::array::from_fn(|k| min[k].min(position[k]));
            max = std::array::from_fn(|k| max[k].max(position[k]));
        }
        self.middle = std::array::from_fn(|k| (min[k] + max[k]) / 2.0);
        self.size = std::array::from_fn(|k| max[k] - min[k]);
    }

    /// The numbers that a moved part keeps.
    fn key(&self) -> (u32, usize) {
        (self.faces, self.vertices.len())
    }

    /// The length of the box's diagonal.
    fn diagonal(&self) -> f64 {
        dot(self.size, self.size).sqrt()
    }
}

/// The part of `a` that has the shape of this part of `b`, and what happened. Of several, the nearest.
fn of_same_shape(
    of_a: &Labelled,
    left: &mut Left,
    after: &Part,
    of_b: &Labelled,
    tolerance: f64,
    budget: &Budget,
) -> Result<Option<(u32, Fate)>, LimitExceeded> {
    let slack = 4.0 * tolerance;
    // What rounded positions do to an area and to a volume.
    let of_area = slack * after.diagonal() * f64::from(after.faces).sqrt();
    let of_volume = 6.0 * slack * (after.area + slack);
    let is_like =
        |part: &Part| (part.area - after.area).abs() <= of_area && (part.volume - after.volume).abs() <= of_volume;
    let way = |part: u32| sub(after.middle, of_a.parts[part as usize].middle);
    let Some(alike) = left.alike.get_mut(&after.key()) else { return Ok(None) };
    let alike = Left::first(&left.is_taken, alike);
    let mut candidates: Vec<u32> = alike.filter(|part| is_like(&of_a.parts[*part as usize])).collect();
    candidates.sort_by(|x, y| dot(way(*x), way(*x)).total_cmp(&dot(way(*y), way(*y))));
    for part in candidates.into_iter().take(VERIFIED_MAX) {
        let before = &of_a.parts[part as usize];
        let by = way(part);
        // The memory of one comparison is free again at the next.
        let mut budget = budget.clone();
        budget.spend("the parts of a mesh", 4 * after.vertices.len() as u64, 24)?;
        let (points, others) = (of_a.points(before), of_b.points(after));
        let (radii_before, radii_after) = (radii(&points), radii(&others));
        if (0..3).all(|k| (before.size[k] - after.size[k]).abs() <= slack) {
            let grid = Grid::new(points, slack, &mut budget)?;
            if others.iter().all(|point| grid.find(sub(*point, by)).is_some()) {
                return Ok(Some((part, Fate::Moved(by))));
            }
        }
        if radii_before.iter().zip(&radii_after).all(|(one, other)| (one - other).abs() <= slack) {
            return Ok(Some((part, Fate::Turned)));
        }
    }
    Ok(None)
}

/// The distances of points from their mean, sorted: equal for turned copies.
fn radii(points: &[[f64; 3]]) -> Vec<f64> {
    let mean: [f64; 3] = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64);
    let radius = |point: &[f64; 3]| {
        let way = sub(*point, mean);
        dot(way, way).sqrt()
    };
    let mut radii: Vec<f64> = points.iter().map(radius).collect();
    radii.sort_by(f64::total_cmp);
    radii
}

/// The part of `a` whose box has most of its place in common with this part of `b`: at least half.
fn overlapping(of_a: &[Part], left: &mut Left, after: &Part) -> Option<u32> {
    let share = |before: &Part| -> f64 {
        let along = |k: usize| {
            let of = |part: &Part| [part.middle[k] - part.size[k] / 2.0, part.middle[k] + part.size[k] / 2.0];
            let ([low, high], [other_low, other_high]) = (of(before), of(after));
            let (common, whole) =
                (high.min(other_high) - low.max(other_low), high.max(other_high) - low.min(other_low));
            if whole > 0.0 { common.max(0.0) / whole } else { 1.0 }
        };
        along(0) * along(1) * along(2)
    };
    let shares = Left::first(&left.is_taken, &mut left.all).map(|part| (share(&of_a[part as usize]), part));
    let best = shares.max_by(|x, y| x.0.total_cmp(&y.0).then(y.1.cmp(&x.1)))?;
    (best.0 >= 0.5).then_some(best.1)
}
