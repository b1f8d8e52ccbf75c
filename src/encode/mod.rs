//! A finished [`Image`](crate::image::Image) to the bytes of a file.

use crate::image::{Image, ImageFormat};

/// The encoder refused; never the client's fault.
#[derive(Debug, thiserror::Error)]
#[error("the picture could not be encoded: {0}")]
pub struct EncodeError(String);

/// Encodes.
pub fn encode(image: &Image, format: ImageFormat) -> Result<Vec<u8>, EncodeError> {
    let _ = (image, format);
    Err(EncodeError("no encoder".to_owned()))
}
