//! Bytes to [`Mesh`]: opens a bundle, finds its mesh, sniffs the format from the bytes and calls its importer.
//!
//! Reading order: [`bundle`] (what comes in, and what names in it mean), [`formats`] (the table of formats), [`raw`] (what an importer
//! fills), `obj`, `stl`, `ply`, `off`, `fbx`, `three_mf` and `gltf` (the importers), `normalise` (raw to `Mesh`).

mod affine;
pub mod bundle;
pub(crate) mod context;
mod corners;
mod error;
mod fbx;
mod formats;
mod gltf;
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
mod text;
mod three_mf;

pub use bundle::{Bundle, BundleFile, Folder};
pub use error::{MeshError, MeshFault};
pub use formats::Format;
pub use report::{FileContent, FileMetadata, ImportReport};

use context::Context;
use error::DETAIL_CHARS_MAX;
use normalise::normalise;
use raw::RawMesh;

use crate::limits::{Budget, Deadline, Limits};
use crate::mesh::Mesh;
use crate::warning::Warning;
use bundle::{entry, unzip};

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

/// A mesh, and what its import reports beside it.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The mesh.
    pub mesh: Mesh,
    /// Counts, repairs, warnings and metadata.
    pub report: ImportReport,
}

/// Reads the mesh of a bundle.
pub fn import(
    bundle: &Bundle,
    options: impl Into<Options>,
    limits: &Limits,
    budget: &mut Budget,
    deadline: &Deadline,
) -> Result<Imported, MeshError> {
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
