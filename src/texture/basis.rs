//! Basis Universal textures in KTX2 files, as KHR_texture_basisu has them: the largest image, transcoded to RGBA.
//! <https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html>

use std::panic::catch_unwind;

use crate::plan::PlanError;
use basisu::{DecodeFlags, TargetFormat, Transcoder};

/// What a KTX2 file's header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BasisHeader {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Memory that transcoding takes, the result included.
    pub decoding_bytes: u64,
}

/// The first bytes of any KTX2 file.
pub const KTX2_MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Zstandard, as supercompression; below it BasisLZ and none, above it what glTF does not have.
const ZSTANDARD: u32 = 2;
/// The largest window that the decoder of Zstandard gives itself, and tables.
const ZSTANDARD_BYTES: u64 = 128 << 20;
/// Code books, of 16-bit counts, and tables.
const CODE_BOOK_BYTES: u64 = 8 << 20;
/// A block of 4 x 4 texels of the less compressed of the two codecs.
const BLOCK_BYTES: u64 = 16;

/// Reads what is needed to know the cost, and no more. `name` is for errors.
pub fn header(name: &str, bytes: &[u8]) -> Result<BasisHeader, PlanError> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        word.ok_or_else(|| broken(name, "is cut off"))
    };
    let [width, height, depth] = [word(20)?, word(24)?, word(28)?];
    let [layers, faces, scheme] = [word(32)?, word(36)?, word(44)?];
    if word(12)? != 0 || scheme > ZSTANDARD {
        return Err(broken(name, "is a KTX2 file that is not of Basis Universal: those alone are read"));
    }
    if width == 0 || height == 0 || depth > 0 || layers > 1 || faces != 1 {
        return Err(broken(name, "is a KTX2 file that is not one flat picture"));
    }
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    // Sizes are checked later: 2^60 blocks may be claimed here.
    let decoded_bytes = blocks.saturating_mul(16 * 4 + BLOCK_BYTES);
    let mut decoding_bytes = decoded_bytes.saturating_add(CODE_BOOK_BYTES + bytes.len() as u64);
    if scheme == ZSTANDARD {
        // The decoder takes the file's word for how long the largest image is.
        let unpacked = u64::from(word(96)?) | u64::from(word(100)?) << 32;
        let expected = blocks.saturating_mul(BLOCK_BYTES);
        if unpacked != expected {
            let detail = format!("says that it unpacks to {unpacked} bytes, and it should be {expected}");
            return Err(broken(name, &detail));
        }
        decoding_bytes = decoding_bytes.saturating_add(ZSTANDARD_BYTES);
    }
    Ok(BasisHeader { width, height, decoding_bytes })
}

/// Transcodes to straight RGBA, 8 bits a channel; the caller has paid for it.
pub fn decode(name: &str, bytes: &[u8], header: &BasisHeader) -> Result<Vec<u8>, PlanError> {
    // A young crate with a large input: what it does not survive is the file's fault, not ours.
    let texels = catch_unwind(|| {
        let texture = Transcoder::new(bytes).ok()?;
        let same = texture.base_dimensions() == (header.width, header.height);
        same.then(|| texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).ok())?
    });
    let wanted = header.width as usize * header.height as usize * 4;
    let texels = texels.ok().flatten().filter(|texels| texels.len() == wanted);
    texels.ok_or_else(|| broken(name, "cannot be transcoded: its data is broken, or of a kind that is not read"))
}

fn broken(name: &str, detail: &str) -> PlanError {
    PlanError::Texture(format!("{name} of the mesh {detail}"))
}
