//! Closed parts of a mesh that are inside out, for the rule `no-inverted-volume`: their faces look inwards, so their
//! signed volume is negative. Such a part within the bounding box of a solid (one of the 64 largest) is taken for a
//! cavity of that solid, and is no fault.

use super::places::{self, Faults};
use meshsnap_render::limits::{Budget, LimitExceeded};
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::EdgeList;
use meshsnap_render::mesh::union_find::UnionFind;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Memory per vertex: its set, its number of a part.
const BYTES_PER_VERTEX: u64 = 4 + 4;

/// Memory per triangle, if each were a part of its own.
const BYTES_PER_TRIANGLE: u64 = size_of::<Part>() as u64;

/// Most solids around that are looked at for a cavity: the largest ones.
const SOLIDS_MAX: usize = 64;

/// A connected part.
struct Part {
    first_face: u32,
    is_closed: bool,
    /// Six times its volume, about its own first vertex.
    volume: f64,
    min: [f32; 3],
    max: [f32; 3],
}

/// The closed parts whose fronts look inwards, and how many parts are closed. A part of negative volume
/// within the box of a solid is that solid's cavity, and no fault.
pub fn inverted(
    mesh: &Mesh,
    edges: &EdgeList,
    places_max: usize,
    budget: &mut Budget,
) -> Result<(Faults, u64), LimitExceeded> {
    budget.spend("the volumes of parts", mesh.positions.len() as u64, BYTES_PER_VERTEX)?;
    budget.spend("the volumes of parts", mesh.triangles.len() as u64, BYTES_PER_TRIANGLE)?;
    let parts = parts(mesh, edges);
    let closed = parts.iter().filter(|part| part.is_closed);
    let mut solids: Vec<&Part> = closed.clone().filter(|part| part.volume > 0.0).collect();
    solids.sort_by(|a, b| b.volume.total_cmp(&a.volume).then(a.first_face.cmp(&b.first_face)));
    solids.truncate(SOLIDS_MAX);
    let is_cavity = |part: &Part| {
        let is_around = |solid: &&Part| (0..3).all(|k| solid.min[k] < part.min[k] && part.max[k] < solid.max[k]);
        solids.iter().any(is_around)
    };
    let faults = closed.clone().filter(|part| part.volume < 0.0 && !is_cavity(part));
    Ok((Faults::at(faults, places_max, |part| places::face(mesh, part.first_face)), closed.count() as u64))
}

/// The parts, in the order of their first faces.
fn parts(mesh: &Mesh, edges: &EdgeList) -> Vec<Part> {
    const NONE: u32 = u32::MAX;
    let mut sets = UnionFind::new(mesh.positions.len());
    for t in &mesh.triangles {
        sets.unite(t[0], t[1]);
        sets.unite(t[0], t[2]);
    }
    let mut numbers = vec![NONE; mesh.positions.len()];
    let mut parts: Vec<Part> = Vec::new();
    for (face, t) in (0_u32..).zip(&mesh.triangles) {
        let set = sets.find(t[0]);
        let number = &mut numbers[set as usize];
        if *number == NONE {
            *number = parts.len() as u32;
            let (min, max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            parts.push(Part { first_face: face, is_closed: true, volume: 0.0, min, max });
        }
        let part = &mut parts[*number as usize];
        let corners = t.map(|v| mesh.positions[v as usize]);
        for (corner, k) in corners.iter().flat_map(|corner| (0..3).map(move |k| (corner, k))) {
            part.min[k] = part.min[k].min(corner[k]);
            part.max[k] = part.max[k].max(corner[k]);
        }
        // `set` is a vertex of the part: about it, a small part far from the origin loses no digits.
        let origin = mesh.positions[set as usize].map(f64::from);
        let [a, b, c] = corners.map(|corner| sub(corner.map(f64::from), origin));
        part.volume += dot(a, cross(b, c));
    }
    for edge in edges.iter().filter(|edge| edge.face_count != 2 || edge.has_inconsistent_winding) {
        let number = numbers[sets.find(edge.vertices[0]) as usize];
        if let Some(part) = parts.get_mut(number as usize) {
            part.is_closed = false;
        }
    }
    parts
}
