//! The crate's public face: a mesh, a look and a renderer, without queues, files or sockets.

mod error;
mod mesh;
mod renderer;
mod spec;

pub use error::{Error, Fault};
pub use mesh::{Mesh, MeshReader};
pub use renderer::{Picture, Renderer};
pub use spec::Spec;

use crate::encode;
use crate::image::{Image, ImageFormat};
use crate::limits::Deadline;
use crate::spec::DEFAULT_EFFORT;

/// Encoding. The same picture always gives the same bytes.
impl Image {
    /// The bytes of a PNG file: lossless, without an alpha channel where every pixel is opaque.
    pub fn to_png(&self) -> Result<Vec<u8>, Error> {
        self.encode(ImageFormat::Png)
    }

    /// The bytes of a file in the given format. JPEG has no alpha: what is transparent is laid over
    /// white.
    pub fn encode(&self, format: ImageFormat) -> Result<Vec<u8>, Error> {
        self.encode_with_effort(format, DEFAULT_EFFORT)
    }

    /// As [`Image::encode`]. An effort from 4 to 9 makes smaller PNG files, in 5 to 100 times the
    /// time.
    pub fn encode_with_effort(&self, format: ImageFormat, effort: u32) -> Result<Vec<u8>, Error> {
        Ok(encode::encode(self, format, effort, &Deadline::default())?)
    }
}
