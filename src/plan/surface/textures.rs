//! Images to textures: decoded only if sampled, once per way of reading them, and only as large as
//! the picture can show.
//!
//! All textures of a picture together have at most [`TEXELS_MAX`] texels: while they have more, the
//! largest one loses its finest level.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::{ImageContent, TextureRef, Wrap};
use crate::plan::geometry::Geometry;
use crate::plan::projection::Projection;
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::surface::closeup;
use crate::plan::surface::closeup::Use;
use crate::plan::{PlanError, Texture, TextureUse, Textures};
use crate::texture::decode;
use crate::texture::decode::Header;
use crate::texture::mips;

/// Texels of all textures of a picture: 96 MiB of half floats, because bindings of 128 MiB are the
/// most that every GPU has.
pub const TEXELS_MAX: u64 = (96 << 20) / 8;

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
            ImageContent::Missing(sentence) => return Err(PlanError::Texture(sentence.clone())),
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
        let first_levels = first_levels(&sizes, &finest, skip);

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
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    wrap(texture.wrap[0]) | wrap(texture.wrap[1]) << 2 | u32::from(texture.nearest) << 4
}

/// The finest level that is kept of each texture, given the finest that the picture can show.
///
/// The picture is the same with or without finer levels (`skip`): the cap takes the same levels
/// from it either way.
fn first_levels(sizes: &[[u32; 2]], finest: &[u32], skip: bool) -> Vec<u32> {
    let mut shown = finest.to_vec();
    halve(sizes, &mut shown, |_| u32::MAX);
    if skip {
        return shown;
    }
    let mut kept: Vec<u32> = shown.iter().zip(finest).map(|(&s, &f)| if s > f { s } else { 0 }).collect();
    halve(sizes, &mut kept, |i| shown[i]);
    kept
}

/// Takes the finest level from the largest texture (of equal ones the first) until all fit, and no
/// level beyond `last`.
fn halve(sizes: &[[u32; 2]], first: &mut [u32], last: impl Fn(usize) -> u32) {
    let texels = |i: usize, first: u32| mips::texels(sizes[i][0], sizes[i][1], first);
    let mut total: u64 = (0..sizes.len()).map(|i| texels(i, first[i])).sum();
    let mut heap: BinaryHeap<(u64, Reverse<usize>)> =
        (0..sizes.len()).map(|i| (texels(i, first[i]), Reverse(i))).collect();
    while total > TEXELS_MAX {
        let Some((before, Reverse(i))) = heap.pop() else { return };
        if first[i] < last(i) && first[i] + 1 < mips::count(sizes[i][0], sizes[i][1]) {
            first[i] += 1;
            let after = texels(i, first[i]);
            total -= before - after;
            heap.push((after, Reverse(i)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_are_halved_until_all_fit() {
        let sizes = [[4096, 4096], [2048, 2048], [64, 64], [4096, 4096]];
        // With their smaller levels 22.4 + 5.6 + 22.4 million texels; 12.6 are allowed.
        assert_eq!(first_levels(&sizes, &[0; 4], true), [2, 1, 0, 1]);
        assert_eq!(first_levels(&sizes, &[0; 4], false), [2, 1, 0, 1]);
        // Levels that are not shown do not count, and keeping them takes nothing from those that
        // are.
        assert_eq!(first_levels(&sizes, &[2, 0, 3, 2], true), [2, 0, 3, 2]);
        let kept = first_levels(&sizes, &[2, 0, 3, 2], false);
        assert_eq!(kept, [2, 0, 0, 2]);
        let total: u64 = sizes.iter().zip(&kept).map(|(s, &k)| mips::texels(s[0], s[1], k)).sum();
        assert!(total <= TEXELS_MAX);
    }
}
