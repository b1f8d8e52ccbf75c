//! Faces that two meshes have in common, faces that only one of them has, and faces that look to
//! the other side (their corners run the other way round). Two faces are the same if they have the
//! same three corners, in any order. Corners are compared by numbers from `vertices`, which are
//! equal for vertices at the same place.

use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;

/// Memory of a face: its key in a list, and its marks.
const BYTES_PER_FACE: u64 = (size_of::<Key>() + 2 * size_of::<[u32; 2]>()) as u64;

/// The faces of two meshes, compared by the numbers of their corners.
#[derive(Debug, Default)]
pub struct Faces {
    /// Faces with the same three corners: one of `a`, and one of `b`.
    pub common: Vec<[u32; 2]>,
    /// Those of them that look to the other side: faces of `b`.
    pub turned: Vec<u32>,
    /// Faces that only `a` has.
    pub removed: Vec<u32>,
    /// Faces that only `b` has.
    pub added: Vec<u32>,
}

/// Sorted corners, whether the face runs through them backwards, and the face.
type Key = ([u32; 3], bool, u32);

impl Faces {
    /// Compares the faces; `numbers` are the vertices of `b` in the numbers of `a`.
    pub fn of(a: &Mesh, b: &Mesh, numbers: &[u32], budget: &mut Budget) -> Result<Self, LimitExceeded> {
        let count = a.triangles.len() + b.triangles.len();
        budget.spend("faces to compare", count as u64, BYTES_PER_FACE)?;
        let of_a = keys(a.triangles.iter().copied());
        let of_b = keys(b.triangles.iter().map(|t| t.map(|vertex| numbers[vertex as usize])));
        let (mut a, mut b) = (of_a.as_slice(), of_b.as_slice());
        let mut faces = Self::default();
        while let Some(corners) = [a.first(), b.first()].into_iter().flatten().map(|key| key.0).min() {
            let group_a = split_group(&mut a, corners);
            let group_b = split_group(&mut b, corners);
            faces.add(group_a, group_b);
        }
        for list in [&mut faces.turned, &mut faces.removed, &mut faces.added] {
            list.sort_unstable();
        }
        Ok(faces)
    }

    /// Adds the faces with the same corners: pairs that look to one side first.
    fn add(&mut self, a: &[Key], b: &[Key]) {
        let side = |keys: &[Key], is_backwards: bool| -> Vec<u32> {
            keys.iter().filter(|key| key.1 == is_backwards).map(|key| key.2).collect()
        };
        let mut rest: [Vec<u32>; 2] = Default::default();
        for is_backwards in [false, true] {
            let (of_a, of_b) = (side(a, is_backwards), side(b, is_backwards));
            let pairs = of_a.len().min(of_b.len());
            self.common.extend((0..pairs).map(|i| [of_a[i], of_b[i]]));
            rest[0].extend(&of_a[pairs..]);
            rest[1].extend(&of_b[pairs..]);
        }
        let [of_a, of_b] = rest;
        let pairs = of_a.len().min(of_b.len());
        self.common.extend((0..pairs).map(|i| [of_a[i], of_b[i]]));
        self.turned.extend(&of_b[..pairs]);
        self.removed.extend(&of_a[pairs..]);
        self.added.extend(&of_b[pairs..]);
    }

    /// True if no face is removed or added.
    pub fn are_all_common(&self) -> bool {
        self.removed.is_empty() && self.added.is_empty()
    }
}

fn keys(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<Key> {
    let key = |(corners, face): ([u32; 3], u32)| {
        let mut sorted = corners;
        sorted.sort_unstable();
        // An even permutation is one of the three rotations.
        let is_rotation = |k: usize| (0..3).all(|i| sorted[i] == corners[(i + k) % 3]);
        (sorted, !(0..3).any(is_rotation), face)
    };
    let mut keys: Vec<Key> = triangles.zip(0..).map(key).collect();
    keys.sort_unstable();
    keys
}

/// Takes the keys with these corners from the front.
fn split_group<'k>(keys: &mut &'k [Key], corners: [u32; 3]) -> &'k [Key] {
    let count = keys.iter().take_while(|key| key.0 == corners).count();
    let (group, rest) = keys.split_at(count);
    *keys = rest;
    group
}
