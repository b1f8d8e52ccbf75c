//! Node transforms, in f64.

use crate::import::gltf::document::tree::Node;

/// An affine map: a 3 x 3 matrix by rows, and a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    linear: [[f64; 3]; 3],
    translation: [f64; 3],
}

/// A translation, a rotation (x, y, z, w) and a scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Applied last.
    pub translation: [f64; 3],
    /// A quaternion, which exporters do not always normalise.
    pub rotation: [f64; 4],
    /// Applied first.
    pub scale: [f64; 3],
}

impl Trs {
    /// No change.
    pub const IDENTITY: Self = Self { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };

    /// What a node without a matrix has.
    pub fn of(node: &Node) -> Self {
        Self {
            translation: node.translation.unwrap_or(Self::IDENTITY.translation),
            rotation: node.rotation.unwrap_or(Self::IDENTITY.rotation),
            scale: node.scale.unwrap_or(Self::IDENTITY.scale),
        }
    }
}

impl From<Trs> for Affine {
    fn from(trs: Trs) -> Self {
        let mut linear = rotation(trs.rotation);
        for row in &mut linear {
            for (c, s) in row.iter_mut().zip(trs.scale) {
                *c *= s;
            }
        }
        Self { linear, translation: trs.translation }
    }
}

impl Affine {
    /// No change.
    pub const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// A node's own transform.
    pub fn of(node: &Node) -> Self {
        node.matrix.map_or_else(|| Trs::of(node).into(), Self::of_columns)
    }

    /// Of a 4 x 4 matrix by columns, whose last row is taken to be (0, 0, 0, 1).
    pub fn of_columns(m: [f64; 16]) -> Self {
        Self {
            linear: std::array::from_fn(|row| std::array::from_fn(|column| m[column * 4 + row])),
            translation: [m[12], m[13], m[14]],
        }
    }

    /// First `inner`, then `self`.
    pub fn after(&self, inner: &Self) -> Self {
        let linear = std::array::from_fn(|row| {
            std::array::from_fn(|column| (0..3).map(|k| self.linear[row][k] * inner.linear[k][column]).sum())
        });
        Self { linear, translation: self.point(inner.translation) }
    }

    /// The sum of maps, each with its weight.
    pub fn blend(maps: impl Iterator<Item = (Self, f64)>) -> Self {
        let mut sum = Self { linear: [[0.0; 3]; 3], translation: [0.0; 3] };
        for (map, weight) in maps {
            for (sum, c) in sum.linear.iter_mut().flatten().zip(map.linear.iter().flatten()) {
                *sum += weight * c;
            }
            for (sum, c) in sum.translation.iter_mut().zip(map.translation) {
                *sum += weight * c;
            }
        }
        sum
    }

    /// Where the three axes lead.
    pub fn columns(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|column| std::array::from_fn(|row| self.linear[row][column]))
    }

    /// A transformed point.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        if *self == Self::IDENTITY {
            return p;
        }
        std::array::from_fn(|row| {
            let m = self.linear[row];
            m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + self.translation[row]
        })
    }

    /// The matrix that keeps normals perpendicular to their surfaces: the inverse transpose, but for its length.
    pub fn normal_matrix(&self) -> [[f64; 3]; 3] {
        let m = self.linear;
        let sign = if self.is_mirroring() { -1.0 } else { 1.0 };
        std::array::from_fn(|r| {
            let (a, b) = (m[(r + 1) % 3], m[(r + 2) % 3]);
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]].map(|c| c * sign)
        })
    }

    /// Whether it turns the inside out, so that windings must be turned round.
    pub fn is_mirroring(&self) -> bool {
        let [a, b, c] = self.linear;
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2] < 0.0
    }
}

/// Of a quaternion; a turn by nothing if it has no length.
fn rotation(q: [f64; 4]) -> [[f64; 3]; 3] {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    if length == 0.0 || !length.is_finite() {
        return Affine::IDENTITY.linear;
    }
    let [x, y, z, w] = q.map(|c| c / length);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}
