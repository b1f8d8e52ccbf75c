//! The two rules on texture coordinates. By `uv-in-range` they lie within the texture, from 0 to 1. By
//! `uv-no-overlap` no two faces use the same part of the texture. Overlaps are looked for at the points of a grid of
//! 1,024 on a side, which spans all coordinates, as in the debug view `uv-layout`; an overlap that lies between these
//! points is not found.

use super::places::{self, Faults};
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::{Budget, Deadline};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::plan::{UV_GRID_BYTES, overlapping_uvs};

/// Coordinates this far beyond the texture are rounding.
const SLACK: f32 = 1e-5;

/// Memory per face: its corners in the texture, its number, its mark.
const BYTES_PER_FACE: u64 = 48 + 4 + 1;

/// Vertices whose texture coordinates lie outside of the texture.
pub fn outside(mesh: &Mesh, places_max: usize, budget: &mut Budget) -> Result<Faults, MeshError> {
    budget.spend("the texture coordinates", mesh.uvs.len() as u64, 1)?;
    let mut is_met = vec![false; mesh.uvs.len()];
    let corners =
        mesh.attribute_triangles.iter().zip(&mesh.triangles).flat_map(|(a, t)| (0..3).map(move |k| (a[k], t[k])));
    let is_outside = |uv: [f32; 2]| uv.iter().any(|v| !(-SLACK..=1.0 + SLACK).contains(v));
    let outside = corners.filter(|&(attribute, _)| {
        let at = attribute as usize;
        mesh.uvs.get(at).is_some_and(|uv| is_outside(*uv)) && !std::mem::replace(&mut is_met[at], true)
    });
    Ok(Faults::at(outside, places_max, |(_, vertex)| places::vertex(mesh, vertex)))
}

/// Faces that share a place in the texture with others, and whether all were looked at. Overlaps
/// between the points of a grid of 1,024 on a side are not found.
pub fn overlaps(
    mesh: &Mesh,
    places_max: usize,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<(Faults, bool), MeshError> {
    budget.spend("the faces in the texture", mesh.triangles.len() as u64, BYTES_PER_FACE)?;
    budget.spend("the faces in the texture", UV_GRID_BYTES, 1)?;
    let uv = |v: u32| mesh.uvs.get(v as usize).copied().unwrap_or([0.0; 2]).map(f64::from);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for at in mesh.attribute_triangles.iter().flatten().map(|&v| uv(v)) {
        (low, high) = ([low[0].min(at[0]), low[1].min(at[1])], [high[0].max(at[0]), high[1].max(at[1])]);
    }
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    if !(side > 0.0 && side.is_finite()) {
        return Ok((Faults::default(), true));
    }
    let to_box = |at: [f64; 2]| -> [f64; 2] { std::array::from_fn(|k| (at[k] - (low[k] + high[k]) / 2.0) / side) };
    let all: Vec<(u32, [[f64; 2]; 3])> = (0_u32..)
        .zip(&mesh.attribute_triangles)
        .map(|(face, attributes)| (face, attributes.map(|v| to_box(uv(v)))))
        .filter(|(_, corners)| has_area(corners))
        .collect();
    let corners: Vec<[[f64; 2]; 3]> = all.iter().map(|(_, corners)| *corners).collect();
    let found = overlapping_uvs(&corners, deadline)?;
    let faces = all.iter().zip(&found.faces).filter(|(_, is_overlapping)| **is_overlapping);
    Ok((Faults::at(faces, places_max, |((face, _), _)| places::face(mesh, *face)), found.is_complete))
}

fn has_area([a, b, c]: &[[f64; 2]; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) != (b[1] - a[1]) * (c[0] - a[0])
}
