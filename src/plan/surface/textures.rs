//! Images to textures: decoded only if sampled, each once for each way it is read, and only as large as the picture can show.
//!
//! All textures of a picture together have at most [`TEXELS_MAX`] texels: while they have more, the largest one loses its
//! finest level.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use crate::limits::{Budget, Deadline};
use crate::mesh::Mesh;
use crate::mesh::material::{ImageContent, TextureRef, Wrap};
use crate::plan::context::PlanContext;
use crate::plan::skips::{SkipKind, Skips};
use crate::plan::surface::closeup;
use crate::plan::surface::closeup::Use;
use crate::plan::{PlanError, Projection, Texture, TextureUse, Textures};
use crate::texture::decode;
use crate::texture::decode::Header;
use crate::texture::mips;

/// 96 MiB of half floats: bindings of 128 MiB are the most that every GPU has.
pub const TEXELS_MAX: u64 = (96 << 20) / 8;

/// Collects what materials ask for, and decodes it at the end.
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

/// An image that is read in one way.
struct Wanted {
    image: u32,
    is_color: bool,
    header: Header,
}

impl<'a> TextureLoader<'a> {
    /// Nothing so far.
    pub fn new(mesh: &'a Mesh, cx: &'a mut PlanContext<'_>) -> Self {
        Self {
            mesh,
            budget: cx.budget,
            deadline: cx.deadline,
            material: 0,
            is_used: true,
            wanted: Vec::new(),
            known: BTreeMap::new(),
            uses: Vec::new(),
        }
    }

    /// Says whose textures are loaded next. One that no triangle uses (`is_used`) gets none.
    pub fn for_material(&mut self, material: usize, is_used: bool) {
        self.material = material as u32;
        self.is_used = is_used;
    }

    /// A texture for a material; `is_color` says that texels are sRGB.
    pub fn load(&mut self, texture: &TextureRef, is_color: bool) -> Result<TextureUse, PlanError> {
        // Without coordinates nothing says where it goes.
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

    /// Decodes all that was asked for.
    pub fn finish(self, projection: &Projection, skips: &mut Skips<'_>) -> Result<Textures, PlanError> {
        if self.wanted.is_empty() {
            return Ok(Textures::default());
        }
        let Self { mesh, budget, deadline, wanted, uses, .. } = self;
        let sizes: Vec<[u32; 2]> = wanted.iter().map(|w| [w.header.width, w.header.height]).collect();
        let mut finest = closeup::finest_levels(mesh, projection, &uses, wanted.len(), deadline)?;
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
            // One is decoded after the other, in the memory of the one before.
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

/// The level from which each texture is kept, given the finest that the picture can show. With or without finer levels
/// (`skip`), the picture is the same: what the cap takes from the picture does not depend on it.
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

/// Takes the finest level from the largest texture (of equal ones the first) until all fit; none beyond `last`.
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
        // What is not shown does not count, and what is kept beyond that takes nothing from what is.
        assert_eq!(first_levels(&sizes, &[2, 0, 3, 2], true), [2, 0, 3, 2]);
        let kept = first_levels(&sizes, &[2, 0, 3, 2], false);
        assert_eq!(kept, [2, 0, 0, 2]);
        let total: u64 = sizes.iter().zip(&kept).map(|(s, &k)| mips::texels(s[0], s[1], k)).sum();
        assert!(total <= TEXELS_MAX);
    }
}
