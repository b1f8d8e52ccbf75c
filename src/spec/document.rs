//! The request document, understood: presets applied, defaults filled in, every value in range. Units are in the names.

use super::color::Rgba;
use super::layers::{Layers, Topology};
pub use crate::image::ImageFormat;
use crate::mesh::UpAxis;
use crate::spec::quality::QualityTarget;

/// Everything a request says.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// What is drawn, for materials that `materials` does not name.
    pub layers: Layers,
    /// What is drawn for the asset's materials of these names, in full: nothing is taken from `layers` any more. The last of
    /// equal names counts.
    pub materials: Vec<(String, Layers)>,
    /// Edges that say how the mesh hangs together, if any.
    pub topology: Option<Topology>,
    /// The moment of the file's first animation, seconds; None: the file as its animations find it.
    pub time_s: Option<f64>,
    /// Where from.
    pub camera: CameraSpec,
    /// Lit how.
    pub light: Light,
    /// Size, format, sampling, background.
    pub image: ImageSpec,
    /// Which back-end draws.
    pub backend: BackendChoice,
    /// An error or a time that is asked for in place of what `QualityTarget::open` names; None: nothing is chosen.
    pub quality_target: Option<QualityTarget>,
}

/// Named directions to look from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedView {
    /// From the front right, above: azimuth 45 degrees, elevation 30.
    Iso,
    /// Azimuth 0.
    Front,
    /// Azimuth 180.
    Back,
    /// Azimuth -90.
    Left,
    /// Azimuth 90.
    Right,
    /// From above.
    Top,
    /// From below.
    Bottom,
}

/// How depth becomes size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectionKind {
    /// Farther is smaller.
    Perspective,
    /// It is not.
    Orthographic,
}

/// Where the picture is taken from.
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
    /// Orthographic view height in file units; None fits.
    pub height: Option<f64>,
    /// Overrides the format's up axis.
    pub up: Option<UpAxis>,
    /// Free border as a fraction of the picture's size, each side, 0 to 0.45.
    pub margin: f64,
    /// Position in file space; given together with `target`, nothing is fitted.
    pub eye: Option<[f64; 3]>,
    /// The point in file space at the picture's centre.
    pub target: Option<[f64; 3]>,
    /// Looks through the file's own first camera; nothing is fitted. Not together with `eye`.
    pub from_file: bool,
}

/// Which lamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightPreset {
    /// One over the viewer's shoulder.
    Headlight,
    /// Key, fill and rim, as in a studio; they turn with the camera.
    ThreePoint,
    /// None: ambient light alone.
    None,
}

/// Lamps over an ambient term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Which lamps.
    pub preset: LightPreset,
    /// Where the key light shines, in file space; None: as the preset has it, relative to the camera. Not zero.
    pub direction: Option<[f64; 3]>,
    /// Strength of the lamps, 0 to 10.
    pub intensity: f32,
    /// Share of light that comes from everywhere, 0 to 1.
    pub ambient: f32,
}

/// The picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSpec {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// None: whoever asks decides (extension, Accept, then PNG).
    pub format: Option<ImageFormat>,
    /// Visibility samples a pixel: 1, 4, 8 or 16.
    pub samples: u32,
    /// What is behind the mesh; alpha 0 is transparent.
    pub background: Rgba,
}

/// Who draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackendChoice {
    /// A hardware GPU if there is one, the CPU otherwise.
    Auto,
    /// Any GPU, a software Vulkan included.
    Gpu,
    /// The CPU rasterizer.
    Cpu,
}
