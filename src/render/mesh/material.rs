//! Materials of a file, with their textures and images, and the file's cameras.
//!
//! Images stay encoded here, so that a picture without textures costs no decoding.

use std::sync::Arc;

/// A material of the file. `None` and defaults mean that the file gives no value.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct MaterialSlot {
    /// The name in the file; empty where it gives none.
    pub name: String,
    /// Linear RGBA base colour, straight alpha.
    pub base_color: Option<[f32; 4]>,
    /// 0 to 1.
    pub metallic: Option<f32>,
    /// 0 to 1.
    pub roughness: Option<f32>,
    /// Emitted linear RGB, its strength included; may exceed 1.
    pub emissive: Option<[f32; 3]>,
    /// The meaning of the base colour's alpha.
    pub alpha: AlphaMode,
    /// True if the material is shown without light (KHR_materials_unlit).
    pub unlit: bool,
    /// sRGB colour and alpha, times `base_color`.
    pub base_texture: Option<TextureRef>,
    /// Roughness in green, metallic in blue, times the factors.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals: x right, y up in texture space, z out.
    pub normal_texture: Option<TextureRef>,
    /// A factor of the normal texture's x and y. None: 1.
    pub normal_scale: Option<f32>,
    /// sRGB colour, times `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// Ambient light in red: 1 all of it.
    pub occlusion_texture: Option<TextureRef>,
    /// The share of the occlusion texture's darkness that counts, 0 to 1. None: 1.
    pub occlusion_texture_strength: Option<f32>,
}

/// The meaning of alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum AlphaMode {
    /// Nothing: the surface is opaque.
    #[default]
    Opaque,
    /// A cutoff: the surface is absent where alpha is below it, and opaque elsewhere.
    Mask(f32),
    /// The share of the surface in the colour, over what lies behind it.
    Blend,
}

/// A use of an image by a material.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct TextureRef {
    /// Index into [`Mesh::images`](super::Mesh::images).
    pub image: u32,
    /// KHR_texture_transform, or the identity: `[u', v'] = [[a, b, c], [d, e, f]] (u, v, 1)`. (0,
    /// 0) is the upper left corner of the image, and v runs down.
    pub transform: [[f32; 3]; 2],
    /// Continuation of the image beyond 0 and 1, across and down.
    pub wrap: [Wrap; 2],
    /// True if the nearest texel is sampled, false for a blend of neighbours.
    pub nearest: bool,
    /// True if the place of the image follows the mesh's second set of texture coordinates.
    pub is_second_uvs: bool,
}

impl TextureRef {
    /// The transform that changes no coordinates.
    pub const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// A use without transform, repeated and filtered.
    pub fn new(image: u32) -> Self {
        Self { image, transform: Self::IDENTITY, wrap: [Wrap::Repeat; 2], nearest: false, is_second_uvs: false }
    }
}

/// Continuation of a texture beyond its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum Wrap {
    /// It starts again.
    #[default]
    Repeat,
    /// It is mirrored, back and forth.
    Mirror,
    /// Its last row or column continues.
    Clamp,
}

/// An image of the file, still encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct ImageSource {
    /// Its name in messages: `image 3 ("wood.png")`.
    pub name: String,
    /// Its bytes.
    pub content: ImageContent,
}

/// The bytes of an image, or why there are none.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub enum ImageContent {
    /// The bytes as the file has them, of any encoding.
    Encoded(Arc<[u8]>),
    /// The upload lacks the image. The model is drawn without it.
    Absent,
}

/// A camera of the file, in file space.
#[derive(Clone, Debug, PartialEq)]
pub struct FileCamera {
    /// The name in the file; empty where it gives none.
    pub name: String,
    /// Position.
    pub eye: [f64; 3],
    /// Right in the picture, up in the picture, and towards the viewer: unit vectors, right-handed.
    pub axes: [[f64; 3]; 3],
    /// The projection.
    pub lens: FileLens,
}

/// The projection of a file's camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FileLens {
    /// Perspective.
    Perspective {
        /// Vertical field of view, degrees.
        fov_deg: f64,
    },
    /// Orthographic.
    Orthographic {
        /// Height of the view, file units.
        height: f64,
    },
}
