//! Buffers that each kernel binds.

use crate::backend::gpu::pipelines::Access;
use crate::backend::gpu::pipelines::Access::{Read, ReadWrite};
use crate::backend::gpu::pipelines::{Kernel, SampleTarget, Slot};

/// A buffer of group 1 and the kernel's access to it.
pub type Binding = (Slot, Access);

impl Kernel {
    /// The buffers of group 1 that the kernel declares.
    pub fn buffers(self) -> &'static [Binding] {
        match self {
            Self::Transform => TRANSFORM,
            Self::Visibility { target: SampleTarget::Visibility, .. } => VISIBILITY,
            Self::Visibility { target: SampleTarget::Layer, .. } => VISIBILITY_OF_LAYER,
            Self::Visibility { target: SampleTarget::Points, .. } => VISIBILITY_OF_POINTS,
            Self::VisibilityTile { target: SampleTarget::Points, .. } => TILE_OF_POINTS,
            Self::Visibility { target: SampleTarget::Lists, .. } => VISIBILITY_OF_LISTS,
            Self::VisibilityTile { target: SampleTarget::Lists, .. } => TILE_OF_LISTS,
            Self::Breaks => BREAKS,
            Self::Thin => THIN,
            Self::MixedPixels => MIXED_PIXELS,
            Self::MixedColor => MIXED_COLOR,
            Self::MixedParts => MIXED_PARTS,
            Self::MixedShade => MIXED_SHADE,
            Self::MixedSum => MIXED_SUM,
            Self::Clip => CLIP,
            Self::VisibilityTile { target: SampleTarget::Visibility, .. } => TILE,
            Self::VisibilityTile { target: SampleTarget::Layer, .. } => TILE_OF_LAYER,
            Self::Grid => GRID,
            Self::Gather => GATHER,
            Self::VisibilityFew { .. } => FEW,
            Self::Composite => COMPOSITE,
            Self::Shade => SHADE,
            Self::Paint => PAINT,
            Self::Holes => HOLES,
            Self::Tips => TIPS,
            Self::Edge => EDGE,
            Self::Coverage => COVERAGE,
            Self::LineLight => LINE_LIGHT,
            Self::Resolve => RESOLVE,
        }
    }

    /// The buffer that is bound at a slot's number. Kernels that find a peeled layer write it where
    /// others write the visibility buffer, and read that where others read the layer. Those that find what points see
    /// write that there, too.
    pub fn bound_at(self, slot: Slot) -> Slot {
        match (self, slot) {
            (
                Self::Visibility { target: SampleTarget::Layer, .. }
                | Self::VisibilityTile { target: SampleTarget::Layer, .. },
                slot,
            ) => match slot {
                Slot::Samples => Slot::PeelLayer,
                Slot::PeelLayer => Slot::Samples,
                slot => slot,
            },
            (
                Self::Visibility { target: SampleTarget::Points, .. }
                | Self::VisibilityTile { target: SampleTarget::Points, .. },
                Slot::Samples,
            ) => Slot::Points,
            _ => slot,
        }
    }
}

const TRANSFORM: &[Binding] =
    &[(Slot::Positions, Read), (Slot::Vertices, ReadWrite), (Slot::Samples, ReadWrite), (Slot::Work, ReadWrite)];

const VISIBILITY: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::Work, ReadWrite),
    (Slot::PeelRounds, Read),
];

const VISIBILITY_OF_LAYER: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::Work, ReadWrite),
    (Slot::PeelRounds, Read),
    (Slot::PeelLayer, Read),
    (Slot::PeelState, Read),
];

const VISIBILITY_OF_POINTS: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::Work, ReadWrite),
    (Slot::PeelRounds, Read),
    (Slot::Mixed, Read),
];

const VISIBILITY_OF_LISTS: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Work, ReadWrite),
    (Slot::PeelRounds, Read),
    (Slot::Mixed, ReadWrite),
    (Slot::Lists, ReadWrite),
];

const CLIP: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Work, ReadWrite),
    (Slot::PeelRounds, Read),
];

const TILE: &[Binding] = &[(Slot::Samples, ReadWrite), (Slot::Work, Read)];

const FEW: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::PeelRounds, Read),
];

const TILE_OF_LAYER: &[Binding] =
    &[(Slot::Samples, ReadWrite), (Slot::Work, Read), (Slot::PeelLayer, Read), (Slot::PeelState, Read)];

const TILE_OF_POINTS: &[Binding] = &[(Slot::Samples, ReadWrite), (Slot::Work, Read), (Slot::Mixed, Read)];

const TILE_OF_LISTS: &[Binding] = &[(Slot::Work, Read), (Slot::Mixed, ReadWrite), (Slot::Lists, ReadWrite)];

const BREAKS: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::HullMaterials, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Mixed, ReadWrite),
];

const THIN: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::PassMasks, Read),
    (Slot::HullMaterials, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Mixed, ReadWrite),
];

const MIXED_PIXELS: &[Binding] = &[(Slot::Mixed, ReadWrite), (Slot::PeelState, Read)];

const MIXED_COLOR: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::HullMaterials, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Occlusion, Read),
    (Slot::Colors, ReadWrite),
    (Slot::Mixed, ReadWrite),
    (Slot::Points, ReadWrite),
];

const MIXED_PARTS: &[Binding] =
    &[(Slot::Attributes, Read), (Slot::Materials, Read), (Slot::Mixed, ReadWrite), (Slot::Lists, ReadWrite)];

const MIXED_SHADE: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::HullMaterials, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Occlusion, Read),
    (Slot::Mixed, Read),
    (Slot::Lists, ReadWrite),
];

const MIXED_SUM: &[Binding] = &[(Slot::Colors, ReadWrite), (Slot::Mixed, Read), (Slot::Lists, Read)];

const GRID: &[Binding] = &[(Slot::Samples, Read), (Slot::Occlusion, ReadWrite)];

const GATHER: &[Binding] = &[(Slot::Occlusion, ReadWrite)];

const COMPOSITE: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::PassMasks, Read),
    (Slot::HullMaterials, Read),
    (Slot::PeelLayer, Read),
    (Slot::PeelState, ReadWrite),
    (Slot::PeelRounds, ReadWrite),
    (Slot::Colors, ReadWrite),
];

const SHADE: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::PassMasks, Read),
    (Slot::HullMaterials, Read),
    (Slot::PeelState, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Occlusion, Read),
    (Slot::Colors, ReadWrite),
];

const PAINT: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::PassMasks, Read),
    (Slot::HullMaterials, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Thresholds, Read),
    (Slot::Rgba, ReadWrite),
];

const HOLES: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Owners, ReadWrite),
    (Slot::Strokes, ReadWrite),
];

const TIPS: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::PassMasks, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Strokes, ReadWrite),
];

const EDGE: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Edges, Read),
    (Slot::Owners, ReadWrite),
    (Slot::Strokes, ReadWrite),
    (Slot::Progress, ReadWrite),
];

const COVERAGE: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Colors, ReadWrite),
    (Slot::Owners, ReadWrite),
    (Slot::Strokes, ReadWrite),
    (Slot::LineColors, Read),
    (Slot::PeelState, Read),
    (Slot::SampleMasks, Read),
    (Slot::Mixed, Read),
];

const LINE_LIGHT: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Normals, Read),
    (Slot::CornerTriangles, Read),
    (Slot::Attributes, Read),
    (Slot::Materials, Read),
    (Slot::FaceNormals, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Colors, ReadWrite),
    (Slot::Owners, ReadWrite),
];

const RESOLVE: &[Binding] = &[(Slot::Colors, Read), (Slot::Thresholds, Read), (Slot::Rgba, ReadWrite)];
