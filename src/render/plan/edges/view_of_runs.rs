//! Runs of faces as a view shows them: the side of all faces of a run, and its place on screen.

use super::face_runs::FaceRun;
use crate::mesh::Mesh;
use crate::mesh::vector::dot;
use crate::plan::Projection;
use crate::plan::projection::row_dot;

/// The largest relative error of a determinant of three rounded places, generously.
const ROUNDED: f64 = 1e-13;

/// Errors of a cone and of the direction to the eye, relative, generously.
const TURNED: f64 = 1e-5;

/// A distance on screen beyond all rounding errors, 1/256 px.
const BESIDE: f64 = 1.0;

/// The view of a mesh.
///
/// A face shows the side that the sign of a determinant says: that of the X, Y and W of its corners. By the
/// formula of Cauchy and Binet it is the product of the face's plane with the eye, a homogeneous point.
#[derive(Clone, Copy, Debug)]
pub struct RunView {
    rows: [[f32; 4]; 3],
    near: f64,
    /// The eye, or the direction to it where `eye_w` is 0, times a factor that may be negative.
    eye: [f64; 3],
    eye_w: f64,
    /// Determinants that rounding may take for 0.
    pub rounded: f64,
    /// The same for a product of a unit normal with the eye.
    eye_rounded: f64,
}

impl RunView {
    /// The view of a mesh by a projection, whose smallest W is `near`.
    pub fn new(mesh: &Mesh, projection: &Projection, near: f64) -> Self {
        let rows = [projection.x, projection.y, projection.w];
        let [x, y, w] = rows.map(|row| row.map(f64::from));
        let minor = |[i, j, k]: [usize; 3]| {
            x[i] * (y[j] * w[k] - y[k] * w[j]) - x[j] * (y[i] * w[k] - y[k] * w[i]) + x[k] * (y[i] * w[j] - y[j] * w[i])
        };
        // The same without anything that cancels.
        let terms = |[i, j, k]: [usize; 3]| {
            let [x, y, w] = [x, y, w].map(|row| row.map(f64::abs));
            x[i] * (y[j] * w[k] + y[k] * w[j]) + x[j] * (y[i] * w[k] + y[k] * w[i]) + x[k] * (y[i] * w[j] + y[j] * w[i])
        };
        let columns = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
        let [ex, ey, ez, ew] = columns.map(minor);
        let absolute = |row: &[f64; 4]| {
            let reach = [0, 1, 2].map(|k| f64::from(mesh.bounds[0][k].abs().max(mesh.bounds[1][k].abs())));
            row[3].abs() + (0..3).map(|k| row[k].abs() * reach[k]).sum::<f64>()
        };
        Self {
            rows,
            near,
            eye: [ex, -ey, ez],
            eye_w: -ew,
            rounded: ROUNDED * 6.0 * [&x, &y, &w].map(absolute).iter().product::<f64>(),
            eye_rounded: ROUNDED * columns.map(terms).iter().sum::<f64>(),
        }
    }

    /// The side that all faces of a run surely show: -1 front, 1 back; 0 where it is not known.
    pub fn side(&self, run: &FaceRun) -> i8 {
        let [low, high] = run.bounds.map(|corner| corner.map(f64::from));
        let to_eye = [0, 1, 2].map(|k| self.eye[k] - self.eye_w * 0.5 * (low[k] + high[k]));
        let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
        let axis = run.axis.map(f64::from);
        let (along, all) = (dot(axis, to_eye), dot(to_eye, to_eye));
        let across = (all - along * along).max(0.0).sqrt();
        let cos = f64::from(run.cos);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        // The least product of a normal in the cone with a direction from a point in the box to the eye.
        let lost = sin * across + self.eye_w.abs() * dot(half, half).sqrt() + TURNED * all.sqrt() + self.eye_rounded;
        let least = f64::from(run.least_area) * (along.abs() * cos - lost);
        // Of a cone wider than a right angle, nothing is known.
        if cos <= 0.0 || least.is_nan() || least <= 2.0 * self.rounded {
            0
        } else if along > 0.0 {
            1
        } else {
            -1
        }
    }

    /// The box around a run on screen, 1/256 px from the centre: the lowest and the highest x and y. None
    /// where the run may reach behind the near plane.
    pub fn place(&self, run: &FaceRun) -> Option<[[f64; 2]; 2]> {
        let [low, high] = run.bounds;
        let middle = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
        // Half a side, and what rounding the middle leaves out.
        let half: [f64; 3] = std::array::from_fn(|k| f64::from(high[k] - low[k]) * 0.5 + 1e-6);
        let [x, y, w] = self.rows.map(|row| row_dot(&row, middle));
        let reach = |row: [f64; 3]| (0..3).map(|k| row[k].abs() * half[k]).sum::<f64>();
        let row = |i: usize| [0, 1, 2].map(|k| f64::from(self.rows[i][k]));
        let least_w = w - reach(row(2));
        if least_w < self.near * (1.0 + 1e-6) || least_w.is_nan() {
            return None;
        }
        // X / W - s = (X - s W) / W, where s is the middle's: the numerator is 0 there.
        let range = |i: usize, middle: f64| {
            let (across, depth) = (row(i), row(2));
            let far = reach([0, 1, 2].map(|k| across[k] - middle * depth[k])) / least_w + BESIDE;
            [middle - far, middle + far]
        };
        let ([left, right], [top, bottom]) = (range(0, x / w), range(1, y / w));
        Some([[left, top], [right, bottom]])
    }
}
