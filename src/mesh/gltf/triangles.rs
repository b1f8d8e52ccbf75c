//! Lists, strips and fans of triangles.

use super::tree::mode;
use crate::mesh::import::Context;
use crate::mesh::{MeshError, counted};

/// How many triangles so many corners make up. Corners that do not make up a whole triangle are left over.
pub fn count(mode: usize, corners: u64) -> u64 {
    match mode {
        mode::TRIANGLES => corners / 3,
        mode::TRIANGLE_STRIP | mode::TRIANGLE_FAN => corners.saturating_sub(2),
        _ => 0,
    }
}

/// The triangles of `what`, whose vertices are as many as `vertices` says.
pub fn of(
    what: &str,
    mode: usize,
    indices: Option<&[u32]>,
    vertices: usize,
    cx: &mut Context<'_>,
) -> Result<Vec<[u32; 3]>, MeshError> {
    if let Some(bad) = indices.into_iter().flatten().find(|&&i| i as usize >= vertices) {
        return Err(MeshError::broken(format!(
            "{what} of the glTF file has the vertex index {bad}, and {}",
            counted(vertices, "vertex", "vertices")
        )));
    }
    let corners = indices.map_or(vertices, <[u32]>::len);
    let count = count(mode, corners as u64);
    cx.check_triangles(count)?;
    cx.budget.spend("glTF triangles", count, 12)?;
    let at = |i: usize| indices.map_or(i as u32, |list| list[i]);
    Ok((0..count as usize)
        .map(|i| match mode {
            mode::TRIANGLE_STRIP => [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)],
            mode::TRIANGLE_FAN => [at(i + 1), at(i + 2), at(0)],
            _ => [at(3 * i), at(3 * i + 1), at(3 * i + 2)],
        })
        .collect())
}
