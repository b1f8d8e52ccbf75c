//! Opens a bundle, finds its mesh, sniffs the format from the bytes and calls its importer.

use super::bundle::Bundle;
use super::error::DETAIL_CHARS_MAX;
use super::normalise::normalise;
use super::raw::RawMesh;
use super::{
    Folder, ImportReport, Mesh, MeshError, Warning, entry, fbx, gltf, obj, off, ply, stl, text, three_mf, unzip,
};
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

/// What is said of a mesh beside its bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Overrides sniffing.
    pub format: Option<Format>,
    /// The moment of the file's first animation that is drawn, seconds; None: the file as its animations find it.
    pub time_s: Option<f64>,
}

impl From<Option<Format>> for Options {
    fn from(format: Option<Format>) -> Self {
        Self { format, time_s: None }
    }
}

/// Reads the mesh of a bundle.
pub fn import(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Mesh, MeshError> {
    open(bundle, options.into(), limits, budget, deadline, normalise)
}

/// Reads all of a file that [`import`] reads, and reports what is in it, whether there is anything to draw or not.
pub fn survey(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<ImportReport, MeshError> {
    open(bundle, options.into(), limits, budget, deadline, |raw, _| Ok(raw.report))
}

/// Finds the mesh of a bundle, reads it, and has it finished.
fn open<T>(
    bundle: &Bundle,
    options: Options,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
    finish: impl FnOnce(RawMesh, &mut Context<'_>) -> Result<T, MeshError>,
) -> Result<T, MeshError> {
    let files = match bundle.files.as_slice() {
        [archive] if bundle.is_zip => unzip::unzip(&archive.bytes, limits, budget, deadline)?,
        // Clones of shared bytes.
        files => {
            bundle.check_sent()?;
            files.to_vec()
        }
    };
    let (folder, format) = entry::choose(files, bundle.entry.as_deref(), options.format, deadline)?;
    let bytes = &folder.entry().bytes;
    let mut cx = Context { limits, budget, deadline, bundle: &folder, time_s: options.time_s };
    let mut raw = match format {
        Format::Obj => obj::read(bytes, &mut cx)?,
        Format::StlBinary | Format::StlAscii => stl::read(bytes, &mut cx)?,
        Format::Ply => ply::read(bytes, &mut cx)?,
        Format::Off => off::read(bytes, &mut cx)?,
        Format::Fbx => fbx::read(bytes, &mut cx)?,
        Format::ThreeMf => three_mf::read(&mut cx)?,
        Format::Gltf | Format::Glb => gltf::read(bytes, &mut cx)?,
    };
    if options.time_s.is_some() && !matches!(format, Format::Gltf | Format::Glb) {
        let detail = format!("scene.time_s is given, and {format} files have no animation");
        raw.report.warnings.push(Warning { code: "animation_missing", detail });
    }
    // As with errors: what a file repeats here has ended long before.
    for warning in raw.report.warnings.iter_mut().filter(|warning| warning.detail.len() > DETAIL_CHARS_MAX) {
        warning.detail = text::cut(&warning.detail, DETAIL_CHARS_MAX);
    }
    finish(raw, &mut cx)
}

/// What every importer is given beside the bytes.
pub struct Context<'a> {
    /// The caps.
    pub limits: &'a Limits,
    /// Bytes that may still be allocated.
    pub budget: &'a mut Budget,
    /// Looked at inside long loops.
    pub deadline: &'a Deadline,
    /// The files that names in the mesh may mean.
    pub bundle: &'a Folder,
    /// As [`Options::time_s`].
    pub time_s: Option<f64>,
}

impl Context<'_> {
    /// Refuses more triangles than the limit allows.
    pub fn check_triangles(&self, count: u64) -> Result<(), MeshError> {
        Ok(crate::limits::check("the number of triangles", count, self.limits.triangles, "--limit-triangles")?)
    }
}
