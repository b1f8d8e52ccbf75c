//! What each kernel is made of: its source, and what of a plan it is specialised to.

use crate::backend::gpu::pipelines::key;
use crate::backend::gpu::pipelines::{Into, Stage, Write};
use crate::backend::gpu::schedule::sizes::STROKES_BYTES;

const COMMON: &str = include_str!("../../../../shaders/common.wgsl");
const CONTOUR: &str = include_str!("../../../../shaders/lines/contour.wgsl");
const HIDING: &str = include_str!("../../../../shaders/lines/hidden_lines.wgsl");
const SEGMENT: &str = include_str!("../../../../shaders/lines/segment.wgsl");
const STROKE: &str = include_str!("../../../../shaders/lines/stroke.wgsl");
const PLANES: &str = include_str!("../../../../shaders/geometry/planes.wgsl");
const WORK: &str = include_str!("../../../../shaders/geometry/work.wgsl");
const TRIANGLE: &str = include_str!("../../../../shaders/geometry/triangle.wgsl");
const SAMPLES_32: &str = include_str!("../../../../shaders/geometry/samples32.wgsl");
const SAMPLES_64: &str = include_str!("../../../../shaders/geometry/samples64.wgsl");
const SAMPLES: &str = include_str!("../../../../shaders/geometry/samples.wgsl");
const LAYERED: &str = include_str!("../../../../shaders/peeling/state.wgsl");
const EMIT: &str = include_str!("../../../../shaders/geometry/emit.wgsl");
const EMIT_LAYER: &str = include_str!("../../../../shaders/peeling/emit_layer.wgsl");
const OVER: &str = include_str!("../../../../shaders/over.wgsl");
const GROUP: &str = include_str!("../../../../shaders/surface/group.wgsl");

/// What shade, layers and line_light have in common: from where a point lies to its colour.
const SHADE: &[&str] = &[
    include_str!("../../../../shaders/surface/barycentric.wgsl"),
    include_str!("../../../../shaders/surface/texture.wgsl"),
    include_str!("../../../../shaders/surface/light.wgsl"),
    include_str!("../../../../shaders/surface/wire.wgsl"),
    include_str!("../../../../shaders/surface/normal.wgsl"),
    include_str!("../../../../shaders/surface/debug.wgsl"),
    include_str!("../../../../shaders/surface/point.wgsl"),
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
            Self::Transform => [COMMON, include_str!("../../../../shaders/geometry/transform.wgsl")].concat(),
            Self::Visibility { write, into } => {
                let kernel = include_str!("../../../../shaders/geometry/visibility.wgsl");
                [COMMON, TRIANGLE, WORK, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Clip => {
                [COMMON, TRIANGLE, WORK, PLANES, include_str!("../../../../shaders/geometry/clip.wgsl")].concat()
            }
            Self::VisibilityTile { write, into } => {
                let kernel = include_str!("../../../../shaders/geometry/visibility_tile.wgsl");
                [COMMON, TRIANGLE, SAMPLES, keep_nearest(write), &emit(into), kernel].concat()
            }
            Self::Layers => [
                &[COMMON, TRIANGLE],
                SHADE,
                &[GROUP, LAYERED, include_str!("../../../../shaders/peeling/composite.wgsl")],
            ]
            .concat()
            .concat(),
            Self::Shade => {
                [&[COMMON, TRIANGLE], SHADE, &[GROUP, LAYERED, include_str!("../../../../shaders/surface/shade.wgsl")]]
                    .concat()
                    .concat()
            }
            Self::LineLight => {
                [&[COMMON, TRIANGLE], SHADE, &[include_str!("../../../../shaders/lines/line_light.wgsl")]]
                    .concat()
                    .concat()
            }
            Self::Lines => {
                let kernel = include_str!("../../../../shaders/lines/edge.wgsl");
                [COMMON, TRIANGLE, PLANES, CONTOUR, SEGMENT, HIDING, STROKE, kernel].concat()
            }
            Self::Ink => [COMMON, OVER, LAYERED, include_str!("../../../../shaders/lines/coverage.wgsl")].concat(),
            Self::Resolve => [COMMON, OVER, include_str!("../../../../shaders/resolve.wgsl")].concat(),
        }
    }

    /// The flags that the kernel reads; there is a pipeline for every combination that a plan asks for.
    pub fn looks(self) -> u32 {
        const NORMALS: u32 = key::FACE_NORMALS | key::VERTEX_NORMALS | key::DERIVATIVE_NORMALS;
        const WIRES: u32 = key::WIRES | key::WIRE_MINIMUM | key::WIRE_LIT | key::EDGE_MASKS;
        const PAINT: u32 = key::VERTEX_COLORS | key::UVS | key::TEXTURES | key::DEBUG | key::VARYING;
        const SHADED: u32 = key::SURFACE
            | key::TRIANGLE_MATERIALS
            | NORMALS
            | WIRES
            | PAINT
            | key::CLIPPED
            | key::SAMPLES
            | key::HULL_LOOKS
            | key::WIRES_ONLY;
        match self {
            Self::Transform => 0,
            Self::Clip => key::ROLES | key::LAYERS,
            Self::Visibility { into: Into::Surface, .. } => key::SAMPLES | key::ROLES,
            Self::Visibility { into: Into::Layer, .. } => key::SAMPLES | key::ROLES | key::LAYERS | key::BEHIND_SURFACE,
            Self::VisibilityTile { into: Into::Surface, .. } => key::SAMPLES,
            Self::VisibilityTile { into: Into::Layer, .. } => key::SAMPLES | key::BEHIND_SURFACE,
            Self::Layers => SHADED | key::LAYERED_HULL,
            Self::Shade => SHADED | key::LAYERS,
            Self::LineLight => SHADED,
            Self::Ink => key::SURFACE | key::HULL | key::LAYERS | key::SAMPLES,
            Self::Lines => key::CONTOURS | key::CLIPPED | key::SAMPLES,
            Self::Resolve => key::SURFACE | key::HULL | key::LINES,
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
