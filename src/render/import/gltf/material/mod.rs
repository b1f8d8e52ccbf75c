//! The materials of a glTF file, each parsed on first use: an unused broken material is no error.

pub(crate) mod images;
use self::images::Images;
use crate::import::context::Context;
use crate::import::gltf::data::accessor::Reader;
use crate::import::gltf::document::lists;
use crate::import::gltf::document::lists::{EmissiveStrength, Lists, SpecularGlossiness, TextureInfo, entry};
use crate::import::{MeshError, text};
use crate::mesh::MaterialSlot;
use crate::mesh::material::{AlphaMode, TextureRef};
use crate::warning::Warning;
use serde::Deserialize;

/// The materials of a file.
#[derive(Debug)]
pub struct Materials<'a> {
    lists: &'a Lists<'a>,
    used: Vec<Option<Used>>,
    /// Images of the used materials.
    pub images: Images,
}

#[derive(Clone, Debug)]
struct Used {
    slot: MaterialSlot,
    uv_sets: [Option<u32>; 2],
}

impl<'a> Materials<'a> {
    /// An empty collection for the file's list.
    pub fn new(lists: &'a Lists<'a>, cx: &mut Context<'_>) -> Result<Self, MeshError> {
        let count = lists.materials.len();
        cx.budget.spend("materials", count as u64, 2 * size_of::<Option<Used>>() as u64)?;
        Ok(Self { lists, used: vec![None; count], images: Images::default() })
    }

    /// The number of materials in the file.
    pub fn count(&self) -> usize {
        self.used.len()
    }

    /// Reads a material that `what` uses. Returns the sets of texture coordinates that it needs: that
    /// of its most important texture, then the one of textures that lie otherwise.
    pub fn uv_sets(
        &mut self,
        what: &str,
        index: usize,
        reader: &mut Reader<'_>,
        warnings: &mut Vec<Warning>,
        cx: &mut Context<'_>,
    ) -> Result<[Option<u32>; 2], MeshError> {
        let Some(known) = self.used.get(index) else {
            return Err(MeshError::broken(format!(
                "{what} of the glTF file uses material {index}, which is not there"
            )));
        };
        if let Some(used) = known {
            return Ok(used.uv_sets);
        }
        let json: lists::Material<'_> = entry("material", &self.lists.materials, index)?;
        let what = format!("material {index}");
        warn_of_undrawn(&what, &json, warnings);
        let mut textures = Textures { what: &what, uv_sets: [None; 2], materials: self, reader, warnings, cx };
        let slot = textures.slot(&json)?;
        let uv_sets = textures.uv_sets;
        self.used[index] = Some(Used { slot, uv_sets });
        Ok(uv_sets)
    }

    /// A slot for every material. Unused ones have only a name.
    pub fn into_slots(self) -> (Vec<MaterialSlot>, Images) {
        let unused = |index: usize| {
            let json = entry::<Named>("material", &self.lists.materials, index).unwrap_or_default();
            MaterialSlot { name: text::name(json.name.as_deref().unwrap_or_default()), ..MaterialSlot::default() }
        };
        let slots = self.used.into_iter().enumerate();
        let slots = slots.map(|(index, used)| used.map_or_else(|| unused(index), |used| used.slot)).collect();
        (slots, self.images)
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Named {
    name: Option<String>,
}

/// The state for reading one material's textures.
struct Textures<'t, 'a, 'r, 'c> {
    what: &'t str,
    /// As [`Materials::uv_sets`] has them.
    uv_sets: [Option<u32>; 2],
    materials: &'t mut Materials<'a>,
    reader: &'t mut Reader<'r>,
    warnings: &'t mut Vec<Warning>,
    cx: &'t mut Context<'c>,
}

impl Textures<'_, '_, '_, '_> {
    fn slot(&mut self, json: &lists::Material<'_>) -> Result<MaterialSlot, MeshError> {
        let name = text::name(json.name.as_deref().unwrap_or_default());
        let mut slot = MaterialSlot { name, ..MaterialSlot::default() };
        match (&json.pbr_metallic_roughness, self.extension::<SpecularGlossiness>(json, SPECULAR_GLOSSINESS)?) {
            (None, Some(other)) => {
                slot.base_color = Some(color(other.diffuse_factor.unwrap_or([1.0; 4])));
                slot.base_texture = self.texture(&other.diffuse_texture)?;
                slot.metallic = Some(0.0);
                // With a texture, roughness would come from its alpha channel, which is not read.
                let gloss = other.glossiness_factor.unwrap_or(1.0);
                slot.roughness = other.specular_glossiness_texture.is_none().then(|| share(1.0 - gloss));
            }
            (pbr, _) => {
                let default = lists::Pbr::default();
                let pbr = pbr.as_ref().unwrap_or(&default);
                slot.base_color = Some(color(pbr.base_color_factor.unwrap_or([1.0; 4])));
                slot.base_texture = self.texture(&pbr.base_color_texture)?;
                slot.metallic = Some(share(pbr.metallic_factor.unwrap_or(1.0)));
                slot.roughness = Some(share(pbr.roughness_factor.unwrap_or(1.0)));
                slot.metallic_roughness_texture = self.texture(&pbr.metallic_roughness_texture)?;
            }
        }
        slot.normal_texture = self.texture(&json.normal_texture)?;
        slot.normal_scale = json.normal_texture.as_ref().and_then(|t| t.scale).map(|s| s.clamp(-1e4, 1e4) as f32);
        slot.emissive_texture = self.texture(&json.emissive_texture)?;
        slot.occlusion_texture = self.occlusion_texture(&json.occlusion_texture)?;
        slot.occlusion_texture_strength = json.occlusion_texture.as_ref().and_then(|t| t.strength).map(share);
        let strength = self.extension::<EmissiveStrength>(json, "KHR_materials_emissive_strength")?;
        let strength = strength.and_then(|s| s.emissive_strength).unwrap_or(1.0);
        slot.emissive = json.emissive_factor.map(|rgb| rgb.map(|v| (v * strength).clamp(0.0, BRIGHTEST) as f32));
        slot.unlit = json.extensions.contains_key("KHR_materials_unlit");
        slot.alpha = match json.alpha_mode.as_deref() {
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some("MASK") => AlphaMode::Mask(json.alpha_cutoff.unwrap_or(0.5).clamp(0.0, BRIGHTEST) as f32),
            Some("BLEND") => AlphaMode::Blend,
            Some(other) => {
                let detail =
                    format!("{} has the alpha mode \"{other:.20}\", which is unknown: it is opaque", self.what);
                super::warn_once(self.warnings, "alpha_mode_unknown", detail);
                AlphaMode::Opaque
            }
        };
        Ok(slot)
    }

    fn texture(&mut self, info: &Option<TextureInfo>) -> Result<Option<TextureRef>, MeshError> {
        let Some(info) = info else { return Ok(None) };
        let Materials { lists, images, .. } = &mut *self.materials;
        let texture = images.texture(self.what, info, lists, self.reader, self.warnings, self.cx)?;
        let moved = info.extensions.transform.as_ref().and_then(|transform| transform.tex_coord);
        let uv_set = moved.or(info.tex_coord).map_or(0, |set| set.0 as u32);
        Ok(texture.map(|texture| TextureRef { is_second_uvs: self.is_second(uv_set), ..texture }))
    }

    /// True if a texture that wants this set of texture coordinates follows the second one.
    fn is_second(&mut self, uv_set: u32) -> bool {
        let [first, second] = self.uv_sets;
        match (first, second) {
            (None, _) => self.uv_sets[0] = Some(uv_set),
            (Some(first), None) if first != uv_set => self.uv_sets[1] = Some(uv_set),
            (Some(first), Some(second)) if ![first, second].contains(&uv_set) => {
                let detail = format!(
                    "the textures of {} use texture coordinates {first}, {second} and {uv_set}; those with {uv_set} are \
                     drawn with {first}",
                    self.what
                );
                super::warn_once(self.warnings, "uv_sets_differ", detail);
            }
            _ => {}
        }
        self.uv_sets[1] == Some(uv_set)
    }

    /// An occlusion texture. One that is not there costs no picture: it is a warning.
    fn occlusion_texture(&mut self, texture: &Option<TextureInfo>) -> Result<Option<TextureRef>, MeshError> {
        let Some(info) = texture else { return Ok(None) };
        if info.index.0 < self.materials.lists.textures.len() {
            return self.texture(texture);
        }
        let detail = format!("the occlusion texture of {} is not drawn: it is not there", self.what);
        super::warn_once(self.warnings, "occlusion_ignored", detail);
        Ok(None)
    }

    fn extension<'j, T: Deserialize<'j>>(
        &self,
        json: &lists::Material<'j>,
        name: &str,
    ) -> Result<Option<T>, MeshError> {
        let Some(raw) = json.extensions.get(name) else { return Ok(None) };
        serde_json::from_str(raw.get()).map(Some).map_err(|error| {
            let why = text::foreign(error);
            MeshError::broken(format!("{name} of {} of the glTF file cannot be read: {why}", self.what))
        })
    }
}

/// The largest finite half float: a factor need not be brighter than a texture can be.
const BRIGHTEST: f64 = 65504.0;

const SPECULAR_GLOSSINESS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Extensions of materials that are not drawn though they change the look, each with the code of
/// its warning.
const UNDRAWN: &[(&str, &str)] = &[
    ("KHR_materials_anisotropy", "anisotropy_ignored"),
    ("KHR_materials_clearcoat", "clearcoat_ignored"),
    ("KHR_materials_diffuse_transmission", "diffuse_transmission_ignored"),
    ("KHR_materials_dispersion", "dispersion_ignored"),
    ("KHR_materials_ior", "ior_ignored"),
    ("KHR_materials_iridescence", "iridescence_ignored"),
    ("KHR_materials_sheen", "sheen_ignored"),
    ("KHR_materials_specular", "specular_ignored"),
    ("KHR_materials_transmission", "transmission_ignored"),
    ("KHR_materials_volume_scatter", "volume_scatter_ignored"),
    ("KHR_materials_volume", "volume_ignored"),
];

/// Extensions of materials that are drawn.
const DRAWN: &[&str] = &["KHR_materials_emissive_strength", "KHR_materials_unlit", SPECULAR_GLOSSINESS];

/// True if an extension of materials is drawn, or known and reported in a warning.
pub fn is_known(extension: &str) -> bool {
    DRAWN.contains(&extension) || UNDRAWN.iter().any(|(name, _)| *name == extension)
}

fn warn_of_undrawn(what: &str, json: &lists::Material<'_>, warnings: &mut Vec<Warning>) {
    for name in json.extensions.keys() {
        if let Some((name, code)) = UNDRAWN.iter().find(|(known, _)| known == name) {
            super::warn_once(warnings, code, format!("{name} is not drawn ({what} has it)"));
        }
    }
    if json.extensions.contains_key(SPECULAR_GLOSSINESS) {
        let detail = match json.pbr_metallic_roughness {
            Some(_) => format!("{SPECULAR_GLOSSINESS} is not drawn: {what} has metallic and roughness too"),
            None => format!("{SPECULAR_GLOSSINESS} is drawn without its specular part ({what} has it)"),
        };
        super::warn_once(warnings, "specular_glossiness_ignored", detail);
    }
}

fn color(rgba: [f64; 4]) -> [f32; 4] {
    rgba.map(share)
}

fn share(v: f64) -> f32 {
    v.clamp(0.0, 1.0) as f32
}
