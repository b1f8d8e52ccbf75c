//! KTX2 files with Basis Universal data, as the glTF extension KHR_texture_basisu has them: the
//! largest image, transcoded to RGBA. A build without the feature `basis` reads the header alone
//! and refuses the image.
//!
//! Offsets and field names are those of the KTX File Format, version 2.0, section 3
//! (<https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html>).

#[cfg(feature = "basis")]
use crate::guard::guarded;
use crate::texture::TextureError;

/// The header of a KTX2 file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BasisHeader {
    /// Columns, texels.
    pub width: u32,
    /// Rows, texels.
    pub height: u32,
    /// Memory that transcoding takes, the result included.
    pub decoding_bytes: u64,
}

/// The first bytes of every KTX2 file.
pub const KTX2_MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// `supercompressionScheme` of Zstandard. Smaller numbers are BasisLZ (1) and none (0); glTF allows
/// no larger one.
const ZSTANDARD: u32 = 2;
/// The largest window that the Zstandard decoder allocates, and its tables.
const ZSTANDARD_BYTES: u64 = 128 << 20;
/// BasisLZ's code books, whose entries are counted in 16 bits, and their tables.
const CODE_BOOK_BYTES: u64 = 8 << 20;
/// One block of 4 x 4 texels in UASTC, the larger of the two codecs.
const BLOCK_BYTES: u64 = 16;

/// Reads the header alone, which tells what transcoding costs. `name` is the image's, for errors.
pub fn header(name: &str, bytes: &[u8]) -> Result<BasisHeader, TextureError> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        word.ok_or_else(|| broken(name, "is cut off"))
    };
    let [width, height, depth] = [word(20)?, word(24)?, word(28)?];
    let [layers, faces, scheme] = [word(32)?, word(36)?, word(44)?];
    // Basis Universal data has `vkFormat` 0.
    if word(12)? != 0 || scheme > ZSTANDARD {
        return Err(unsupported(name, "is a KTX2 file that is not of Basis Universal: those alone are read"));
    }
    if width == 0 || height == 0 || depth > 0 || layers > 1 || faces != 1 {
        return Err(unsupported(name, "is a KTX2 file that is not one flat picture"));
    }
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    // The caller checks the size later, so a header may claim 2^60 blocks here.
    let decoded_bytes = blocks.saturating_mul(16 * 4 + BLOCK_BYTES);
    let mut decoding_bytes = decoded_bytes.saturating_add(CODE_BOOK_BYTES + bytes.len() as u64);
    if scheme == ZSTANDARD {
        // The decoder allocates the uncompressed length that the file claims, so the claim is
        // checked.
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

/// Transcodes to straight RGBA with 8 bits per channel. The caller has spent
/// [`BasisHeader::decoding_bytes`].
#[cfg(feature = "basis")]
pub fn decode(name: &str, bytes: &[u8], header: &BasisHeader) -> Result<Vec<u8>, TextureError> {
    use basisu::{DecodeFlags, TargetFormat, Transcoder};
    let texels = guarded("Basis", || {
        let texture = Transcoder::new(bytes).ok()?;
        let same = texture.base_dimensions() == (header.width, header.height);
        same.then(|| texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).ok())?
    });
    let wanted = header.width as usize * header.height as usize * 4;
    let texels = texels.ok().flatten().filter(|texels| texels.len() == wanted);
    texels.ok_or_else(|| broken(name, "cannot be transcoded: its data is broken, or of a kind that is not read"))
}

/// Refuses: this build has no transcoder.
#[cfg(not(feature = "basis"))]
pub fn decode(name: &str, _: &[u8], _: &BasisHeader) -> Result<Vec<u8>, TextureError> {
    Err(unsupported(name, "is a Basis Universal texture, and this program was built without the feature `basis`"))
}

fn broken(name: &str, detail: &str) -> TextureError {
    TextureError::Broken(format!("{name} of the mesh {detail}"))
}

fn unsupported(name: &str, detail: &str) -> TextureError {
    TextureError::Unsupported(format!("{name} of the mesh {detail}"))
}
