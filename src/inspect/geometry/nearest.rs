//! The distance from a point to the nearest face, line or point of a mesh, and along a ray to the first face that it
//! meets, by a tree of boxes (a bounding volume hierarchy).
//!
//! Distances are computed in f64, in units of the mesh's unit box: the box of side 1 into which reading scales a
//! mesh. Positions are stored as the mesh has them, in f32.

use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Most faces of a leaf.
const LEAF_FACES: usize = 4;

/// Most boxes that wait in a search. The tree is balanced, so its depth is at most 32.
const WAITING_MAX: usize = 64;

/// Memory of a face: its corners, and its share of the boxes.
const BYTES_PER_FACE: u64 = (size_of::<[u32; 3]>() + size_of::<Node>()) as u64;

/// The tree of a mesh. Lines and points are in it as faces without area.
#[derive(Debug)]
pub struct NearestFaces<'m> {
    positions: &'m [[f32; 3]],
    /// Corners of all faces, those of a leaf one after the other.
    faces: Vec<[u32; 3]>,
    /// A box, then all boxes in its first half, then all in its second.
    nodes: Vec<Node>,
}

/// A box.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [f32; 3],
    max: [f32; 3],
    /// Of a leaf its first face, otherwise the box of the second half.
    next: u32,
    /// The number of faces; 0 for a box that has halves.
    face_count: u32,
}

/// A nearest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Its distance.
    pub distance: f64,
    /// Its face, by the tree's own numbers.
    pub face: u32,
}

impl<'m> NearestFaces<'m> {
    /// Builds the tree.
    pub fn new(mesh: &'m Mesh, budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let others = mesh.lines_and_points.iter().map(|one| [one.ends[0], one.ends[1], one.ends[1]]);
        let count = mesh.triangles.len() + mesh.lines_and_points.len();
        budget.spend("distances between surfaces", count as u64, BYTES_PER_FACE)?;
        let mut faces = Vec::with_capacity(count);
        faces.extend(mesh.triangles.iter().copied());
        faces.extend(others);
        let mut tree = Self { positions: &mesh.positions, faces, nodes: Vec::new() };
        tree.build();
        Ok(tree)
    }

    fn build(&mut self) {
        if self.faces.is_empty() {
            return;
        }
        let mut waiting = vec![(0..self.faces.len(), None)];
        while let Some((range, parent)) = waiting.pop() {
            let index = self.nodes.len() as u32;
            if let Some(parent) = parent {
                let parent: &mut Node = &mut self.nodes[parent as usize];
                parent.next = index;
            }
            let positions = self.positions;
            let faces = &mut self.faces[range.clone()];
            let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for k in 0..3 {
                for corner in faces.iter().flatten().map(|&vertex| positions[vertex as usize][k]) {
                    min[k] = min[k].min(corner);
                    max[k] = max[k].max(corner);
                }
            }
            if faces.len() <= LEAF_FACES {
                self.nodes.push(Node { min, max, next: range.start as u32, face_count: faces.len() as u32 });
                continue;
            }
            self.nodes.push(Node { min, max, next: 0, face_count: 0 });
            let sides: [f32; 3] = std::array::from_fn(|k| max[k] - min[k]);
            let axis = (0..3).fold(0, |longest, k| if sides[k] > sides[longest] { k } else { longest });
            let middle = |face: &[u32; 3]| face.iter().map(|&v| positions[v as usize][axis]).sum::<f32>();
            let half = faces.len() / 2;
            faces.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            // The first half is next in the list.
            waiting.push((range.start + half..range.end, Some(index)));
            waiting.push((range.start..range.start + half, None));
        }
    }

    /// The nearest point of the mesh. `hint` is a face that is probably near. None for a mesh without faces,
    /// and for a point whose distance an f64 cannot hold.
    pub fn nearest(&self, point: [f64; 3], hint: Option<u32>) -> Option<Hit> {
        let mut best = (f64::INFINITY, u32::MAX);
        if let Some(face) = hint {
            best = (self.squared_to(face, point), face);
        }
        let mut waiting = [(0_u32, 0.0_f64); WAITING_MAX];
        let mut count = usize::from(!self.nodes.is_empty());
        while count > 0 {
            count -= 1;
            let (index, squared) = waiting[count];
            if squared >= best.0 {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.face_count > 0 {
                for face in node.next..node.next + node.face_count {
                    let squared = self.squared_to(face, point);
                    if squared < best.0 {
                        best = (squared, face);
                    }
                }
                continue;
            }
            let halves = [index + 1, node.next].map(|half| (half, self.nodes[half as usize].squared_to(point)));
            let [near, far] = if halves[0].1 <= halves[1].1 { halves } else { [halves[1], halves[0]] };
            for half in [far, near] {
                // Never full: each level of the tree leaves one box behind.
                if half.1 < best.0 && count < WAITING_MAX {
                    waiting[count] = half;
                    count += 1;
                }
            }
        }
        (best.0 < f64::INFINITY).then(|| Hit { distance: best.0.sqrt(), face: best.1 })
    }

    /// The length of the way from a point along a unit vector to the first face, beyond `least`. None where it meets none.
    pub fn first_hit(&self, from: [f64; 3], along: [f64; 3], least: f64) -> Option<f64> {
        let mut best = f64::INFINITY;
        let mut waiting = [0_u32; WAITING_MAX];
        let mut count = usize::from(!self.nodes.is_empty());
        while count > 0 {
            count -= 1;
            let index = waiting[count];
            let node = &self.nodes[index as usize];
            if !node.is_met(from, along, best) {
                continue;
            }
            if node.face_count > 0 {
                for face in node.next..node.next + node.face_count {
                    let corners = self.faces[face as usize].map(|v| self.positions[v as usize].map(f64::from));
                    if let Some(length) = way_to_triangle(from, along, corners)
                        && length > least
                        && length < best
                    {
                        best = length;
                    }
                }
            } else if count + 2 <= WAITING_MAX {
                waiting[count] = node.next;
                waiting[count + 1] = index + 1;
                count += 2;
            }
        }
        (best < f64::INFINITY).then_some(best)
    }

    /// The distance of a point to one face.
    pub fn distance_to(&self, face: u32, point: [f64; 3]) -> f64 {
        self.squared_to(face, point).sqrt()
    }

    fn squared_to(&self, face: u32, point: [f64; 3]) -> f64 {
        let corners = self.faces[face as usize].map(|vertex| self.positions[vertex as usize].map(f64::from));
        squared_to_triangle(point, corners)
    }
}

impl Node {
    /// The squared distance of a point to the box; 0 inside.
    fn squared_to(&self, point: [f64; 3]) -> f64 {
        let along = |k: usize| (f64::from(self.min[k]) - point[k]).max(point[k] - f64::from(self.max[k])).max(0.0);
        let outside = [along(0), along(1), along(2)];
        dot(outside, outside)
    }
}

impl Node {
    /// True if a way, no longer than `most`, meets the box, or comes very near to it.
    fn is_met(&self, from: [f64; 3], along: [f64; 3], most: f64) -> bool {
        const SLACK: f64 = 1e-9;
        let (mut enters, mut leaves) = (0.0_f64, most);
        for k in 0..3 {
            let (low, high) = (f64::from(self.min[k]) - SLACK - from[k], f64::from(self.max[k]) + SLACK - from[k]);
            if along[k] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return false;
                }
                continue;
            }
            let ends = [low / along[k], high / along[k]];
            enters = enters.max(ends[0].min(ends[1]));
            leaves = leaves.min(ends[0].max(ends[1]));
        }
        enters <= leaves
    }
}

/// The length of the way along a unit vector to a triangle, seen from either side (Möller and Trumbore 1997). What passes
/// an edge by less than rounding meets it.
fn way_to_triangle(from: [f64; 3], along: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Option<f64> {
    const SLACK: f64 = 1e-12;
    let (ab, ac, way) = (sub(b, a), sub(c, a), sub(from, a));
    let across = cross(along, ac);
    let determinant = dot(ab, across);
    let u = dot(way, across) / determinant;
    let turned = cross(way, ab);
    let v = dot(along, turned) / determinant;
    let length = dot(ac, turned) / determinant;
    (determinant != 0.0 && u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK && length.is_finite()).then_some(length)
}

/// The squared distance of a point to a triangle, which may have no area.
fn squared_to_triangle(point: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let normal = cross(sub(b, a), sub(c, a));
    let squared = dot(normal, normal);
    let is_inside = |from: [f64; 3], to: [f64; 3]| dot(cross(sub(to, from), sub(point, from)), normal) >= 0.0;
    if squared > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        let height = dot(sub(point, a), normal);
        return height * height / squared;
    }
    squared_to_segment(point, a, b).min(squared_to_segment(point, b, c)).min(squared_to_segment(point, c, a))
}

fn squared_to_segment(point: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let (along, from) = (sub(b, a), sub(point, a));
    let length = dot(along, along);
    let share = if length > 0.0 { (dot(from, along) / length).clamp(0.0, 1.0) } else { 0.0 };
    let off: [f64; 3] = std::array::from_fn(|k| from[k] - share * along[k]);
    dot(off, off)
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshsnap_render::limits::Limits;
    use meshsnap_render::mesh::LineOrPoint;

    /// Numbers from -0.5 to 0.5.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
    }

    /// The distance by a search that shares no formula: the triangle is divided around its nearest quarter.
    fn by_quarters(point: [f64; 3], mut corners: [[f64; 3]; 3]) -> f64 {
        let middle = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|k| (a[k] + b[k]) / 2.0) };
        let length = |v: [f64; 3]| dot(v, v).sqrt();
        let mut best = f64::INFINITY;
        let mut all = vec![corners];
        for _ in 0..22 {
            let mut next = Vec::new();
            for [a, b, c] in all.drain(..) {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            let to_first = |t: &[[f64; 3]; 3]| length(sub(point, t[0]));
            next.sort_by(|x, y| to_first(x).total_cmp(&to_first(y)));
            next.truncate(24);
            corners = next[0];
            best = best.min(corners.iter().map(|corner| length(sub(point, *corner))).fold(f64::INFINITY, f64::min));
            all = next;
        }
        best
    }

    fn mesh(faces: usize, state: &mut u64) -> Mesh {
        let positions = (0..3 * faces).map(|_| std::array::from_fn(|_| random(state) as f32)).collect();
        let triangles = (0..faces as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
        Mesh { positions, triangles, ..Mesh::default() }
    }

    #[test]
    fn a_triangle_is_as_far_as_a_search_finds_it() {
        let mut state = 1;
        for _ in 0..300 {
            let mut point = || [(); 3].map(|()| random(&mut state));
            let (at, corners) = (point(), [point(), point(), point()]);
            let (found, expected) = (squared_to_triangle(at, corners).sqrt(), by_quarters(at, corners));
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }

    #[test]
    fn the_tree_finds_what_a_brute_force_finds() {
        let mut state = 2;
        for faces in [1, 2, 4, 5, 9, 100, 1000] {
            let mut mesh = mesh(faces, &mut state);
            // Without area: a point, a line, a face on a line.
            mesh.lines_and_points = vec![LineOrPoint::point(0, 0), LineOrPoint { ends: [1, 2], material: 0 }];
            mesh.triangles.push([0, 0, 1]);
            let tree = NearestFaces::new(&mesh, &mut Budget::new(&Limits::default())).unwrap();
            for i in 0..200 {
                let point = [(); 3].map(|()| 2.0 * random(&mut state));
                let all = (0..tree.faces.len() as u32).map(|face| tree.distance_to(face, point));
                let expected = all.fold(f64::INFINITY, f64::min);
                let hint = (i % 2 == 0).then_some(0);
                let hit = tree.nearest(point, hint).unwrap();
                assert_eq!(hit.distance, expected);
                assert_eq!(tree.distance_to(hit.face, point), expected);
            }
        }
    }

    #[test]
    fn nothing_is_near_an_empty_mesh_or_from_infinity() {
        let mut budget = Budget::new(&Limits::default());
        let empty = Mesh::default();
        assert_eq!(NearestFaces::new(&empty, &mut budget).unwrap().nearest([0.0; 3], None), None);
        let one = mesh(1, &mut 3);
        let tree = NearestFaces::new(&one, &mut budget).unwrap();
        assert_eq!(tree.nearest([1e300, 0.0, 0.0], None), None);
        assert!(tree.nearest([1e150, 0.0, 0.0], Some(0)).is_some());
    }

    #[test]
    fn equal_faces_in_great_number_are_divided_too() {
        let mut mesh = mesh(1, &mut 4);
        mesh.triangles = vec![[0, 1, 2]; 10_000];
        let tree = NearestFaces::new(&mesh, &mut Budget::new(&Limits::default())).unwrap();
        assert!(tree.nodes.len() < 10_000);
        assert!(tree.nearest([2.0; 3], None).is_some());
    }
}
