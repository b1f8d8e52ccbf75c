//! The reader of the glTF extension FB_ngon_encoding, in which the order of triangles tells which
//! consecutive ones form a polygon. The edges between triangles of one polygon are marked as
//! diagonals, so that a drawing of the edges leaves them out.
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/FB_ngon_encoding>

use crate::import::polygon::ALL_EDGES;

/// Edge masks of triangles whose consecutive fans are polygons, and the polygons counted by their
/// number of corners.
///
/// A polygon's triangles share their first vertex. A triangle that shares it without going on where
/// the last one ended begins a polygon of its own, since no diagonal lies between them.
pub fn edge_masks(triangles: &[[u32; 3]]) -> (Vec<u8>, [u64; 13]) {
    let mut masks = vec![ALL_EDGES; triangles.len()];
    let mut by_arity = [0; 13];
    let mut corners = 0;
    for (i, &[first, second, _]) in triangles.iter().enumerate() {
        let continues = i > 0 && triangles[i - 1][0] == first && triangles[i - 1][2] == second;
        if continues {
            masks[i - 1] &= !LAST_EDGE;
            masks[i] &= !FIRST_EDGE;
            corners += 1;
        } else {
            count(&mut by_arity, corners);
            corners = 3;
        }
    }
    count(&mut by_arity, corners);
    (masks, by_arity)
}

/// The edge from corner 0 to 1, shared with the triangle before.
const FIRST_EDGE: u8 = 0b001;
/// The edge from corner 2 to 0.
const LAST_EDGE: u8 = 0b100;

fn count(by_arity: &mut [u64; 13], corners: usize) {
    if corners > 0 {
        by_arity[corners.min(12)] += 1;
    }
}

/// The mask of a triangle after its second and third corner are swapped.
pub fn mirrored(mask: u8) -> u8 {
    (mask & 0b010) | (mask & FIRST_EDGE) << 2 | (mask & LAST_EDGE) >> 2
}
