//! The loader of the images that materials sample. An image is decoded only if it is sampled and not
//! kept from an earlier picture, once per way of reading its texels (as colours, as numbers, or with an
//! alpha cutoff). Mip levels that are finer than the picture can show, or than there is room for, are
//! not made.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::{ImageContent, ImageSource, TextureRef, Wrap};
use crate::plan::context::PlanContext;
use crate::plan::geometry::Geometry;
use crate::plan::prepared::Prepared;
use crate::plan::projection::Projector;
use crate::plan::skips::SkipKind;
use crate::plan::surface::closeup;
use crate::plan::surface::closeup::Use;
use crate::plan::{PlanError, TextureUse};
use crate::texture::decode::{self, Header, Pixels};
use crate::texture::kept::{Decoded, ImageKey, KeptTextures};
use crate::texture::mips::Reading;
use crate::texture::{Texels, Texture, TextureError, Textures, fit, mips};

/// Memory of images that are decoded at once, bytes: three of 2048 x 2048 texels in JPEG.
const TOGETHER_BYTES_MAX: u64 = 256 << 20;

/// Collects the textures that materials sample, and decodes them at the end. An image that cannot be read
/// is a fault, and the picture goes on without it.
pub struct TextureLoader<'a, 'c> {
    /// The plan's.
    pub cx: &'a mut PlanContext<'c>,
    mesh: &'a Mesh,
    material: u32,
    is_used: bool,
    wanted: Vec<Wanted>,
    /// Index into `wanted` by image and way of reading; None for an image that cannot be read.
    known: BTreeMap<(u32, Reading), Option<usize>>,
    uses: Vec<Use>,
    /// True if some vertex has an alpha, once that is asked for.
    has_vertex_alpha: OnceCell<bool>,
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

impl<'a, 'c> TextureLoader<'a, 'c> {
    /// A loader without textures.
    pub fn new(mesh: &'a Mesh, cx: &'a mut PlanContext<'c>) -> Self {
        Self {
            cx,
            mesh,
            material: 0,
            is_used: true,
            wanted: Vec::new(),
            known: BTreeMap::new(),
            uses: Vec::new(),
            has_vertex_alpha: OnceCell::new(),
            faults: BTreeMap::new(),
        }
    }

    /// Sets the material whose textures are loaded next. One without triangles (not `is_used`) gets
    /// none.
    pub fn for_material(&mut self, material: usize, is_used: bool) {
        self.material = material as u32;
        self.is_used = is_used;
    }

    /// True if the colour of some vertex is not opaque. All vertices are looked at once, however many materials ask.
    pub fn has_vertex_alpha(&self) -> bool {
        *self.has_vertex_alpha.get_or_init(|| self.mesh.colors.iter().any(|color| color[3] != 1.0))
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
        self.cx.budget.spend("textures", 1, 2 * size_of::<Use>() as u64)?;
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
        self.cx.budget.spend("textures", 1, 1024)?;
        let index = match decode::header(&source.name, bytes) {
            Ok(header) => {
                self.cx.budget.spend_texture(&source.name, header.width, header.height)?;
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
    pub fn finish(self, geometry: &Geometry<'_>, projector: &Projector) -> Result<LoadedTextures, PlanError> {
        let Self { cx, mesh, wanted, uses, faults, .. } = self;
        if wanted.is_empty() {
            return Ok(LoadedTextures { faults: faults.into_values().collect(), ..LoadedTextures::default() });
        }
        let sizes: Vec<[u32; 2]> = wanted.iter().map(|w| [w.header.width, w.header.height]).collect();
        let mut finest = closeup::finest_levels(mesh, geometry, projector, &uses, wanted.len(), cx.deadline)?;
        for (level, size) in finest.iter_mut().zip(&sizes) {
            *level = (*level).min(mips::count(size[0], size[1]) - 1);
        }
        let is_unneeded = finest.iter().any(|&level| level > 0);
        let skip = cx.skips.skip(SkipKind::FineTextureLevels, is_unneeded, "no pixel comes close enough to see them");
        let first_levels = fit::first_levels(&sizes, &finest, skip);

        let texels = |(w, &first): (&Wanted, &u32)| mips::texels(w.header.width, w.header.height, first);
        let total: u64 = wanted.iter().zip(&first_levels).map(texels).sum();
        cx.budget.spend("textures", total, 8)?;
        let decoding: Vec<u64> = wanted.iter().map(Wanted::decoding_bytes).collect();
        // Also where nothing is decoded: what is kept must refuse no less.
        let batches = spend_on_decoding(&decoding, cx.budget)?;
        let kept = cx.prepared.map(Prepared::textures);
        let find = |(w, &first): (&Wanted, &u32)| kept.and_then(|kept| kept.find(w.key(), first));
        let mut decoded: Vec<Option<Decoded>> = wanted.iter().zip(&first_levels).map(find).collect();
        let mut missing = Vec::new();
        for (place, (want, &first_level)) in decoded.iter_mut().zip(wanted.iter().zip(&first_levels)) {
            let is_missing = place.is_none();
            let image = &mesh.images[want.image as usize];
            missing.push(is_missing.then_some(Decoding { image, want, first_level, place }));
        }
        decode_all(missing, &batches, cx.deadline)?;
        let mut decoded: Vec<Decoded> = decoded.into_iter().flatten().collect();
        if let Some(kept) = kept {
            kept.keep(wanted.iter().map(Wanted::key).zip(&mut decoded));
        }
        Ok(LoadedTextures::new(&wanted, decoded, Levels { first: &first_levels, finest: &finest }, kept, faults))
    }
}

/// The levels that a picture wants of each image.
#[derive(Clone, Copy)]
struct Levels<'a> {
    /// The finest that there is room for.
    first: &'a [u32],
    /// The finest that a pixel asks for.
    finest: &'a [u32],
}

impl LoadedTextures {
    /// Decoded images, those that are kept maybe from finer levels on than wanted, and the faults of images that
    /// were not decoded at all.
    fn new(
        wanted: &[Wanted],
        decoded: Vec<Decoded>,
        levels: Levels<'_>,
        kept: Option<&KeptTextures>,
        mut faults: BTreeMap<u32, TextureError>,
    ) -> Self {
        let (mut images, mut broken) = (Vec::with_capacity(wanted.len()), Vec::new());
        for (index, (want, decoded)) in wanted.iter().zip(decoded).enumerate() {
            images.push(decoded.unwrap_or_else(|fault| {
                broken.push(index as u32);
                // An image that is read in two ways is broken once.
                faults.insert(want.image, fault);
                want.without_texels()
            }));
        }
        let mut textures = Textures { images };
        cut_to_fit(&mut textures, levels);
        let textures = match kept {
            Some(kept) => kept.shared(wanted.iter().map(Wanted::key).collect(), textures),
            None => Arc::new(textures),
        };
        Self { textures, broken, faults: faults.into_values().collect() }
    }
}

/// Leaves out levels that are finer than wanted where they would be seen, or where all together are too large.
/// Elsewhere they stay: so pictures from near and from afar have the same textures.
///
/// They would be seen of an image that is to begin with a coarser level than pixels ask for, for lack of room.
fn cut_to_fit(textures: &mut Textures, levels: Levels<'_>) {
    let is_too_large = textures.texel_count() > fit::TEXELS_MAX;
    for (texture, (&first, &finest)) in textures.images.iter_mut().zip(levels.first.iter().zip(levels.finest)) {
        if texture.first_level < first && (is_too_large || first > finest) {
            *texture = texture.from_level(first);
        }
    }
}

impl Wanted {
    fn key(&self) -> ImageKey {
        (self.image, self.reading)
    }

    /// The texture of an image that is broken.
    fn without_texels(&self) -> Texture {
        let Header { width, height, .. } = self.header;
        Texture { width, height, first_level: 0, levels: mips::count(width, height), texels: Texels::default() }
    }

    /// Memory that decoding takes beside the levels.
    fn decoding_bytes(&self) -> u64 {
        let Header { width, height, decoding_bytes, .. } = self.header;
        let reading_bytes = self.reading.working_bytes(width, height);
        decoding_bytes.saturating_add(mips::working_bytes(width, height)).saturating_add(reading_bytes)
    }
}

/// An image that is to be decoded, and the place for its levels.
struct Decoding<'a> {
    image: &'a ImageSource,
    want: &'a Wanted,
    first_level: u32,
    place: &'a mut Option<Decoded>,
}

impl Decoding<'_> {
    fn run(self, deadline: &Deadline) -> Result<(), PlanError> {
        deadline.check()?;
        let Header { width, height, .. } = self.want.header;
        let ImageContent::Encoded(encoded) = &self.image.content else {
            *self.place = Some(Ok(self.want.without_texels()));
            return Ok(());
        };
        let levels = |pixels: &Pixels| {
            let mut texels = vec![[0; 4]; mips::texels(width, height, self.first_level) as usize];
            mips::fill(pixels, self.want.reading, self.first_level, &mut texels, deadline)?;
            let levels = mips::count(width, height);
            Ok::<_, PlanError>(Texture { width, height, first_level: self.first_level, levels, texels: texels.into() })
        };
        *self.place = Some(match decode::decode(&self.image.name, encoded, &self.want.header) {
            Ok(pixels) => Ok(levels(&pixels)?),
            Err(fault) => Err(fault),
        });
        Ok(())
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

/// Decodes images, so many together as `batches` says; None of those that need not be decoded.
fn decode_all(mut images: Vec<Option<Decoding<'_>>>, batches: &[usize], deadline: &Deadline) -> Result<(), PlanError> {
    for &count in batches {
        let others = images.split_off(count.min(images.len()));
        // Of several errors, the first image's.
        let results: Vec<_> = images.into_par_iter().flatten().map(|image| image.run(deadline)).collect();
        results.into_iter().collect::<Result<(), _>>()?;
        images = others;
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(side: u32, first_level: u32) -> Texture {
        let texels = vec![[0; 4]; mips::texels(side, side, first_level) as usize].into();
        Texture { width: side, height: side, first_level, levels: mips::count(side, side), texels }
    }

    fn cut(sides: &[u32], kept: &[u32], first: &[u32], finest: &[u32]) -> Vec<u32> {
        let images = sides.iter().zip(kept).map(|(&side, &first)| texture(side, first)).collect();
        let mut textures = Textures { images };
        cut_to_fit(&mut textures, Levels { first, finest });
        for image in &textures.images {
            assert_eq!(image.texels.len() as u64, mips::texels(image.width, image.height, image.first_level));
        }
        textures.images.iter().map(|image| image.first_level).collect()
    }

    #[test]
    fn finer_levels_stay_where_they_change_nothing_and_fit() {
        // Pixels ask for level 2: what is finer is not seen.
        assert_eq!(cut(&[64, 64], &[0, 1], &[2, 2], &[2, 2]), [0, 1]);
        // Pixels ask for level 1, and there is no room for it.
        assert_eq!(cut(&[64, 64], &[0, 1], &[2, 2], &[1, 2]), [2, 1]);
        // 22 million texels, of which 12.6 are allowed.
        assert_eq!(cut(&[4096, 64], &[0, 0], &[2, 2], &[2, 2]), [2, 2]);
    }
}
