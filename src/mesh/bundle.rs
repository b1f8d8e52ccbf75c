//! Files that belong together: what was uploaded, and the folder that it makes for whoever follows a name in one of them.
//!
//! Everything here is names and bytes. A name that leads out of the folder leads nowhere: no file is opened for it.

use super::{MeshError, MeshFault};
use bytes::Bytes;
use rapidhash::RapidHashMap;
use std::collections::hash_map::Entry;

/// Longest path of a file in a bundle, bytes: what file systems allow, roughly.
const PATH_BYTES_MAX: usize = 1024;

/// What was uploaded: one file, several, or a zip archive that is still closed.
#[derive(Clone, Debug, Default)]
pub struct Bundle {
    pub(super) files: Vec<BundleFile>,
    /// The mesh among the files, if the client says which.
    pub(super) entry: Option<String>,
    pub(super) is_zip: bool,
}

/// One file of a bundle.
#[derive(Clone, Debug)]
pub struct BundleFile {
    /// Where it is in the bundle: components with `/` between them, none of them `.` or `..`.
    pub path: String,
    /// What is in it; clones share it.
    pub bytes: Bytes,
}

/// A path that no file of a bundle may have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadPath(String);

impl Bundle {
    /// A bundle of one file without a name, or a zip archive if that is what the bytes are.
    pub fn of_one(bytes: impl Into<Bytes>) -> Self {
        let bytes = bytes.into();
        let is_zip = bytes.starts_with(b"PK\x03\x04");
        Self { files: vec![BundleFile { path: "mesh".into(), bytes }], entry: None, is_zip }
    }

    /// A zip archive, whatever its bytes say.
    pub fn zip(bytes: impl Into<Bytes>) -> Self {
        Self { is_zip: true, ..Self::of_one(bytes) }
    }

    /// Several files; a single one may be a zip archive.
    pub fn of_files(mut files: Vec<BundleFile>) -> Self {
        let is_zip = files.len() == 1 && files[0].bytes.starts_with(b"PK\x03\x04");
        files.shrink_to_fit();
        Self { files, entry: None, is_zip }
    }

    /// The same with the mesh named among the files.
    #[must_use]
    pub fn with_entry(self, entry: Option<String>) -> Self {
        Self { entry, ..self }
    }

    /// Its bytes, as they came.
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

    /// What follows the last dot of its name, in lower case; empty without one.
    pub fn extension(&self) -> String {
        self.base_name().rsplit_once('.').map_or_else(String::new, |(_, e)| e.to_ascii_lowercase())
    }
}

/// The files of a bundle, unpacked, and which of them is the mesh.
#[derive(Debug)]
pub struct Folder {
    files: Vec<BundleFile>,
    entry: usize,
    by_path: RapidHashMap<String, usize>,
    /// Lower-case paths, and base names as they are and in lower case. None where several files have it.
    by_lower_path: RapidHashMap<String, Option<usize>>,
    by_base_name: RapidHashMap<String, Option<usize>>,
    by_lower_base_name: RapidHashMap<String, Option<usize>>,
}

impl Folder {
    /// Of some files; `entry` is one of them.
    pub fn new(files: Vec<BundleFile>, entry: usize) -> Self {
        let mut folder = Self {
            entry,
            by_path: RapidHashMap::default(),
            by_lower_path: RapidHashMap::default(),
            by_base_name: RapidHashMap::default(),
            by_lower_base_name: RapidHashMap::default(),
            files,
        };
        for (i, file) in folder.files.iter().enumerate() {
            folder.by_path.insert(file.path.clone(), i);
            insert_unique(&mut folder.by_lower_path, file.path.to_lowercase(), i);
            insert_unique(&mut folder.by_base_name, file.base_name().to_owned(), i);
            insert_unique(&mut folder.by_lower_base_name, file.base_name().to_lowercase(), i);
        }
        folder
    }

    /// The mesh.
    pub fn entry(&self) -> &BundleFile {
        &self.files[self.entry]
    }

    /// The file with this number.
    pub fn file(&self, number: usize) -> &BundleFile {
        &self.files[number]
    }

    /// The same files with another entry.
    #[must_use]
    pub fn with_entry(self, entry: usize) -> Self {
        Self { entry, ..self }
    }

    /// The file that a URI in the entry means, relative to the entry's folder, if the bundle has it.
    ///
    /// Percent escapes are decoded and backslashes are slashes. Where no path fits exactly, one in other letter case does;
    /// where none does, the only file of that base name, because uploads of single files lose their folders. A URI that
    /// leads out of the bundle is an error. `data:` URIs are the caller's to decode.
    pub fn resolve(&self, uri: &str) -> Result<Option<&BundleFile>, MeshError> {
        let found = match self.at(self.entry().folder(), uri)? {
            Some(number) => Some(number),
            None => self.of_base_name(uri),
        };
        Ok(found.map(|number| self.file(number)))
    }

    /// The file at a relative path from `folder`, in the wrong letter case if need be.
    pub fn at(&self, folder: &str, uri: &str) -> Result<Option<usize>, MeshError> {
        if has_scheme(uri) {
            return Ok(None);
        }
        let mut outside = None;
        for path in readings(uri) {
            match join(folder, &path) {
                Ok(path) => {
                    let other_case = || self.by_lower_path.get(&path.to_lowercase()).copied().flatten();
                    if let Some(number) = self.by_path.get(&path).copied().or_else(other_case) {
                        return Ok(Some(number));
                    }
                }
                Err(error) => outside = Some(error),
            }
        }
        outside.map_or(Ok(None), Err)
    }

    /// The only file with the base name of `uri`, whatever its folder.
    pub fn of_base_name(&self, uri: &str) -> Option<usize> {
        if has_scheme(uri) {
            return None;
        }
        readings(uri).find_map(|path| {
            let name = base_name(&path);
            let exact = self.by_base_name.get(name).copied().flatten();
            exact.or_else(|| self.by_lower_base_name.get(&name.to_lowercase()).copied().flatten())
        })
    }
}

/// A short, printable form of a name that a client chose.
pub fn show(name: &str) -> String {
    let shown = name.chars().map(|c| if c.is_control() { '\u{FFFD}' } else { c });
    if name.chars().nth(80).is_some() { shown.take(77).chain("...".chars()).collect() } else { shown.collect() }
}

/// The first few of some names, for a sentence.
pub fn show_all<'n>(names: impl ExactSizeIterator<Item = &'n str>) -> String {
    const SHOWN: usize = 8;
    let count = names.len();
    let mut text = names.take(SHOWN).map(|name| format!("\"{}\"", show(name))).collect::<Vec<_>>().join(", ");
    if count > SHOWN {
        text += &format!(" and {} more", count - SHOWN);
    }
    text
}

fn insert_unique(map: &mut RapidHashMap<String, Option<usize>>, key: String, number: usize) {
    match map.entry(key) {
        Entry::Vacant(place) => drop(place.insert(Some(number))),
        Entry::Occupied(mut place) => *place.get_mut() = None,
    }
}

fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

fn has_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

/// `https:` and the like; a single letter is a drive.
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.len() > 1 && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.'))
    })
}

/// A URI with its percent escapes decoded, then as it is: many exporters escape nothing.
fn readings(uri: &str) -> impl Iterator<Item = String> {
    let decoded = if uri.contains('%') { percent_decode(uri) } else { None };
    decoded.into_iter().chain(std::iter::once(uri.to_owned()))
}

/// None where the result is no text.
fn percent_decode(uri: &str) -> Option<String> {
    let digit = |b: Option<&u8>| b.and_then(|&b| char::from(b).to_digit(16));
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        match (byte, digit(bytes.get(at + 1)), digit(bytes.get(at + 2))) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                out.push(byte);
                at += 1;
            }
        }
    }
    String::from_utf8(out).ok()
}

/// `folder` and then `path`, without `.` and `..`.
fn join(folder: &str, path: &str) -> Result<String, MeshError> {
    let outside = || {
        let detail = format!("the name \"{}\" leads out of the upload, and nothing outside it is read", show(path));
        MeshError::new(MeshFault::OutsideBundle, detail)
    };
    if path.starts_with(['/', '\\']) || has_drive(path) {
        return Err(outside());
    }
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop().ok_or_else(outside)?),
            part => parts.push(part),
        }
    }
    Ok(parts.join("/"))
}
