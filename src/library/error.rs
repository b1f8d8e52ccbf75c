//! Errors of the library. Each says which party can mend it ([`Fault`]): the author of the mesh,
//! the author of the request, the caller, who stopped the work, or the machine or this crate.

use meshsnap_render::backend::DrawError;
use meshsnap_render::encode::EncodeError;
use meshsnap_render::import::MeshError;
use meshsnap_render::limits::Stopped;
use meshsnap_render::pipeline::RenderError;
use meshsnap_render::plan::PlanError;
use meshsnap_render::request::RequestError;

/// Errors of reading a mesh, making a spec, drawing or encoding. [`Error::fault`] says who can mend
/// it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The bytes are no mesh that is read, or break a limit.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A key of the request document is unknown, or its value is out of range.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// Mesh and spec do not go together, or need more than a limit allows.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The deadline was raised.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The back-end failed: there is no GPU, or it was lost.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The encoder failed.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// The party that can mend an [`Error`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// Whoever made the mesh file.
    Mesh,
    /// Whoever wrote the request.
    Request,
    /// The caller, who raised the deadline.
    Deadline,
    /// The machine or this crate.
    Machine,
}

impl Error {
    /// The party that can mend this.
    pub fn fault(&self) -> Fault {
        match self {
            Self::Mesh(_) => Fault::Mesh,
            Self::Request(_) | Self::Plan(_) => Fault::Request,
            Self::Stopped(_) => Fault::Deadline,
            Self::Draw(_) | Self::Encode(_) => Fault::Machine,
        }
    }
}

impl From<RenderError> for Error {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Mesh(error) => Self::Mesh(error),
            RenderError::Plan(error) => Self::Plan(error),
            RenderError::Stopped(error) => Self::Stopped(error),
            RenderError::Draw(error) => Self::Draw(error),
            RenderError::Encode(error) => Self::Encode(error),
        }
    }
}
