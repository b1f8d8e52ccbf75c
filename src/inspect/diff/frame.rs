//! Positions of two meshes in one space. Each mesh is stored in a unit box of its own, so before
//! two are compared, the positions of one are brought into the unit box of the other. Also the
//! distance below which two positions count as the same.

use meshsnap_render::mesh::{Mesh, ToFile};

/// The largest number whose square, and sums of such squares, an f64 holds.
const COORDINATE_MAX: f64 = 1e150;

/// A shift and a factor that lead from the unit box of one mesh to that of another.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    factor: f64,
    offset: [f64; 3],
}

impl Frame {
    /// The way between two unit boxes.
    pub fn between(from: &ToFile, to: &ToFile) -> Self {
        let held = |value: f64| value.clamp(-COORDINATE_MAX, COORDINATE_MAX);
        let offset = std::array::from_fn(|k| held((from.centre[k] - to.centre[k]) / to.scale));
        Self { factor: held(from.scale / to.scale), offset }
    }

    /// A position of the one in the other's unit box.
    pub fn map(&self, position: [f32; 3]) -> [f64; 3] {
        std::array::from_fn(|k| self.offset[k] + self.factor * f64::from(position[k]))
    }
}

/// A position in a mesh's unit box as the file has it.
pub fn in_file(to_file: &ToFile, position: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| (to_file.centre[k] + to_file.scale * position[k]).clamp(f64::MIN, f64::MAX))
}

/// The length of the diagonal of the larger bounding box, file units.
pub fn diagonal(meshes: [&Mesh; 2]) -> f64 {
    let of_one = |mesh: &Mesh| {
        let [min, max] = mesh.bounds.map(|corner| corner.map(f64::from));
        let sides: [f64; 3] = std::array::from_fn(|k| max[k] - min[k]);
        sides.iter().map(|side| side * side).sum::<f64>().sqrt() * mesh.to_file.scale
    };
    of_one(meshes[0]).max(of_one(meshes[1])).min(f64::MAX)
}

/// The distance below which two positions count as one: a millionth of the diagonal, as exporters write six
/// digits, or what a coordinate in f32 leaves open, if that is more. File units.
pub fn rounding(meshes: [&Mesh; 2]) -> f64 {
    let largest = |mesh: &Mesh| {
        let corners = mesh.bounds.map(|corner| in_file(&mesh.to_file, corner.map(f64::from)));
        corners.as_flattened().iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))
    };
    let of_f32 = largest(meshes[0]).max(largest(meshes[1])) * f64::from(f32::EPSILON);
    (1e-6 * diagonal(meshes)).max(of_f32)
}
