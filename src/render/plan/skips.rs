//! Skips: work that a plan leaves out because its scene does not need it. A skip changes no byte of
//! the picture, and can be turned off to show that.

use std::fmt;

/// Something that a plan leaves out, and why its scene does not need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skip {
    /// The kind of work.
    pub kind: SkipKind,
    /// The reason: "flat shading reads face normals".
    pub why: &'static str,
}

/// Kinds of work that a plan can leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SkipKind {
    /// Filling and shading a surface.
    Surface,
    /// Colours of a surface that only hides lines.
    Shading,
    /// Outlines around surfaces.
    Hull,
    /// Transparent layers and their blending.
    Peeling,
    /// A normal per triangle.
    FaceNormals,
    /// A normal per vertex.
    VertexNormals,
    /// Texture coordinates.
    Uvs,
    /// Vertex colours.
    VertexColors,
    /// Decoding textures.
    Textures,
    /// Levels of textures finer than the picture can show.
    FineTextureLevels,
    /// A material index per triangle.
    MaterialIndices,
    /// The edges, and which triangles are neighbours.
    Adjacency,
    /// Clipping at the near plane and the guard band.
    Clipping,
    /// Visibility samples beyond the picture.
    Margin,
    /// The light that hollows go without.
    Occlusion,
    /// Faces of a closed mesh that show their inside, where faces are looked for that hide an outline.
    UnseenFaces,
}

impl SkipKind {
    /// All kinds, in the order in which they are listed.
    pub const ALL: &'static [Self] = &[
        Self::Surface,
        Self::Shading,
        Self::Hull,
        Self::Peeling,
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
        Self::Occlusion,
        Self::UnseenFaces,
    ];
}

impl fmt::Display for SkipKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Surface => "surface",
            Self::Shading => "shading",
            Self::Hull => "hull",
            Self::Peeling => "transparent layers",
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
            Self::Occlusion => "occlusion",
            Self::UnseenFaces => "unseen faces of outlines",
        })
    }
}

/// The skips of one plan so far, and the kinds that must not be skipped.
#[derive(Debug)]
pub struct Skips<'k> {
    /// The skips so far.
    pub done: Vec<Skip>,
    keep: &'k [SkipKind],
}

impl<'k> Skips<'k> {
    /// No skips yet. Kinds in `keep` are never skipped.
    pub fn new(keep: &'k [SkipKind]) -> Self {
        Self { done: Vec::new(), keep }
    }

    /// True if `kind` is left out: the scene does not need it, and it need not be kept. If so, the
    /// skip is noted once.
    pub fn skip(&mut self, kind: SkipKind, is_unneeded: bool, why: &'static str) -> bool {
        let skips = is_unneeded && !self.keep.contains(&kind);
        let skip = Skip { kind, why };
        if skips && !self.done.contains(&skip) {
            self.done.push(skip);
        }
        skips
    }
}
