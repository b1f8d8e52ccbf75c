//! Real mesh files: those of `tests/data`, which every clone has, and those of a larger folder
//! beside the repository, whose licences do not allow a copy.
#![allow(clippy::unwrap_used)] // clippy knows tests, but not their helpers

use std::path::{Path, PathBuf};

use super::skip::{Need, skip};

/// A folder of `tests/data`.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    assert!(folder.is_dir(), "{} is part of the repository", folder.display());
    folder
}

/// A folder of the large data. None, and the test counts as skipped, where it is missing.
#[track_caller]
pub fn large_folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MESHSNAP_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    skip(Need::LargeData, &folder.display().to_string());
    None
}

/// A file of `tests/data`.
pub fn bytes(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All files below a folder, sorted.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}
