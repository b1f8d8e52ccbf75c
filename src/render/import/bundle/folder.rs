//! The files of an upload as a folder, in which a name that stands in one file is resolved to
//! another: the URI of a glTF buffer, the path of an OBJ file's material library.
//!
//! Only names and bytes in memory are handled here, and no file of the machine is opened. A name
//! that leads out of the folder (`../../other`) therefore reaches nothing outside the upload.

use crate::import::bundle::{Bundle, BundleFile, FileUse, Origin, base_name, has_drive, show};
use crate::import::{MeshError, MeshFault};
use percent_encoding::percent_decode_str;
use rapidhash::RapidHashMap;
use std::borrow::Cow;
use std::collections::hash_map::Entry;

/// The unpacked files of a bundle, one of which is the mesh.
#[derive(Debug)]
pub struct Folder {
    files: Vec<BundleFile>,
    entry: usize,
    by_path: RapidHashMap<String, usize>,
    /// Files by lower-case path, by base name and by lower-case base name. None if several files
    /// have it.
    by_lower_path: RapidHashMap<String, Option<usize>>,
    by_base_name: RapidHashMap<String, Option<usize>>,
    by_lower_base_name: RapidHashMap<String, Option<usize>>,
    origin: Origin,
    file_use: Option<FileUse>,
}

impl Folder {
    /// A folder of files, with the index of the mesh.
    pub fn new(files: Vec<BundleFile>, entry: usize) -> Self {
        let mut folder = Self {
            entry,
            by_path: RapidHashMap::default(),
            by_lower_path: RapidHashMap::default(),
            by_base_name: RapidHashMap::default(),
            by_lower_base_name: RapidHashMap::default(),
            origin: Origin::default(),
            file_use: None,
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

    /// The same folder with the origin of the bundle, whose use of files it notes.
    #[must_use]
    pub fn of_bundle(self, bundle: &Bundle) -> Self {
        Self { origin: bundle.origin, file_use: bundle.file_use.clone(), ..self }
    }

    /// Who gave the files.
    pub fn origin(&self) -> Origin {
        self.origin
    }

    /// The file that holds the mesh.
    pub fn entry(&self) -> &BundleFile {
        self.file(self.entry)
    }

    /// The size of all files.
    pub fn bytes_len(&self) -> u64 {
        self.files.iter().map(|file| file.bytes.len() as u64).sum()
    }

    /// The paths of all files, and the number of the mesh.
    pub fn paths(&self) -> (Vec<String>, u32) {
        (self.files.iter().map(|file| file.path.clone()).collect(), self.entry as u32)
    }

    /// The file with this number, if there is one.
    pub fn try_file(&self, number: usize) -> Option<&BundleFile> {
        (number < self.files.len()).then(|| self.file(number))
    }

    /// The file with this number, which counts as used from here on.
    pub fn file(&self, number: usize) -> &BundleFile {
        let file = &self.files[number];
        if let Some(file_use) = &self.file_use {
            file_use.add_used(&file.path);
        }
        file
    }

    /// Notes that a file in `folder` names one that is not there.
    pub fn note_missing(&self, folder: &str, name: &str) {
        if let Some(file_use) = &self.file_use {
            file_use.add_missing(folder, name);
        }
    }

    /// The same files with another entry.
    #[must_use]
    pub fn with_entry(self, entry: usize) -> Self {
        Self { entry, ..self }
    }

    /// The file that a URI in the mesh refers to, relative to the mesh's folder. None if the bundle
    /// lacks it.
    ///
    /// Percent escapes are decoded, and backslashes count as slashes. If no path fits exactly,
    /// letter case is ignored; then the only file of that base name is taken, because uploads of
    /// single files lose their folders. A URI that leads out of the bundle is an error. The caller
    /// decodes `data:` URIs.
    pub fn resolve(&self, uri: &str) -> Result<Option<&BundleFile>, MeshError> {
        let folder = self.entry().folder();
        let at = self.at(folder, uri);
        let found = at.map(|number| number.or_else(|| self.of_base_name(uri)));
        if !matches!(found, Ok(Some(_))) {
            self.note_missing(folder, &readings(uri).next().unwrap_or_default());
        }
        Ok(found?.map(|number| self.file(number)))
    }

    /// The file at a relative path from `folder`, in any letter case if there is no exact match.
    pub fn at(&self, folder: &str, uri: &str) -> Result<Option<usize>, MeshError> {
        if has_scheme(uri) {
            return Ok(None);
        }
        let mut outside = None;
        for path in readings(uri) {
            match join(folder, &path, self.origin) {
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

fn insert_unique(map: &mut RapidHashMap<String, Option<usize>>, key: String, number: usize) {
    match map.entry(key) {
        Entry::Vacant(place) => drop(place.insert(Some(number))),
        Entry::Occupied(mut place) => *place.get_mut() = None,
    }
}

/// True for `https:` and the like. A single letter is a drive.
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.len() > 1 && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'-' | b'.'))
    })
}

/// Both readings of a URI: with percent escapes decoded, if that is UTF-8, then unchanged, because many
/// exporters do not escape.
fn readings(uri: &str) -> impl Iterator<Item = String> {
    let decoded = uri.contains('%').then(|| percent_decode_str(uri).decode_utf8().ok()).flatten();
    decoded.into_iter().map(Cow::into_owned).chain(std::iter::once(uri.to_owned()))
}

/// Joins `folder` and `path`, and resolves `.` and `..`.
fn join(folder: &str, path: &str, origin: Origin) -> Result<String, MeshError> {
    let outside = || {
        let whole = origin.whole();
        let detail = format!("the name \"{}\" leads out of {whole}, and nothing outside is read", show(path));
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
