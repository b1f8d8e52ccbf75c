//! The styles that a request can name, such as `wire` or `clay`. A style is a preset, which the other
//! keys of the request override. It says which layers of a picture are drawn and how (`layers_draft`
//! and `draft` have that), and how much ambient light and ambient occlusion there is by default.

use crate::spec::words::word_enums;

word_enums! {
    /// A preset: the layers that are drawn, and how.
    pub enum Style {
        /// The mesh as it is meant to look: smooth by the file's normals, or with creases where it has none.
        Auto = "auto",
        /// One normal per face.
        Flat = "flat",
        /// Interpolated normals.
        Smooth = "smooth",
        /// Base colours without light.
        Unlit = "unlit",
        /// Flat surface and lines on its edges.
        Wire = "wire",
        /// Lines without a surface, faint where edges are hidden.
        Wireframe = "wireframe",
        /// Smooth surface and a hull around it.
        Outline = "outline",
        /// White surface and lines.
        HiddenLine = "hidden-line",
        /// Flat surface, and edges coloured by their number of faces.
        Topology = "topology",
        /// Smooth surface, feature edges and a contour, as in a technical drawing.
        Technical = "technical",
        /// The bare form: one matt colour for all materials, and strong occlusion.
        Clay = "clay",
        /// Translucent surface in one colour, opaque where it turns away from the viewer.
        Xray = "xray",
    }
}

impl Style {
    /// Default of [`Light::ambient_occlusion`](crate::spec::Light::ambient_occlusion): looks that show a mesh
    /// at its best have it, and the techniques that go by name stay as they are known.
    pub fn ambient_occlusion(self) -> f32 {
        match self {
            Self::Clay => 1.0,
            Self::Auto | Self::Outline | Self::Technical => 0.6,
            _ => 0.0,
        }
    }

    /// Default of [`Light::ambient`](crate::spec::Light::ambient) beside lamps: the same looks have less, so that
    /// their sides differ more.
    pub fn ambient(self) -> f32 {
        match self {
            Self::Auto | Self::Outline | Self::Technical | Self::Clay => 0.18,
            _ => crate::spec::Light::default().ambient,
        }
    }
}
