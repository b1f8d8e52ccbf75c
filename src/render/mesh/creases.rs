//! Vertex normals with creases, for smooth shading of meshes whose files have no normals. A crease is an
//! edge whose faces' normals differ by more than a given angle. At a vertex on a crease, faces that are
//! connected through other edges share a normal, so that shading is smooth on either side of the crease
//! and breaks at it.

use rayon::prelude::*;

use super::normals::{angle_weighted, corner_angles, unit};
use super::union_find::UnionFind;
use super::vector::dot;
use crate::limits::{Budget, Deadline, Exhausted};

/// Vertex normals, and which of them each triangle's corners have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CreasedNormals {
    /// Unit normals: one per position, then the further ones of positions on creases.
    pub normals: Vec<[f32; 3]>,
    /// Three indices into `normals` per triangle; None if these are the triangles' positions, because no
    /// position has more than one normal.
    pub triangles: Option<Vec<[u32; 3]>>,
}

/// The angles between the normals of two faces beyond which the edge between them is a crease.
#[derive(Clone, Copy, Debug)]
pub struct CreaseAngles<'a> {
    /// [`sharp_cos`] of each material's angle.
    pub cos_by_material: &'a [f64],
    /// The material of each triangle; empty if all have the first.
    pub triangle_materials: &'a [u32],
}

/// The cosine below which two faces' normals differ by more than an angle in degrees. An excess of a tenth
/// of a degree does not count: files round their coordinates, and the edges of a cylinder with twelve
/// sides, all of 30 degrees, should be sharp all or none. From 180 on no edge is sharp.
pub fn sharp_cos(angle_deg: f64) -> f64 {
    const SLACK_DEG: f64 = 0.1;
    // The product of two rounded unit vectors may be a little less than -1.
    if angle_deg >= 180.0 { NEVER_SHARP } else { libm::cos((angle_deg + SLACK_DEG).min(180.0).to_radians()) }
}

/// Less than the product of any two unit vectors.
const NEVER_SHARP: f64 = -2.0;

/// Memory per position on creases' looks, bytes: a mark, a place and the end of a list.
const BYTES_PER_POSITION: u64 = 1 + 4 + 4;

/// Memory per corner at a position that may lie on a crease, bytes: its number, and at worst a normal of its
/// own.
const BYTES_PER_CORNER: u64 = 4 + 12;

/// Further memory per corner that is worked on, bytes: edges, sets and an order at a position; then at worst
/// a side of its own, in lists that double as they grow.
const WORKING_BYTES_PER_CORNER: u64 = 16 + 4 + 8 + 2 * (4 + size_of::<CreaseSide>() as u64);

/// Positions that a thread takes at a time.
const PIECE: usize = 1 << 10;

/// Pieces between two checks of the deadline.
const PIECES_AT_ONCE: usize = 256;

/// Slack in the test for positions that may lie on a crease: a sum of a few rounded products.
const SLACK: f64 = 1e-5;

/// An edge with more faces compares each with the next alone.
const COMPARED_ALL_MAX: usize = 8;

/// Vertex normals as [`angle_weighted`] finds them, separately for faces that creases separate.
///
/// An edge is a crease if the angle between its faces' normals is greater than the smaller of their
/// materials' angles. A neighbour that is turned over counts as turned by half a circle. Where an edge has
/// more than two faces, each two of them are compared, or, with more than 8, each with the next in the order
/// of their numbers. At a position on a crease, faces that are connected through edges without one share a
/// normal; at any other position all faces do.
pub fn creased(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    face_normals: &[[f32; 3]],
    angles: CreaseAngles<'_>,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<CreasedNormals, Exhausted> {
    let normals = angle_weighted(positions, triangles, face_normals);
    let mut result = CreasedNormals { normals, triangles: None };
    if angles.smallest_cos() <= NEVER_SHARP {
        return Ok(result);
    }
    deadline.check()?;
    budget.spend("creases", positions.len() as u64, BYTES_PER_POSITION)?;
    let suspects = suspects(&result.normals, triangles, face_normals, angles);
    deadline.check()?;
    let corners = CornerLists::of(&suspects, triangles, budget)?;
    deadline.check()?;
    let faces = Faces { positions, triangles, face_normals, angles };
    let count = corners.count();
    // In pieces, whose results are joined in their order.
    for first in (0..count).step_by(PIECE * PIECES_AT_ONCE) {
        deadline.check()?;
        let pieces = count.min(first + PIECE * PIECES_AT_ONCE).saturating_sub(first).div_ceil(PIECE);
        let found: Vec<Sides> = (0..pieces)
            .into_par_iter()
            .map(|piece| {
                let first = first + piece * PIECE;
                faces.sides((first..count.min(first + PIECE)).map(|i| corners.of_suspect(i)))
            })
            .collect();
        result.add(&found, triangles, budget)?;
    }
    Ok(result)
}

/// The faces of a mesh.
struct Faces<'a> {
    positions: &'a [[f32; 3]],
    triangles: &'a [[u32; 3]],
    face_normals: &'a [[f32; 3]],
    angles: CreaseAngles<'a>,
}

/// The sides of creases at some positions.
#[derive(Default)]
struct Sides {
    /// Corners, `3 * triangle + corner`, side by side.
    corners: Vec<u32>,
    sides: Vec<CreaseSide>,
}

/// The corners at a position on one side of its creases.
struct CreaseSide {
    /// The end of its corners in [`Sides::corners`]; they begin where those of the side before end.
    end: u32,
    normal: [f32; 3],
    /// True for the side of the position's first corner: its normal takes the place of the common one.
    is_first: bool,
}

impl CreaseAngles<'_> {
    fn smallest_cos(&self) -> f64 {
        self.cos_by_material.iter().copied().fold(NEVER_SHARP, f64::max)
    }

    /// The cosine of a triangle's angle: that of the first material where it has none of its own.
    fn cos_of(&self, triangle: usize) -> f64 {
        let material = self.triangle_materials.get(triangle).map_or(0, |&material| material as usize);
        self.cos_by_material.get(material).or(self.cos_by_material.first()).copied().unwrap_or(NEVER_SHARP)
    }
}

impl CreasedNormals {
    fn add(&mut self, found: &[Sides], triangles: &[[u32; 3]], budget: &mut Budget) -> Result<(), Exhausted> {
        let further = found.iter().flat_map(|sides| &sides.sides).filter(|side| !side.is_first).count();
        if further > 0 && self.triangles.is_none() {
            budget.spend("creases", triangles.len() as u64, 12)?;
            self.triangles = Some(triangles.to_vec());
        }
        self.normals.reserve_exact(further);
        for sides in found {
            let mut start = 0;
            for side in &sides.sides {
                self.add_side(side, &sides.corners[start..side.end as usize], triangles);
                start = side.end as usize;
            }
        }
        Ok(())
    }

    fn add_side(&mut self, side: &CreaseSide, corners: &[u32], triangles: &[[u32; 3]]) {
        let place_of = |corner: u32| (corner as usize / 3, corner as usize % 3);
        let Some((triangle, k)) = corners.first().map(|&corner| place_of(corner)) else { return };
        if side.is_first {
            self.normals[triangles[triangle][k] as usize] = side.normal;
            return;
        }
        let index = self.normals.len() as u32;
        self.normals.push(side.normal);
        let Some(own) = &mut self.triangles else { return };
        for &corner in corners {
            let (triangle, k) = place_of(corner);
            own[triangle][k] = index;
        }
    }
}

/// Positions that may lie on a crease: a face's normal there is farther from the common one than half of
/// the smallest crease angle. Any two faces closer than that are within the angle of each other.
fn suspects(
    normals: &[[f32; 3]],
    triangles: &[[u32; 3]],
    face_normals: &[[f32; 3]],
    angles: CreaseAngles<'_>,
) -> Vec<bool> {
    let mut is_suspect = vec![false; normals.len()];
    // cos(a / 2), from cos(a).
    let limit = (0.5 * (1.0 + angles.smallest_cos())).max(0.0).sqrt() + SLACK;
    for (triangle, normal) in triangles.iter().zip(face_normals) {
        let normal = normal.map(f64::from);
        for &v in triangle {
            is_suspect[v as usize] |= dot(normal, normals[v as usize].map(f64::from)) < limit;
        }
    }
    is_suspect
}

/// The corners at each suspect.
struct CornerLists {
    /// Ends of the lists, with a 0 before the first.
    ends: Vec<u32>,
    corners: Vec<u32>,
}

impl CornerLists {
    fn of(is_suspect: &[bool], triangles: &[[u32; 3]], budget: &mut Budget) -> Result<Self, Exhausted> {
        const NONE: u32 = u32::MAX;
        let mut count = 0;
        let number = |&is_suspect: &bool| {
            count += u32::from(is_suspect);
            if is_suspect { count - 1 } else { NONE }
        };
        let place: Vec<u32> = is_suspect.iter().map(number).collect();
        let at = |v: u32| Some(place[v as usize]).filter(|&i| i != NONE).map(|i| i as usize);
        let mut ends = vec![0; count as usize + 2];
        for i in triangles.as_flattened().iter().filter_map(|&v| at(v)) {
            ends[i + 2] += 1;
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let total = ends.last().copied().unwrap_or_default();
        budget.spend("creases", u64::from(total), BYTES_PER_CORNER)?;
        let batches = (0..count as usize).step_by(PIECE * PIECES_AT_ONCE);
        let of_batch = |first: usize| ends[(first + PIECE * PIECES_AT_ONCE).min(count as usize) + 1] - ends[first + 1];
        let most = batches.map(of_batch).max().unwrap_or_default();
        budget.spend("creases", u64::from(most), WORKING_BYTES_PER_CORNER)?;
        let mut corners = vec![0; total as usize];
        for (corner, &v) in triangles.as_flattened().iter().enumerate() {
            if let Some(i) = at(v) {
                let end = &mut ends[i + 1];
                corners[*end as usize] = corner as u32;
                *end += 1;
            }
        }
        Ok(Self { ends, corners })
    }

    /// Number of suspects.
    fn count(&self) -> usize {
        self.ends.len() - 2
    }

    fn of_suspect(&self, i: usize) -> &[u32] {
        &self.corners[self.ends[i] as usize..self.ends[i + 1] as usize]
    }
}

impl Faces<'_> {
    /// The sides of the creases at positions, given the corners at each.
    fn sides<'c>(&self, positions: impl Iterator<Item = &'c [u32]>) -> Sides {
        let mut found = Sides::default();
        for corners in positions {
            self.split(corners, &mut found);
        }
        found
    }

    /// Adds the sides of a position's creases; none if it lies on none.
    fn split(&self, corners: &[u32], found: &mut Sides) {
        // The far end of each edge at the position, and the place in `corners` of a face that has it.
        let mut edges: Vec<(u32, u32)> = Vec::with_capacity(2 * corners.len());
        for (i, &corner) in corners.iter().enumerate() {
            let (triangle, k) = (self.triangles[corner as usize / 3], corner as usize % 3);
            edges.extend([1, 2].map(|step| (triangle[(k + step) % 3], i as u32)));
        }
        edges.sort_unstable();
        let mut sides = UnionFind::new(corners.len());
        let mut has_crease = false;
        for faces in edges.chunk_by(|a, b| a.0 == b.0) {
            let reach = if faces.len() <= COMPARED_ALL_MAX { faces.len() } else { 2 };
            for (i, &(_, a)) in faces.iter().enumerate() {
                for &(_, b) in &faces[i + 1..faces.len().min(i + reach)] {
                    match self.is_crease(corners[a as usize], corners[b as usize]) {
                        true => has_crease = true,
                        false => _ = sides.unite(a, b),
                    }
                }
            }
        }
        if has_crease {
            self.add_sides(corners, &mut sides, found);
        }
    }

    fn is_crease(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a as usize / 3, b as usize / 3];
        let cos = dot(self.face_normals[a].map(f64::from), self.face_normals[b].map(f64::from));
        cos < self.angles.cos_of(a).max(self.angles.cos_of(b))
    }

    fn add_sides(&self, corners: &[u32], sides: &mut UnionFind, found: &mut Sides) {
        // By side, in the order of their first corners.
        let mut ordered: Vec<(u32, u32)> =
            corners.iter().enumerate().map(|(i, &corner)| (sides.find(i as u32), corner)).collect();
        ordered.sort_unstable();
        for (i, side) in ordered.chunk_by(|a, b| a.0 == b.0).enumerate() {
            let start = found.corners.len();
            found.corners.extend(side.iter().map(|&(_, corner)| corner));
            let normal = self.normal(&found.corners[start..]);
            found.sides.push(CreaseSide { end: found.corners.len() as u32, normal, is_first: i == 0 });
        }
    }

    /// The mean of the corners' face normals, weighted by their angles; the first one if they cancel, or
    /// if all are the same.
    fn normal(&self, corners: &[u32]) -> [f32; 3] {
        let first = corners.first().map_or([0.0; 3], |&corner| self.face_normals[corner as usize / 3]);
        if corners.iter().all(|&corner| self.face_normals[corner as usize / 3] == first) {
            return first;
        }
        let mut sum = [0.0_f64; 3];
        for &corner in corners {
            let (face, k) = (corner as usize / 3, corner as usize % 3);
            let angles = corner_angles(self.triangles[face].map(|v| self.positions[v as usize].map(f64::from)));
            for (sum, n) in sum.iter_mut().zip(self.face_normals[face]) {
                *sum += f64::from(n) * angles[k];
            }
        }
        unit(sum).unwrap_or(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::mesh::vector::{cross, sub};

    struct Shape {
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        face_normals: Vec<[f32; 3]>,
    }

    impl Shape {
        fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Self {
            let face_normal = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|v| positions[v as usize].map(f64::from));
                unit(cross(sub(b, a), sub(c, a))).unwrap()
            };
            let face_normals = triangles.iter().map(face_normal).collect();
            Self { positions, triangles, face_normals }
        }

        fn creased(&self, angle_deg: f64) -> CreasedNormals {
            self.creased_by([angle_deg; 2])
        }

        /// Creases of one angle for faces of even numbers, and of another for the others.
        fn creased_by(&self, angles_deg: [f64; 2]) -> CreasedNormals {
            self.try_creased(angles_deg, &mut Budget::new(&Limits::default()), &Deadline::default()).unwrap()
        }

        fn try_creased(
            &self,
            angles_deg: [f64; 2],
            budget: &mut Budget,
            deadline: &Deadline,
        ) -> Result<CreasedNormals, Exhausted> {
            let triangle_materials: Vec<u32> = (0..self.triangles.len() as u32).map(|i| i % 2).collect();
            let cos_by_material = &angles_deg.map(sharp_cos);
            let angles = CreaseAngles { cos_by_material, triangle_materials: &triangle_materials };
            creased(&self.positions, &self.triangles, &self.face_normals, angles, budget, deadline)
        }

        /// A normal per corner.
        fn by_corner(&self, angles_deg: [f64; 2]) -> Vec<[[f32; 3]; 3]> {
            let found = self.creased_by(angles_deg);
            let triangles = found.triangles.as_ref().unwrap_or(&self.triangles);
            triangles.iter().map(|t| t.map(|v| found.normals[v as usize])).collect()
        }

        /// The same by the definition alone: of each corner, the faces that can be reached around its
        /// position.
        fn by_definition(&self, angles_deg: [f64; 2]) -> Vec<[[f32; 3]; 3]> {
            let cos = |f: usize, g: usize| match angles_deg[f % 2].min(angles_deg[g % 2]) {
                180.0 => -9.0,
                angle => libm::cos((angle + 0.1).to_radians()),
            };
            let at = |v: u32| (0..self.triangles.len()).filter(move |&f| self.triangles[f].contains(&v));
            // Pairs of faces at an edge of v that are compared, and whether they meet in a crease.
            let pairs = |v: u32| {
                let ends: std::collections::BTreeSet<u32> =
                    at(v).flat_map(|f| self.triangles[f]).filter(|&u| u != v).collect();
                let faces = |u: u32| at(v).filter(|&f| self.triangles[f].contains(&u)).collect::<Vec<_>>();
                let pairs = ends.into_iter().flat_map(|u| {
                    let faces = faces(u);
                    let reach = if faces.len() > 8 { 1 } else { 8 };
                    let to = |i: usize| faces.len().min(i + reach + 1);
                    let of = |i: usize| (i + 1..to(i)).map(move |j| [i, j]);
                    (0..faces.len()).flat_map(of).map(|[i, j]| [faces[i], faces[j]]).collect::<Vec<_>>()
                });
                let normal = |f: usize| self.face_normals[f].map(f64::from);
                pairs.map(|[f, g]| ([f, g], dot(normal(f), normal(g)) < cos(f, g))).collect::<Vec<_>>()
            };
            let common = angle_weighted(&self.positions, &self.triangles, &self.face_normals);
            let corner = |f: usize, v: u32| {
                let pairs = pairs(v);
                if pairs.iter().all(|(_, is_crease)| !is_crease) {
                    return common[v as usize];
                }
                let mut side = vec![f];
                while let Some(more) = at(v).find(|g| {
                    let joins = |h: &usize| pairs.contains(&([*g, *h], false)) || pairs.contains(&([*h, *g], false));
                    !side.contains(g) && side.iter().any(joins)
                }) {
                    side.push(more);
                }
                side.sort_unstable();
                let mut sum = [0.0_f64; 3];
                for &g in &side {
                    let t = self.triangles[g];
                    let k = t.iter().position(|&u| u == v).unwrap();
                    let angle = corner_angles(t.map(|v| self.positions[v as usize].map(f64::from)))[k];
                    (0..3).for_each(|i| sum[i] += f64::from(self.face_normals[g][i]) * angle);
                }
                let is_flat = side.iter().all(|&g| self.face_normals[g] == self.face_normals[side[0]]);
                unit(sum).filter(|_| !is_flat).unwrap_or(self.face_normals[side[0]])
            };
            (0..self.triangles.len()).map(|f| self.triangles[f].map(|v| corner(f, v))).collect()
        }
    }

    fn cube() -> Shape {
        let positions = (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { -0.5 } else { 0.5 })).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Shape::new(positions, quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect())
    }

    /// Two squares that meet at an angle.
    fn bent(angle_deg: f64) -> Shape {
        let (sin, cos) = libm::sincos(angle_deg.to_radians());
        let (x, z) = (cos as f32, sin as f32);
        let positions =
            [[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [x, 0.0, z], [-1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [x, 1.0, z]];
        Shape::new(positions.to_vec(), vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    }

    #[test]
    fn the_faces_of_a_cube_are_flat_to_the_bit() {
        let cube = cube();
        for (corners, normal) in cube.by_corner([30.0; 2]).iter().zip(&cube.face_normals) {
            assert_eq!(corners, &[*normal; 3]);
        }
        assert_eq!(cube.creased(30.0).normals.len(), 24);
    }

    #[test]
    fn an_edge_is_a_crease_beyond_the_angle() {
        assert_eq!(bent(30.09).creased(30.0).triangles, None);
        let sharp = bent(30.11).creased(30.0);
        assert_eq!((sharp.normals.len(), sharp.triangles.map(|t| t[0])), (8, Some([0, 1, 4])));
    }

    #[test]
    fn without_creases_normals_are_the_common_ones() {
        let cube = cube();
        let common = angle_weighted(&cube.positions, &cube.triangles, &cube.face_normals);
        assert_eq!(cube.creased(180.0), CreasedNormals { normals: common, triangles: None });
    }

    #[test]
    fn fins_at_one_edge_are_compared_with_each_other() {
        let fins = |count: u32| {
            let at = |i: u32| [1.0, 0.0, 0.01 * (i * 7 % count) as f32];
            let positions = [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]].into_iter().chain((0..count).map(at));
            let triangles = [[0, 1, 2]].into_iter().chain((3..3 + count).map(|i| [1, 0, i]));
            Shape::new(positions.collect(), triangles.collect())
        };
        let mut split = Vec::new();
        for count in [2, 3, 7, 8, 9, 30] {
            let fins = fins(count);
            assert_eq!(fins.creased(90.0).triangles, None);
            for angle_deg in [0.1, 1.0, 4.0] {
                assert_eq!(fins.by_corner([angle_deg; 2]), fins.by_definition([angle_deg; 2]), "{count} {angle_deg}");
            }
            split.push(fins.creased(1.0).normals.len() - fins.positions.len());
        }
        // Neighbours at .6 degrees: one side, until only those that follow each other are compared.
        assert_eq!(split[..3], [0; 3]);
        assert!(split[3..].iter().all(|&sides| sides > 0), "{split:?}");
    }

    /// A ring of squares, with coordinates of so many decimals.
    fn prism(sides: u32, decimals: i32) -> Shape {
        let round = |v: f64| ((v * 10_f64.powi(decimals)).round() / 10_f64.powi(decimals)) as f32;
        let at = |i: u32| {
            let (sin, cos) = libm::sincos(f64::from(i / 2) / f64::from(sides) * std::f64::consts::TAU);
            [round(cos), round(sin), (i % 2) as f32]
        };
        let n = 2 * sides;
        let squares = (0..sides).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]);
        Shape::new((0..n).map(at).collect(), squares.map(|t| t.map(|v| v % n)).collect())
    }

    #[test]
    fn regular_prisms_are_sharp_all_over_or_nowhere() {
        let mut checked = 0;
        for (sides, angle_deg) in [(12, 30.0), (24, 15.0), (8, 45.0), (6, 60.0), (36, 10.0)] {
            for decimals in [4, 6, 15] {
                let prism = prism(sides, decimals);
                assert_eq!(prism.creased(angle_deg).triangles, None, "{sides} {decimals}");
                let normals = prism.creased(angle_deg - 0.3).normals.len();
                assert_eq!(normals, 2 * prism.positions.len(), "{sides} {decimals}");
                checked += 1;
            }
        }
        assert_eq!(checked, 15);
    }

    #[test]
    fn no_edge_is_a_crease_at_180_degrees() {
        // Two squares in one plane, one of them turned over. The product of their normals is below -1.
        let [u, v] = [[3.0, 0.0, -1.0], [2.0, -1.0, 0.0]];
        let at = |a: f32, b: f32| [0, 1, 2].map(|k| a * u[k] + b * v[k]);
        let positions = vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
        let surface = Shape::new(positions, vec![[0, 1, 2], [1, 2, 3]]);
        let product = dot(surface.face_normals[0].map(f64::from), surface.face_normals[1].map(f64::from));
        assert!(product < -0.999_999, "{product}");
        assert_eq!(surface.creased(180.0).triangles, None);
        assert!(surface.creased(179.0).triangles.is_some());
        assert_eq!(surface.by_corner([180.0, 179.0]), surface.by_definition([180.0, 179.0]));
    }

    #[test]
    fn memory_is_paid_for_and_time_is_asked_for() {
        let cube = cube();
        let mut budget = Budget::new(&Limits::default());
        cube.try_creased([30.0; 2], &mut budget, &Deadline::default()).unwrap();
        let needed = budget.spent_bytes();
        assert!(needed >= 36 * 16 + 12 * 12, "{needed}");
        for memory_bytes in 0..needed {
            let mut budget = Budget::new(&Limits { memory_bytes, ..Limits::default() });
            let error = cube.try_creased([30.0; 2], &mut budget, &Deadline::default()).unwrap_err();
            assert!(matches!(error, Exhausted::Limit(_)), "{error}");
        }
        let mut stopped = 0;
        while let Err(error) =
            cube.try_creased([30.0; 2], &mut Budget::new(&Limits::default()), &Deadline::after_polls(stopped + 1))
        {
            assert!(matches!(error, Exhausted::Stopped(_)), "{error}");
            stopped += 1;
        }
        assert!(stopped >= 4, "{stopped}");
    }

    #[test]
    fn positions_that_are_not_looked_at_have_no_crease() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut split = 0;
        for roughness in [0.02, 0.1, 0.2, 0.3, 0.5, 2.0] {
            const N: u32 = 12;
            let positions: Vec<[f32; 3]> =
                (0..N * N).map(|i| [(i % N) as f32, (i / N) as f32, roughness * random()]).collect();
            let mut triangles: Vec<[u32; 3]> = (0..N * N)
                .filter(|i| i % N + 1 < N && i / N + 1 < N)
                .flat_map(|i| [[i, i + 1, i + N + 1], [i, i + N + 1, i + N]])
                .collect();
            // Some holes, and some faces turned over.
            triangles.retain(|_| random() > 0.05);
            triangles.iter_mut().filter(|_| random() > 0.95).for_each(|t| t.swap(0, 1));
            let shape = Shape::new(positions, triangles);
            for angles_deg in
                [[5.0; 2], [20.0; 2], [30.0; 2], [90.0; 2], [180.0; 2], [5.0, 20.0], [60.0, 10.0], [0.0, 180.0]]
            {
                assert_eq!(shape.by_corner(angles_deg), shape.by_definition(angles_deg), "{roughness} {angles_deg:?}");
                split += shape.creased_by(angles_deg).normals.len() - shape.positions.len();
            }
        }
        assert!(split > 1000, "{split}");
    }
}
