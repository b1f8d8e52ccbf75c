//! The surface of a plan: what a back-end reads to colour a visible point of a filled face or of a
//! barycentric wire. These are materials, textures, lamps, and values of triangles and of their
//! corners, such as normals. The layout of materials and the bits of their flags, which shaders read,
//! are defined here.

pub(crate) mod adaptive;
pub(crate) mod build;
pub(crate) mod closeup;
pub(crate) mod edge_masks;
pub(crate) mod lights;
pub(crate) mod materials;
pub(crate) mod occlusion;
pub(crate) mod textures;

pub use build::surface_pass;
use std::borrow::Cow;
use std::sync::Arc;

use super::Faces;
use super::shared_slice::SharedSlice;
use crate::texture::Textures;

/// The filled surface. Arrays that no material reads may be empty.
#[derive(Debug)]
pub struct SurfacePass<'a> {
    /// The faces that are drawn.
    pub faces: Faces,
    /// True if the surface is visible. An invisible one only hides lines.
    pub is_shaded: bool,
    /// The materials; at least one.
    pub materials: Vec<ShadedMaterial>,
    /// An index into `materials` per triangle; empty where there is one material.
    pub triangle_materials: SharedSlice<'a, u32>,
    /// A unit normal per triangle.
    pub face_normals: SharedSlice<'a, [f32; 3]>,
    /// Unit normals, interpolated between corners.
    pub vertex_normals: Option<CornerValues<'a, [f32; 3]>>,
    /// Texture coordinates.
    pub uvs: Option<CornerValues<'a, [f32; 2]>>,
    /// The second set of them, with the indices of the first; as many, or none.
    pub second_uvs: SharedSlice<'a, [f32; 2]>,
    /// Linear RGBA vertex colours, straight alpha.
    pub colors: Option<CornerValues<'a, [f32; 4]>>,
    /// The edges of each triangle that barycentric wires follow (bit i: corner i to i + 1); empty
    /// where wires follow all edges.
    pub edge_masks: Cow<'a, [u8]>,
    /// The textures that materials sample.
    pub textures: Arc<Textures>,
    /// The lamps and the ambient light.
    pub lights: Lights,
}

/// Values of triangle corners, with their own index.
#[derive(Clone, Debug)]
pub struct CornerValues<'a, T> {
    /// The values.
    pub values: SharedSlice<'a, T>,
    /// Three indices into `values` per triangle.
    pub triangles: SharedSlice<'a, [u32; 3]>,
}

/// A material as the shaders read it, field for field.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ShadedMaterial {
    /// Linear RGBA, straight alpha.
    pub base_color: [f32; 4],
    /// Emitted light, linear RGB.
    pub emissive: [f32; 3],
    /// For [`flags::MASK`]: the smallest alpha that is drawn.
    pub alpha_cutoff: f32,
    /// Colour of a barycentric wire: premultiplied linear RGBA, opacity included.
    pub wire_color: [f32; 4],
    /// Thickness of a barycentric wire: t in the formulas.
    pub wire_thickness: f32,
    /// Smoothing of a barycentric wire: s in the formulas.
    pub wire_smoothing: f32,
    /// Metallic share, 0 to 1.
    pub metallic: f32,
    /// Roughness, 0 to 1.
    pub roughness: f32,
    /// Factor of the normal texture's x and y.
    pub normal_scale: f32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Factor of the final alpha, 0 to 1.
    pub opacity: f32,
    /// For [`flags::BY_ANGLE`]: the share of alpha that is left where the surface faces the viewer.
    pub facing_opacity: f32,
    /// The share of the occlusion texture's darkness that counts, 0 to 1.
    pub occlusion_texture_strength: f32,
    /// Always 0.
    pub padding_a: u32,
    /// Always 0.
    pub padding_b: u32,
    /// Always 0.
    pub padding_c: u32,
    /// Uses of textures, by [`slots`]: [`slots::COUNT`] of them.
    pub textures: [TextureUse; 5],
}

/// A material's use of a texture.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct TextureUse {
    /// The texture transform: `[u', v'] = [[a, b, c], [d, e, f]] (u, v, 1)`.
    pub transform: [[f32; 3]; 2],
    /// Index into [`Textures::images`], or [`TEXTURE_NONE`].
    pub texture: u32,
    /// Bits of [`samplers`].
    pub sampler: u32,
}

/// The index of no texture.
pub const TEXTURE_NONE: u32 = u32::MAX;

/// Places in [`ShadedMaterial::textures`].
pub mod slots {
    /// Base colour and alpha.
    pub const BASE: usize = 0;
    /// Roughness in green, metallic in blue.
    pub const METALLIC_ROUGHNESS: usize = 1;
    /// Tangent-space normal.
    pub const NORMAL: usize = 2;
    /// Emitted light.
    pub const EMISSIVE: usize = 3;
    /// The occlusion texture: the share of ambient light that is left, in red.
    pub const OCCLUSION_TEXTURE: usize = 4;
    /// Number of places.
    pub const COUNT: usize = 5;
}

/// Bits of [`TextureUse::sampler`]: the wrap mode across in the lowest bits, the wrap mode down
/// from bit [`samplers::DOWN_SHIFT`] on.
pub mod samplers {
    /// Bits of a wrap mode.
    pub const WRAP_BITS: u32 = 3;
    /// Lowest bit of the wrap mode down.
    pub const DOWN_SHIFT: u32 = 2;
    /// Wrap mode: the image repeats.
    pub const REPEAT: u32 = 0;
    /// Wrap mode: every second copy is mirrored.
    pub const MIRROR: u32 = 1;
    /// Wrap mode: the border's texels go on.
    pub const CLAMP: u32 = 2;
    /// The nearest texel, unfiltered.
    pub const NEAREST: u32 = 16;
    /// The second set of texture coordinates.
    pub const SECOND_UVS: u32 = 32;
    /// In place of alpha, texels say how much of a pixel is drawn: see [`mips`](crate::texture::mips::fill).
    pub const CUT_OUT: u32 = 64;
    /// Plain trilinear filtering: one lookup per pixel, in the level of its longer step. For the benchmark; no request
    /// asks for it.
    pub const TRILINEAR: u32 = 128;
    /// Places along the longer axis of a pixel's footprint that are looked at, at most.
    pub const TAPS_MAX: u32 = 8;

    /// The same for a texture of a slot: several where its colours are seen, one where they only change the light.
    #[inline(always)]
    pub fn taps_max(slot: usize) -> u32 {
        if matches!(slot, super::slots::BASE | super::slots::EMISSIVE) { TAPS_MAX } else { 1 }
    }
}

/// Values of the debug view in [`ShadedMaterial::flags`]; 0 for none.
pub mod debug_views {
    /// Barycentric coordinates.
    pub const BARYCENTRIC: u32 = 1;
    /// The smallest barycentric coordinate.
    pub const MIN_BARYCENTRIC: u32 = 2;
    /// Distance to the nearest drawn edge.
    pub const EDGE_DISTANCE: u32 = 3;
    /// The normal in view axes.
    pub const NORMAL: u32 = 4;
    /// Texture coordinates.
    pub const UV: u32 = 5;
    /// Front or back.
    pub const FACE_ORIENTATION: u32 = 6;
    /// Vertex colours.
    pub const VERTEX_COLOR: u32 = 7;
}

/// Bits of [`ShadedMaterial::flags`].
pub mod flags {
    /// Filled. Without this bit only wires show.
    pub const FILL: u32 = 1;
    /// Lit by a normal per triangle. Without this and the next two bits: unlit.
    pub const FACE_NORMALS: u32 = 2;
    /// Lit by the cross product of screen-space derivatives of the position.
    pub const DERIVATIVE_NORMALS: u32 = 4;
    /// Lit by interpolated vertex normals.
    pub const VERTEX_NORMALS: u32 = 8;
    /// All kinds of normals: lit.
    pub const LIT: u32 = FACE_NORMALS | DERIVATIVE_NORMALS | VERTEX_NORMALS;
    /// Vertex colours multiply the base colour.
    pub const VERTEX_COLORS: u32 = 16;
    /// Alpha is 0 below the cutoff and 1 from it on.
    pub const MASK: u32 = 32;
    /// Alpha is used as it is. Without this and `MASK` it is 1. The opacity multiplies either.
    pub const BLEND: u32 = 64;
    /// A wire where any `b < 0.02 t`.
    pub const WIRE_THRESHOLD: u32 = 128;
    /// A wire by `smoothstep(0, 0.1 t, min b)`.
    pub const WIRE_BARYCENTRIC: u32 = 256;
    /// A wire by fwidth of the smallest coordinate.
    pub const WIRE_FWIDTH_MIN: u32 = 512;
    /// A wire by fwidth of each coordinate.
    pub const WIRE_FWIDTH: u32 = 1024;
    /// The wire is mixed into the base colour before lighting.
    pub const WIRE_LIT: u32 = 2048;
    /// All four kinds of wire.
    pub const WIRES: u32 = WIRE_THRESHOLD | WIRE_BARYCENTRIC | WIRE_FWIDTH_MIN | WIRE_FWIDTH;
    /// The debug view, one of [`debug_views`](super::debug_views), is in three bits from here on.
    pub const DEBUG_SHIFT: u32 = 12;
    /// All bits of the debug view.
    pub const DEBUG: u32 = 7 << DEBUG_SHIFT;
    /// The request gives the metallic share, and the texture's is ignored.
    pub const OWN_METALLIC: u32 = 1 << 15;
    /// The request gives the roughness, and the texture's is ignored.
    pub const OWN_ROUGHNESS: u32 = 1 << 16;
    /// Alpha depends on the angle to the viewer. An unlit material has vertex normals for it.
    pub const BY_ANGLE: u32 = 1 << 17;
}

/// Lamps infinitely far away, and light from everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    /// The lamps, at most [`Lights::LAMPS_MAX`].
    pub lamps: Vec<Lamp>,
    /// Share of light that comes from everywhere, 0 to 1. It is brighter from above than from
    /// below.
    pub ambient: f32,
}

impl Lights {
    /// Lamps that the shaders have room for.
    pub const LAMPS_MAX: usize = 3;
}

/// A lamp. Unit vectors in unit-box axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Direction towards the lamp.
    pub to_light: [f32; 3],
    /// Direction halfway between the lamp and the viewer: the normal with the strongest highlight.
    pub halfway: [f32; 3],
    /// Brightness, multiplied by the share of light that is not ambient.
    pub strength: f32,
}

impl TextureUse {
    /// No texture.
    pub const NONE: Self = Self { transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], texture: TEXTURE_NONE, sampler: 0 };
}

impl ShadedMaterial {
    /// An unlit fill of one colour.
    pub fn unlit(base_color: [f32; 4]) -> Self {
        Self {
            base_color,
            emissive: [0.0; 3],
            alpha_cutoff: 0.0,
            wire_color: [0.0; 4],
            wire_thickness: 0.0,
            wire_smoothing: 0.0,
            metallic: 0.0,
            roughness: 1.0,
            normal_scale: 1.0,
            flags: flags::FILL,
            opacity: 1.0,
            facing_opacity: 1.0,
            occlusion_texture_strength: 1.0,
            padding_a: 0,
            padding_b: 0,
            padding_c: 0,
            textures: [TextureUse::NONE; slots::COUNT],
        }
    }
}

/// Metals below this roughness mirror sharply: the lobe is narrow beside the windows that they mirror.
pub const MIRROR_ROUGHNESS: f32 = 0.5;

impl ShadedMaterial {
    /// True if a metal may mirror so sharply that its light changes much with its normal.
    #[inline(always)]
    pub fn mirrors_sharply(&self) -> bool {
        let may_be_smooth =
            self.roughness < MIRROR_ROUGHNESS || self.textures[slots::METALLIC_ROUGHNESS].texture != TEXTURE_NONE;
        self.metallic > 0.0 && may_be_smooth
    }

    /// True if adaptive samples shade it in each quarter of a pixel, because it mirrors sharply with normals that change
    /// within a face.
    #[inline(always)]
    pub fn is_quartered(&self) -> bool {
        self.flags & flags::VERTEX_NORMALS != 0 && self.mirrors_sharply()
    }
}

impl<'a> SurfacePass<'a> {
    /// A surface of one material or several, without arrays, textures and lamps.
    pub fn new(faces: Faces, materials: Vec<ShadedMaterial>) -> Self {
        Self {
            faces,
            is_shaded: true,
            materials,
            triangle_materials: SharedSlice::default(),
            face_normals: SharedSlice::default(),
            vertex_normals: None,
            uvs: None,
            second_uvs: SharedSlice::default(),
            colors: None,
            edge_masks: Cow::Borrowed(&[]),
            textures: Arc::default(),
            lights: Lights::default(),
        }
    }

    /// The material of a triangle.
    #[inline(always)]
    pub fn material(&self, triangle: usize) -> &ShadedMaterial {
        let index = self.triangle_materials.get(triangle).map_or(0, |&m| m as usize);
        &self.materials[index.min(self.materials.len() - 1)]
    }

    /// The flags of all materials together: the union of what shading needs.
    pub fn all_flags(&self) -> u32 {
        self.materials.iter().fold(0, |all, material| all | material.flags)
    }

    /// True if any material samples the texture in this slot.
    pub fn samples(&self, slot: usize) -> bool {
        self.materials.iter().any(|material| material.textures[slot].texture != TEXTURE_NONE)
    }
}
