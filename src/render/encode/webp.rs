//! The encoder of animated WebP files. It writes the container, as Google's specification has it, around
//! frames that are encoded without loss.
//!
//! Each frame is first encoded as a file of its own by the encoder of single pictures. Such a file is a
//! RIFF header and one chunk, `VP8L`. The chunk is then copied into the container.

use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;

use super::{EncodeError, drop_alpha, frame};
use crate::image::Image;
use crate::limits::Deadline;

/// The bytes before the first chunk of a WebP file: `RIFF`, a length, `WEBP`.
const HEADER_BYTES: usize = 12;

/// Flags of `VP8X`: the file is animated; it has transparent pixels.
const ANIMATED: u8 = 0x02;
const ALPHA: u8 = 0x10;

/// Flag of `ANMF`: the frame replaces what is below it, instead of being blended over it.
const REPLACES: u8 = 0x02;

/// Encodes the frames of an animation, as [`super::encode_animation`] has them.
pub fn encode_animation(
    frames: &Image,
    count: u32,
    delay_ms: u32,
    deadline: &Deadline,
) -> Result<Vec<u8>, EncodeError> {
    let (is_opaque, (_, height_px)) = (frames.is_opaque(), frame(frames, 0, count));
    let size = [u24(frames.width_px - 1), u24(height_px - 1)].concat();
    let mut chunks = Vec::new();
    let flags = ANIMATED | if is_opaque { 0 } else { ALPHA };
    chunk(&mut chunks, *b"VP8X", &[&[flags, 0, 0, 0], &size[..]].concat())?;
    // A transparent background, and no last round.
    chunk(&mut chunks, *b"ANIM", &[0; 6])?;
    for index in 0..count {
        deadline.check()?;
        let still = still(frame(frames, index, count).0, [frames.width_px, height_px], is_opaque)?;
        let pixels = still.get(HEADER_BYTES..).unwrap_or_default();
        let at = [0; 6];
        chunk(&mut chunks, *b"ANMF", &[&at, &size[..], &u24(delay_ms), &[REPLACES], pixels].concat())?;
    }
    let mut bytes = Vec::with_capacity(chunks.len() + HEADER_BYTES);
    chunk(&mut bytes, *b"RIFF", &[b"WEBP", &chunks[..]].concat())?;
    Ok(bytes)
}

/// A frame as a file of its own.
fn still(rgba: &[u8], [width_px, height_px]: [u32; 2], is_opaque: bool) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    let encoder = WebPEncoder::new_lossless(&mut bytes);
    if is_opaque {
        encoder.encode(&drop_alpha(rgba), width_px, height_px, ExtendedColorType::Rgb8)?;
    } else {
        encoder.encode(rgba, width_px, height_px, ExtendedColorType::Rgba8)?;
    }
    Ok(bytes)
}

/// Appends a chunk: its name, its length, its bytes, and a zero where the length is odd.
fn chunk(to: &mut Vec<u8>, name: [u8; 4], bytes: &[u8]) -> Result<(), EncodeError> {
    let length = u32::try_from(bytes.len())
        .map_err(|_| EncodeError::Failed("the animation is larger than a WebP file can be".to_owned()))?;
    to.extend_from_slice(&name);
    to.extend_from_slice(&length.to_le_bytes());
    to.extend_from_slice(bytes);
    to.extend(std::iter::repeat_n(0, bytes.len() % 2));
    Ok(())
}

/// The three lowest bytes of a number.
fn u24(number: u32) -> [u8; 3] {
    let [a, b, c, _] = number.to_le_bytes();
    [a, b, c]
}
