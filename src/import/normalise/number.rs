//! Welded positions, numbered in the order of their first use by faces, and then by lines and
//! points.

use super::faces::Faces;
use super::geometry::Geometry;
use super::weld::{Welded, weld};
use crate::import::parallel::map;
use crate::limits::{Deadline, Stopped};

/// Triangles handed to a thread at a time.
const TRIANGLES_PER_PIECE: usize = 16_384;
/// Faces between two deadline checks.
const FACES_PER_POLL: usize = 65_536;
const UNSEEN: u32 = u32::MAX;

/// Welded positions and what uses them.
#[derive(Debug)]
pub struct Numbered {
    /// The positions.
    pub positions: Vec<[f32; 3]>,
    /// The faces' corners.
    pub triangles: Vec<[u32; 3]>,
    /// The ends of lines and points.
    pub ends: Vec<[u32; 2]>,
}

/// For triangles that share vertices: each vertex is welded once.
pub fn vertices<G: Geometry>(
    geometry: &G,
    faces: &Faces,
    ends: impl ExactSizeIterator<Item = [u32; 2]>,
    position: impl Fn(u32) -> [f32; 3] + Sync,
    deadline: &Deadline,
) -> Result<Numbered, Stopped> {
    let welded = weld(geometry.vertices(), position, deadline)?;
    let mut numbers = vec![UNSEEN; welded.positions.len()];
    let mut positions = Vec::with_capacity(welded.positions.len());
    let mut number = |v: u32| {
        let welded_number = welded.numbers[v as usize] as usize;
        let number = &mut numbers[welded_number];
        if *number == UNSEEN {
            *number = positions.len() as u32;
            positions.push(welded.positions[welded_number]);
        }
        *number
    };
    let mut triangles = Vec::with_capacity(faces.normals.len());
    for face in 0..faces.normals.len() {
        if face % FACES_PER_POLL == 0 {
            deadline.check()?;
        }
        let [a, b, c] = geometry.triangle(faces.triangle(face));
        triangles.push([number(a), number(b), number(c)]);
    }
    let ends = ends.map(|[a, b]| [number(a), number(b)]).collect();
    Ok(Numbered { positions, triangles, ends })
}

/// For triangles that share no vertices: each corner is welded by itself.
pub fn corners<G: Geometry>(
    geometry: &G,
    faces: &Faces,
    position: impl Fn(u32) -> [f32; 3] + Sync,
    deadline: &Deadline,
) -> Result<Numbered, Stopped> {
    let count = faces.normals.len() * 3;
    let Welded { positions, numbers } = if faces.kept.is_none() {
        // Vertices are numbered as corners are.
        weld(count, position, deadline)?
    } else {
        let vertex = |corner: u32| geometry.triangle(faces.triangle(corner as usize / 3))[corner as usize % 3];
        weld(count, |corner| position(vertex(corner)), deadline)?
    };
    let mut triangles = vec![[0_u32; 3]; faces.normals.len()];
    let pieces = triangles.chunks_mut(TRIANGLES_PER_PIECE).zip(numbers.chunks(3 * TRIANGLES_PER_PIECE)).collect();
    map(pieces, |(triangles, numbers): (&mut [[u32; 3]], &[u32])| {
        for (triangle, of_corners) in triangles.iter_mut().zip(numbers.chunks_exact(3)) {
            *triangle = [of_corners[0], of_corners[1], of_corners[2]];
        }
    });
    Ok(Numbered { positions, triangles, ends: Vec::new() })
}
