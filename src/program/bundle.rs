//! The reading of the files that a command line names as one bundle: a mesh and the files that it
//! refers to, such as its textures. No other file is read here; `siblings` finds those that a mesh
//! refers to and that the command does not name. Also says which of the named files the mesh does
//! not use.

use std::path::{Component, Path, PathBuf};

use super::files;
use crate::error::CliError;
use meshsnap_render::import::{Bundle, BundleFile, FileUse, Origin};
use meshsnap_render::limits::{self, Limits};

/// The files of one mesh, as they are named.
pub struct NamedFiles {
    /// The files.
    pub bundle: Bundle,
    /// The use that the mesh makes of them while it is read.
    pub file_use: FileUse,
    /// The folder that they have in common, to which their paths in the bundle are relative.
    pub common: PathBuf,
    /// Each name with its path in the bundle; empty for a single file.
    paths: Vec<(String, String)>,
}

/// The name of a bundle in messages: its first file.
pub fn name(names: &[String]) -> &str {
    names.first().map_or("", String::as_str)
}

/// Reads the files. Their paths in the bundle are relative to the folder that they have in common,
/// so that references between them work as on disk.
pub fn read(names: &[String], entry: Option<String>, limits: &Limits) -> Result<NamedFiles, CliError> {
    if names.iter().filter(|name| *name == "-").count() > 1 {
        return Err(CliError::usage("`-`, standard input, can be given once"));
    }
    let file_use = FileUse::default();
    let of_command = |bundle: Bundle| bundle.with_entry(entry).given_by(Origin::Command).watched_by(&file_use);
    if let [single] = names {
        let bytes = files::read(single, limits.memory_bytes)?;
        let common = folder_of(single)?;
        let bundle = match single.as_str() {
            "-" => Bundle::of_one(bytes),
            // A single file may have any name, also one that no file of a bundle may have.
            name => match BundleFile::new(&relative_to(&common, name)?, bytes.clone()) {
                Ok(file) => Bundle::of_files(vec![file]),
                Err(_) => Bundle::of_one(bytes),
            },
        };
        return Ok(NamedFiles { bundle: of_command(bundle), file_use, common, paths: Vec::new() });
    }
    let count = names.len() as u64;
    limits::check("the number of files", count, limits.bundle_entries, "--limit-bundle-entries")
        .map_err(|limit| CliError::input(limit.to_string()))?;
    let common = common_folder(names)?;
    let (mut all, mut left): (Vec<BundleFile>, _) = (Vec::new(), limits.memory_bytes);
    let mut paths = Vec::new();
    for name in names {
        let bytes = files::read(name, left)?;
        left -= bytes.len() as u64;
        let file = BundleFile::new(&relative_to(&common, name)?, bytes);
        let file = file.map_err(|error| CliError::input(format!("{name}: {error}")))?;
        file.check_new(&all).map_err(|error| CliError::usage(format!("{name}: {error}")))?;
        paths.push((name.clone(), file.path.clone()));
        all.push(file);
    }
    Ok(NamedFiles { bundle: of_command(Bundle::of_files(all)), file_use, common, paths })
}

/// A sentence for each file that was named for nothing: the mesh, and what it refers to, do without
/// it. To be asked after the mesh was read.
pub fn unused(paths: &[(String, String)], file_use: &FileUse, is_archive: impl Fn(&str) -> bool) -> Vec<String> {
    let used = file_use.used();
    let unused = paths.iter().filter(|(_, path)| !used.contains(path));
    let sentence = |(name, path): &(String, String)| match is_archive(path) {
        true => format!("{name}: is not used: a zip archive is opened only where it is named alone"),
        false => format!("{name}: is not used: the mesh does not refer to it"),
    };
    unused.map(sentence).collect()
}

impl NamedFiles {
    /// Each name with its path in the bundle, and the paths of the archives among them.
    pub fn paths(&self) -> (Vec<(String, String)>, Vec<String>) {
        let archives = self.bundle.files().iter().filter(|file| meshsnap_render::import::bundle::is_zip(&file.bytes));
        (self.paths.clone(), archives.map(|file| file.path.clone()).collect())
    }
}

/// The folder that all files have in common.
fn common_folder(names: &[String]) -> Result<PathBuf, CliError> {
    let mut common = folder_of(name(names))?;
    for name in names {
        let folder = folder_of(name)?;
        common = common.components().zip(folder.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect();
    }
    Ok(common)
}

fn folder_of(name: &str) -> Result<PathBuf, CliError> {
    Ok(absolute(name)?.parent().map(Path::to_path_buf).unwrap_or_default())
}

/// The absolute path without `.` and `..`; links are not followed. Standard input is in the current
/// folder.
fn absolute(name: &str) -> Result<PathBuf, CliError> {
    let path = std::path::absolute(name).map_err(|error| CliError::input(format!("{name}: {error}")))?;
    Ok(plain(&path))
}

/// A path as paths are compared: absolute, without `.` and `..`.
pub fn comparable(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    std::path::absolute(path).map_or_else(|_| path.to_owned(), |path| plain(&path))
}

/// A path without `.` and `..`.
pub fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

fn relative_to(folder: &Path, name: &str) -> Result<String, CliError> {
    let path = absolute(name)?;
    Ok(path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned())
}
