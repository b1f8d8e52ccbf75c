//! The thickness of a solid's walls: the distance from the middle of a face, straight inwards, to
//! the surface opposite. At most 50,000 faces are measured; of larger meshes, every n-th face.

use super::nearest::NearestFaces;
use meshsnap_render::limits::{Budget, Deadline, Exhausted, Stopped};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::vector::{cross, dot, sub};
use meshsnap_render::parallel::map;

/// Most faces that are measured: at equal distances in the order of the file.
const FACES_MAX: usize = 50_000;

/// Faces handed to a thread at a time.
const PIECE: usize = 256;

/// Hits that are nearer belong to the face itself or to its neighbours. In the unit box.
const NEAR: f64 = 1e-6;

/// The thickness below the middle of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thickness {
    /// The face.
    pub face: u32,
    /// The middle of the face, in the unit box.
    pub at: [f64; 3],
    /// The length of the way, in the unit box; none where it meets nothing.
    pub length: Option<f64>,
}

/// The thickness below faces that have an area.
pub fn thicknesses(mesh: &Mesh, budget: &Budget, deadline: &Deadline) -> Result<Vec<Thickness>, Exhausted> {
    let mut budget = budget.clone();
    let tree = NearestFaces::new(mesh, &mut budget)?;
    let step = mesh.triangles.len().div_ceil(FACES_MAX).max(1);
    let faces: Vec<u32> = (0..mesh.triangles.len() as u32).step_by(step).collect();
    budget.spend("the thickness of walls", faces.len() as u64, size_of::<Thickness>() as u64 + 4)?;
    deadline.check()?;
    let pieces = map(faces.chunks(PIECE).collect(), |faces: &[u32]| {
        deadline.check()?;
        Ok(faces.iter().filter_map(|&face| below(mesh, &tree, face)).collect::<Vec<_>>())
    });
    Ok(pieces.into_iter().collect::<Result<Vec<_>, Stopped>>()?.concat())
}

fn below(mesh: &Mesh, tree: &NearestFaces<'_>, face: u32) -> Option<Thickness> {
    let [a, b, c] = mesh.triangles[face as usize].map(|vertex| mesh.positions[vertex as usize].map(f64::from));
    let normal = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    if length == 0.0 {
        return None;
    }
    let at = std::array::from_fn(|k| (a[k] + b[k] + c[k]) / 3.0);
    let inwards = normal.map(|value| -value / length);
    Some(Thickness { face, at, length: tree.first_hit(at, inwards, NEAR) })
}
