//! Affine maps in f64, for formats whose scenes place parts by matrices.

/// A 3 x 3 matrix by rows, and a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Rows of the matrix.
    pub linear: [[f64; 3]; 3],
    /// What is added.
    pub translation: [f64; 3],
}

impl Affine {
    /// No change.
    pub const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// First `inner`, then `self`.
    pub fn after(&self, inner: &Self) -> Self {
        let linear = std::array::from_fn(|row| {
            std::array::from_fn(|column| (0..3).map(|k| self.linear[row][k] * inner.linear[k][column]).sum())
        });
        Self { linear, translation: self.point(inner.translation) }
    }

    /// A transformed point. No change is none: numbers stay as the file has them.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        if *self == Self::IDENTITY {
            return p;
        }
        std::array::from_fn(|row| {
            let m = self.linear[row];
            m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + self.translation[row]
        })
    }

    /// Whether it turns the inside out, so that windings must be turned round.
    pub fn is_mirroring(&self) -> bool {
        let [a, b, c] = self.linear;
        let cross = cross(b, c);
        a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2] < 0.0
    }

    /// The matrix that keeps normals perpendicular to their surfaces: the inverse transpose, but for its length.
    pub fn normal_matrix(&self) -> [[f64; 3]; 3] {
        let sign = if self.is_mirroring() { -1.0 } else { 1.0 };
        let [a, b, c] = self.linear;
        [cross(b, c), cross(c, a), cross(a, b)].map(|row| row.map(|v| v * sign))
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
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
