//! Places of faults: the vertex, the edge or the face where a rule is broken, with positions in the coordinates of
//! the file (in memory, a mesh is scaled into a box of side 1). All faults are counted, and the first of them are
//! kept with their places. Positions are rounded, because those of a mesh are f32 and have about seven digits.

use super::Place;
use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::edges::MeshEdge;

/// Faults: how many there are, and where the first are.
#[derive(Debug, Default)]
pub struct Faults {
    /// All of them.
    pub count: u64,
    /// The first.
    pub places: Vec<Place>,
}

impl Faults {
    /// The faults at these places. All are counted, and only the first so many are made.
    pub fn at<T>(all: impl Iterator<Item = T>, places_max: usize, place: impl Fn(T) -> Place) -> Self {
        let mut faults = Self::default();
        for one in all {
            faults.count += 1;
            if faults.places.len() < places_max {
                faults.places.push(place(one));
            }
        }
        faults
    }

    /// Faults that have no place, such as faces that reading drops.
    pub fn without_places(count: u64) -> Self {
        Self { count, places: Vec::new() }
    }

    /// These faults and others, with so many places at most.
    pub fn and(mut self, others: Self, places_max: usize) -> Self {
        self.count += others.count;
        self.places.extend(others.places);
        self.places.truncate(places_max);
        self
    }
}

/// The place of a vertex.
pub fn vertex(mesh: &Mesh, vertex: u32) -> Place {
    Place::Vertex(position(mesh, vertex))
}

/// The place of an edge.
pub fn edge(mesh: &Mesh, edge: &MeshEdge) -> Place {
    Place::Edge(edge.vertices.map(|vertex| position(mesh, vertex)))
}

/// The place of a face.
pub fn face(mesh: &Mesh, face: u32) -> Place {
    Place::Face(mesh.triangles[face as usize].map(|vertex| position(mesh, vertex)))
}

/// The place of a face with these corners in the file's space.
pub fn corners(mesh: &Mesh, corners: [[f64; 3]; 3]) -> Place {
    Place::Face(corners.map(|corner| corner.map(|value| tidy(value, mesh.to_file.scale))))
}

/// The position of a vertex, rounded to the digits that f32 has.
fn position(mesh: &Mesh, vertex: u32) -> [f64; 3] {
    let to_file = &mesh.to_file;
    let at = mesh.positions[vertex as usize];
    std::array::from_fn(|axis| {
        let value = to_file.centre[axis] + to_file.scale * f64::from(at[axis]);
        tidy(value.clamp(f64::MIN, f64::MAX), to_file.scale)
    })
}

/// Rounds to the seventh digit of a mesh of this size: what lies below is the noise of f32.
fn tidy(value: f64, scale: f64) -> f64 {
    let digits = 7.0 - libm::ceil(libm::log10(scale));
    if !(0.0..=15.0).contains(&digits) {
        return value;
    }
    let rounded: f64 = format!("{value:.*}", digits as usize).parse().unwrap_or(value);
    // No minus before a zero.
    if rounded == 0.0 { 0.0 } else { rounded }
}
