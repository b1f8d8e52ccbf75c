//! The plane on which a mesh stands, for its contact shadow: where the plane is, from which cameras its
//! upper side is seen, and how far the shadow reaches.

use glam::DVec3;

use super::camera::{Camera, frame};
use crate::mesh::{Mesh, UpAxis};
use crate::spec::ProjectionKind;

/// Distance that the ground's shadow reaches beyond the mesh, as a share of the mesh's longer side across
/// the up axis.
pub const GROUND_REACH: f64 = 0.3;

/// Height above the ground up to which the mesh darkens it, as a share of the same side.
pub const GROUND_HEIGHT: f64 = 0.6;

/// Distance of the plane below the lowest point, as a share of the same side: so the plane does not cut
/// the faces on which the mesh stands.
const BELOW: f64 = 6e-4;

/// The plane under a mesh.
#[derive(Clone, Copy, Debug)]
pub struct GroundPlane {
    /// Right, up, and right x up.
    pub axes: [DVec3; 3],
    /// Bounds of the mesh along these.
    pub bounds: [[f64; 2]; 3],
    /// The mesh's longer side across the up axis.
    pub side: f64,
    /// The plane's height along the up axis.
    pub height: f64,
}

impl GroundPlane {
    /// The plane under a mesh with this up axis.
    pub fn new(mesh: &Mesh, up: UpAxis) -> Self {
        let axes = frame(up);
        let [low, high] = mesh.bounds.map(|corner| DVec3::from(corner.map(f64::from)));
        let bounds = axes.map(|axis| [axis.dot(low).min(axis.dot(high)), axis.dot(low).max(axis.dot(high))]);
        let [right, lowest, across] = bounds;
        let side = (right[1] - right[0]).max(across[1] - across[0]);
        Self { axes, bounds, side, height: lowest[0] - BELOW * side }
    }

    /// True if a camera sees its upper side.
    pub fn is_seen(&self, camera: &Camera) -> bool {
        let [right, up, back] = camera.axes;
        match camera.kind {
            ProjectionKind::Orthographic => back.dot(self.axes[1]) > 0.0,
            ProjectionKind::Perspective => {
                let eye = right * camera.center.x + up * camera.center.y + back * camera.distance;
                eye.dot(self.axes[1]) > self.height
            }
        }
    }
}

/// Distance from a mesh that its ground has at most, generously.
pub fn ground_distance(mesh: &Mesh) -> f64 {
    let [low, high] = mesh.bounds;
    let side = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(0.0, f64::max);
    side * (1.5 * GROUND_REACH + GROUND_HEIGHT + 0.1)
}
