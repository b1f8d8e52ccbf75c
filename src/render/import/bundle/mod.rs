//! An upload (`Bundle`): a mesh and the files that it refers to, such as textures and material
//! libraries, each with a relative path.
//!
//! It is one file, several files, or a zip archive that is not yet unpacked. Paths that are absolute,
//! empty or very long, or have `..` or control characters in them, are refused.

pub(crate) mod entry;
pub(crate) mod folder;
mod origin;
pub(crate) mod unzip;
pub use folder::Folder;
pub use origin::{FileUse, Missing, Origin};

use super::{Format, MeshError, MeshFault};
use bytes::Bytes;

/// Longest path of a file in a bundle, bytes: what file systems allow, roughly.
const PATH_BYTES_MAX: usize = 1024;

/// The path of a file that was sent without a name.
pub const UNNAMED: &str = "mesh";

/// An upload: one file, several files, or a zip archive that is not yet unpacked.
#[derive(Clone, Debug, Default)]
pub struct Bundle {
    pub(crate) files: Vec<BundleFile>,
    /// The path of the mesh, if the client named it.
    pub(crate) entry: Option<String>,
    pub(crate) is_zip: bool,
    pub(crate) origin: Origin,
    /// What becomes of the files, if anyone asked.
    pub(crate) file_use: Option<FileUse>,
}

/// One file of a bundle.
#[derive(Clone, Debug)]
pub struct BundleFile {
    /// Its path in the bundle: components with `/` between them, none of them `.` or `..`.
    pub path: String,
    /// Its content, shared by clones.
    pub bytes: Bytes,
}

/// A path that no file of a bundle may have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadPath(String);

impl Bundle {
    /// A bundle of one unnamed file, or of a zip archive if the bytes are one.
    pub fn of_one(bytes: impl Into<Bytes>) -> Self {
        let bytes = bytes.into();
        let is_zip = is_zip(&bytes);
        Self { files: vec![BundleFile { path: UNNAMED.into(), bytes }], is_zip, ..Self::default() }
    }

    /// A zip archive, whatever its bytes say.
    pub fn zip(bytes: impl Into<Bytes>) -> Self {
        Self { is_zip: true, ..Self::of_one(bytes) }
    }

    /// Several files; a single one may be a zip archive.
    pub fn of_files(files: Vec<BundleFile>) -> Self {
        let is_zip = files.len() == 1 && is_zip(&files[0].bytes);
        Self { files, is_zip, ..Self::default() }
    }

    /// The same bundle with the path of its mesh.
    #[must_use]
    pub fn with_entry(self, entry: Option<String>) -> Self {
        Self { entry, ..self }
    }

    /// The same bundle, given by another than an HTTP request.
    #[must_use]
    pub fn given_by(self, origin: Origin) -> Self {
        Self { origin, ..self }
    }

    /// The same bundle, which notes the use of its files in `file_use`.
    #[must_use]
    pub fn watched_by(self, file_use: &FileUse) -> Self {
        Self { file_use: Some(file_use.clone()), ..self }
    }

    /// The path of the mesh, if the client named it.
    pub fn entry(&self) -> Option<&str> {
        self.entry.as_deref()
    }

    /// A bundle as it was taken apart into files.
    pub fn restored(files: Vec<BundleFile>, is_zip: bool, entry: Option<String>) -> Self {
        Self { files, entry, is_zip, ..Self::default() }
    }

    /// Refuses a single empty file.
    pub fn check_sent(&self) -> Result<(), MeshError> {
        match self.files.as_slice() {
            [single] if single.bytes.is_empty() => Err(MeshError::new(
                MeshFault::Unrecognised,
                format!("{} is empty, and should be a mesh ({})", self.subject(single), Format::list()),
            )),
            _ => Ok(()),
        }
    }

    /// A file as the subject of a sentence. A single unnamed one needs no name.
    fn subject(&self, file: &BundleFile) -> String {
        if self.files.len() == 1 && file.path == UNNAMED {
            return self.origin.unnamed().to_owned();
        }
        format!("\"{}\"", show(&file.path))
    }

    /// Its files, unopened: an archive is one file.
    pub fn files(&self) -> &[BundleFile] {
        &self.files
    }

    /// True if it is an archive that is not yet unpacked.
    pub fn is_zip(&self) -> bool {
        self.is_zip
    }

    /// Its files, without a copy.
    pub fn into_files(self) -> Vec<BundleFile> {
        self.files
    }

    /// The size of all of it.
    pub fn bytes_len(&self) -> u64 {
        self.files.iter().map(|file| file.bytes.len() as u64).sum()
    }
}

impl BundleFile {
    /// A file under a checked name: relative, with slashes of either kind.
    pub fn new(name: &str, bytes: impl Into<Bytes>) -> Result<Self, BadPath> {
        let bad = |why: &str| Err(BadPath(format!("the file name \"{}\" {why}", show(name))));
        if name.len() > PATH_BYTES_MAX {
            return bad(&format!("is longer than {PATH_BYTES_MAX} bytes"));
        }
        if name.chars().any(char::is_control) {
            return bad("has control characters in it");
        }
        if name.starts_with(['/', '\\']) {
            return bad("is absolute; names are relative to the bundle");
        }
        if has_drive(name) {
            return bad("begins with a drive letter; names are relative to the bundle");
        }
        let parts: Vec<&str> = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | ".")).collect();
        if parts.contains(&"..") {
            return bad("has `..` in it; names go down from the bundle only");
        }
        if parts.is_empty() {
            return bad("is empty");
        }
        Ok(Self { path: parts.join("/"), bytes: bytes.into() })
    }

    /// Refuses a name that another file has already.
    pub fn check_new(&self, others: &[Self]) -> Result<(), BadPath> {
        if others.iter().any(|other| other.path == self.path) {
            return Err(BadPath(format!("two files are named \"{}\"", show(&self.path))));
        }
        Ok(())
    }

    /// The path without its last component; empty at the top.
    pub fn folder(&self) -> &str {
        self.path.rsplit_once('/').map_or("", |(folder, _)| folder)
    }

    /// The last component of its path.
    pub fn base_name(&self) -> &str {
        base_name(&self.path)
    }

    /// The text after the last dot of its name, in lower case; empty without a dot.
    pub fn extension(&self) -> String {
        self.base_name().rsplit_once('.').map_or_else(String::new, |(_, e)| e.to_ascii_lowercase())
    }
}

/// True if the bytes are a zip archive with at least one entry.
pub fn is_zip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// A short, printable form of a name that a client chose.
pub fn show(name: &str) -> String {
    let shown = name.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c });
    if name.chars().nth(80).is_some() { shown.take(77).chain("...".chars()).collect() } else { shown.collect() }
}

/// The first few of some names, for a sentence.
pub fn show_all<'n>(names: impl ExactSizeIterator<Item = &'n str>) -> String {
    const SHOWN: usize = 10;
    let count = names.len();
    let mut text = names.take(SHOWN).map(|name| format!("\"{}\"", show(name))).collect::<Vec<_>>().join(", ");
    if count > SHOWN {
        text += &format!(" and {} more", count - SHOWN);
    }
    text
}

/// The last component, after a slash of either kind.
pub fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// True if a path begins with a drive letter.
pub fn has_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}
