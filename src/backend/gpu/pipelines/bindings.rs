//! Which buffers each kernel binds.

use crate::backend::gpu::pipelines::Access;
use crate::backend::gpu::pipelines::Access::{Read, ReadWrite};
use crate::backend::gpu::pipelines::{Into, Slot, Stage};

/// A buffer of group 1, and what the kernel does with it.
pub type Binding = (Slot, Access);

impl Stage {
    /// The buffers of group 1 that the kernel declares.
    pub fn buffers(self) -> &'static [Binding] {
        match self {
            Self::Transform => TRANSFORM,
            Self::Visibility { into: Into::Surface, .. } => VISIBILITY,
            Self::Visibility { into: Into::Layer, .. } => VISIBILITY_OF_LAYER,
            Self::Clip => CLIP,
            Self::VisibilityTile { into: Into::Surface, .. } => TILE,
            Self::VisibilityTile { into: Into::Layer, .. } => TILE_OF_LAYER,
            Self::Layers => LAYERS,
            Self::Shade => SHADE,
            Self::Lines => LINES,
            Self::Ink => INK,
            Self::LineLight => LINE_LIGHT,
            Self::Resolve => RESOLVE,
        }
    }

    /// The buffer that is bound at a slot's number: a kernel that looks for a layer writes it where others write samples, and
    /// reads these where others find layers.
    pub fn bound_at(self, slot: Slot) -> Slot {
        match (self, slot) {
            (Self::Visibility { into: Into::Layer, .. } | Self::VisibilityTile { into: Into::Layer, .. }, slot) => {
                match slot {
                    Slot::Samples => Slot::Layer,
                    Slot::Layer => Slot::Samples,
                    slot => slot,
                }
            }
            _ => slot,
        }
    }
}

const TRANSFORM: &[Binding] = &[(Slot::Positions, Read), (Slot::Vertices, ReadWrite)];

const VISIBILITY: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::Roles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::Work, ReadWrite),
    (Slot::Rounds, Read),
];

const VISIBILITY_OF_LAYER: &[Binding] = &[
    (Slot::Triangles, Read),
    (Slot::Roles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, ReadWrite),
    (Slot::Work, ReadWrite),
    (Slot::Rounds, Read),
    (Slot::Layer, Read),
    (Slot::Layered, Read),
];

const CLIP: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Roles, Read),
    (Slot::Vertices, Read),
    (Slot::Work, ReadWrite),
    (Slot::Rounds, Read),
];

const TILE: &[Binding] = &[(Slot::Samples, ReadWrite), (Slot::Work, Read)];

const TILE_OF_LAYER: &[Binding] =
    &[(Slot::Samples, ReadWrite), (Slot::Work, Read), (Slot::Layer, Read), (Slot::Layered, Read)];

const LAYERS: &[Binding] = &[
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
    (Slot::Roles, Read),
    (Slot::HullLooks, Read),
    (Slot::Layer, Read),
    (Slot::Layered, ReadWrite),
    (Slot::Rounds, ReadWrite),
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
    (Slot::Roles, Read),
    (Slot::HullLooks, Read),
    (Slot::Layered, Read),
    (Slot::Uvs, Read),
    (Slot::VertexColors, Read),
    (Slot::Texels, Read),
    (Slot::Colors, ReadWrite),
];

const LINES: &[Binding] = &[
    (Slot::Positions, Read),
    (Slot::Triangles, Read),
    (Slot::Vertices, Read),
    (Slot::Samples, Read),
    (Slot::Edges, Read),
    (Slot::Owners, ReadWrite),
    (Slot::Strokes, ReadWrite),
    (Slot::Progress, ReadWrite),
];

const INK: &[Binding] = &[
    (Slot::Samples, Read),
    (Slot::Colors, ReadWrite),
    (Slot::Strokes, ReadWrite),
    (Slot::LineColors, Read),
    (Slot::Layered, Read),
    (Slot::Cells, Read),
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
