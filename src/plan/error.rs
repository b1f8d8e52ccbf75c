//! Why there is no plan. It is always the input's fault.

use crate::limits::{LimitExceeded, Stopped};
use crate::texture::TextureError;

/// A mesh and a request that do not make a picture; the text is safe to show.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// More than is allowed.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// A texture that the picture needs cannot be read. The mesh is at fault.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// The request asks for the file's camera, and there is none.
    #[error("`camera.from_file` is true, and the file has no camera")]
    NoCamera,
    /// The job's time was up.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}
