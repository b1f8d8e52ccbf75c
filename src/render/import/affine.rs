//! Affine maps in f64 (a 3 x 3 matrix and a translation), by which a scene places its meshes and
//! cameras. They are for the formats that have scenes: glTF, FBX and 3MF.

use crate::mesh::vector::{cross, dot};

/// A 3 x 3 matrix by rows, and a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Rows of the matrix.
    pub linear: [[f64; 3]; 3],
    /// Added after the matrix.
    pub translation: [f64; 3],
}

impl Affine {
    /// The identity.
    pub const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// From a 4 x 4 matrix by columns, whose last row is taken to be (0, 0, 0, 1).
    pub fn from_columns(m: [f64; 16]) -> Self {
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

    /// The weighted sum of some maps.
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

    /// Columns of the matrix: the images of the three axes.
    pub fn columns(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|column| std::array::from_fn(|row| self.linear[row][column]))
    }

    /// A transformed point. The identity returns it unchanged, infinities included.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        if *self == Self::IDENTITY {
            return p;
        }
        std::array::from_fn(|row| {
            let m = self.linear[row];
            m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + self.translation[row]
        })
    }

    /// True if it mirrors: windings must then be reversed.
    pub fn is_mirroring(&self) -> bool {
        let [a, b, c] = self.linear;
        dot(a, cross(b, c)) < 0.0
    }

    /// The inverse transpose up to a positive factor: the matrix for normals, which are made unit
    /// later.
    pub fn normal_matrix(&self) -> [[f64; 3]; 3] {
        let sign = if self.is_mirroring() { -1.0 } else { 1.0 };
        let [a, b, c] = self.linear;
        [cross(b, c), cross(c, a), cross(a, b)].map(|row| row.map(|v| v * sign))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_compose_and_mirror() {
        let turn =
            Affine { linear: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], translation: [1.0, 2.0, 3.0] };
        let flip = Affine { linear: [[-2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..Affine::IDENTITY };
        assert_eq!(turn.after(&flip).point([1.0, 1.0, 1.0]), turn.point(flip.point([1.0, 1.0, 1.0])));
        assert_eq!(turn.point([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0]);
        assert!(flip.is_mirroring() && turn.after(&flip).is_mirroring() && !turn.is_mirroring());
        assert_eq!(Affine::IDENTITY.point([f64::MAX, -0.0, f64::INFINITY])[2], f64::INFINITY);
        // The normal of x = const stays along x, and keeps its side.
        assert_eq!(flip.normal_matrix().map(|row| row[0]), [-1.0, 0.0, 0.0]);
        assert_eq!(flip.normal_matrix().map(|row| row[1]), [0.0, 2.0, 0.0]);
    }
}
