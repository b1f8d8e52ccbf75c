//! Textures: encoded images to levels that a back-end can sample.
//!
//! ```text
//! bytes -> Header (size, memory) -> Pixels (as stored) -> levels (linear RGBA, half floats)
//! ```
//!
//! - [`decode`]: an image's header, then its pixels. The `image` crate decodes PNG, JPEG, WebP, BMP, TGA and
//!   DDS.
//! - [`basis`]: KTX2 files with Basis Universal data.
//! - [`png`]: drops the chunks of a PNG that its pixels do not need, before the decoder reads them.
//! - [`mips`]: makes the levels of one image.
//! - [`cut_out`]: the distance of texels from the border of what is cut out.
//! - [`fit`]: chooses the finest level of each image, so that all textures of a picture fit.
//! - [`kept`]: a mesh's decoded images, from one picture to the next.
//!
//! Memory is taken from the job's budget first. A header says how much decoding takes, the caller takes that from
//! the budget, and only then are pixels decoded. The plan decides which images a picture needs and how close it
//! comes to each.
//!
//! **Invariant**: the encoding is sniffed from the bytes. A file name or a declared type is not
//! trusted.
//!
//! An image that cannot be read is a warning ([`fault_warnings`]), and its materials are drawn without it.

pub mod basis;
pub mod cut_out;
pub mod decode;
pub mod fit;
pub mod kept;
pub mod mips;
pub mod png;

use std::ops::Deref;
use std::sync::Arc;

use crate::warning::Warning;

/// The textures of a picture.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    /// By the index that a material's use has.
    pub images: Vec<Texture>,
}

/// An image with its levels. Level k has `max(1, width >> k)` by `max(1, height >> k)` texels.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Columns of level 0, texels.
    pub width: u32,
    /// Rows of level 0, texels.
    pub height: u32,
    /// The finest level that is stored. The picture samples none that is finer.
    pub first_level: u32,
    /// One more than the number of the coarsest level, which has a single texel.
    pub levels: u32,
    /// The levels from `first_level` on; none of an image that is broken.
    pub texels: Texels,
}

/// Linear RGBA with straight alpha, as IEEE 754 half floats: row by row, then level by level, finest first.
///
/// A slice, of memory that several pictures may share.
#[derive(Clone, Debug, Default)]
pub struct Texels {
    all: Arc<Vec<[u16; 4]>>,
    first: usize,
}

impl Textures {
    /// Number of texels of all images.
    pub fn texel_count(&self) -> u64 {
        self.images.iter().map(|image| image.texels.len() as u64).sum()
    }

    /// True if the others are the same texels in memory, image by image.
    fn are_same(&self, others: &Self) -> bool {
        let is_same = |(a, b): (&Texture, &Texture)| a.first_level == b.first_level && a.texels.is_same(&b.texels);
        self.images.len() == others.images.len() && self.images.iter().zip(&others.images).all(is_same)
    }
}

impl Texture {
    /// The same from a coarser level on.
    pub fn from_level(&self, first_level: u32) -> Self {
        let texels = |first| mips::texels(self.width, self.height, first) as usize;
        let first_level = first_level.clamp(self.first_level, self.levels.max(1) - 1);
        let skipped = texels(self.first_level) - texels(first_level);
        let first = (self.texels.first + skipped).min(self.texels.all.len());
        Self { first_level, texels: Texels { all: Arc::clone(&self.texels.all), first }, ..*self }
    }
}

impl Texels {
    /// True if the others are the same in memory. All without texels are.
    fn is_same(&self, others: &Self) -> bool {
        Arc::ptr_eq(&self.all, &others.all) && self.first == others.first || self.is_empty() && others.is_empty()
    }

    /// True if these are in the memory of the others.
    fn is_of(&self, others: &Self) -> bool {
        Arc::ptr_eq(&self.all, &others.all)
    }
}

impl From<Vec<[u16; 4]>> for Texels {
    fn from(texels: Vec<[u16; 4]>) -> Self {
        Self { all: Arc::new(texels), first: 0 }
    }
}

impl Deref for Texels {
    type Target = [[u16; 4]];

    fn deref(&self) -> &Self::Target {
        self.all.get(self.first..).unwrap_or_default()
    }
}

/// An image that cannot become a texture.
///
/// The upload is always at fault. Each text is one sentence that names the image and is safe to
/// show to a client.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextureError {
    /// The image's data contradicts its own format.
    #[error("{0}")]
    Broken(String),
    /// The image may be valid, but its encoding is not read here.
    #[error("{0}")]
    Unsupported(String),
}

/// Warnings of images that cannot be read: one for each kind of fault, with the first image's reason.
pub fn fault_warnings(faults: &[TextureError]) -> Vec<Warning> {
    let is_broken = |fault: &&TextureError| matches!(fault, TextureError::Broken(_));
    let (broken, unsupported): (Vec<_>, Vec<_>) = faults.iter().partition(is_broken);
    let warning = |faults: Vec<&TextureError>, code: &'static str| {
        let first = faults.first()?;
        let detail = match faults.len() {
            1 => format!("{first}; what it belongs to is drawn without it"),
            n => format!("{first}; so it is with {} more, and what they belong to is drawn without them", n - 1),
        };
        Some(Warning { code, detail })
    };
    [(broken, "textures_broken"), (unsupported, "textures_unsupported")]
        .into_iter()
        .filter_map(|(faults, code)| warning(faults, code))
        .collect()
}
