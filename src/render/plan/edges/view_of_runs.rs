//! Runs of faces as one view shows them. A run is 32 consecutive faces of a mesh, with a bounding
//! box and a cone that contains their normals (`face_runs`). Box and cone tell whether all faces of
//! the run surely show the same side to the viewer, and in which rectangle on screen they lie.
//! Where this is known, the faces need not be tested one by one.

use super::face_runs::FaceRun;
use crate::mesh::Mesh;
use crate::mesh::vector::dot;
use crate::plan::Projector;

/// The largest relative error of a determinant of three rounded places, generously.
const ROUNDED: f64 = 1e-13;

/// Errors of a cone and of the direction to the eye, relative, generously.
const TURNED: f64 = 1e-5;

/// The error of the least W in a box, relative, generously.
const NEAR_ROUNDED: f64 = 1e-6;

/// A distance on screen beyond all rounding errors, 1/256 px.
const BESIDE: f64 = 1.0;

/// The view of a mesh.
///
/// A face shows the side that the sign of a determinant says: that of the X, Y and W of its corners. By the
/// formula of Cauchy and Binet it is the product of the face's plane with the eye, a homogeneous point.
#[derive(Clone, Copy, Debug)]
pub struct RunView {
    projector: Projector,
    near_w: f64,
    /// The eye, or the direction to it where `eye_w` is 0, times a factor that may be negative.
    eye: [f64; 3],
    eye_w: f64,
    /// Determinants that rounding may take for 0.
    pub rounded: f64,
    /// The same for a product of a unit normal with the eye.
    eye_rounded: f64,
}

impl RunView {
    /// The view of a mesh by a projection. What has a W of less than `near_w` is not on screen.
    pub fn new(mesh: &Mesh, projector: Projector, near_w: f64) -> Self {
        let [x, y, _, w] = projector.rows;
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
            projector,
            near_w,
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
        let [x, y, w] = self.projector.place(middle);
        let reach = |row: [f64; 3]| (0..3).map(|k| row[k].abs() * half[k]).sum::<f64>();
        let [right, down, _, away] = self.projector.rows.map(|[x, y, z, _]| [x, y, z]);
        let least_w = w - reach(away);
        if least_w < self.near_w * (1.0 + NEAR_ROUNDED) || least_w.is_nan() {
            return None;
        }
        // X / W - s = (X - s W) / W, where s is the middle's: the numerator is 0 there.
        let range = |across: [f64; 3], middle: f64| {
            let far = reach([0, 1, 2].map(|k| across[k] - middle * away[k])) / least_w + BESIDE;
            [middle - far, middle + far]
        };
        let ([left, right], [top, bottom]) = (range(right, x / w), range(down, y / w));
        Some([[left, top], [right, bottom]])
    }
}
