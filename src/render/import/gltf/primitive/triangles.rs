//! The triangles, line segments and points of a glTF primitive, made by its mode from its vertex
//! indices, or from its vertices in order if it has none: lists, strips and fans of triangles;
//! lists, strips and loops of lines; points.

use crate::import::MeshError;
use crate::import::context::Context;
use crate::import::gltf::document::schema::mode;
use crate::mesh::primitives::{POINT_TRIANGLES, SEGMENT_TRIANGLES};
use crate::parallel::map;
use crate::pluralise::pluralise;
use bytemuck::allocation::try_cast_vec as cast_vec;

/// Indices that a thread looks at at a time.
const INDICES_PER_PIECE: usize = 65_536;

/// The number of triangles from a number of corners. Corners of an incomplete triangle are ignored.
pub fn count(mode: usize, corners: u64) -> u64 {
    match mode {
        mode::TRIANGLES => corners / 3,
        mode::TRIANGLE_STRIP | mode::TRIANGLE_FAN => corners.saturating_sub(2),
        _ => 0,
    }
}

/// The numbers of line segments and of points from a number of corners.
pub fn count_lines_and_points(mode: usize, corners: u64) -> [u64; 2] {
    match mode {
        mode::POINTS => [0, corners],
        mode::LINES => [corners / 2, 0],
        mode::LINE_LOOP if corners > 1 => [corners, 0],
        mode::LINE_STRIP => [corners.saturating_sub(1), 0],
        _ => [0; 2],
    }
}

/// The ends of line segments and points. Without indices all vertices are taken in turn. A point
/// has its vertex at both ends.
pub fn lines_and_points(
    mode: usize,
    indices: Option<&[u32]>,
    vertices: usize,
    cx: &mut Context<'_>,
) -> Result<Vec<[u32; 2]>, MeshError> {
    let corners = indices.map_or(vertices, <[u32]>::len);
    let [segments, points] = count_lines_and_points(mode, corners as u64);
    cx.check_triangles(SEGMENT_TRIANGLES * segments + POINT_TRIANGLES * points)?;
    cx.budget.spend("glTF lines and points", segments + points, 8)?;
    let at = |i: usize| indices.map_or(i as u32, |list| list[i]);
    Ok((0..(segments + points) as usize)
        .map(|i| match mode {
            mode::POINTS => [at(i); 2],
            mode::LINES => [at(2 * i), at(2 * i + 1)],
            _ => [at(i), at((i + 1) % corners)],
        })
        // A segment between a vertex and itself is invisible.
        .filter(|ends| mode == mode::POINTS || ends[0] != ends[1])
        .collect())
}

/// Refuses indices beyond the vertices of primitive `what`.
pub fn check_indices(what: &str, indices: &[u32], vertices: usize) -> Result<(), MeshError> {
    // The maximum of a list is found faster than the first index that is too large.
    let is_bad = |i: u32| i as usize >= vertices;
    let largest =
        map(indices.chunks(INDICES_PER_PIECE).collect(), |piece: &[u32]| piece.iter().copied().fold(0, u32::max));
    match largest.into_iter().max().filter(|largest| is_bad(*largest)) {
        None => Ok(()),
        Some(largest) => {
            let bad = indices.iter().copied().find(|i| is_bad(*i)).unwrap_or(largest);
            let has = pluralise(vertices, "vertex", "vertices");
            Err(MeshError::broken(format!("{what} of the glTF file has the vertex index {bad}, and {has}")))
        }
    }
}

/// The triangles of a primitive, which has this many `vertices`. Its indices are checked.
pub fn of(
    mode: usize,
    indices: Option<Vec<u32>>,
    vertices: usize,
    cx: &mut Context<'_>,
) -> Result<Vec<[u32; 3]>, MeshError> {
    let corners = indices.as_ref().map_or(vertices, Vec::len);
    let count = count(mode, corners as u64);
    cx.check_triangles(count)?;
    cx.budget.spend("glTF triangles", count, 12)?;
    let indices = match indices {
        // The list is one of triangles already.
        Some(list) if mode == mode::TRIANGLES => match cast_vec(list) {
            Ok(triangles) => return Ok(triangles),
            Err((_, list)) => Some(list),
        },
        other => other,
    };
    let at = |i: usize| indices.as_ref().map_or(i as u32, |list| list[i]);
    Ok((0..count as usize)
        .map(|i| match mode {
            mode::TRIANGLE_STRIP => [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)],
            mode::TRIANGLE_FAN => [at(i + 1), at(i + 2), at(0)],
            _ => [at(3 * i), at(3 * i + 1), at(3 * i + 2)],
        })
        .collect())
}
