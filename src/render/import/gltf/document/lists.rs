//! The parts of a glTF document that are parsed lazily: materials, textures, samplers, images,
//! cameras and animations. An entry is parsed on first use, so that an odd value in an unused
//! material is no error.

use crate::import::{MeshError, text};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::value::RawValue;
use std::collections::BTreeMap;

/// The document's lists, with unparsed entries.
#[derive(Debug, Default)]
pub struct Lists<'a> {
    /// `materials`
    pub materials: Vec<&'a RawValue>,
    /// `textures`
    pub textures: Vec<&'a RawValue>,
    /// `samplers`
    pub samplers: Vec<&'a RawValue>,
    /// `images`
    pub images: Vec<&'a RawValue>,
    /// `cameras`
    pub cameras: Vec<&'a RawValue>,
    /// `animations`
    pub animations: Vec<&'a RawValue>,
}

impl<'a> Lists<'a> {
    /// Splits a document whose parsing was paid for before. A value that is no list counts as an
    /// empty list, so that only its use is an error.
    pub fn of(json: &'a [u8]) -> Result<Self, MeshError> {
        #[derive(Default, Deserialize)]
        #[serde(default)]
        struct Raw<'a> {
            #[serde(borrow)]
            materials: Option<&'a RawValue>,
            #[serde(borrow)]
            textures: Option<&'a RawValue>,
            #[serde(borrow)]
            samplers: Option<&'a RawValue>,
            #[serde(borrow)]
            images: Option<&'a RawValue>,
            #[serde(borrow)]
            cameras: Option<&'a RawValue>,
            #[serde(borrow)]
            animations: Option<&'a RawValue>,
        }
        let raw: Raw<'a> =
            serde_json::from_slice(text::trim_start(json)).map_err(crate::import::gltf::document::unread)?;
        let list = |raw: Option<&'a RawValue>| -> Vec<&'a RawValue> {
            raw.and_then(|raw| serde_json::from_str(raw.get()).ok()).unwrap_or_default()
        };
        Ok(Self {
            materials: list(raw.materials),
            textures: list(raw.textures),
            samplers: list(raw.samplers),
            images: list(raw.images),
            cameras: list(raw.cameras),
            animations: list(raw.animations),
        })
    }
}

/// Parses entry `index` of a list; `kind` names it: "material".
pub fn entry<'a, T: Deserialize<'a>>(kind: &str, list: &[&'a RawValue], index: usize) -> Result<T, MeshError> {
    let raw =
        list.get(index).ok_or_else(|| MeshError::broken(format!("there is no {kind} {index} in the glTF file")))?;
    serde_json::from_str(raw.get()).map_err(|error| {
        MeshError::broken(format!("{kind} {index} of the glTF file cannot be read: {}", text::foreign(error)))
    })
}

/// An index. `1.0` is a valid integer in JSON.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(try_from = "f64")]
pub struct Index(pub usize);

impl TryFrom<f64> for Index {
    type Error = &'static str;

    fn try_from(v: f64) -> Result<Self, Self::Error> {
        let index = v as usize;
        if index as f64 == v && v < 4294967296.0 { Ok(Self(index)) } else { Err("an index must be a whole number") }
    }
}

/// Extensions by name.
pub type Extensions<'a> = BTreeMap<String, &'a RawValue>;

/// `material`
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Material<'a> {
    pub name: Option<String>,
    pub pbr_metallic_roughness: Option<Pbr>,
    pub normal_texture: Option<TextureInfo>,
    pub occlusion_texture: Option<TextureInfo>,
    pub emissive_texture: Option<TextureInfo>,
    pub emissive_factor: Option<[f64; 3]>,
    pub alpha_mode: Option<String>,
    pub alpha_cutoff: Option<f64>,
    #[serde(borrow)]
    pub extensions: Extensions<'a>,
}

/// `material.pbrMetallicRoughness`
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Pbr {
    pub base_color_factor: Option<[f64; 4]>,
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: Option<f64>,
    pub roughness_factor: Option<f64>,
    pub metallic_roughness_texture: Option<TextureInfo>,
}

/// `KHR_materials_pbrSpecularGlossiness`: the fields that can stand in for [`Pbr`].
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct SpecularGlossiness {
    pub diffuse_factor: Option<[f64; 4]>,
    pub diffuse_texture: Option<TextureInfo>,
    pub glossiness_factor: Option<f64>,
    pub specular_glossiness_texture: Option<IgnoredAny>,
}

/// `KHR_materials_emissive_strength`
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct EmissiveStrength {
    pub emissive_strength: Option<f64>,
}

/// `textureInfo`, a normal texture's `scale` included.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureInfo {
    pub index: Index,
    pub tex_coord: Option<Index>,
    pub scale: Option<f64>,
    pub strength: Option<f64>,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

/// Extensions of `textureInfo`.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<Transform>,
}

/// `KHR_texture_transform`
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Transform {
    pub offset: Option<[f64; 2]>,
    pub rotation: Option<f64>,
    pub scale: Option<[f64; 2]>,
    pub tex_coord: Option<Index>,
}

/// `texture`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Texture {
    pub source: Option<Index>,
    pub sampler: Option<Index>,
    pub extensions: TextureExtensions,
}

/// Extensions of `texture`: images in other formats.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct TextureExtensions {
    #[serde(rename = "EXT_texture_webp")]
    pub webp: Option<OtherSource>,
    #[serde(rename = "KHR_texture_basisu")]
    pub basisu: Option<OtherSource>,
}

/// An image in another format.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct OtherSource {
    pub source: Option<Index>,
}

/// `sampler`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Sampler {
    pub mag_filter: Option<f64>,
    pub wrap_s: Option<f64>,
    pub wrap_t: Option<f64>,
}

/// `image`
#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub struct Image {
    pub name: Option<String>,
    pub uri: Option<String>,
    pub buffer_view: Option<Index>,
}

/// `camera`
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub struct Camera {
    pub name: Option<String>,
    pub perspective: Option<Perspective>,
    pub orthographic: Option<Orthographic>,
}

/// `camera.perspective`
#[derive(Debug, Deserialize)]
pub struct Perspective {
    pub yfov: f64,
}

/// `camera.orthographic`
#[derive(Debug, Deserialize)]
pub struct Orthographic {
    pub ymag: f64,
}
