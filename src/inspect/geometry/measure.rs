//! The area and the volume of a mesh, in file units, for reports and for comparisons.

use meshsnap_render::mesh::Mesh;
use meshsnap_render::mesh::vector::{cross, dot, sub};

/// Area and volume; None where an f64 cannot hold the number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// The sum of the faces' areas, square file units.
    pub area: Option<f64>,
    /// Signed volume, cubic file units: positive where faces look outwards. Only watertight meshes
    /// have a volume; for others the number means nothing.
    pub volume: Option<f64>,
}

impl Measures {
    /// Sums over all triangles: half the length of the edges' cross product for the area, and by
    /// the divergence theorem `a . (b x c) / 6` for the volume.
    ///
    /// The sums are taken in the unit box, where nothing overflows, and a mesh far from the file's
    /// origin loses no digits.
    pub fn of(mesh: &Mesh) -> Self {
        let (mut area, mut volume) = (0.0, 0.0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
            let n = cross(sub(b, a), sub(c, a));
            area += dot(n, n).sqrt() / 2.0;
            volume += dot(a, cross(b, c)) / 6.0;
        }
        let scale = mesh.to_file.scale;
        Self { area: product(area, [scale, scale, 1.0]), volume: product(volume, [scale; 3]) }
    }
}

/// `value` times all factors; None where that overflows or loses digits below the smallest normal
/// number.
fn product(value: f64, factors: [f64; 3]) -> Option<f64> {
    let product = factors.into_iter().fold(value, |product, factor| product * factor);
    (product.is_normal() || value == 0.0).then_some(product)
}
