//! Source of each kernel, and the bits of the pipeline key that it is specialised by.

use crate::backend::gpu::pipelines::key;
use crate::backend::gpu::pipelines::{Kernel, SampleTarget, SampleWrite};

const COMMON: &str = include_str!("../../../shaders/common.wgsl");
const ONE_JOB: &str = include_str!("../../../shaders/one_job.wgsl");
const GANG: &str = include_str!("../../../shaders/gang.wgsl");
const CONTOUR: &str = include_str!("../../../shaders/lines/contour.wgsl");
const HIDDEN_LINES: &str = include_str!("../../../shaders/lines/hidden_lines.wgsl");
const COPLANAR: &str = include_str!("../../../shaders/lines/coplanar.wgsl");
const INSET: &str = include_str!("../../../shaders/lines/holes/inset.wgsl");
const MARKS: &str = include_str!("../../../shaders/lines/holes/marks.wgsl");
const SEEN: &str = include_str!("../../../shaders/lines/seen.wgsl");
const SEGMENT: &str = include_str!("../../../shaders/lines/segment.wgsl");
const LATTICE: &str = include_str!("../../../shaders/lines/lattice.wgsl");
const FREE_POINTS: &str = include_str!("../../../shaders/lines/holes/free_points.wgsl");
const STROKE_WORDS: &str = include_str!("../../../shaders/lines/stroke_words.wgsl");
const STROKE: &str = include_str!("../../../shaders/lines/stroke.wgsl");
const PLANES: &str = include_str!("../../../shaders/geometry/planes.wgsl");
const CORNERS: &str = include_str!("../../../shaders/geometry/corners.wgsl");
const CULLING: &str = include_str!("../../../shaders/geometry/culling.wgsl");
const TILE: &str = include_str!("../../../shaders/geometry/tile.wgsl");
const WORK: &str = include_str!("../../../shaders/geometry/work.wgsl");
const TRIANGLE: &str = include_str!("../../../shaders/geometry/triangle.wgsl");
const SAMPLES_32: &str = include_str!("../../../shaders/samples/samples32.wgsl");
const SAMPLES_64: &str = include_str!("../../../shaders/samples/samples64.wgsl");
const SAMPLES: &str = include_str!("../../../shaders/samples/samples.wgsl");
const PEEL_STATE: &str = include_str!("../../../shaders/peeling/state.wgsl");
const TINTS: &str = include_str!("../../../shaders/peeling/tints.wgsl");
const STEEPNESS: &str = include_str!("../../../shaders/geometry/steepness.wgsl");
const EMIT: &str = include_str!("../../../shaders/samples/emit.wgsl");
const EMIT_LAYER: &str = include_str!("../../../shaders/peeling/emit_layer.wgsl");
const ENCODE: &str = include_str!("../../../shaders/encode.wgsl");
const OVER: &str = include_str!("../../../shaders/over.wgsl");
const PLACE: &str = include_str!("../../../shaders/occlusion/place.wgsl");
const SPREAD: &str = include_str!("../../../shaders/occlusion/spread.wgsl");
const SMALL: &str = include_str!("../../../shaders/geometry/small.wgsl");
const TILE_SAMPLES: &str = include_str!("../../../shaders/geometry/tile_samples.wgsl");
const MIXED_PLACE: &str = include_str!("../../../shaders/mixed/place.wgsl");
const SEEN_FACES: &str = include_str!("../../../shaders/mixed/find/seen_faces.wgsl");
const LOOK: &str = include_str!("../../../shaders/mixed/find/look.wgsl");
const POINT_EDGES: &str = include_str!("../../../shaders/mixed/point_edges.wgsl");
const MIXED_LATTICE: &str = include_str!("../../../shaders/mixed/lattice.wgsl");
const MIXED_POINTS: &str = include_str!("../../../shaders/mixed/points.wgsl");
const MIXED_LISTS: &str = include_str!("../../../shaders/mixed/lists.wgsl");
const SHARES: &str = include_str!("../../../shaders/mixed/shares.wgsl");
const POINT_SETS: &str = include_str!("../../../shaders/mixed/point_sets.wgsl");
const SHARE_COLOR: &str = include_str!("../../../shaders/mixed/share_color.wgsl");
const MATERIAL: &str = include_str!("../../../shaders/surface/material.wgsl");
const HULL: &str = include_str!("../../../shaders/surface/hull.wgsl");
const GROUP: &str = include_str!("../../../shaders/surface/group.wgsl");

/// Shared by shade, composite and line_light: from a point's position to its colour.
const SHADE: &[&str] = &[
    include_str!("../../../shaders/surface/barycentric.wgsl"),
    include_str!("../../../shaders/surface/texture.wgsl"),
    include_str!("../../../shaders/surface/light.wgsl"),
    include_str!("../../../shaders/surface/occlusion_texture.wgsl"),
    include_str!("../../../shaders/surface/wire.wgsl"),
    include_str!("../../../shaders/surface/normal.wgsl"),
    include_str!("../../../shaders/surface/debug.wgsl"),
    include_str!("../../../shaders/surface/point.wgsl"),
    MATERIAL,
];

impl Kernel {
    /// Name of the entry point, and of the file in shaders/.
    pub fn entry(self) -> &'static str {
        match self {
            Self::Transform => "transform",
            Self::Visibility { .. } => "visibility",
            Self::Clip => "clip",
            Self::Grid => "grid",
            Self::Gather => "gather",
            Self::Composite => "composite",
            Self::VisibilityTile { .. } => "visibility_tile",
            Self::VisibilityFew { .. } => "visibility_few",
            Self::Paint => "paint",
            Self::Shade => "shade",
            Self::Breaks => "breaks",
            Self::Thin => "thin",
            Self::MixedPixels => "mixed_pixels",
            Self::MixedColor => "mixed_color",
            Self::MixedParts => "mixed_parts",
            Self::MixedShade => "mixed_shade",
            Self::MixedSum => "mixed_sum",
            Self::Holes => "holes",
            Self::Tips => "tips",
            Self::Edge => "edge",
            Self::Coverage => "coverage",
            Self::LineLight => "line_light",
            Self::Resolve => "resolve",
        }
    }

    /// The kernel in the first of its phases, whose source is that of all.
    pub fn in_one_phase(self) -> Self {
        let first = |write: SampleWrite| if write == SampleWrite::Id { SampleWrite::Depth } else { write };
        match self {
            Self::Visibility { write, target } => Self::Visibility { write: first(write), target },
            Self::VisibilityTile { write, target } => Self::VisibilityTile { write: first(write), target },
            Self::VisibilityFew { write } => Self::VisibilityFew { write: first(write) },
            other => other,
        }
    }

    /// WGSL has no include: a kernel is its files, one after the other.
    pub fn source(self, is_of_gang: bool) -> String {
        [COMMON, if is_of_gang { GANG } else { ONE_JOB }, &self.own_source()].concat()
    }

    /// True if a gang's jobs can share it: then it asks for its job first.
    pub fn is_shared(self) -> bool {
        match self {
            Self::Transform | Self::VisibilityFew { .. } | Self::Paint => true,
            Self::Grid | Self::Gather | Self::Shade | Self::Resolve => true,
            Self::Visibility { target, .. } | Self::VisibilityTile { target, .. } => target == SampleTarget::Visibility,
            _ => false,
        }
    }

    #[expect(clippy::too_many_lines, reason = "one arm for each kernel")]
    fn own_source(self) -> String {
        let keep_nearest = |write: SampleWrite| if write == SampleWrite::Both { SAMPLES_64 } else { SAMPLES_32 };
        // The place to which results go, and what of a triangle is found: first of small ones, then in tiles.
        let emit = |write: SampleWrite, target: SampleTarget, by_size: &str| match target {
            SampleTarget::Visibility => [keep_nearest(write), SAMPLES, EMIT, by_size].concat(),
            SampleTarget::Layer => [keep_nearest(write), SAMPLES, PEEL_STATE, EMIT_LAYER, by_size].concat(),
            SampleTarget::Points => {
                [keep_nearest(write), MIXED_PLACE, MIXED_LATTICE, POINT_EDGES, MIXED_POINTS].concat()
            }
            SampleTarget::Lists => [MIXED_PLACE, POINT_EDGES, MIXED_LISTS].concat(),
        };
        match self {
            Self::Transform => include_str!("../../../shaders/geometry/transform.wgsl").to_owned(),
            Self::Visibility { write, target } => {
                let kernel = include_str!("../../../shaders/geometry/visibility.wgsl");
                [TRIANGLE, CORNERS, CULLING, WORK, &emit(write, target, SMALL), kernel].concat()
            }
            Self::Clip => {
                [TRIANGLE, CORNERS, CULLING, WORK, PLANES, include_str!("../../../shaders/geometry/clip.wgsl")].concat()
            }
            Self::VisibilityTile { write, target } => {
                let kernel = include_str!("../../../shaders/geometry/visibility_tile.wgsl");
                [TRIANGLE, &emit(write, target, TILE_SAMPLES), TILE, kernel].concat()
            }
            Self::Grid => [PLACE, include_str!("../../../shaders/occlusion/grid.wgsl")].concat(),
            Self::Gather => [PLACE, include_str!("../../../shaders/occlusion/gather.wgsl")].concat(),
            Self::VisibilityFew { write } => {
                let kernel = include_str!("../../../shaders/geometry/visibility_few.wgsl");
                [TRIANGLE, CORNERS, CULLING, SAMPLES, keep_nearest(write), EMIT, TILE_SAMPLES, TILE, kernel].concat()
            }
            Self::Paint => {
                [&[TRIANGLE], SHADE, &[HULL, GROUP, OVER, ENCODE, include_str!("../../../shaders/surface/paint.wgsl")]]
                    .concat()
                    .concat()
            }
            Self::Composite => [
                &[TRIANGLE],
                SHADE,
                &[HULL, GROUP, PEEL_STATE, TINTS, STEEPNESS, include_str!("../../../shaders/peeling/composite.wgsl")],
            ]
            .concat()
            .concat(),
            Self::Shade => [
                &[TRIANGLE],
                SHADE,
                &[HULL, GROUP, PEEL_STATE, PLACE, SPREAD, include_str!("../../../shaders/surface/shade.wgsl")],
            ]
            .concat()
            .concat(),
            Self::Breaks | Self::Thin | Self::MixedPixels | Self::MixedColor => self.mixed_source(),
            Self::MixedParts | Self::MixedShade | Self::MixedSum => self.mixed_source(),
            Self::LineLight => {
                [&[TRIANGLE], SHADE, &[include_str!("../../../shaders/lines/line_light.wgsl")]].concat().concat()
            }
            Self::Holes => {
                let kernel = include_str!("../../../shaders/lines/holes/holes.wgsl");
                [TRIANGLE, STROKE_WORDS, SEEN, INSET, MARKS, kernel].concat()
            }
            Self::Tips => {
                let kernel = include_str!("../../../shaders/lines/holes/tips.wgsl");
                [TRIANGLE, CULLING, STROKE_WORDS, SEEN, INSET, MARKS, kernel].concat()
            }
            Self::Edge => {
                let kernel = include_str!("../../../shaders/lines/edge.wgsl");
                [
                    TRIANGLE,
                    PLANES,
                    STEEPNESS,
                    CONTOUR,
                    SEGMENT,
                    SEEN,
                    HIDDEN_LINES,
                    COPLANAR,
                    STROKE_WORDS,
                    LATTICE,
                    STROKE,
                    kernel,
                ]
                .concat()
            }
            Self::Coverage => {
                let kernel = include_str!("../../../shaders/lines/coverage.wgsl");
                [
                    OVER,
                    STROKE_WORDS,
                    SEEN,
                    INSET,
                    LATTICE,
                    FREE_POINTS,
                    PEEL_STATE,
                    TINTS,
                    STEEPNESS,
                    MIXED_PLACE,
                    kernel,
                ]
                .concat()
            }
            Self::Resolve => [OVER, ENCODE, include_str!("../../../shaders/resolve.wgsl")].concat(),
        }
    }

    /// The source of the kernels of stage mixed alone.
    fn mixed_source(self) -> String {
        let parts: &[&str] = match self {
            Self::Breaks => {
                &[HULL, MIXED_PLACE, LOOK, SEEN_FACES, include_str!("../../../shaders/mixed/find/breaks.wgsl")]
            }
            Self::Thin => {
                let kernel = include_str!("../../../shaders/mixed/find/thin.wgsl");
                &[HULL, CULLING, MIXED_PLACE, LOOK, SEEN_FACES, POINT_EDGES, kernel]
            }
            Self::MixedColor => {
                let kernel = include_str!("../../../shaders/mixed/mixed_color.wgsl");
                &[HULL, PLACE, SPREAD, MIXED_PLACE, MIXED_LATTICE, SHARES, SHARE_COLOR, kernel]
            }
            Self::MixedShade => {
                let kernel = include_str!("../../../shaders/mixed/mixed_shade.wgsl");
                &[HULL, PLACE, SPREAD, MIXED_PLACE, MIXED_LATTICE, SHARE_COLOR, kernel]
            }
            Self::MixedParts => {
                let kernel = include_str!("../../../shaders/mixed/mixed_parts.wgsl");
                return [MATERIAL, MIXED_PLACE, MIXED_LATTICE, SHARES, POINT_SETS, kernel].concat();
            }
            Self::MixedSum => return [MIXED_PLACE, include_str!("../../../shaders/mixed/mixed_sum.wgsl")].concat(),
            _ => {
                let kernel = include_str!("../../../shaders/mixed/find/mixed_pixels.wgsl");
                return [MIXED_PLACE, PEEL_STATE, kernel].concat();
            }
        };
        [&[TRIANGLE], SHADE, parts].concat().concat()
    }

    /// Bits of the key that the kernel reads: there is a pipeline for every combination in use.
    pub fn key_bits(self) -> u32 {
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
            | key::HULL_MATERIALS
            | key::WIRES_ONLY;
        match self {
            Self::Transform => key::GANG,
            Self::Clip => key::PASS_MASKS | key::PEELING,
            Self::Visibility { target: SampleTarget::Visibility, .. } => key::SAMPLES | key::PASS_MASKS | key::GANG,
            Self::Visibility { target: SampleTarget::Layer, .. } => {
                key::SAMPLES | key::PASS_MASKS | key::PEELING | key::BEHIND_SURFACE
            }
            Self::VisibilityTile { target: SampleTarget::Visibility, .. } => key::SAMPLES | key::GANG,
            Self::Visibility { target: SampleTarget::Points | SampleTarget::Lists, .. } => key::PASS_MASKS,
            Self::VisibilityTile { target: SampleTarget::Points | SampleTarget::Lists, .. } => 0,
            Self::Breaks => SHADED,
            Self::Thin => SHADED | key::PASS_MASKS,
            Self::MixedPixels => key::PEELING | key::SAMPLES,
            Self::MixedColor => SHADED | key::OCCLUSION | key::LINES,
            Self::MixedParts => key::LINES | key::CLIPPED | key::TRIANGLE_MATERIALS,
            Self::MixedShade => SHADED | key::OCCLUSION,
            Self::MixedSum => 0,
            Self::VisibilityFew { .. } => key::SAMPLES | key::PASS_MASKS | key::GANG,
            Self::Paint => SHADED | key::GANG,
            Self::VisibilityTile { target: SampleTarget::Layer, .. } => key::SAMPLES | key::BEHIND_SURFACE,
            Self::Composite => SHADED | key::PEELED_HULL | key::LINES | key::ADAPTIVE,
            Self::Grid | Self::Gather => key::SAMPLES | key::GANG,
            Self::Shade => SHADED | key::PEELING | key::OCCLUSION | key::GANG | key::ADAPTIVE,
            Self::LineLight => SHADED,
            Self::Coverage => key::HOLED | key::SURFACE | key::HULL | key::PEELING | key::SAMPLES | key::ADAPTIVE,
            Self::Holes => key::SAMPLES,
            Self::Tips => key::SAMPLES | key::PASS_MASKS,
            Self::Edge => key::HOLED | key::CONTOURS | key::CLIPPED | key::SAMPLES,
            Self::Resolve => key::SURFACE | key::HULL | key::LINES | key::GANG,
        }
    }

    /// Values of the kernel's `override` constants.
    pub fn constants(self, key: u32) -> Vec<(&'static str, f64)> {
        let key = ("PIPELINE_KEY", f64::from(key));
        match self {
            Self::Visibility { write, .. } | Self::VisibilityTile { write, .. } | Self::VisibilityFew { write } => {
                match write {
                    SampleWrite::Both => vec![key],
                    SampleWrite::Depth => vec![key, ("PHASE", 0.0)],
                    SampleWrite::Id => vec![key, ("PHASE", 1.0)],
                }
            }
            _ => vec![key],
        }
    }
}
