//! Decoded images of one mesh, kept from picture to picture. Looks that sample different images each find
//! theirs.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::texture::mips::Reading;
use crate::texture::{Texture, TextureError, Textures, fit};

/// Most texels that are kept: those of two pictures at their largest.
const TEXELS_MAX: u64 = 2 * fit::TEXELS_MAX;

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
    /// Texels of all images.
    texels: u64,
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

    /// Keeps a decoded image, in place of one that begins with a coarser level.
    pub fn keep(&self, key: ImageKey, decoded: &Decoded) {
        self.with(|kept| kept.keep(key, decoded));
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
            if kept.sets.len() == SETS_MAX {
                kept.sets.remove(0);
            }
            kept.sets.push(set);
            kept.drop_stale_sets();
            shared
        })
    }

    /// Memory of the images, bytes.
    pub fn bytes(&self) -> u64 {
        self.with(|kept| {
            let lists = kept.sets.iter().map(|set| size_of_val(&set.textures.images[..]) as u64).sum::<u64>();
            kept.texels * size_of::<[u16; 4]>() as u64 + lists
        })
    }

    fn with<T>(&self, act: impl FnOnce(&mut Kept) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Kept {
    fn keep(&mut self, key: ImageKey, decoded: &Decoded) {
        let first_level = decoded.as_ref().map_or(0, |texture| texture.first_level);
        if self.images.get(&key).is_some_and(|entry| entry.is_enough(first_level)) {
            return;
        }
        self.remove(key);
        self.now += 1;
        let entry = Entry { decoded: decoded.clone(), used: self.now };
        self.texels += entry.texels();
        self.images.insert(key, entry);
        while self.texels > TEXELS_MAX {
            let Some(oldest) = self.images.iter().min_by_key(|(_, entry)| entry.used).map(|(key, _)| *key) else {
                break;
            };
            self.remove(oldest);
        }
        self.drop_stale_sets();
    }

    fn remove(&mut self, key: ImageKey) {
        self.texels -= self.images.remove(&key).map_or(0, |entry| entry.texels());
    }

    /// Drops sets with an image that is not kept any more, which would hold its memory.
    fn drop_stale_sets(&mut self) {
        let is_kept = |key: &ImageKey, texture: &Texture| match self.images.get(key).map(|entry| &entry.decoded) {
            Some(Ok(kept)) => kept.texels.is_of(&texture.texels),
            Some(Err(_)) => true,
            None => false,
        };
        let mut sets = std::mem::take(&mut self.sets);
        sets.retain(|set| set.keys.iter().zip(&set.textures.images).all(|(key, texture)| is_kept(key, texture)));
        self.sets = sets;
    }
}

impl Entry {
    fn is_enough(&self, first_level: u32) -> bool {
        self.decoded.as_ref().map_or(true, |texture| texture.first_level <= first_level)
    }

    fn texels(&self) -> u64 {
        self.decoded.as_ref().map_or(0, |texture| texture.texels.len() as u64)
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

    fn first_level(kept: &KeptTextures, key: ImageKey, wanted: u32) -> Option<u32> {
        kept.find(key, wanted).map(|decoded| decoded.unwrap().first_level)
    }

    #[test]
    fn an_image_is_found_where_it_is_fine_enough() {
        let kept = KeptTextures::default();
        kept.keep(COLOR(0), &decoded(16, 2));
        assert_eq!([1, 2, 3].map(|wanted| first_level(&kept, COLOR(0), wanted)), [None, Some(2), Some(2)]);
        assert!(kept.find((0, Reading::plain(false)), 2).is_none(), "it was read as a colour");
        kept.keep(COLOR(0), &decoded(16, 3));
        assert_eq!(first_level(&kept, COLOR(0), 2), Some(2), "a coarser one does not take its place");
        kept.keep(COLOR(0), &decoded(16, 0));
        assert_eq!(first_level(&kept, COLOR(0), 1), Some(0));
        assert_eq!(kept.bytes(), 8 * mips::texels(16, 16, 0));
        // A fault is one for every level.
        let fault = TextureError::Broken("image 1 is broken".into());
        kept.keep(COLOR(1), &Err(fault.clone()));
        assert_eq!(kept.find(COLOR(1), 0).unwrap().unwrap_err(), fault);
    }

    #[test]
    fn the_least_recently_used_makes_room() {
        let kept = KeptTextures::default();
        // 5.6 million texels each: four fit.
        for image in 0..4 {
            kept.keep(COLOR(image), &decoded(2048, 0));
        }
        assert!(kept.find(COLOR(0), 0).is_some());
        kept.keep(COLOR(4), &decoded(2048, 0));
        let found: Vec<u32> = (0..5).filter(|&image| kept.find(COLOR(image), 0).is_some()).collect();
        assert_eq!(found, [0, 2, 3, 4]);
        assert_eq!(kept.bytes(), 4 * 8 * mips::texels(2048, 2048, 0));
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
            kept.keep(COLOR(image), &decoded(16, 1));
        }
        let (both, one) = (set(&kept, &[0, 1]), set(&kept, &[1]));
        assert!(Arc::ptr_eq(&both, &set(&kept, &[0, 1])) && Arc::ptr_eq(&one, &set(&kept, &[1])));
        // From a finer level on it is another set, and those with what was there before are not held.
        kept.keep(COLOR(0), &decoded(16, 0));
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
