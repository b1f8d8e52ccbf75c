//! Materials and textures of an FBX scene. An image is embedded in the file, or else found among
//! the files of the upload: by its path, or by the last part of the path alone, because most paths
//! are those of the author's computer.
//!
//! A missing file is a warning that says what to add, never an error: the shape is complete without
//! it.

use super::geometry::Used;
use crate::import::bundle::show_all;
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::import::{MeshError, Origin, text};
use crate::mesh::MaterialSlot;
use crate::mesh::material::{AlphaMode, ImageContent, ImageSource, TextureRef, Wrap};
use crate::srgb::srgb_to_linear;
use crate::warning::Warning;
use rapidhash::RapidHashMap;
use ufbx::{Material, MaterialMap, Scene, Texture, WrapMode};

/// Longest file name in bytes. No file of a bundle has a longer path.
const NAME_BYTES_MAX: usize = 1024;
/// Entries of texture transforms are rounded to this step, because sines differ between machines.
const STEPS: f64 = 65_536.0;

/// Gives `raw` its materials and images.
pub fn read(scene: &Scene, used: &Used, raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
    let bytes = size_of::<MaterialSlot>() as u64 + 64;
    cx.budget.spend("materials", used.materials.len() as u64, bytes)?;
    let mut reader = Reader::default();
    for number in &used.materials {
        cx.deadline.check()?;
        let material = number.and_then(|number| scene.materials.get(number as usize));
        let slot = match material {
            Some(material) => reader.slot(material, cx)?,
            // Vertex colours are final: white takes the place of the grey of files without colours.
            None => MaterialSlot {
                base_color: if raw.colors.is_empty() { None } else { Some([1.0; 4]) },
                ..MaterialSlot::default()
            },
        };
        raw.materials.push(slot);
    }
    raw.report.warnings.extend(reader.warnings(cx.bundle.origin()));
    raw.images = reader.images;
    Ok(())
}

#[derive(Default)]
struct Reader {
    images: Vec<ImageSource>,
    /// Images by the id of their texture in the file.
    known: RapidHashMap<u32, Option<u32>>,
    missing: Vec<String>,
    maps_ignored: u64,
    invisible: u64,
}

impl Reader {
    fn slot(&mut self, material: &Material, cx: &mut Context<'_>) -> Result<MaterialSlot, MeshError> {
        let pbr = &material.pbr;
        let base_texture = self.texture(&pbr.base_color, cx)?;
        let emissive_texture = self.texture(&pbr.emission_color, cx)?;
        let normal_texture = self.texture(&pbr.normal_map, cx)?;
        let is_pbr = material.features.pbr.enabled;
        for map in [&pbr.roughness, &pbr.metalness, &pbr.opacity, &material.fbx.bump] {
            self.maps_ignored += u64::from(map.texture.is_some() && map.texture_enabled);
        }
        let alpha = self.alpha(material);
        let factor = |map: &MaterialMap| if map.has_value { clamped(map.value_vec4.x) } else { 1.0 };
        // A texture replaces the colour.
        let color = match (&base_texture, pbr.base_color.has_value) {
            (Some(_), _) => Some([1.0; 3]),
            (None, true) => Some(rgb(&pbr.base_color)),
            (None, false) => None,
        };
        let scale = factor(&pbr.base_factor);
        let base_color = color.map(|color| {
            let [r, g, b] = color.map(|c| srgb_to_linear((c * scale).clamp(0.0, 1.0)) as f32);
            [r, g, b, alpha as f32]
        });
        let emission = match (&emissive_texture, pbr.emission_color.has_value) {
            (Some(_), _) => Some([1.0; 3]),
            (None, true) => Some(rgb(&pbr.emission_color)),
            (None, false) => None,
        };
        let strength = factor(&pbr.emission_factor);
        let exponent = Some(&material.fbx.specular_exponent).filter(|map| !is_pbr && map.has_value);
        // `clamp` would keep a NaN.
        let value_of =
            |map: &MaterialMap| Some(map.value_vec4.x).filter(|value| is_pbr && map.has_value && value.is_finite());
        let (roughness, metallic) = (value_of(&pbr.roughness), value_of(&pbr.metalness));
        Ok(MaterialSlot {
            name: text::name(&material.element.name),
            base_color,
            metallic: metallic.map(|v| v.clamp(0.0, 1.0) as f32),
            roughness: roughness.or(exponent.map(roughness_of)).map(|v| v.clamp(0.0, 1.0) as f32),
            emissive: emission.map(|color| color.map(|c| (srgb_to_linear(c) * strength).clamp(0.0, 1e4) as f32)),
            alpha: if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            base_texture,
            normal_texture,
            emissive_texture,
            ..MaterialSlot::default()
        })
    }

    /// Alpha from the transparency, or from the opacity where a material has one. A fully invisible
    /// material is a mistake of the exporter and is drawn opaque.
    fn alpha(&mut self, material: &Material) -> f64 {
        let (fbx, pbr) = (&material.fbx, &material.pbr);
        let alpha = if material.features.pbr.enabled {
            if pbr.opacity.has_value { clamped(pbr.opacity.value_vec4.x) } else { 1.0 }
        } else if fbx.transparency_factor.has_value {
            let color = if fbx.transparency_color.has_value { rgb(&fbx.transparency_color) } else { [1.0; 3] };
            1.0 - clamped(fbx.transparency_factor.value_vec4.x) * (color[0] + color[1] + color[2]) / 3.0
        } else {
            1.0
        };
        if alpha <= 0.0 || alpha.is_nan() {
            self.invisible += 1;
            return 1.0;
        }
        alpha.min(1.0)
    }

    fn texture(&mut self, map: &MaterialMap, cx: &mut Context<'_>) -> Result<Option<TextureRef>, MeshError> {
        let Some(texture) = map.texture.as_ref().filter(|_| map.texture_enabled) else { return Ok(None) };
        // Of a layered texture only the first file is used.
        let texture: &Texture = texture.file_textures.first().unwrap_or(texture);
        let id = texture.element.typed_id;
        let image = match self.known.get(&id) {
            Some(&image) => image,
            None => {
                let image = self.image(texture, cx)?;
                self.known.insert(id, image);
                image
            }
        };
        Ok(image.map(|image| use_of(texture, image)))
    }

    /// The index of the image. None if the texture has no file.
    fn image(&mut self, texture: &Texture, cx: &mut Context<'_>) -> Result<Option<u32>, MeshError> {
        let names = [&texture.relative_filename, &texture.filename, &texture.absolute_filename];
        let name = names.into_iter().map(|name| &**name).find(|name| !name.is_empty()).unwrap_or_default();
        let name: String = name.chars().take(NAME_BYTES_MAX).collect();
        let embedded = match &texture.video {
            Some(video) if texture.content.is_empty() => &*video.content,
            _ => &*texture.content,
        };
        if name.is_empty() && embedded.is_empty() {
            return Ok(None);
        }
        cx.budget.spend("a texture's name", 256 + 4 * name.len() as u64, 1)?;
        let folder = cx.bundle;
        let file = || {
            let at = folder.at(folder.entry().folder(), &name).ok().flatten();
            at.or_else(|| folder.of_base_name(&name)).map(|number| &folder.file(number).bytes[..])
        };
        let content = match Some(embedded).filter(|bytes| !bytes.is_empty()).or_else(file) {
            Some(bytes) => {
                cx.budget.spend("a texture file", bytes.len() as u64, 1)?;
                ImageContent::Encoded(bytes.into())
            }
            None => {
                folder.note_missing(folder.entry().folder(), &name);
                self.missing.push(name.clone());
                ImageContent::Absent
            }
        };
        let image = self.images.len() as u32;
        self.images
            .push(ImageSource { name: format!("texture {}", show_all(std::iter::once(name.as_str()))), content });
        Ok(Some(image))
    }

    fn warnings(&self, origin: Origin) -> Vec<Warning> {
        let lacks = origin.lacks();
        let names = show_all(self.missing.iter().map(String::as_str));
        let all = [
            (
                self.missing.len() as u64,
                "textures_missing",
                format!("{lacks} {names}: add the files to see these textures"),
            ),
            (
                self.maps_ignored,
                "maps_ignored",
                format!(
                    "textures for anything but colour, emission and normals are not drawn (textures: {})",
                    self.maps_ignored
                ),
            ),
            (
                self.invisible,
                "opacity_ignored",
                format!("materials that would be invisible are taken as opaque (materials: {})", self.invisible),
            ),
        ];
        let met = all.into_iter().filter(|(count, ..)| *count > 0);
        met.map(|(_, code, detail)| Warning { code, detail }).collect()
    }
}

/// The file's matrix, which has v up, turned to v down.
fn use_of(texture: &Texture, image: u32) -> TextureRef {
    let mut out = TextureRef::new(image);
    let wrap = |mode: WrapMode| if mode == WrapMode::Clamp { Wrap::Clamp } else { Wrap::Repeat };
    out.wrap = [wrap(texture.wrap_u), wrap(texture.wrap_v)];
    if texture.has_uv_transform {
        let m = &texture.uv_to_texture;
        let rows = [[m.m00, -m.m01, m.m03 + m.m01], [-m.m10, m.m11, 1.0 - m.m11 - m.m13]];
        if rows.iter().flatten().all(|v| v.abs() < 1e9) {
            out.transform = rows.map(|row| row.map(|v| ((v * STEPS).round_ties_even() / STEPS) as f32));
        }
    }
    out
}

fn rgb(map: &MaterialMap) -> [f64; 3] {
    let v = &map.value_vec4;
    [v.x, v.y, v.z].map(|c| if c.is_finite() { c.clamp(0.0, 1e4) } else { 0.0 })
}

fn clamped(v: f64) -> f64 {
    if v.is_finite() { v.clamp(0.0, 1e4) } else { 1.0 }
}

/// As for the highlights of MTL files (Karis, "Specular BRDF Reference", 2013): `n = 2 / alpha^2 -
/// 2`, `alpha = roughness^2`.
fn roughness_of(exponent: &MaterialMap) -> f64 {
    (2.0 / (clamped(exponent.value_vec4.x) + 2.0)).sqrt().sqrt()
}
