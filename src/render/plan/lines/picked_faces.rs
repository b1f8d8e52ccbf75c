//! The faces by which the width of lines is found: all of a small mesh, and a few of a large one.

use crate::limits::{Budget, LimitExceeded};
use crate::mesh::Mesh;
use crate::parallel;

/// Faces that are looked at, about: of a larger mesh, those that a hash of their corners' places picks.
const LOOKED_AT: usize = 1 << 11;

/// Faces that a thread takes at a time.
const CHUNK: usize = 1 << 14;

/// The faces of a mesh that are looked at, in order. They are about [`LOOKED_AT`] to twice as many, unless
/// an unlucky mesh has equal hashes: so they are counted first, and paid for.
pub fn looked_at(mesh: &Mesh, budget: &mut Budget) -> Result<Vec<u32>, LimitExceeded> {
    let count = mesh.triangles.len();
    // One in so many faces, a power of two.
    let one_in = 1_u64 << (count / LOOKED_AT).max(1).ilog2();
    let picked = |first: usize| {
        let faces = first..count.min(first + CHUNK);
        faces.filter(|&face| hash_of(mesh, face).is_multiple_of(one_in))
    };
    let firsts = || (0..count).step_by(CHUNK);
    let counts = parallel::map(firsts().collect(), |first| picked(first).count());
    budget.spend("the width of lines", counts.iter().sum::<usize>() as u64, 2 * 4)?;
    let collect = |(first, count)| {
        let mut faces = Vec::with_capacity(count);
        faces.extend(picked(first).map(|face| face as u32));
        faces
    };
    Ok(parallel::map(firsts().zip(counts).collect(), collect).concat())
}

/// A number from the places of a face's corners, the same for any order of them.
fn hash_of(mesh: &Mesh, face: usize) -> u64 {
    let mut sum = 0_u64;
    for corner in mesh.triangles[face] {
        let [x, y, z] = mesh.positions[corner as usize].map(|v| u64::from(v.to_bits()));
        sum = sum.wrapping_add((x ^ y << 21 ^ z << 42).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    }
    (sum ^ sum >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93) >> 32
}
