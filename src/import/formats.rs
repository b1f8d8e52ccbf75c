//! The mesh formats that are read.

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
    /// PLY of any encoding.
    Ply,
    /// Geomview's object file format, text or binary.
    Off,
    /// Autodesk FBX, binary or ASCII.
    Fbx,
    /// 3MF, a zip package of XML.
    ThreeMf,
}

impl Format {
    /// The names that [`Format::from_name`] knows.
    pub const NAMES: [&str; 8] = ["obj", "gltf", "glb", "stl", "ply", "off", "fbx", "3mf"];

    /// All of them, for a sentence.
    pub const ALL: &str = "OBJ, STL, PLY, OFF, FBX, 3MF, glTF or GLB";

    /// From a file extension or a query value. `stl` may be either kind: the importer looks.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "gltf" => Some(Self::Gltf),
            "glb" => Some(Self::Glb),
            "stl" => Some(Self::StlBinary),
            "ply" => Some(Self::Ply),
            "off" => Some(Self::Off),
            "fbx" => Some(Self::Fbx),
            "3mf" => Some(Self::ThreeMf),
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
            Self::Ply => "ply",
            Self::Off => "off",
            Self::Fbx => "fbx",
            Self::ThreeMf => "3mf",
        }
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Obj => "OBJ",
            Self::Gltf => "glTF",
            Self::Glb => "GLB",
            Self::StlBinary => "binary STL",
            Self::StlAscii => "ASCII STL",
            Self::Ply => "PLY",
            Self::Off => "OFF",
            Self::Fbx => "FBX",
            Self::ThreeMf => "3MF",
        })
    }
}
