//! How large a mesh is, in file units, for `inspect`.

use super::Mesh;

/// Area and volume; None where the number is beyond what an f64 can hold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// Sum of the faces' areas, square file units.
    pub area: Option<f64>,
    /// Signed volume, cubic file units: positive where fronts are outside. It means something for watertight meshes alone.
    pub volume: Option<f64>,
}

impl Measures {
    /// Sums over all triangles, in f64, in the unit box: nothing overflows or cancels there, wherever in the file the mesh lies.
    pub fn of(mesh: &Mesh) -> Self {
        let (mut area, mut volume) = (0.0, 0.0);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
            let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
            let n = cross(sub(b, a), sub(c, a));
            area += dot(n, n).sqrt() / 2.0;
            volume += dot(a, cross(b, c)) / 6.0;
        }
        let scale = mesh.to_file.scale;
        Self { area: held(area, [scale, scale, 1.0]), volume: held(volume, [scale; 3]) }
    }
}

/// A product, unless it overflows or vanishes.
fn held(value: f64, factors: [f64; 3]) -> Option<f64> {
    let product = factors.into_iter().fold(value, |product, factor| product * factor);
    (product.is_normal() || value == 0.0).then_some(product)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
