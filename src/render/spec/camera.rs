//! The camera, as a request describes it: the direction or the position to look from, the projection and
//! the lens. It is placed for a mesh later, in `scene`.

use super::words::word_enums;
use crate::mesh::UpAxis;

word_enums! {
    /// Named directions to look from.
    #[non_exhaustive]
    pub enum NamedView {
        /// From the front, a little from the right and from above: azimuth 30 degrees, elevation 20.
        Auto = "auto",
        /// From the front right, above: azimuth 45 degrees, elevation 30.
        Iso = "iso",
        /// Azimuth 0.
        Front = "front",
        /// Azimuth 180.
        Back = "back",
        /// Azimuth -90.
        Left = "left",
        /// Azimuth 90.
        Right = "right",
        /// From above.
        Top = "top",
        /// From below.
        Bottom = "bottom",
    }

    /// The relation of distance and size.
    pub enum ProjectionKind {
        /// Distant objects are smaller.
        Perspective = "perspective",
        /// Size does not depend on distance.
        Orthographic = "orthographic",
    }
}

/// Position and lens of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSpec {
    /// A named direction; azimuth and elevation override its angles.
    pub view: NamedView,
    /// Angle around the up axis, degrees; 0 is the front, 90 the right.
    pub azimuth_deg: Option<f64>,
    /// Angle above the horizon, degrees, -90 to 90.
    pub elevation_deg: Option<f64>,
    /// Perspective or orthographic.
    pub projection: ProjectionKind,
    /// Vertical field of view, degrees, 0.01 to 179.
    pub fov_deg: f64,
    /// Height of an orthographic view in file units; None fits the mesh.
    pub height: Option<f64>,
    /// Overrides the file format's up axis.
    pub up: Option<UpAxis>,
    /// Free border on each side as a fraction of the picture's size, 0 to 0.45.
    pub margin: f64,
    /// Position in file space. Given together with `target`; the mesh is then not fitted.
    pub eye: Option<[f64; 3]>,
    /// The point in file space at the picture's centre.
    pub target: Option<[f64; 3]>,
    /// Uses the file's own first camera; the mesh is then not fitted. Excludes `eye`.
    pub from_file: bool,
    /// Fits the mesh for all its turns around the up axis, so that it keeps its size and place in each.
    pub fits_turn: bool,
}

impl NamedView {
    /// Azimuth and elevation, degrees.
    pub fn angles_deg(self) -> [f64; 2] {
        match self {
            // The front stays the widest side, and no two sides of a box look alike.
            Self::Auto => [30.0, 20.0],
            Self::Iso => [45.0, 30.0],
            Self::Front => [0.0, 0.0],
            Self::Back => [180.0, 0.0],
            Self::Left => [-90.0, 0.0],
            Self::Right => [90.0, 0.0],
            Self::Top => [0.0, 90.0],
            Self::Bottom => [0.0, -90.0],
        }
    }
}

impl CameraSpec {
    /// The angle around the up axis, given or the view's.
    pub fn azimuth_deg(&self) -> f64 {
        self.azimuth_deg.unwrap_or(self.view.angles_deg()[0])
    }

    /// The angle above the horizon, given or the view's.
    pub fn elevation_deg(&self) -> f64 {
        self.elevation_deg.unwrap_or(self.view.angles_deg()[1])
    }

    /// True if the request says what is up, or where to look from.
    pub fn has_own_up(&self) -> bool {
        self.up.is_some() || self.eye.is_some() || self.from_file
    }
}

impl Default for CameraSpec {
    fn default() -> Self {
        Self {
            view: NamedView::Auto,
            azimuth_deg: None,
            elevation_deg: None,
            projection: ProjectionKind::Perspective,
            fov_deg: 35.0,
            height: None,
            up: None,
            margin: 0.05,
            eye: None,
            target: None,
            from_file: false,
            fits_turn: false,
        }
    }
}
