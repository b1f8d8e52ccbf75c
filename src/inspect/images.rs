//! The test whether an image of a mesh (a texture) is damaged, without decoding its pixels: its header is read, and
//! of a PNG also the checksums of the chunks that change pixels, up to the end. Reports name the images that fail it,
//! and so does the rule `no-warnings`.

use std::io::BufRead;

use meshsnap_render::texture::TextureError;
use meshsnap_render::texture::decode::{self, Header};
use meshsnap_render::texture::png::CriticalChunks;

/// Bytes of a PNG's signature.
const SIGNATURE_BYTES: usize = 8;

/// The header of an image without faults: those of the header, and of a PNG false checksums. Pixels may be broken beyond
/// that.
pub fn checked_header(name: &str, bytes: &[u8]) -> Result<Header, TextureError> {
    let header = decode::header(name, bytes)?;
    if header.encoding_name() == "png" && !has_all_chunks(bytes) {
        let detail = format!("{name} of the mesh is damaged: a checksum is false, or its end is missing");
        return Err(TextureError::Broken(detail));
    }
    Ok(header)
}

/// True if each chunk of a PNG that changes pixels is there, up to the last, with a checksum that is right. ISO/IEC
/// 15948, 5.3.
fn has_all_chunks(bytes: &[u8]) -> bool {
    let mut chunks = CriticalChunks::new(bytes);
    chunks.consume(SIGNATURE_BYTES);
    loop {
        let chunk = chunks.fill_buf().unwrap_or_default();
        let chunk_bytes = chunk.len();
        let Some((body, crc)) = chunk.get(4..).and_then(<[u8]>::split_last_chunk) else { return false };
        if body.len() < 4 || crc32fast::hash(body) != u32::from_be_bytes(*crc) {
            return false;
        }
        if body.starts_with(b"IEND") {
            return true;
        }
        chunks.consume(chunk_bytes);
    }
}
