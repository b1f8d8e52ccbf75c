//! What a scene does not need. Each skip changes no byte of the picture, and can be turned off to show that.

use std::fmt;

/// Something that was left out, and why this scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skip {
    /// What.
    pub kind: SkipKind,
    /// Why: "flat shading reads face normals".
    pub why: &'static str,
}

/// What can be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkipKind {
    /// Filling and shading a surface.
    Surface,
    /// Colours of a surface that only hides lines.
    Shading,
    /// Outlines around surfaces.
    Hull,
    /// Transparent layers and their blending.
    Layers,
    /// A normal a triangle.
    FaceNormals,
    /// A normal a vertex.
    VertexNormals,
    /// Texture coordinates.
    Uvs,
    /// Vertex colours.
    VertexColors,
    /// Decoding textures.
    Textures,
    /// Levels of textures finer than the picture can show.
    FineTextureLevels,
    /// A material index a triangle.
    MaterialIndices,
    /// Which triangles are neighbours.
    Adjacency,
    /// Clipping at the near plane and the guard band.
    Clipping,
    /// Visibility samples beyond the picture.
    Margin,
}

impl SkipKind {
    /// All of them.
    pub const ALL: &'static [Self] = &[
        Self::Surface,
        Self::Shading,
        Self::Hull,
        Self::Layers,
        Self::FaceNormals,
        Self::VertexNormals,
        Self::Uvs,
        Self::VertexColors,
        Self::Textures,
        Self::FineTextureLevels,
        Self::MaterialIndices,
        Self::Adjacency,
        Self::Clipping,
        Self::Margin,
    ];
}

impl fmt::Display for SkipKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Surface => "surface",
            Self::Shading => "shading",
            Self::Hull => "hull",
            Self::Layers => "transparent layers",
            Self::FaceNormals => "face normals",
            Self::VertexNormals => "vertex normals",
            Self::Uvs => "texture coordinates",
            Self::VertexColors => "vertex colours",
            Self::Textures => "textures",
            Self::FineTextureLevels => "fine texture levels",
            Self::MaterialIndices => "material indices",
            Self::Adjacency => "adjacency",
            Self::Clipping => "clipping",
            Self::Margin => "samples beyond the picture",
        })
    }
}

/// The skips of one plan: what was left out so far, and what must not be.
#[derive(Debug)]
pub struct Skips<'k> {
    /// What was left out.
    pub done: Vec<Skip>,
    keep: &'k [SkipKind],
}

impl<'k> Skips<'k> {
    /// None so far; those in `keep` never.
    pub fn new(keep: &'k [SkipKind]) -> Self {
        Self { done: Vec::new(), keep }
    }

    /// Whether `kind` can be left out, where the scene does not need it; noted if so.
    pub fn skip(&mut self, kind: SkipKind, is_unneeded: bool, why: &'static str) -> bool {
        let skips = is_unneeded && !self.keep.contains(&kind);
        if skips {
            self.done.push(Skip { kind, why });
        }
        skips
    }
}
