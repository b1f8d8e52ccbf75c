//! Transforms of nodes, as a matrix or as translation, rotation and scale.

use crate::import::affine::Affine;
use crate::import::gltf::document::schema::Node;

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
    /// The identity.
    pub const IDENTITY: Self = Self { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] };

    /// From the parts of a node without a matrix.
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

/// The transform of a node: its matrix, or else its translation, rotation and scale.
pub fn of_node(node: &Node) -> Affine {
    node.matrix.map_or_else(|| Trs::of(node).into(), Affine::from_columns)
}

/// The rotation matrix of a quaternion; the identity if it has no length.
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
