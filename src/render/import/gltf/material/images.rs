//! The textures of glTF materials, with their samplers and images. Images stay encoded here. An
//! image whose bytes cannot be found in the file or the upload is left out with a warning.

use crate::import::bundle::show_all;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::data::buffers;
use crate::import::gltf::data::buffers::Uri;
use crate::import::gltf::document::lists;
use crate::import::gltf::document::lists::{Lists, TextureInfo, Transform, entry};
use crate::import::{MeshError, MeshFault, Origin};
use crate::mesh::material::{ImageContent, ImageSource, TextureRef, Wrap};
use crate::warning::Warning;
use serde::Deserialize;
use serde_json::value::RawValue;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The images that drawn materials use, collected while they are read.
#[derive(Debug, Default)]
pub struct Images {
    /// In the order of their first use.
    pub sources: Vec<ImageSource>,
    /// Index into `sources` by the file's image index.
    known: BTreeMap<usize, u32>,
    /// Parsed entries by the file's indices. Materials may share them, and parsing each again could
    /// be quadratic.
    textures: BTreeMap<usize, lists::Texture>,
    samplers: BTreeMap<usize, lists::Sampler>,
    /// URIs of images that the upload lacks.
    missing: Vec<String>,
    /// Why images cannot be found in the file.
    broken: Vec<String>,
}

impl Images {
    /// The image and sampler of a texture. `what` names the material. None if the texture has no
    /// image.
    pub fn texture(
        &mut self,
        what: &str,
        info: &TextureInfo,
        lists: &Lists<'_>,
        reader: &mut Reader<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<Option<TextureRef>, MeshError> {
        let index = info.index.0;
        if index >= lists.textures.len() {
            return Err(MeshError::broken(format!(
                "{what} of the glTF file uses texture {index}, and there are {}",
                lists.textures.len()
            )));
        }
        cx.deadline.check()?;
        let texture: lists::Texture = once(&mut self.textures, "texture", &lists.textures, index, cx)?;
        let in_other = |other: &Option<lists::OtherSource>| other.as_ref().and_then(|other| other.source);
        // Basis Universal last: the other formats have lost less.
        let image = in_other(&texture.extensions.webp).or(texture.source).or(in_other(&texture.extensions.basisu));
        let Some(image) = image else {
            let detail = format!("texture {index} has no image that is read; it is drawn as if it were white");
            crate::import::gltf::warn_once(warnings, "texture_without_image", detail);
            return Ok(None);
        };
        let image = self.image(index, image.0, lists, reader, cx)?;
        let sampler = match texture.sampler {
            Some(sampler) => once(&mut self.samplers, "sampler", &lists.samplers, sampler.0, cx)?,
            None => lists::Sampler::default(),
        };
        Ok(Some(TextureRef {
            image,
            transform: info.extensions.transform.as_ref().map_or(TextureRef::IDENTITY, transform),
            wrap: [sampler.wrap_s, sampler.wrap_t].map(wrap),
            nearest: sampler.mag_filter == Some(GL_NEAREST),
            is_second_uvs: false,
        }))
    }

    fn image(
        &mut self,
        texture: usize,
        index: usize,
        lists: &Lists<'_>,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<u32, MeshError> {
        if let Some(&known) = self.known.get(&index) {
            return Ok(known);
        }
        if index >= lists.images.len() {
            return Err(MeshError::broken(format!(
                "texture {texture} of the glTF file uses image {index}, and there are {}",
                lists.images.len()
            )));
        }
        cx.deadline.check()?;
        let raw_bytes = lists.images[index].get().len() as u64;
        cx.budget.spend("a glTF image's description", raw_bytes, 1)?;
        let image: lists::Image = entry("image", &lists.images, index)?;
        let name = name(index, &image);
        let content = self.content(&name, index, &image, reader, cx)?;
        cx.budget.spend("images", 1, size_of::<ImageSource>() as u64 * 2 + 1024)?;
        let place = self.sources.len() as u32;
        self.sources.push(ImageSource { name, content });
        self.known.insert(index, place);
        Ok(place)
    }

    /// The bytes of an image, still encoded. Without them the model is drawn without the image.
    fn content(
        &mut self,
        name: &str,
        index: usize,
        image: &lists::Image,
        reader: &mut Reader<'_>,
        cx: &mut Context<'_>,
    ) -> Result<ImageContent, MeshError> {
        match encoded(name, index, image, reader, cx) {
            Ok(Some(bytes)) => Ok(ImageContent::Encoded(bytes)),
            Ok(None) => {
                self.missing.push(buffers::printable(image.uri.as_deref().unwrap_or_default()));
                Ok(ImageContent::Absent)
            }
            Err(error) if matches!(error.fault, MeshFault::Broken | MeshFault::OutsideBundle) => {
                self.broken.push(error.detail);
                Ok(ImageContent::Absent)
            }
            Err(error) => Err(error),
        }
    }

    /// Warnings of images that are not there.
    pub fn warnings(&self, origin: Origin) -> impl Iterator<Item = Warning> {
        let names = show_all(self.missing.iter().map(String::as_str));
        let missing = format!("{} {names}: add the files, or embed them, to see these textures", origin.lacks());
        let missing = (!self.missing.is_empty()).then_some(Warning { code: "textures_missing", detail: missing });
        let broken = self.broken.first().map(|first| {
            let detail = format!("{first}; it is drawn without (images: {})", self.broken.len());
            Warning { code: "textures_broken", detail }
        });
        missing.into_iter().chain(broken)
    }
}

/// An entry of a list, parsed on first use.
fn once<'a, T: Clone + Deserialize<'a>>(
    known: &mut BTreeMap<usize, T>,
    kind: &str,
    list: &[&'a RawValue],
    index: usize,
    cx: &mut Context<'_>,
) -> Result<T, MeshError> {
    if let Some(known) = known.get(&index) {
        return Ok(known.clone());
    }
    cx.budget.spend("the textures of the glTF file", 1, 2 * size_of::<T>() as u64 + 64)?;
    let parsed: T = entry(kind, list, index)?;
    known.insert(index, parsed.clone());
    Ok(parsed)
}

/// The bytes of an image, paid for; None if the upload lacks it.
fn encoded(
    name: &str,
    index: usize,
    image: &lists::Image,
    reader: &mut Reader<'_>,
    cx: &mut Context<'_>,
) -> Result<Option<Arc<[u8]>>, MeshError> {
    if let Some(view) = image.buffer_view {
        let view = reader.view(view.0, cx)?;
        cx.budget.spend("an image of the glTF file", view.bytes().len() as u64, 1)?;
        return Ok(Some(view.bytes().into()));
    }
    match &image.uri {
        Some(uri) => Ok(match buffers::from_uri(uri, &format!("image {index}"), cx)? {
            Uri::Bytes(bytes) => {
                cx.budget.spend("an image of the glTF file", bytes.len() as u64, 1)?;
                Some(bytes.into())
            }
            Uri::Outside(_) => None,
        }),
        None => Err(MeshError::broken(format!("{name} of the glTF file has neither a URI nor a buffer view"))),
    }
}

/// `image 3 ("wood.png")`
fn name(index: usize, image: &lists::Image) -> String {
    let file = image.uri.as_deref().filter(|uri| uri.get(..5).is_none_or(|head| !head.eq_ignore_ascii_case("data:")));
    let known = image.name.as_deref().filter(|name| !name.is_empty()).or(file).unwrap_or_default();
    match buffers::printable(known).as_str() {
        "" => format!("image {index}"),
        known => format!("image {index} (\"{known}\")"),
    }
}

const GL_NEAREST: f64 = 9728.0;
const GL_CLAMP_TO_EDGE: f64 = 33071.0;
const GL_MIRRORED_REPEAT: f64 = 33648.0;

fn wrap(mode: Option<f64>) -> Wrap {
    match mode {
        Some(GL_CLAMP_TO_EDGE) => Wrap::Clamp,
        Some(GL_MIRRORED_REPEAT) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// Scales, then rotates counter-clockwise as the image is seen (v runs down), then translates. The
/// extension's own example fixes the direction: a quarter turn and an offset of (0, 1) show the
/// lower left quadrant.
fn transform(json: &Transform) -> [[f32; 3]; 2] {
    // Large enough for any atlas, small enough that no product of two is infinite.
    let tame = |v: f64| v.clamp(-1e6, 1e6);
    let (sin, cos) = libm::sincos(json.rotation.unwrap_or(0.0));
    let [x, y] = json.offset.unwrap_or([0.0; 2]).map(tame);
    let [width, height] = json.scale.unwrap_or([1.0; 2]).map(tame);
    [[cos * width, sin * height, x], [-sin * width, cos * height, y]].map(|row| row.map(|v| v as f32))
}
