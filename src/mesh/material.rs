//! What a file says about its surfaces: factors, textures, the images they come from, and its cameras.
//!
//! Images stay encoded here. Whoever samples one decodes it, so that a texture that no picture shows costs nothing.

use std::sync::Arc;

/// A material as the file has it. `None` and the default mean that the file does not say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialSlot {
    /// The asset's own name; empty where it gives none.
    pub name: String,
    /// Linear RGBA base colour, straight alpha.
    pub base_color: Option<[f32; 4]>,
    /// 0 to 1.
    pub metallic: Option<f32>,
    /// 0 to 1.
    pub roughness: Option<f32>,
    /// Linear RGB that the surface gives off, its strength included; may be above 1.
    pub emissive: Option<[f32; 3]>,
    /// What the base colour's alpha means.
    pub alpha: AlphaMode,
    /// Shown without light (KHR_materials_unlit).
    pub unlit: bool,
    /// sRGB colour and alpha, times `base_color`.
    pub base_texture: Option<TextureRef>,
    /// Roughness in green, metallic in blue, times the factors.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals: x right, y up in texture space, z out.
    pub normal_texture: Option<TextureRef>,
    /// Multiplies the normal texture's x and y; None: 1.
    pub normal_scale: Option<f32>,
    /// sRGB colour, times `emissive`.
    pub emissive_texture: Option<TextureRef>,
}

/// What alpha means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// Below this the surface is not there, from it on it is opaque.
    Mask(f32),
    /// Share of the surface over what is behind it.
    Blend,
}

/// A use of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Mesh::images`](super::Mesh::images).
    pub image: u32,
    /// `[u', v'] = [[a, b, c], [d, e, f]] (u, v, 1)`: KHR_texture_transform, or the identity. (0, 0) is the upper left
    /// corner of the image, v runs down.
    pub transform: [[f32; 3]; 2],
    /// What lies beyond 0 and 1, across and down.
    pub wrap: [Wrap; 2],
    /// Whether a texel is shown as a square instead of blending into its neighbours.
    pub nearest: bool,
}

impl TextureRef {
    /// No change of coordinates.
    pub const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// The image as it is, repeated, smoothed.
    pub fn new(image: u32) -> Self {
        Self { image, transform: Self::IDENTITY, wrap: [Wrap::Repeat; 2], nearest: false }
    }
}

/// How a texture goes on beyond its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// From the start.
    #[default]
    Repeat,
    /// Back and forth.
    Mirror,
    /// With its last row or column.
    Clamp,
}

/// An image of the file, still encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageSource {
    /// How to speak of it: `image 3 ("wood.png")`.
    pub name: String,
    /// Its bytes.
    pub content: ImageContent,
}

/// Where an image's bytes are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImageContent {
    /// Here: PNG, JPEG or WebP, unless the file lies.
    Encoded(Arc<[u8]>),
    /// Not in the upload, and the format says that the model is incomplete without: an error for whoever samples it. Holds
    /// the sentence.
    Missing(String),
    /// Not in the upload, and by the format's custom the model is shown without it.
    Absent,
}

/// A camera of the file, in file space.
#[derive(Clone, Debug, PartialEq)]
pub struct FileCamera {
    /// The asset's own name; empty where it gives none.
    pub name: String,
    /// Position.
    pub eye: [f64; 3],
    /// Picture right, picture up and towards the viewer: unit vectors, right-handed.
    pub axes: [[f64; 3]; 3],
    /// How it projects.
    pub lens: FileLens,
}

/// A camera's projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileLens {
    /// Vertical field of view, degrees.
    Perspective {
        /// As above.
        fov_deg: f64,
    },
    /// Height of the view, file units.
    Orthographic {
        /// As above.
        height: f64,
    },
}
