//! Images to textures: decoded only if sampled, once per way of reading them, and only as large as
//! the picture can show.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::{ImageContent, ImageSource, TextureRef, Wrap};
use crate::plan::geometry::Geometry;
use crate::plan::prepared::{Prepared, PreparedTextures};
use crate::plan::projection::Projection;
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::surface::closeup;
use crate::plan::surface::closeup::Use;
use crate::plan::{PlanError, TextureUse};
use crate::texture::decode::{self, Header};
use crate::texture::mips::Reading;
use crate::texture::{Texture, TextureError, Textures, fit, mips};

/// Memory of images that are decoded at once, bytes: three of 2048 x 2048 texels in JPEG.
const TOGETHER_BYTES_MAX: u64 = 256 << 20;

/// Collects the textures that materials sample, and decodes them at the end. An image that cannot be read
/// is a fault, and the picture goes on without it.
pub struct TextureLoader<'a> {
    mesh: &'a Mesh,
    budget: &'a mut Budget,
    deadline: &'a Deadline,
    material: u32,
    is_used: bool,
    wanted: Vec<Wanted>,
    /// Index into `wanted` by image and way of reading; None for an image that cannot be read.
    known: BTreeMap<(u32, Reading), Option<usize>>,
    uses: Vec<Use>,
    /// By image.
    faults: BTreeMap<u32, TextureError>,
}

/// The textures of a picture.
#[derive(Debug, Default)]
pub struct LoadedTextures {
    /// The textures, decoded.
    pub textures: Arc<Textures>,
    /// Indices of those without pixels, because their images are broken.
    pub broken: Vec<u32>,
    /// The fault of each image that cannot be read.
    pub faults: Vec<TextureError>,
}

/// An image that is read in one way.
struct Wanted {
    image: u32,
    reading: Reading,
    header: Header,
}

impl<'a> TextureLoader<'a> {
    /// A loader without textures.
    pub fn new(mesh: &'a Mesh, budget: &'a mut Budget, deadline: &'a Deadline) -> Self {
        Self {
            mesh,
            budget,
            deadline,
            material: 0,
            is_used: true,
            wanted: Vec::new(),
            known: BTreeMap::new(),
            uses: Vec::new(),
            faults: BTreeMap::new(),
        }
    }

    /// Sets the material whose textures are loaded next. One without triangles (not `is_used`) gets
    /// none.
    pub fn for_material(&mut self, material: usize, is_used: bool) {
        self.material = material as u32;
        self.is_used = is_used;
    }

    /// A texture for a material. None if the picture has to go on without it.
    pub fn load(&mut self, texture: &TextureRef, reading: Reading) -> Result<Option<TextureUse>, PlanError> {
        if !self.is_used {
            return Ok(Some(TextureUse::NONE));
        }
        // Without texture coordinates a texture has no place on the mesh.
        let is_second_uvs = texture.is_second_uvs;
        if self.mesh.uvs.is_empty() || is_second_uvs && self.mesh.second_uvs.is_empty() {
            return Ok(None);
        }
        let Some(index) = self.index_of(texture.image, reading)? else { return Ok(None) };
        let Header { width, height, .. } = self.wanted[index].header;
        let size = [f64::from(width), f64::from(height)];
        self.budget.spend("textures", 1, 2 * size_of::<Use>() as u64)?;
        let (material, transform) = (self.material, texture.transform);
        self.uses.push(Use { material, texture: index, transform, is_second_uvs, size });
        Ok(Some(TextureUse { transform: texture.transform, texture: index as u32, sampler: sampler(texture) }))
    }

    /// The place of an image in `wanted`; None if it is absent or its header cannot be read.
    fn index_of(&mut self, image: u32, reading: Reading) -> Result<Option<usize>, PlanError> {
        if let Some(&known) = self.known.get(&(image, reading)) {
            return Ok(known);
        }
        let source = self.mesh.images.get(image as usize);
        let Some((source, ImageContent::Encoded(bytes))) = source.map(|source| (source, &source.content)) else {
            return Ok(None);
        };
        // With the sentence of a fault.
        self.budget.spend("textures", 1, 1024)?;
        let index = match decode::header(&source.name, bytes) {
            Ok(header) => {
                self.budget.spend_texture(&source.name, header.width, header.height)?;
                self.wanted.push(Wanted { image, reading, header });
                Some(self.wanted.len() - 1)
            }
            Err(fault) => {
                self.faults.insert(image, fault);
                None
            }
        };
        self.known.insert((image, reading), index);
        Ok(index)
    }

    /// Decodes all textures that were loaded.
    pub fn finish(
        self,
        geometry: &Geometry<'_>,
        projection: &Projection,
        prepared: Option<&Prepared>,
        skips: &mut Skips<'_>,
    ) -> Result<LoadedTextures, PlanError> {
        let Self { mesh, budget, deadline, wanted, uses, faults, .. } = self;
        if wanted.is_empty() {
            return Ok(LoadedTextures { faults: faults.into_values().collect(), ..LoadedTextures::default() });
        }
        let sizes: Vec<[u32; 2]> = wanted.iter().map(|w| [w.header.width, w.header.height]).collect();
        let mut finest = closeup::finest_levels(mesh, geometry, projection, &uses, wanted.len(), deadline)?;
        for (level, size) in finest.iter_mut().zip(&sizes) {
            *level = (*level).min(mips::count(size[0], size[1]) - 1);
        }
        let is_unneeded = finest.iter().any(|&level| level > 0);
        let skip = skips.skip(SkipKind::FineTextureLevels, is_unneeded, "no pixel comes close enough to see them");
        let first_levels = fit::first_levels(&sizes, &finest, skip);

        let texels = |w: &Wanted, first: u32| mips::texels(w.header.width, w.header.height, first);
        let total: u64 = wanted.iter().zip(&first_levels).map(|(w, &first)| texels(w, first)).sum();
        budget.spend("textures", total, 8)?;
        let of_wanted = |w: &Wanted| (w.image, w.reading);
        let decoding: Vec<u64> = wanted.iter().map(Wanted::decoding_bytes).collect();
        // Also where nothing is decoded: what is kept must refuse no less.
        let batches = spend_on_decoding(&decoding, budget)?;
        let kept = prepared.and_then(Prepared::textures);
        let images: Vec<(u32, Reading)> = wanted.iter().map(of_wanted).collect();
        if let Some(kept) = kept.filter(|kept| kept.have(&images, &first_levels, &finest)) {
            return Ok(LoadedTextures::new(&kept, faults));
        }
        let mut textures = Textures { texels: vec![[0; 4]; total as usize], images: Vec::new() };
        let mut decodings = Vec::new();
        let mut rest = &mut textures.texels[..];
        let mut first_texel = 0;
        for (want, &first_level) in wanted.iter().zip(&first_levels) {
            let Header { width, height, .. } = want.header;
            let (out, others) = rest.split_at_mut(texels(want, first_level) as usize);
            let levels = mips::count(width, height);
            textures.images.push(Texture { width, height, first_level, levels, first_texel, padding: [0; 3] });
            first_texel += out.len() as u32;
            decodings.push(Decoding { image: &mesh.images[want.image as usize], want, first_level, out });
            rest = others;
        }
        let broken = decode_all(decodings, &batches, deadline)?;
        let decoded = PreparedTextures { images, textures: Arc::new(textures), broken: broken.into() };
        let loaded = LoadedTextures::new(&decoded, faults);
        if let Some(prepared) = prepared {
            prepared.keep_textures(decoded);
        }
        Ok(loaded)
    }
}

impl LoadedTextures {
    /// Decoded textures, and the faults of images that were not decoded at all.
    fn new(decoded: &PreparedTextures, mut faults: BTreeMap<u32, TextureError>) -> Self {
        // An image that is read in two ways is broken once.
        faults.extend(decoded.broken.iter().map(|(index, fault)| (decoded.images[*index as usize].0, fault.clone())));
        Self {
            textures: Arc::clone(&decoded.textures),
            broken: decoded.broken.iter().map(|(index, _)| *index).collect(),
            faults: faults.into_values().collect(),
        }
    }
}

impl Wanted {
    /// Memory that decoding takes beside the levels.
    fn decoding_bytes(&self) -> u64 {
        let Header { width, height, decoding_bytes, .. } = self.header;
        let reading_bytes = self.reading.working_bytes(width, height);
        decoding_bytes.saturating_add(mips::working_bytes(width, height)).saturating_add(reading_bytes)
    }
}

/// An image that is to be decoded, and the place of its levels.
struct Decoding<'a> {
    image: &'a ImageSource,
    want: &'a Wanted,
    first_level: u32,
    out: &'a mut [[u16; 4]],
}

impl Decoding<'_> {
    /// Returns the fault of an image that is broken.
    fn run(self, deadline: &Deadline) -> Result<Option<TextureError>, PlanError> {
        deadline.check()?;
        let ImageContent::Encoded(encoded) = &self.image.content else { return Ok(None) };
        match decode::decode(&self.image.name, encoded, &self.want.header) {
            Ok(pixels) => {
                mips::fill(&pixels, self.want.reading, self.first_level, self.out, deadline)?;
                Ok(None)
            }
            Err(fault) => Ok(Some(fault)),
        }
    }
}

/// Spends what decoding images takes, given the bytes for each: a few images at once, each few in the
/// memory of those before. Returns how many are decoded together, batch by batch. That follows from
/// sizes and the budget alone, so that threads change no refusal.
fn spend_on_decoding(decoding_bytes: &[u64], budget: &mut Budget) -> Result<Vec<usize>, PlanError> {
    let (mut batches, mut most, mut left) = (Vec::new(), 0, decoding_bytes);
    while !left.is_empty() {
        let mut bytes = 0_u64;
        let fits = |image: &&u64| {
            bytes = bytes.saturating_add(**image);
            bytes <= TOGETHER_BYTES_MAX
        };
        let mut count = left.iter().take_while(fits).count().max(1);
        let mut together: u64 = left[..count].iter().fold(0, |sum, bytes| sum.saturating_add(*bytes));
        if count > 1 && budget.spend("decoding textures", together.saturating_sub(most), 1).is_err() {
            (count, together) = (1, left[0]);
        }
        if count == 1 {
            budget.spend("decoding textures", together.saturating_sub(most), 1)?;
        }
        most = most.max(together);
        batches.push(count);
        left = &left[count..];
    }
    Ok(batches)
}

/// Decodes images, so many together as `batches` says. Returns the faults of those that are broken, with
/// their places.
fn decode_all(
    mut images: Vec<Decoding<'_>>,
    batches: &[usize],
    deadline: &Deadline,
) -> Result<Vec<(u32, TextureError)>, PlanError> {
    let mut faults = Vec::new();
    let mut first = 0;
    for &count in batches {
        let others = images.split_off(count.min(images.len()));
        // Of several errors, the first image's.
        let results: Vec<_> = images.into_par_iter().map(|image| image.run(deadline)).collect();
        for (index, result) in (first..).zip(results) {
            faults.extend(result?.map(|fault| (index, fault)));
        }
        first += count as u32;
        images = others;
    }
    Ok(faults)
}

/// Bits as in [`TextureUse::sampler`].
fn sampler(texture: &TextureRef) -> u32 {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => super::samplers::REPEAT,
        Wrap::Mirror => super::samplers::MIRROR,
        Wrap::Clamp => super::samplers::CLAMP,
    };
    let nearest = if texture.nearest { super::samplers::NEAREST } else { 0 };
    let uvs = if texture.is_second_uvs { super::samplers::SECOND_UVS } else { 0 };
    wrap(texture.wrap[0]) | wrap(texture.wrap[1]) << super::samplers::DOWN_SHIFT | nearest | uvs
}
