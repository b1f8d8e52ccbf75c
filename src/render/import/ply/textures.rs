//! The materials of a PLY file: one for each texture that its header names, and one for triangles
//! without a texture if there are any. Texture files are found among the files of the upload.
//!
//! A missing file is a warning that says what to add, never an error: the shape is complete without
//! it.

use super::faces::NO_TEXTURE;
use crate::import::MeshError;
use crate::import::bundle::show_all;
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::import::text::utf8_or_latin1;
use crate::mesh::MaterialSlot;
use crate::mesh::material::{ImageContent, ImageSource, TextureRef};
use crate::warning::Warning;
use rapidhash::RapidHashMap;

/// Longest file name in bytes. No file of a bundle has a longer path.
const NAME_BYTES_MAX: usize = 1024;

/// Gives `raw` its materials: one per texture, and one without a texture. `numbers` are the
/// textures of the triangles; empty if all use the first.
pub fn apply(names: &[Vec<u8>], numbers: &[u32], raw: &mut RawMesh, cx: &mut Context<'_>) -> Result<(), MeshError> {
    // Vertex colours are final: white takes the place of the grey of files without colours.
    let color = if raw.colors.is_empty() { None } else { Some([1.0; 4]) };
    let plain = MaterialSlot { base_color: color, ..MaterialSlot::default() };
    if !names.is_empty() && raw.uvs.is_empty() {
        raw.report.warnings.push(Warning {
            code: "uvs_missing",
            detail: "the PLY file names a texture and has no texture coordinates that say where it goes".into(),
        });
    }
    if names.is_empty() || raw.uvs.is_empty() {
        raw.materials = vec![plain];
        return Ok(());
    }
    let mut images = Images { all: Vec::new(), of_file: RapidHashMap::default(), missing: Vec::new() };
    cx.budget.spend("materials", names.len() as u64, size_of::<MaterialSlot>() as u64 + 64)?;
    for name in names {
        cx.deadline.check()?;
        let (image, is_there) = images.find(name, cx)?;
        let base_color = if is_there { Some([1.0; 4]) } else { color };
        let base_texture = Some(TextureRef::new(image));
        raw.materials.push(MaterialSlot { base_color, base_texture, ..MaterialSlot::default() });
    }
    // MeshLab gives faces without a texture the number -1.
    let count = names.len() as u32;
    if numbers.iter().any(|&number| number >= count) {
        raw.materials.push(plain);
    }
    if !numbers.is_empty() {
        raw.triangle_materials = numbers.iter().map(|&number| number.min(count)).collect();
    }
    let unknown = numbers.iter().filter(|&&number| number >= count && number != NO_TEXTURE).count();
    if unknown > 0 {
        let detail = format!("triangles refer to textures beyond the {count} that the PLY header names: {unknown}");
        raw.report.warnings.push(Warning { code: "textures_undefined", detail });
    }
    if !images.missing.is_empty() {
        let names = show_all(images.missing.iter().map(String::as_str));
        let detail = format!("{} {names}: add the files to see these textures", cx.bundle.origin().lacks());
        raw.report.warnings.push(Warning { code: "textures_missing", detail });
    }
    raw.images = images.all;
    Ok(())
}

struct Images {
    all: Vec<ImageSource>,
    of_file: RapidHashMap<usize, u32>,
    missing: Vec<String>,
}

impl Images {
    /// The index of the image with a name, and true if the bundle has it.
    fn find(&mut self, name: &[u8], cx: &mut Context<'_>) -> Result<(u32, bool), MeshError> {
        let name = utf8_or_latin1(&name[..name.len().min(NAME_BYTES_MAX)]).into_owned();
        let folder = cx.bundle;
        // By its path from the mesh, or else by its base name: absolute paths are those of the
        // author's computer.
        let at = folder.at(folder.entry().folder(), &name).ok().flatten();
        let number = at.or_else(|| folder.of_base_name(&name));
        if let Some(&image) = number.and_then(|number| self.of_file.get(&number)) {
            return Ok((image, true));
        }
        let image = self.all.len() as u32;
        cx.budget.spend("a texture's name", 256 + 4 * name.len() as u64, 1)?;
        let content = match number {
            Some(number) => {
                let bytes = &folder.file(number).bytes;
                cx.budget.spend("a texture file", bytes.len() as u64, 1)?;
                self.of_file.insert(number, image);
                ImageContent::Encoded(bytes.as_ref().into())
            }
            None => {
                folder.note_missing(folder.entry().folder(), &name);
                self.missing.push(name.clone());
                ImageContent::Absent
            }
        };
        self.all.push(ImageSource { name: format!("texture {}", show_all(std::iter::once(name.as_str()))), content });
        Ok((image, number.is_some()))
    }
}
