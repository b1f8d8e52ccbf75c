//! The interface to another process in which decoders written in C and C++ run (FBX,
//! meshoptimizer), so that a hostile file that makes one crash there does no harm here. A program
//! may set such a process up, as `meshsnap-cli` does with its sandbox on Linux. Without it these
//! decoders run in this process.

use std::sync::OnceLock;

use crate::import::{MeshError, MeshFault};
use crate::limits::{Deadline, Stopped};

/// The first byte of an order's head: an FBX file.
#[cfg(feature = "isolate")]
pub const FBX: u8 = 0;
/// The first byte of an order's head: views of a glTF file that meshoptimizer has packed.
#[cfg(feature = "isolate")]
pub const MESHOPT: u8 = 1;

/// Another process in which a decoder may crash.
pub trait Isolation: Send + Sync {
    /// Decodes a file there.
    fn decode(&self, order: &Order<'_>, deadline: &Deadline) -> Result<Vec<u8>, IsolationError>;
}

/// What is decoded, and what that may cost.
#[derive(Clone, Copy)]
pub struct Order<'a> {
    /// What the decoder has to know beside the file.
    pub head: &'a [u8],
    /// The file.
    pub file: &'a [u8],
    /// Memory that decoding may take, bytes.
    pub memory_bytes: u64,
    /// Borrows memory of the job for what the process takes now, as [`crate::limits::Budget::lend_beside`] does.
    pub lend: &'a dyn Fn(u64) -> Result<(), u64>,
}

/// A decoding that failed outside of the decoder's own errors.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IsolationError {
    /// The job was stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The process ended, or was ended.
    #[error("{0}")]
    Crashed(String),
    /// The process took more memory than the job can have, bytes.
    #[error("the process that reads files of this format took too much memory: more than {0} bytes are not to be had")]
    TooLarge(u64),
}

static ISOLATION: OnceLock<Box<dyn Isolation>> = OnceLock::new();

/// From now on, decoders in C and C++ run there. The first call counts.
pub fn isolate_in(isolation: Box<dyn Isolation>) {
    let _ = ISOLATION.set(isolation);
}

/// The way to the processes in which decoders in C and C++ run. None: they run in this process.
pub fn isolation() -> Option<&'static dyn Isolation> {
    ISOLATION.get().map(Box::as_ref)
}

impl From<IsolationError> for MeshError {
    fn from(error: IsolationError) -> Self {
        match error {
            IsolationError::Stopped(stopped) => stopped.into(),
            IsolationError::Crashed(detail) => Self::new(MeshFault::DecoderCrashed, detail),
            too_large @ IsolationError::TooLarge(_) => Self::new(MeshFault::DecoderCrashed, too_large.to_string()),
        }
    }
}
