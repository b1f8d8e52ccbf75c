//! Styles: presets of layers.

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
        /// Translucent surface in one colour, opaque where it turns away from the viewer.
        Xray = "xray",
    }
}
