//! The import of a mesh, from the bytes of an upload to a [`Mesh`]: unpacks an archive, finds the
//! file that holds the mesh, recognises its format, has the importer of that format read it, and
//! brings the result into its normal form.
//!
//! Reading order: [`bundle`] (the upload, and the files that names refer to), `formats` (the table
//! of formats), `sniff` (recognition of a format by its bytes), [`raw`] (the mesh that an importer
//! fills), the importers `obj`, `stl`, `ply`, `off`, `fbx`, `three_mf` and `gltf`, and `normalise`
//! (raw mesh to `Mesh`).

mod affine;
pub mod bundle;
pub(crate) mod context;
mod corners;
mod error;
mod fbx;
mod formats;
mod gltf;
pub mod isolate;
mod metadata;
mod normalise;
mod obj;
mod off;
mod ply;
mod polygon;
pub mod raw;
mod report;
mod sniff;
mod stl;
#[cfg(test)]
mod test_random;
mod text;
mod three_mf;
pub mod up_axis;

pub use bundle::{BadPath, Bundle, BundleFile, FileUse, Folder, Missing, Origin};
pub use error::{MeshError, MeshFault};
pub use report::{FileContent, FileMetadata, ImportReport};

use context::Context;
use error::DETAIL_CHARS_MAX;
use normalise::normalise;
use raw::RawMesh;

use crate::limits::{Budget, Deadline, Limits};
use crate::mesh::Mesh;
use crate::warning::Warning;
use bundle::{entry, unzip};

/// The mesh formats that are read. The table in `formats` has a row for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
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

/// Options of an import.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Format of the mesh. None: by sniffing.
    pub format: Option<Format>,
    /// Moment of the file's first animation, in seconds. None: the rest pose.
    pub time_s: Option<f64>,
    /// Count the vertices that nothing refers to, which takes a pass over the triangles.
    pub counts_loose: bool,
}

impl From<Option<Format>> for Options {
    fn from(format: Option<Format>) -> Self {
        Self { format, ..Self::default() }
    }
}

/// The work of a process in which decoders in C and C++ run: the answer to one order.
#[cfg(feature = "isolate")]
pub fn answer_in_isolation(head: &[u8], file: &[u8]) -> Vec<u8> {
    match head.split_first() {
        #[cfg(feature = "fbx")]
        Some((&isolate::FBX, head)) => fbx::answer(head, file),
        #[cfg(feature = "meshopt")]
        Some((&isolate::MESHOPT, head)) => gltf::answer(head, file),
        _ => file[..0].to_vec(),
    }
}

/// Reads the mesh of a bundle, in its normal form, with the report on its file.
pub fn import(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<(Mesh, ImportReport), MeshError> {
    open(bundle, options.into(), limits, budget, deadline, |raw, cx| {
        let (mesh, mut report) = normalise(raw, cx)?;
        report.warnings.extend(up_axis::warning(&mesh, &report));
        Ok((mesh, report))
    })
}

/// Reads everything that [`import`] reads, and returns its report even if there is nothing to draw.
pub fn survey(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<ImportReport, MeshError> {
    open(bundle, options.into(), limits, budget, deadline, |raw, _| Ok(raw.report))
}

/// Finds the mesh of a bundle, reads it and gives it to `finish`.
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
        // Cheap: clones share their bytes.
        files => {
            bundle.check_sent()?;
            files.to_vec()
        }
    };
    let (folder, format) = entry::choose(files, bundle, options.format, deadline)?;
    let bytes = &folder.entry().bytes;
    let mut cx = Context {
        limits,
        budget,
        deadline,
        bundle: &folder,
        time_s: options.time_s,
        counts_loose: options.counts_loose,
    };
    let mut raw = (format.entry().read)(bytes, &mut cx)?;
    (raw.report.path, raw.report.file_bytes) = (folder.entry().path.clone(), bundle.bytes_len());
    if options.time_s.is_some() && !format.entry().has_animations {
        let detail = format!("scene.time_s is given, and {format} files have no animation");
        raw.report.warnings.push(Warning { code: "animation_missing", detail });
    }
    // As with errors: longer details only repeat content of the file.
    for warning in raw.report.warnings.iter_mut().filter(|warning| warning.detail.len() > DETAIL_CHARS_MAX) {
        warning.detail = text::cut(&warning.detail, DETAIL_CHARS_MAX);
    }
    finish(raw, &mut cx)
}
