//! Textures: encoded images to levels that a back-end can sample.
//!
//! ```text
//! bytes -> Header (size, memory) -> Pixels (as stored) -> levels (linear RGBA, half floats)
//! ```
//!
//! - [`decode`]: an image's header, then its pixels. The `image` crate decodes PNG, JPEG, WebP, BMP, TGA and
//!   DDS.
//! - [`basis`]: KTX2 files with Basis Universal data.
//! - [`png`]: drops a PNG's ancillary chunks before the decoder reads them.
//! - [`mips`]: makes the levels of one image.
//! - [`coverage`]: keeps cut-outs as wide at coarse levels as they are.
//! - [`fit`]: chooses the finest level of each image, so that all textures of a picture fit.
//!
//! Memory is paid for first. A header says how much decoding takes, the caller spends that from the
//! job's budget, and only then are pixels decoded. The plan decides which images a picture needs
//! and how close it comes to each.
//!
//! **Invariant**: the encoding is sniffed from the bytes. A file name or a declared type is not
//! trusted.
//!
//! An image that cannot be read is a warning ([`fault_warnings`]), and its materials are drawn without it.

pub(crate) mod basis;
pub(crate) mod coverage;
pub(crate) mod decode;
pub(crate) mod fit;
pub(crate) mod mips;
pub(crate) mod png;

use crate::warning::Warning;

/// Decoded textures with their levels.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    /// Linear RGBA with straight alpha, as IEEE 754 half floats: row by row, then level by level
    /// (finest first), then image by image.
    pub texels: Vec<[u16; 4]>,
    /// The place of each image in `texels`.
    pub images: Vec<Texture>,
}

/// An image in [`Textures::texels`]. Level k has `max(1, width >> k)` by `max(1, height >> k)`
/// texels.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Texture {
    /// Columns of level 0, texels.
    pub width: u32,
    /// Rows of level 0, texels.
    pub height: u32,
    /// The finest level that is stored. The picture samples none that is finer.
    pub first_level: u32,
    /// One more than the number of the coarsest level, which has a single texel.
    pub levels: u32,
    /// Index in [`Textures::texels`] of the first texel of `first_level`.
    pub first_texel: u32,
    /// Always 0: shaders read an entry as four words of 8 bytes.
    pub padding: [u32; 3],
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
pub(crate) fn fault_warnings(faults: &[TextureError]) -> Vec<Warning> {
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
