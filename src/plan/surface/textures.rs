//! Images to textures: decoded only if sampled, once per way of reading them, and only as large as
//! the picture can show.

use std::collections::BTreeMap;

use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::{ImageContent, TextureRef, Wrap};
use crate::plan::geometry::Geometry;
use crate::plan::projection::Projection;
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::surface::closeup;
use crate::plan::surface::closeup::Use;
use crate::plan::{PlanError, TextureUse};
use crate::texture::decode::{self, Header};
use crate::texture::{Texture, TextureError, Textures, fit, mips};

/// Collects the textures that materials sample, and decodes them at the end.
pub struct TextureLoader<'a> {
    mesh: &'a Mesh,
    budget: &'a mut Budget,
    deadline: &'a Deadline,
    material: u32,
    is_used: bool,
    wanted: Vec<Wanted>,
    known: BTreeMap<(u32, bool), usize>,
    uses: Vec<Use>,
}

/// An image that is read in one way: as colours or as numbers.
struct Wanted {
    image: u32,
    is_color: bool,
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
        }
    }

    /// Sets the material whose textures are loaded next. One without triangles (not `is_used`) gets
    /// none.
    pub fn for_material(&mut self, material: usize, is_used: bool) {
        self.material = material as u32;
        self.is_used = is_used;
    }

    /// A texture for a material; `is_color` says that texels are sRGB.
    pub fn load(&mut self, texture: &TextureRef, is_color: bool) -> Result<TextureUse, PlanError> {
        // Without texture coordinates a texture has no place on the mesh.
        let Some(image) =
            self.mesh.images.get(texture.image as usize).filter(|_| self.is_used && !self.mesh.uvs.is_empty())
        else {
            return Ok(TextureUse::NONE);
        };
        let bytes = match &image.content {
            ImageContent::Encoded(bytes) => bytes,
            ImageContent::Missing(sentence) => return Err(TextureError::Missing(sentence.clone()).into()),
            ImageContent::Absent => return Ok(TextureUse::NONE),
        };
        let index = match self.known.get(&(texture.image, is_color)) {
            Some(&index) => index,
            None => {
                let header = decode::header(&image.name, bytes)?;
                self.budget.spend_texture(&image.name, header.width, header.height)?;
                self.budget.spend("textures", 1, 256)?;
                self.wanted.push(Wanted { image: texture.image, is_color, header });
                self.known.insert((texture.image, is_color), self.wanted.len() - 1);
                self.wanted.len() - 1
            }
        };
        let Header { width, height, .. } = self.wanted[index].header;
        let texels = f64::from(width) * f64::from(height);
        self.budget.spend("textures", 1, 2 * size_of::<Use>() as u64)?;
        self.uses.push(Use { material: self.material, texture: index, transform: texture.transform, texels });
        Ok(TextureUse { transform: texture.transform, texture: index as u32, sampler: sampler(texture) })
    }

    /// Decodes all textures that were loaded.
    pub fn finish(
        self,
        geometry: &Geometry<'_>,
        projection: &Projection,
        skips: &mut Skips<'_>,
    ) -> Result<Textures, PlanError> {
        if self.wanted.is_empty() {
            return Ok(Textures::default());
        }
        let Self { mesh, budget, deadline, wanted, uses, .. } = self;
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
        let mut textures = Textures { texels: Vec::with_capacity(total as usize), images: Vec::new() };
        let mut most = 0;
        for (want, &first_level) in wanted.iter().zip(&first_levels) {
            let Header { width, height, decoding_bytes, .. } = want.header;
            // Images are decoded one after the other, in the memory of the one before.
            let bytes = decoding_bytes.saturating_add(mips::working_bytes(width, height));
            budget.spend("decoding textures", bytes.saturating_sub(most), 1)?;
            most = most.max(bytes);
            deadline.check()?;
            let image = &mesh.images[want.image as usize];
            let ImageContent::Encoded(encoded) = &image.content else { continue };
            let pixels = decode::decode(&image.name, encoded, &want.header)?;
            let first_texel = textures.texels.len() as u32;
            mips::append(&pixels, want.is_color, first_level, &mut textures.texels, deadline)?;
            let levels = mips::count(width, height);
            textures.images.push(Texture { width, height, first_level, levels, first_texel, padding: [0; 3] });
        }
        Ok(textures)
    }
}

/// Bits as in [`TextureUse::sampler`].
fn sampler(texture: &TextureRef) -> u32 {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => super::samplers::REPEAT,
        Wrap::Mirror => super::samplers::MIRROR,
        Wrap::Clamp => super::samplers::CLAMP,
    };
    let nearest = if texture.nearest { super::samplers::NEAREST } else { 0 };
    wrap(texture.wrap[0]) | wrap(texture.wrap[1]) << super::samplers::DOWN_SHIFT | nearest
}
