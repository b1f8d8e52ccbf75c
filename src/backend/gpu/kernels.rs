//! What each kernel is made of: its source, and what of a plan it is specialised to.

use super::look;
use super::sizes::STROKES_BYTES;
use super::stages::{Into, Stage, Write};

const COMMON: &str = include_str!("../../../shaders/common.wgsl");
const CONTOUR: &str = include_str!("../../../shaders/contour.wgsl");
const HIDING: &str = include_str!("../../../shaders/hiding.wgsl");
const SEGMENT: &str = include_str!("../../../shaders/segment.wgsl");
const STROKE: &str = include_str!("../../../shaders/stroke.wgsl");
const PLANES: &str = include_str!("../../../shaders/planes.wgsl");
const WORK: &str = include_str!("../../../shaders/work.wgsl");
const TRIANGLE: &str = include_str!("../../../shaders/triangle.wgsl");
const SAMPLES_32: &str = include_str!("../../../shaders/samples32.wgsl");
const SAMPLES_64: &str = include_str!("../../../shaders/samples64.wgsl");
const SAMPLES: &str = include_str!("../../../shaders/samples.wgsl");
const LAYERED: &str = include_str!("../../../shaders/layered.wgsl");
const EMIT: &str = include_str!("../../../shaders/emit.wgsl");
const EMIT_LAYER: &str = include_str!("../../../shaders/emit_layer.wgsl");
const OVER: &str = include_str!("../../../shaders/over.wgsl");
const GROUP: &str = include_str!("../../../shaders/group.wgsl");

/// What shade, layers and line_light have in common: from where a point lies to its colour.
const SHADE: &[&str] = &[
    include_str!("../../../shaders/barycentric.wgsl"),
    include_str!("../../../shaders/texture.wgsl"),
    include_str!("../../../shaders/light.wgsl"),
    include_str!("../../../shaders/wire.wgsl"),
    include_str!("../../../shaders/debug.wgsl"),
    include_str!("../../../shaders/point.wgsl"),
];

impl Stage {
    /// Name of the entry point, and of the file in shaders/.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Visibility { .. } => "visibility",
            Self::Clip => "clip",
            Self::Layers => "layers",
            Self::VisibilityTile { .. } => "visibility_tile",
            Self::Shade => "shade",
            Self::Lines => "lines",
            Self::Ink => "ink",
            Self::LineLight => "line_light",
            Self::Resolve => "resolve",
        }
    }

    /// WGSL has no include: a kernel is its files, one after the other.
    pub fn source(self) -> String {
        let keep_nearest = |write: Write| if write == Write::Both { SAMPLES_64 } else { SAMPLES_32 };
        let emit = |into: Into| match into {
            Into::Surface => EMIT.to_owned(),
            Into::Layer => [LAYERED, EMIT_LAYER].concat(),
        };
        match self {
            Self::Transform => [COMMON, include_str!("../../../shaders/transform.wgsl")].concat(),
            Self::Visibility { write, into } => {
                let kernel = include_str!("../../../shaders/visibility.wgsl");
                [COMMON, TRIANGLE, WORK, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Clip => [COMMON, TRIANGLE, WORK, PLANES, include_str!("../../../shaders/clip.wgsl")].concat(),
            Self::VisibilityTile { write, into } => {
                let kernel = include_str!("../../../shaders/visibility_tile.wgsl");
                [COMMON, TRIANGLE, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Layers => {
                [&[COMMON, TRIANGLE], SHADE, &[GROUP, LAYERED, include_str!("../../../shaders/layers.wgsl")]]
                    .concat()
                    .concat()
            }
            Self::Shade => [&[COMMON, TRIANGLE], SHADE, &[GROUP, LAYERED, include_str!("../../../shaders/shade.wgsl")]]
                .concat()
                .concat(),
            Self::LineLight => {
                [&[COMMON, TRIANGLE], SHADE, &[include_str!("../../../shaders/line_light.wgsl")]].concat().concat()
            }
            Self::Lines => {
                let kernel = include_str!("../../../shaders/lines.wgsl");
                [COMMON, TRIANGLE, PLANES, CONTOUR, SEGMENT, HIDING, STROKE, kernel].concat()
            }
            Self::Ink => [COMMON, OVER, LAYERED, include_str!("../../../shaders/ink.wgsl")].concat(),
            Self::Resolve => [COMMON, OVER, include_str!("../../../shaders/resolve.wgsl")].concat(),
        }
    }

    /// The flags that the kernel reads; there is a pipeline for every combination that a plan asks for.
    pub fn looks(self) -> u32 {
        const NORMALS: u32 = look::FACE_NORMALS | look::VERTEX_NORMALS | look::DERIVATIVE_NORMALS;
        const WIRES: u32 = look::WIRES | look::WIRE_MINIMUM | look::WIRE_LIT | look::EDGE_MASKS;
        const PAINT: u32 = look::VERTEX_COLORS | look::UVS | look::TEXTURES | look::DEBUG | look::VARYING;
        const SHADED: u32 = look::SURFACE
            | look::TRIANGLE_MATERIALS
            | NORMALS
            | WIRES
            | PAINT
            | look::CLIPPED
            | look::SAMPLES
            | look::HULL_LOOKS
            | look::WIRES_ONLY;
        match self {
            Self::Transform => 0,
            Self::Clip => look::ROLES | look::LAYERS,
            Self::Visibility { into: Into::Surface, .. } => look::SAMPLES | look::ROLES,
            Self::Visibility { into: Into::Layer, .. } => {
                look::SAMPLES | look::ROLES | look::LAYERS | look::BEHIND_SURFACE
            }
            Self::VisibilityTile { into: Into::Surface, .. } => look::SAMPLES,
            Self::VisibilityTile { into: Into::Layer, .. } => look::SAMPLES | look::BEHIND_SURFACE,
            Self::Layers => SHADED | look::LAYERED_HULL,
            Self::Shade => SHADED | look::LAYERS,
            Self::LineLight => SHADED,
            Self::Ink => look::SURFACE | look::HULL | look::LAYERS | look::SAMPLES,
            Self::Lines => look::CONTOURS | look::CLIPPED | look::SAMPLES,
            Self::Resolve => look::SURFACE | look::HULL | look::LINES,
        }
    }

    /// Values of the kernel's `override` constants.
    pub fn constants(self, look: u32) -> Vec<(&'static str, f64)> {
        let look = ("LOOK", f64::from(look));
        match self {
            Self::Visibility { write: Write::Depth, .. } | Self::VisibilityTile { write: Write::Depth, .. } => {
                vec![look, ("PHASE", 0.0)]
            }
            Self::Visibility { write: Write::Id, .. } | Self::VisibilityTile { write: Write::Id, .. } => {
                vec![look, ("PHASE", 1.0)]
            }
            Self::Lines | Self::Ink => vec![look, ("STROKE_WORDS", (STROKES_BYTES / 4) as f64)],
            _ => vec![look],
        }
    }
}
