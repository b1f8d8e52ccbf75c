//! The materials of an OBJ file: each name in it gets the values that a material library (an MTL
//! file) gives. Libraries and textures are found among the files of the upload.
//!
//! A missing file is a warning that says what to add, never an error: the shape is complete without
//! it.

use super::map::Map;
use super::mtl::{self, Material, SkippedLines};
use crate::import::bundle::show_all;
use crate::import::context::Context;
use crate::import::raw::RawMesh;
use crate::import::text::utf8_or_latin1;
use crate::import::{Folder, MeshError, Origin, text};
use crate::mesh::MaterialSlot;
use crate::mesh::material::{AlphaMode, ImageContent, ImageSource, TextureRef};
use crate::srgb::srgb_to_linear;
use crate::warning::Warning;
use rapidhash::{RapidHashMap, RapidHashSet};

/// Alpha threshold of a texture that is both drawn and cut out by the same image.
const MASK_AT: f32 = 0.5;

/// Most libraries on one line: a longer line is no list of files.
const LIBRARIES_MAX: usize = 100;

/// A slot for each of `names`, in order, as the `libraries` describe them. Images and warnings go
/// to `raw`.
pub fn read(
    names: &[Vec<u8>],
    libraries: &[Vec<u8>],
    raw: &mut RawMesh,
    cx: &mut Context<'_>,
) -> Result<Vec<MaterialSlot>, MeshError> {
    let mut reader = Reader { folder: cx.bundle, images: Images::default(), notes: Notes::default() };
    let files = reader.find_libraries(libraries, cx)?;
    cx.budget.spend("materials", names.len() as u64, size_of::<Option<(Material, usize)>>() as u64 + 64)?;
    let numbers: RapidHashMap<&[u8], usize> = names.iter().enumerate().map(|(i, name)| (name.as_slice(), i)).collect();
    let mut found: Vec<Option<(Material, usize)>> = vec![None; names.len()];
    for &file in &files {
        let library = text::to_utf8(&cx.bundle.file(file).bytes, cx.budget)?;
        let passed = mtl::read(&library, &numbers, &mut found, file, cx)?;
        reader.notes.add(passed);
    }
    let mut slots = Vec::with_capacity(names.len());
    for (name, found) in names.iter().zip(found) {
        cx.deadline.check()?;
        let name = text::name(&String::from_utf8_lossy(name));
        let slot = match found {
            Some((material, library)) => reader.slot(&material, library, cx)?,
            None => {
                if !files.is_empty() {
                    reader.notes.undefined.push(name.clone());
                }
                MaterialSlot::default()
            }
        };
        slots.push(MaterialSlot { name, ..slot });
    }
    raw.images = reader.images.all;
    raw.report.warnings.extend(reader.notes.warnings(cx.bundle.origin()));
    Ok(slots)
}

struct Reader<'a> {
    folder: &'a Folder,
    images: Images,
    notes: Notes,
}

#[derive(Default)]
struct Images {
    all: Vec<ImageSource>,
    of_file: RapidHashMap<usize, u32>,
    of_missing: RapidHashMap<String, u32>,
}

impl Reader<'_> {
    /// The files of `mtllib` lines, each once. A line is one name with spaces, or several names.
    fn find_libraries(&mut self, lines: &[Vec<u8>], cx: &Context<'_>) -> Result<Vec<usize>, MeshError> {
        let mut distinct = RapidHashSet::default();
        let mut seen = RapidHashSet::default();
        let mut files = Vec::new();
        for line in lines.iter().filter(|line| !line.is_empty() && distinct.insert(line.as_slice())) {
            cx.deadline.check()?;
            let whole = utf8_or_latin1(line);
            let folder = self.folder.entry().folder();
            let numbers: Vec<usize> = match self.find(folder, &whole) {
                Some(number) => vec![number],
                None => {
                    let words = whole.split_ascii_whitespace().take(LIBRARIES_MAX);
                    words.filter_map(|word| self.find(folder, word)).collect()
                }
            };
            if numbers.is_empty() {
                self.folder.note_missing(folder, &whole);
                self.notes.libraries.push(whole.into_owned());
            }
            files.extend(numbers.into_iter().filter(|&number| seen.insert(number)));
        }
        Ok(files)
    }

    /// A file by its path from `folder` or from the mesh, or else by its base name: libraries are
    /// full of absolute paths of the author's computer.
    fn find(&self, folder: &str, name: &str) -> Option<usize> {
        let at = |folder: &str| self.folder.at(folder, name).ok().flatten();
        at(folder).or_else(|| at(self.folder.entry().folder())).or_else(|| self.folder.of_base_name(name))
    }

    fn slot(&mut self, material: &Material, library: usize, cx: &mut Context<'_>) -> Result<MaterialSlot, MeshError> {
        let (alpha, tr_reversed) = material.alpha();
        self.notes.reversed += u64::from(tr_reversed);
        let base_texture = self.texture(material.diffuse_map.as_ref(), library, cx)?;
        let emissive_texture = self.texture(material.emissive_map.as_ref(), library, cx)?;
        let normal_texture = self.texture(material.normal_map.as_ref(), library, cx)?;
        let is_cut_out = self.is_cut_out(material, library);
        let says_base = material.diffuse.is_some() || alpha < 1.0;
        let [r, g, b] = linear(material.diffuse.unwrap_or([1.0; 3]).map(|c| c.min(1.0)));
        // Without `Ke`, `map_Ke` is multiplied by white.
        let emissive = material.emissive.or(emissive_texture.map(|_| [1.0; 3]));
        Ok(MaterialSlot {
            name: String::new(),
            base_color: says_base.then_some([r, g, b, alpha as f32]),
            metallic: material.metallic.map(|v| v as f32),
            roughness: material.roughness.or(material.exponent.map(roughness)).map(|v| v as f32),
            emissive: emissive.map(|e| linear(e.map(|c| c.min(1e4)))),
            alpha: match (alpha < 1.0, is_cut_out) {
                (true, _) => AlphaMode::Blend,
                (false, true) => AlphaMode::Mask(MASK_AT),
                (false, false) => AlphaMode::Opaque,
            },
            base_texture,
            normal_texture,
            normal_scale: material.normal_map.as_ref().and_then(|map| map.strength).map(|v| v as f32),
            emissive_texture,
            ..MaterialSlot::default()
        })
    }

    /// True if `map_d` is the same image as `map_Kd`. Any other is not drawn.
    fn is_cut_out(&mut self, material: &Material, library: usize) -> bool {
        let Some(opacity) = &material.opacity_map else { return false };
        let folder = self.folder.file(library).folder();
        let file = |map: &Map| self.find(folder, &utf8_or_latin1(&map.name)).ok_or_else(|| map.name.clone());
        let same = material.diffuse_map.as_ref().is_some_and(|diffuse| file(diffuse) == file(opacity));
        self.notes.opacity_maps += u64::from(!same);
        same
    }

    fn texture(
        &mut self,
        map: Option<&Map>,
        library: usize,
        cx: &mut Context<'_>,
    ) -> Result<Option<TextureRef>, MeshError> {
        let Some(map) = map else { return Ok(None) };
        let name = utf8_or_latin1(&map.name);
        let number = self.find(self.folder.file(library).folder(), &name);
        let images = &mut self.images;
        let known = match number {
            Some(number) => images.of_file.get(&number),
            None => images.of_missing.get(name.as_ref()),
        };
        if let Some(&image) = known {
            return Ok(Some(map.texture(image)));
        }
        let image = images.all.len() as u32;
        cx.budget.spend("a texture's name", 256 + 4 * name.len() as u64, 1)?;
        let content = match number {
            Some(number) => {
                let bytes = &self.folder.file(number).bytes;
                cx.budget.spend("a texture file", bytes.len() as u64, 1)?;
                images.of_file.insert(number, image);
                ImageContent::Encoded(bytes.as_ref().into())
            }
            None => {
                self.folder.note_missing(self.folder.file(library).folder(), &name);
                images.of_missing.insert(name.clone().into_owned(), image);
                self.notes.textures.push(name.clone().into_owned());
                ImageContent::Absent
            }
        };
        images.all.push(ImageSource { name: format!("texture {}", show_all(std::iter::once(name.as_ref()))), content });
        Ok(Some(map.texture(image)))
    }
}

/// Collects warnings of all libraries.
#[derive(Default)]
struct Notes {
    libraries: Vec<String>,
    textures: Vec<String>,
    undefined: Vec<String>,
    opacity_maps: u64,
    reversed: u64,
    passed: SkippedLines,
}

impl Notes {
    fn add(&mut self, more: SkippedLines) {
        self.passed.bumps += more.bumps;
        self.passed.maps += more.maps;
        self.passed.broken += more.broken;
    }

    fn warnings(&self, origin: Origin) -> Vec<Warning> {
        let lacks = origin.lacks();
        let names = |list: &[String]| show_all(list.iter().map(String::as_str));
        let SkippedLines { bumps, maps, broken } = self.passed;
        let all = [
            (
                self.libraries.len() as u64,
                "mtl_ignored",
                format!(
                    "{lacks} the material library {}: add it, and the textures it names, to see its colours",
                    names(&self.libraries)
                ),
            ),
            (
                self.textures.len() as u64,
                "textures_missing",
                format!("{lacks} {}: add the files to see these textures", names(&self.textures)),
            ),
            (
                self.undefined.len() as u64,
                "materials_undefined",
                format!("no material library defines {}", names(&self.undefined)),
            ),
            (bumps, "bump_ignored", format!("bump maps are not drawn; normal maps (`norm`) are (bump lines: {bumps})")),
            (
                maps,
                "maps_ignored",
                format!("textures for anything but colour, emission and normals are not drawn (lines: {maps})"),
            ),
            (
                self.opacity_maps,
                "map_d_ignored",
                format!("`map_d` is drawn only where it is the image of `map_Kd` (materials: {})", self.opacity_maps),
            ),
            (
                self.reversed,
                "tr_ignored",
                format!("`Tr 1` would make a material invisible and is taken as opaque (materials: {})", self.reversed),
            ),
            (
                broken,
                "mtl_lines_ignored",
                format!("lines of the material library could not be read and were passed over: {broken}"),
            ),
        ];
        let met = all.into_iter().filter(|(count, ..)| *count > 0);
        met.map(|(_, code, detail)| Warning { code, detail }).collect()
    }
}

/// Roughness from the exponent of the highlight: `n = 2 / alpha^2 - 2` with `alpha = roughness^2`
/// (Karis, "Specular BRDF Reference", 2013, for Blinn-Phong).
fn roughness(exponent: f64) -> f64 {
    (2.0 / (exponent + 2.0)).sqrt().sqrt()
}

/// Linear light of an MTL colour, which is sRGB as most viewers take it.
fn linear(color: [f64; 3]) -> [f32; 3] {
    color.map(|c| srgb_to_linear(c) as f32)
}
