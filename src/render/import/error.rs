//! The error of an import: the kind of fault, which has a stable code for programs, and one
//! sentence that is safe to show to a client.

use super::text;
use crate::guard::Panicked;
use crate::limits::{Exhausted, LimitExceeded, Stopped};

/// Longest detail of an error or a warning, in characters. Longer ones only repeat content of the
/// file.
pub const DETAIL_CHARS_MAX: usize = 1000;

/// An import that failed. It is the input's fault unless the job was stopped; the detail is safe to show to a client.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
#[error("{detail}")]
pub struct MeshError {
    /// The kind of fault.
    pub fault: MeshFault,
    /// One sentence: the fault, and its place in the file.
    pub detail: String,
}

/// The kinds of fault, each with its own status and stable code at the edge of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MeshFault {
    /// Not a known mesh format.
    Unrecognised,
    /// Known format, broken content.
    Broken,
    /// Readable, but without anything to draw.
    Empty,
    /// Refers to a file outside the upload, or to one that the upload lacks.
    OutsideBundle,
    /// A bundle that cannot be unpacked, or has files with forbidden names.
    BundleBroken,
    /// Several files of the bundle are meshes, or the requested one is missing.
    EntryUnclear,
    /// A decoder of another crate panicked.
    DecoderFailed,
    /// The process in which a decoder runs crashed, hung, took too much memory or tried what it may not do.
    DecoderCrashed,
    /// The file requires a feature of the format that is not read.
    Unsupported,
    /// Breaks a limit.
    Limit(LimitExceeded),
    /// The job's time was up.
    Stopped,
}

impl MeshFault {
    /// The stable code under which programs know it. Limits and deadlines have codes that do not depend on the mesh.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Unrecognised => "mesh_unrecognised",
            Self::Broken => "mesh_broken",
            Self::Empty => "mesh_empty",
            Self::OutsideBundle => "mesh_outside_bundle",
            Self::BundleBroken => "bundle_broken",
            Self::EntryUnclear => "entry_unclear",
            Self::DecoderFailed => "decoder_failed",
            Self::DecoderCrashed => "decoder_crashed",
            Self::Unsupported => "mesh_unsupported",
            Self::Limit(_) => "limit",
            Self::Stopped => "deadline",
        }
    }
}

impl MeshError {
    /// The file is of the format but its content is broken.
    pub fn broken(detail: impl Into<String>) -> Self {
        Self::new(MeshFault::Broken, detail)
    }

    /// The file needs an optional part of this crate that the build left out. `what` is a sentence's
    /// beginning: "the file is FBX".
    #[cfg(not(all(feature = "fbx", feature = "draco", feature = "meshopt")))]
    pub(crate) fn missing_feature(what: &str, feature: &str) -> Self {
        Self::new(MeshFault::Unsupported, format!("{what}, and this build lacks the feature `{feature}`"))
    }

    /// An error of the given kind.
    pub fn new(fault: MeshFault, detail: impl Into<String>) -> Self {
        let detail: String = detail.into();
        // Most are short and need no copy.
        let detail = if detail.len() > DETAIL_CHARS_MAX { text::cut(detail, DETAIL_CHARS_MAX) } else { detail };
        Self { fault, detail }
    }
}

impl From<LimitExceeded> for MeshError {
    fn from(limit: LimitExceeded) -> Self {
        Self::new(MeshFault::Limit(limit.clone()), limit.to_string())
    }
}

impl From<Panicked> for MeshError {
    fn from(panicked: Panicked) -> Self {
        Self::new(MeshFault::DecoderFailed, panicked.to_string())
    }
}

impl From<Stopped> for MeshError {
    fn from(stopped: Stopped) -> Self {
        Self { detail: stopped.to_string(), fault: MeshFault::Stopped }
    }
}

impl From<Exhausted> for MeshError {
    fn from(exhausted: Exhausted) -> Self {
        match exhausted {
            Exhausted::Limit(limit) => limit.into(),
            Exhausted::Stopped(stopped) => stopped.into(),
        }
    }
}
