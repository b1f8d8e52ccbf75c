//! The decoded images of one mesh, kept in memory from picture to picture, so that they are not decoded
//! again. Images are kept one by one, since the pictures of a mesh may sample different ones. Where
//! they take too much memory, the least recently used go first. The sets of images that the last
//! pictures sampled are kept as shared objects, by which the GPU back-end knows that it has them
//! already.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::texture::mips::Reading;
use crate::texture::{Texture, TextureError, Textures, fit};

/// Most memory that is kept, bytes: the texels of two pictures at their largest.
const BYTES_MAX: u64 = 2 * fit::TEXELS_MAX * size_of::<[u16; 4]>() as u64;

/// Memory of an image beside its texels, bytes: its entry here and its heap block, a little more.
const ENTRY_BYTES: u64 = 192;

/// Most sets of textures that are known. Each is one buffer of a GPU.
const SETS_MAX: usize = 16;

/// An image by its index, and how it is read.
pub type ImageKey = (u32, Reading);

/// An image's levels, or its fault.
pub type Decoded = Result<Texture, TextureError>;

/// Decoded images of a mesh, which must not change. The least recently used go first.
#[derive(Debug, Default)]
pub struct KeptTextures(Mutex<Kept>);

#[derive(Debug, Default)]
struct Kept {
    images: BTreeMap<ImageKey, Entry>,
    /// Memory of all images.
    bytes: u64,
    /// Last used last.
    sets: Vec<Set>,
    /// Counts uses.
    now: u64,
}

#[derive(Debug)]
struct Entry {
    decoded: Decoded,
    used: u64,
}

/// The textures of a picture, in their order.
#[derive(Debug)]
struct Set {
    keys: Vec<ImageKey>,
    textures: Arc<Textures>,
}

impl KeptTextures {
    /// An image that begins with `first_level` or a finer level, or the fault that decoding it has shown.
    pub fn find(&self, key: ImageKey, first_level: u32) -> Option<Decoded> {
        self.with(|kept| {
            kept.now += 1;
            let now = kept.now;
            let entry = kept.images.get_mut(&key).filter(|entry| entry.is_enough(first_level))?;
            entry.used = now;
            Some(entry.decoded.clone())
        })
    }

    /// Keeps decoded images, in place of those that begin with a coarser level. Where another picture has kept as fine
    /// an image in the meantime, it takes the place of the given one.
    pub fn keep<'a>(&self, images: impl Iterator<Item = (ImageKey, &'a mut Decoded)>) {
        self.with(|kept| {
            let mut is_changed = false;
            images.for_each(|(key, decoded)| is_changed |= kept.keep(key, decoded));
            if is_changed {
                kept.make_room();
                kept.drop_stale_sets();
            }
        });
    }

    /// The same textures as one object for all pictures that have them. So a GPU knows that it has them.
    pub fn shared(&self, keys: Vec<ImageKey>, textures: Textures) -> Arc<Textures> {
        self.with(|kept| {
            let known = kept.sets.iter().position(|set| set.keys == keys && set.textures.are_same(&textures));
            let set = match known {
                Some(known) => kept.sets.remove(known),
                None => Set { keys, textures: Arc::new(textures) },
            };
            let shared = Arc::clone(&set.textures);
            if known.is_some() || kept.is_current(&set) {
                if kept.sets.len() == SETS_MAX {
                    kept.sets.remove(0);
                }
                kept.sets.push(set);
            }
            shared
        })
    }

    /// Memory of the images and of the lists of sets, bytes.
    pub fn bytes(&self) -> u64 {
        self.with(|kept| {
            let of_set = |set: &Set| size_of_val(&set.textures.images[..]) + size_of_val(&set.keys[..]);
            kept.bytes + kept.sets.iter().map(|set| of_set(set) as u64).sum::<u64>()
        })
    }

    fn with<T>(&self, act: impl FnOnce(&mut Kept) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Kept {
    /// True if the image was not kept before.
    fn keep(&mut self, key: ImageKey, decoded: &mut Decoded) -> bool {
        let first_level = decoded.as_ref().map_or(u32::MAX, |texture| texture.first_level);
        if let Some(entry) = self.images.get(&key).filter(|entry| entry.is_enough(first_level)) {
            *decoded = entry.decoded.clone();
            return false;
        }
        self.now += 1;
        let entry = Entry { decoded: decoded.clone(), used: self.now };
        self.bytes += entry.bytes();
        self.bytes -= self.images.insert(key, entry).map_or(0, |before| before.bytes());
        true
    }

    fn make_room(&mut self) {
        if self.bytes <= BYTES_MAX {
            return;
        }
        let mut oldest_first: Vec<(u64, ImageKey)> =
            self.images.iter().map(|(key, entry)| (entry.used, *key)).collect();
        oldest_first.sort_unstable();
        for (_, key) in oldest_first {
            if self.bytes <= BYTES_MAX {
                break;
            }
            self.bytes -= self.images.remove(&key).map_or(0, |entry| entry.bytes());
        }
    }

    /// Drops sets with an image that is not kept any more, which would hold its memory.
    fn drop_stale_sets(&mut self) {
        let mut sets = std::mem::take(&mut self.sets);
        sets.retain(|set| self.is_current(set));
        self.sets = sets;
    }

    /// True if all images of a set are kept.
    fn is_current(&self, set: &Set) -> bool {
        let is_kept = |(key, texture): (&ImageKey, &Texture)| match self.images.get(key).map(|entry| &entry.decoded) {
            Some(Ok(kept)) => kept.texels.is_of(&texture.texels),
            Some(Err(_)) => texture.texels.is_empty(),
            None => false,
        };
        set.keys.iter().zip(&set.textures.images).all(is_kept)
    }
}

impl Entry {
    fn is_enough(&self, first_level: u32) -> bool {
        self.decoded.as_ref().map_or(true, |texture| texture.first_level <= first_level)
    }

    fn bytes(&self) -> u64 {
        let own = match &self.decoded {
            Ok(texture) => size_of_val(&texture.texels[..]),
            Err(fault) => fault.to_string().len(),
        };
        ENTRY_BYTES + own as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::mips;

    const COLOR: fn(u32) -> ImageKey = |image| (image, Reading::plain(true));

    fn decoded(side: u32, first_level: u32) -> Decoded {
        let texels = vec![[7; 4]; mips::texels(side, side, first_level) as usize].into();
        Ok(Texture { width: side, height: side, first_level, levels: mips::count(side, side), texels })
    }

    fn keep(kept: &KeptTextures, key: ImageKey, mut decoded: Decoded) {
        kept.keep(std::iter::once((key, &mut decoded)));
    }

    fn first_level(kept: &KeptTextures, key: ImageKey, wanted: u32) -> Option<u32> {
        kept.find(key, wanted).map(|decoded| decoded.unwrap().first_level)
    }

    #[test]
    fn an_image_is_found_where_it_is_fine_enough() {
        let kept = KeptTextures::default();
        keep(&kept, COLOR(0), decoded(16, 2));
        assert_eq!([1, 2, 3].map(|wanted| first_level(&kept, COLOR(0), wanted)), [None, Some(2), Some(2)]);
        assert!(kept.find((0, Reading::plain(false)), 2).is_none(), "it was read as a colour");
        keep(&kept, COLOR(0), decoded(16, 3));
        assert_eq!(first_level(&kept, COLOR(0), 2), Some(2), "a coarser one does not take its place");
        keep(&kept, COLOR(0), decoded(16, 0));
        assert_eq!(first_level(&kept, COLOR(0), 1), Some(0));
        assert_eq!(kept.bytes(), ENTRY_BYTES + 8 * mips::texels(16, 16, 0));
        // Of two that were decoded at once, the second is given the first.
        let mut second = decoded(16, 1);
        kept.keep(std::iter::once((COLOR(0), &mut second)));
        assert_eq!(second.unwrap().first_level, 0);
        // A fault is one for every level, and does not replace what was decoded.
        let fault = TextureError::Broken("image 1 is broken".into());
        keep(&kept, COLOR(1), Err(fault.clone()));
        assert_eq!(kept.find(COLOR(1), 0).unwrap().unwrap_err(), fault);
        keep(&kept, COLOR(0), Err(fault));
        assert_eq!(first_level(&kept, COLOR(0), 0), Some(0));
    }

    #[test]
    fn the_least_recently_used_makes_room() {
        let kept = KeptTextures::default();
        // 44.7 MB each: four fit.
        for image in 0..4 {
            keep(&kept, COLOR(image), decoded(2048, 0));
        }
        assert!(kept.find(COLOR(0), 0).is_some());
        keep(&kept, COLOR(4), decoded(2048, 0));
        let found: Vec<u32> = (0..5).filter(|&image| kept.find(COLOR(image), 0).is_some()).collect();
        assert_eq!(found, [0, 2, 3, 4]);
        assert_eq!(kept.bytes(), 4 * (ENTRY_BYTES + 8 * mips::texels(2048, 2048, 0)));
    }

    #[test]
    fn pictures_of_the_same_textures_share_a_set() {
        let kept = KeptTextures::default();
        let set = |kept: &KeptTextures, images: &[u32]| {
            let keys: Vec<ImageKey> = images.iter().map(|&image| COLOR(image)).collect();
            let images = keys.iter().map(|&key| kept.find(key, 4).unwrap().unwrap()).collect();
            kept.shared(keys, Textures { images })
        };
        for image in 0..2 {
            keep(&kept, COLOR(image), decoded(16, 1));
        }
        let (both, one) = (set(&kept, &[0, 1]), set(&kept, &[1]));
        assert!(Arc::ptr_eq(&both, &set(&kept, &[0, 1])) && Arc::ptr_eq(&one, &set(&kept, &[1])));
        // From a finer level on it is another set, and those with what was there before are not held.
        keep(&kept, COLOR(0), decoded(16, 0));
        assert_eq!(Arc::strong_count(&both), 1);
        assert!(!Arc::ptr_eq(&both, &set(&kept, &[0, 1])));
        assert!(Arc::ptr_eq(&one, &set(&kept, &[1])));
        // A part of an image is not the whole.
        let part = Textures { images: vec![one.images[0].from_level(2)] };
        assert!(!Arc::ptr_eq(&one, &kept.shared(vec![COLOR(1)], part)));
        for first_level in 2..64 {
            let part = Textures { images: vec![one.images[0].from_level(first_level)] };
            kept.shared(vec![COLOR(1)], part);
        }
        assert!(kept.with(|kept| kept.sets.len()) <= SETS_MAX);
    }
}
