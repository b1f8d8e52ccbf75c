//! The words of a request document and what they mean.

use crate::image::ImageFormat;
use crate::mesh::UpAxis;
use crate::spec::BackendChoice;
use crate::spec::{
    Cull, DebugView, FlatNormals, Hidden, LightPreset, NamedView, OutlineMethod, OutlineUnit, ProjectionKind, Shading,
    WireEdges, WireMethod,
};

/// An enumeration that a request names by words.
pub trait Words: Copy + Send + Sync + 'static {
    /// Each word and its meaning.
    const ALL: &'static [(&'static str, Self)];
}

/// A preset: which layers are drawn, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// One normal a face.
    Flat,
    /// Interpolated normals.
    Smooth,
    /// Base colours alone.
    Unlit,
    /// Flat surface and lines on its edges.
    Wire,
    /// Lines alone, back edges too.
    Wireframe,
    /// Smooth surface and a hull around it.
    Outline,
    /// White surface and lines.
    HiddenLine,
    /// Flat surface, and edges by how many faces they have.
    Topology,
}

impl Words for Style {
    const ALL: &'static [(&'static str, Self)] = &[
        ("flat", Self::Flat),
        ("smooth", Self::Smooth),
        ("unlit", Self::Unlit),
        ("wire", Self::Wire),
        ("wireframe", Self::Wireframe),
        ("outline", Self::Outline),
        ("hidden-line", Self::HiddenLine),
        ("topology", Self::Topology),
    ];
}

impl Words for FlatNormals {
    const ALL: &'static [(&'static str, Self)] = &[("face", Self::Face), ("derivative", Self::Derivative)];
}

impl Words for OutlineMethod {
    const ALL: &'static [(&'static str, Self)] = &[("hull", Self::Hull), ("contour", Self::Contour)];
}

impl Words for LightPreset {
    const ALL: &'static [(&'static str, Self)] =
        &[("headlight", Self::Headlight), ("three-point", Self::ThreePoint), ("none", Self::None)];
}

impl Words for Shading {
    const ALL: &'static [(&'static str, Self)] =
        &[("flat", Self::Flat), ("smooth", Self::Smooth), ("unlit", Self::Unlit)];
}

impl Words for DebugView {
    const ALL: &'static [(&'static str, Self)] = &[
        ("none", Self::None),
        ("barycentric", Self::Barycentric),
        ("min-barycentric", Self::MinBarycentric),
        ("edge-distance", Self::EdgeDistance),
        ("normal", Self::Normal),
        ("uv", Self::Uv),
        ("face-orientation", Self::FaceOrientation),
        ("vertex-color", Self::VertexColor),
    ];
}

impl Words for Cull {
    const ALL: &'static [(&'static str, Self)] = &[("none", Self::None), ("back", Self::Back), ("front", Self::Front)];
}

impl Words for WireMethod {
    const ALL: &'static [(&'static str, Self)] = &[
        ("exact", Self::Exact),
        ("fwidth", Self::Fwidth),
        ("fwidth-min", Self::FwidthMin),
        ("barycentric", Self::Barycentric),
        ("threshold", Self::Threshold),
    ];
}

impl Words for WireEdges {
    const ALL: &'static [(&'static str, Self)] = &[
        ("triangles", Self::Triangles),
        ("polygons", Self::Polygons),
        ("feature", Self::Feature),
        ("boundary", Self::Boundary),
    ];
}

impl Words for Hidden {
    const ALL: &'static [(&'static str, Self)] = &[("hide", Self::Hide), ("show", Self::Show), ("fade", Self::Fade)];
}

impl Words for OutlineUnit {
    const ALL: &'static [(&'static str, Self)] = &[("object", Self::Object), ("px", Self::Px)];
}

impl Words for NamedView {
    const ALL: &'static [(&'static str, Self)] = &[
        ("iso", Self::Iso),
        ("front", Self::Front),
        ("back", Self::Back),
        ("left", Self::Left),
        ("right", Self::Right),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
    ];
}

impl Words for ProjectionKind {
    const ALL: &'static [(&'static str, Self)] =
        &[("perspective", Self::Perspective), ("orthographic", Self::Orthographic)];
}

impl Words for UpAxis {
    const ALL: &'static [(&'static str, Self)] =
        &[("y", Self::Y), ("z", Self::Z), ("-y", Self::NegY), ("-z", Self::NegZ), ("x", Self::X), ("-x", Self::NegX)];
}

impl Words for ImageFormat {
    // `jpg` is what the file extension says, so people write it here too.
    const ALL: &'static [(&'static str, Self)] =
        &[("png", Self::Png), ("webp", Self::Webp), ("jpeg", Self::Jpeg), ("jpg", Self::Jpeg)];
}

impl Words for BackendChoice {
    const ALL: &'static [(&'static str, Self)] = &[("auto", Self::Auto), ("gpu", Self::Gpu), ("cpu", Self::Cpu)];
}

/// Just the words.
pub fn words_of<T: Words>() -> Vec<&'static str> {
    T::ALL.iter().map(|&(word, _)| word).collect()
}

/// The word for a value; the first where there are several.
pub fn word_for<T: Words + PartialEq>(value: T) -> &'static str {
    T::ALL.iter().find(|(_, v)| *v == value).map_or("", |&(word, _)| word)
}
