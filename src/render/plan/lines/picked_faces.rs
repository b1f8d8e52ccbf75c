//! The faces from which `auto_width` computes the width of lines: all faces of a mesh with up to 4096, and of a
//! larger mesh a sample of up to about 6000 faces, which saves time. Large faces are picked more often, and each
//! picked face has a weight that says how many it stands for.
//!
//! A hash of a face's corners decides whether it is picked, so the order of faces in the file hardly matters.

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::parallel;

/// Faces that are picked of a larger mesh in proportion to their area, on average.
const BY_AREA: usize = 1 << 12;

/// Faces that are picked of it besides, whatever their area: some of each small part that a view may show alone.
const BY_NUMBER: usize = 1 << 11;

/// Faces that a thread takes at a time.
const CHUNK: usize = 1 << 14;

/// Areas are counted in such parts of the square of the longest side of the mesh's box: sums of whole numbers do not
/// depend on an order. A face is smaller than that square, so that 64 bits hold the sum of a chunk.
const AREA_UNITS: f64 = (1_u64 << 40) as f64;

/// Steps of places along half the longest side of the mesh's box. They are much larger than what scaling a mesh changes
/// by rounding.
const PLACES: f32 = 2048.0;

/// A face that is looked at, and how many such faces it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PickedFace {
    /// The face.
    pub face: u32,
    /// At least 1.
    pub weight: f32,
}

/// The faces of a mesh that are looked at, in order: all, or on average so many as [`BY_AREA`] and [`BY_NUMBER`] say.
///
/// A hash of the places of its corners, in steps, decides whether a face is picked. Order of corners and faces, scale, mirroring
/// and turns by right angles change nothing, but for the few places that rounding moves past a step. Faces that are mirror
/// images of each other, or lie within one step, are picked together.
pub fn picked_faces(mesh: &Mesh, budget: &mut Budget) -> Result<Vec<PickedFace>, LimitExceeded> {
    let count = mesh.triangles.len();
    if count <= BY_AREA {
        budget.spend("the width of lines", count as u64, 2 * size_of::<PickedFace>() as u64)?;
        return Ok((0..count as u32).map(|face| PickedFace { face, weight: 1.0 }).collect());
    }
    budget.spend("the width of lines", count.div_ceil(WORD) as u64, size_of::<u64>() as u64)?;
    let dice = Dice::new(mesh);
    // A bit per face. An unlucky mesh has equal hashes: so those that are picked are counted before they are listed.
    let mut words = vec![0_u64; count.div_ceil(WORD)];
    let chunks = words.chunks_mut(CHUNK / WORD).enumerate().collect();
    let counts = parallel::map(chunks, |(number, words): (usize, &mut [u64])| {
        let faces = number * CHUNK..count.min((number + 1) * CHUNK);
        let mut found = 0_usize;
        for face in faces.clone().filter(|&face| dice.picks(mesh, face)) {
            let bit = face - faces.start;
            words[bit / WORD] |= 1 << (bit % WORD);
            found += 1;
        }
        found
    });
    budget.spend("the width of lines", counts.iter().sum::<usize>() as u64, size_of::<PickedFace>() as u64)?;
    let mut picked = Vec::with_capacity(counts.iter().sum());
    for (first, word) in (0..).step_by(WORD).zip(words) {
        let mut left = word;
        while left != 0 {
            let face = first + left.trailing_zeros() as usize;
            left &= left - 1;
            picked.push(PickedFace { face: face as u32, weight: dice.weight(mesh, face) });
        }
    }
    Ok(picked)
}

/// Bits of a word.
const WORD: usize = u64::BITS as usize;

/// The dice that decide which faces are picked.
struct Dice {
    /// The middle of the mesh's box, and steps of places per unit.
    middle: [f32; 3],
    steps: f32,
    /// The area of all faces over [`BY_AREA`], and their number over [`BY_NUMBER`].
    area_each: f64,
    number_each: f64,
}

impl Dice {
    fn new(mesh: &Mesh) -> Self {
        let [low, high] = mesh.bounds;
        let half = (0..3).map(|k| 0.5 * (high[k] - low[k])).fold(f32::MIN_POSITIVE, f32::max);
        let unit = AREA_UNITS / (4.0 * f64::from(half) * f64::from(half));
        let count = mesh.triangles.len();
        let sum = |first: usize| {
            let faces = first..count.min(first + CHUNK);
            faces.map(|face| (unit * area(mesh, face)) as u64).sum::<u64>()
        };
        let sums = parallel::map((0..count).step_by(CHUNK).collect(), sum);
        let all: u128 = sums.into_iter().map(u128::from).sum();
        let middle = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        let area_each = all as f64 / unit / BY_AREA as f64;
        Self { middle, steps: PLACES / half, area_each, number_each: count as f64 / BY_NUMBER as f64 }
    }

    /// The probability with which a face is picked; 1 or more: always.
    fn probability(&self, mesh: &Mesh, face: usize) -> f64 {
        let by_area = if self.area_each > 0.0 { area(mesh, face) / self.area_each } else { 0.0 };
        by_area + 1.0 / self.number_each
    }

    fn picks(&self, mesh: &Mesh, face: usize) -> bool {
        f64::from(self.throw(mesh, face)) < self.probability(mesh, face) * f64::from(u32::MAX)
    }

    /// The number of faces that a picked one stands for.
    fn weight(&self, mesh: &Mesh, face: usize) -> f32 {
        (1.0 / self.probability(mesh, face)).max(1.0) as f32
    }

    /// A number from the places of a face's corners, the same for any order of them and of their coordinates, and for
    /// mirrored ones.
    fn throw(&self, mesh: &Mesh, face: usize) -> u32 {
        let mut sum = 0_u32;
        for corner in mesh.triangles[face] {
            // Not 0, or faces at the middle of the box would always be picked.
            let mut of_corner = 0x68e3_1da4_u32;
            for (v, middle) in mesh.positions[corner as usize].iter().zip(self.middle) {
                let step = ((v - middle).abs() * self.steps + 0.5) as i32 as u32;
                of_corner =
                    of_corner.wrapping_add(step.wrapping_mul(step).wrapping_add(step.wrapping_mul(0x9e37_79b9)));
            }
            sum = sum.wrapping_add((of_corner ^ of_corner >> 15).wrapping_mul(0x2c1b_3c6d));
        }
        let mixed = (sum ^ sum >> 12).wrapping_mul(0x297a_2d39);
        mixed ^ mixed >> 15
    }
}

fn area(mesh: &Mesh, face: usize) -> f64 {
    let [a, b, c] = mesh.triangles[face].map(|corner| mesh.positions[corner as usize].map(f64::from));
    let [u, v]: [[f64; 3]; 2] = [b, c].map(|p| std::array::from_fn(|k| p[k] - a[k]));
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    0.5 * (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;

    /// A sheet of 2 n^2 triangles that grow from one corner on, with its vertices moved by `place`.
    fn sheet(n: usize, place: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
        let along = |i: usize| 2.0 * (i as f32 / n as f32).powf(2.5) - 1.0;
        let vertices = (0..(n + 1) * (n + 1)).map(|i| [along(i % (n + 1)), along(i / (n + 1)), 0.0]);
        let positions: Vec<[f32; 3]> = vertices.map(place).collect();
        let squares = (0..n * n).map(|i| (i / n * (n + 1) + i % n) as u32);
        let next = n as u32 + 1;
        let triangles = squares.flat_map(|a| [[a, a + 1, a + next], [a + 1, a + next + 1, a + next]]).collect();
        let bound =
            |choose: fn(f32, f32) -> f32| [0, 1, 2].map(|k| positions.iter().map(|p| p[k]).reduce(choose).unwrap());
        Mesh { bounds: [bound(f32::min), bound(f32::max)], triangles, positions, ..Mesh::default() }
    }

    fn picked(mesh: &Mesh) -> Vec<PickedFace> {
        picked_faces(mesh, &mut Budget::new(&Limits::default())).unwrap()
    }

    #[test]
    fn picked_faces_stand_for_all() {
        let small = sheet(45, |p| p);
        assert!(picked(&small).into_iter().eq((0..4050).map(|face| PickedFace { face, weight: 1.0 })));
        for n in [46, 100, 400] {
            let mesh = sheet(n, |p| p);
            let picked = picked(&mesh);
            assert!((500..=BY_AREA + BY_NUMBER + 300).contains(&picked.len()), "{n}: {} faces", picked.len());
            // The area of faces, less what is closer than a distance to their sides: the sum for which they are picked.
            let free = |face: usize, distance: f64| {
                let [a, b, c] = mesh.triangles[face].map(|v| mesh.positions[v as usize].map(f64::from));
                let length = |p: [f64; 3], q: [f64; 3]| (p[0] - q[0]).hypot(p[1] - q[1]);
                let radius = 2.0 * area(&mesh, face) / (length(a, b) + length(b, c) + length(c, a));
                area(&mesh, face) * (1.0 - distance / radius).max(0.0).powi(2)
            };
            let of_all = |distance| (0..mesh.triangles.len()).map(|face| free(face, distance)).sum::<f64>();
            let of_picked = |distance| {
                let free = |one: &PickedFace| f64::from(one.weight) * free(one.face as usize, distance);
                picked.iter().map(free).sum::<f64>()
            };
            // A sum of some 4096 faces, which symmetry picks in pairs.
            assert!((of_picked(0.0) / of_all(0.0) - 1.0).abs() < 0.05, "{n}: {} of {}", of_picked(0.0), of_all(0.0));
            for distance in [1e-4, 1e-3] {
                let [want, got] = [of_all(distance) / of_all(0.0), of_picked(distance) / of_picked(0.0)];
                assert!((got - want).abs() < 0.01, "{n}, {distance}: {got} for {want}");
            }
        }
    }

    #[test]
    fn neither_scale_nor_axes_nor_order_change_what_is_picked() {
        let of = |mesh: &Mesh| picked(mesh).iter().map(|one| one.face).collect::<Vec<_>>();
        let mesh = sheet(150, |p| p);
        let want = of(&mesh);
        assert!(of(&sheet(150, |[x, y, z]| [x, -z, y])) == want, "turned");
        assert!(of(&sheet(150, |[x, y, z]| [-y, z, x])) == want, "turned twice");
        assert!(of(&sheet(150, |p| p.map(|v| v * 0.25))) == want, "a quarter");
        let mut others = 0;
        for factor in [0.3, 0.7, 0.9] {
            let got = of(&sheet(150, |p| p.map(|v| v * factor)));
            others += got.iter().filter(|face| !want.contains(face)).count();
        }
        assert!(others < want.len() / 50, "{others} of {}", 3 * want.len());
        let last = mesh.triangles.len() as u32 - 1;
        let mut reversed =
            Mesh { triangles: mesh.triangles.iter().rev().map(|&[a, b, c]| [b, a, c]).collect(), ..mesh };
        let mut got: Vec<u32> = of(&reversed).iter().map(|face| last - face).collect();
        got.reverse();
        assert!(got == want, "reversed");
        // Without any area they are picked by their number; all alike, all or none.
        reversed.positions.iter_mut().for_each(|p| *p = [0.0; 3]);
        assert!(of(&reversed).is_empty());
    }

    /// A dense part in the middle of a box, as small as a step, is not picked whole.
    #[test]
    fn the_middle_is_a_place_like_others() {
        let tiny = |p: [f32; 3]| p.map(|v| v * 1e-5);
        let mut mesh = sheet(150, tiny);
        let corners = mesh.positions.len() as u32;
        mesh.positions.extend([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]);
        mesh.triangles.push([corners, corners + 1, corners + 2]);
        mesh.bounds = [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]];
        let picked = picked(&mesh);
        assert!(picked.len() < 45_000, "{}", picked.len());
        assert!(picked.iter().any(|one| one.face == 45_000 && one.weight == 1.0), "the large face");
    }
}
