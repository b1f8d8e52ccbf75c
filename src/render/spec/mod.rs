//! The specification of a picture: a [`Spec`] is a request after it was read and checked. It says what to
//! draw of any mesh, and how, with styles applied and defaults filled in. Every value is in range. The
//! unit of a field is in its name (`fov_deg`) or in its comment.

mod background;
mod camera;
pub mod color;
mod image;
mod layers;
mod light;
mod quality;
mod sheet;
mod wire_method;
pub mod words;

pub use background::*;
pub use camera::*;
pub use image::*;
pub use layers::*;
pub use light::*;
pub use quality::*;
pub use sheet::*;
pub use wire_method::*;

use words::word_enums;

/// Everything a request says, with styles applied and defaults filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// The layers of materials that `materials` does not name.
    pub layers: Layers,
    /// The layers of materials of these names. Each entry is complete and takes nothing from
    /// `layers`. Of equal names the last counts.
    pub materials: Vec<(String, Layers)>,
    /// Edges coloured by how the mesh is connected, if any.
    pub topology: Option<Topology>,
    /// Points of the file.
    pub points: Points,
    /// The moment of the file's first animation, seconds. None: the rest pose.
    pub time_s: Option<f64>,
    /// What the mesh stands on.
    pub ground: Ground,
    /// Position and lens.
    pub camera: CameraSpec,
    /// Several views of the mesh, each with a part of the picture or of the time. None: one view.
    pub sheet: Option<Sheet>,
    /// Lamps and ambient light.
    pub light: Light,
    /// Size, format, sampling, background.
    pub image: ImageSpec,
    /// The back-end that draws.
    pub backend: BackendChoice,
    /// An error or a time to reach by choosing what [`QualityTarget::open`] names. None: nothing is
    /// chosen.
    pub quality_target: Option<QualityTarget>,
}

impl Spec {
    /// The layers of all styles: of the document, and of its materials.
    pub fn styles(&self) -> impl Iterator<Item = &Layers> {
        std::iter::once(&self.layers).chain(self.materials.iter().map(|(_, layers)| layers))
    }

    /// True if it asks for filled surfaces, and for nothing transparent.
    pub fn is_opaque(&self) -> bool {
        let surfaces = || self.styles().filter_map(|layers| layers.surface.as_ref());
        let is_opaque =
            |s: &Surface| s.opacity >= 1.0 && s.facing_opacity >= 1.0 && s.color.is_none_or(|color| color.0[3] >= 1.0);
        surfaces().next().is_some() && surfaces().all(is_opaque) && self.ground == Ground::None
    }

    /// Samples in every pixel, if the mesh's own materials are opaque: adaptive ones are 16 beside what is transparent.
    pub fn samples_per_pixel(&self) -> u32 {
        match self.image.samples {
            Samples::Adaptive if !self.is_opaque() => Samples::LAYERED,
            samples => samples.per_pixel(),
        }
    }
}

word_enums! {
    /// What the mesh stands on.
    pub enum Ground {
        /// Nothing.
        None = "none",
        /// A plane at its lowest point that shows a soft contact shadow, and nothing else.
        Shadow = "shadow",
    }

    /// The back-end that draws.
    pub enum BackendChoice {
        /// A hardware GPU if there is one, the CPU otherwise.
        Auto = "auto",
        /// Any GPU, a software Vulkan included.
        Gpu = "gpu",
        /// The CPU rasterizer.
        Cpu = "cpu",
    }
}
